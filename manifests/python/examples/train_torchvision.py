#!/usr/bin/python3
"""Trains torchvision's Faster R-CNN on the boxes of event-volume shards, or its Keypoint R-CNN on the persons.

    train_torchvision.py --data out --dataset kitti_object --out cars
    train_torchvision.py --task keypoints --data out --dataset mpii --out persons
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator

import numpy as np
import torch
import torchvision
import training
from eventgan import drawing
from eventgan.torch import (DetectionDataset, EventAugmentation, KeypointDataset, collate_torchvision,
                            exchange_first_convolution, fitted)
from torch.utils.data import Dataset


def read_args() -> argparse.Namespace:
    parser = training.options(__doc__.splitlines()[0], batch=4, lr=2e-4)
    parser.add_argument("--task", choices=["detection", "keypoints"], default="detection")
    parser.add_argument("--classes", help="detection: class names, separated by commas (default: all); the first one's "
                        "AP is the result")
    parser.add_argument("--scale", type=float, default=1.5, help="input pixels per volume pixel")
    parser.add_argument("--regions", type=int, default=64,
                        help="region proposals per volume that the heads are trained on; more cost more time")
    args = training.begin(parser)
    of_predictions = [name for name in ("test", "as_bright", "without_noise") if getattr(args, name)]
    if args.task == "keypoints" and of_predictions:
        raise SystemExit(f"expected --{of_predictions[0].replace('_', '-')} with --task detection only: keypoints have "
                         "no predictions.json")
    return args


def usable(task: str):
    """What gives the samples with labels for the task."""
    if task == "keypoints":
        return lambda shards: np.unique(shards.persons[:, 0])
    return training.with_boxes


def near_joints(found: torch.Tensor, item: dict) -> np.ndarray:
    """[k] bool, of each annotated joint of an item's persons, whether the best person found on it, [n, 4 + 2J] with
    boxes, has it within a fifth of the longer side of the person's box."""
    near = []
    for box, joints in zip(item["boxes"][~item["ignore"]], item["keypoints"][~item["ignore"]]):
        known = joints[:, 2] > 0
        distance = torch.full((int(known.sum()),), torch.inf)
        if len(found):
            best = torchvision.ops.box_iou(found[:, :4], box[None]).argmax()
            distance = (found[best, 4:].reshape(-1, 2) - joints[:, :2])[known].norm(dim=1)
        near.append((distance < 0.2 * (box[2:] - box[:2]).max()).numpy())
    return np.concatenate([*near, np.empty(0, bool)])


def network(classes: int, joints: int, channels: int, size: tuple[int, int], regions: int) -> torch.nn.Module:
    """The detector, of persons' joints if there are any, for inputs of so many channels that are of this size already
    and are not normalised. A volume holds tens of objects, not hundreds as an image of COCO: fewer regions are looked
    at."""
    settings = {"weights": None, "weights_backbone": None, "min_size": min(size), "max_size": max(size),
                "image_mean": [0.0] * channels, "image_std": [1.0] * channels, "box_batch_size_per_image": regions,
                "rpn_post_nms_top_n_train": 4 * regions, "rpn_post_nms_top_n_test": 2 * regions,
                "box_detections_per_img": regions // 2}
    if joints:
        return torchvision.models.detection.keypointrcnn_resnet50_fpn(num_classes=2, num_keypoints=joints, **settings)
    return torchvision.models.detection.fasterrcnn_mobilenet_v3_large_fpn(num_classes=classes + 1, **settings)


def main() -> None:
    args = read_args()
    train_shards, validation_shards = training.divided(args, usable(args.task))
    area = train_shards.image_area()
    width, height = (32 * int(np.ceil(side * args.scale / 32)) for side in (area[2:] - area[:2]))
    place = {"size": (height, width), "view": fitted(area, (height, width))}
    augmentation = EventAugmentation(scale=(0.8, 1.25), shift=0.1)
    try:
        if args.task == "keypoints":
            train_set = KeypointDataset(train_shards, augmentation=augmentation, **place)
            validation_set = KeypointDataset(validation_shards, train_set.joint_names, **place)
        else:
            train_set = DetectionDataset(train_shards, args.classes.split(",") if args.classes else None,
                                         augmentation=augmentation, **place)
            validation_set = DetectionDataset(validation_shards, train_set.classes, **place)
            searched = training.tested(args, train_shards, validation_shards, usable(args.task))
            test, test_view = training.detection_test(args, searched, list(train_set.classes), **place)
    except ValueError as error:
        raise SystemExit(str(error))
    predict = train(args, train_set, validation_set, (height, width))
    if args.task == "detection":
        classes = list(train_set.classes)
        training.write_predictions(args, searched, (entry for item, found in predict(test) for entry in
                                                    training.box_predictions(item, found, classes, test_view)))


def train(args: argparse.Namespace, train_set: Dataset, validation_set: Dataset,
          size: tuple[int, int]) -> Callable[[Dataset], Iterator]:
    """Trains on items of DetectionDataset, of KeypointDataset or of FramePairs, all of one size, and draws some
    validation items. Returns what gives each item of a dataset, without its volume, with the boxes, labels and scores
    that the network finds in it."""
    joints, classes = len(getattr(train_set, "joint_names", ())), list(train_set.classes)
    print(f"input {size[1]}x{size[0]}, classes " + ", ".join(classes))
    channels = len(validation_set[0]["volume"])
    model = network(len(classes), joints, channels, size, args.regions)
    model = exchange_first_convolution(model, channels)
    training.load_fitting(model, args.pretrained)
    model = model.to(args.device)

    def loss_of(batch: tuple, _: float) -> torch.Tensor:
        images, targets = batch
        targets = [{name: value.to(args.device) for name, value in target.items() if name != "id"}
                   for target in targets]
        return sum(model([image.to(args.device) for image in images], targets).values())

    def detect(volumes: list[torch.Tensor]) -> list[dict[str, torch.Tensor]]:
        return [{name: value.cpu() for name, value in found.items()}
                for found in model([volume.to(args.device) for volume in volumes])]

    def search(dataset: Dataset) -> Iterator[tuple[dict, dict[str, torch.Tensor]]]:
        """Each item, without its volume, with what is found in it."""
        for items in training.batches(args, dataset, list):
            yield from zip(items, detect([item.pop("volume") for item in items]))

    def boxes(found: dict[str, torch.Tensor]) -> tuple[torch.Tensor, ...]:
        return found["boxes"], found["labels"] - 1, found["scores"]

    def measure() -> dict[str, float]:
        pairs = list(search(validation_set))
        values = training.average_precisions(((item, boxes(found)) for item, found in pairs), classes)
        if not joints:
            return values
        near = [near_joints(torch.cat([found["boxes"], found["keypoints"][:, :, :2].flatten(1)], 1), item)
                for item, found in pairs]
        return {**values, "PCK@0.2": float(np.mean(np.concatenate(near)))}

    optimizer = torch.optim.AdamW(model.parameters(), lr=args.lr, weight_decay=1e-4)
    loader = training.batches(args, train_set, collate_torchvision, shuffle=True)
    training.fit(args, model, optimizer, loader, loss_of, measure, f"AP50 {classes[0]}")

    def image_of(i: int) -> tuple[str, np.ndarray]:
        item = validation_set[i]
        found = detect([item["volume"]])[0]
        sure = found["scores"] > 0.5
        texts = [f"{classes[label - 1]} {score:.2f}"
                 for label, score in zip(found["labels"][sure], found["scores"][sure])]
        canvas = training.draw_item(item, found["boxes"][sure], texts)
        for source, kept, colour in ((item, ~item["ignore"], drawing.TRUE), (found, sure, drawing.FOUND)):
            for points in source["keypoints"][kept].numpy() if "keypoints" in source else ():
                drawing.draw_joints(canvas, points[points[:, 2] > 0, :2], colour)
        return item["id"], canvas

    training.write_images(args, len(validation_set), image_of)
    return lambda dataset: ((item, boxes(found)) for item, found in search(dataset))


if __name__ == "__main__":
    main()

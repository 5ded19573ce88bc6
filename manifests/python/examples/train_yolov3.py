#!/usr/bin/python3
"""Trains ultralytics' YOLOv3 (the archive branch) on the boxes of event-volume shards: its Darknet, its loss.

    train_yolov3.py --trainer yolov3 --data out --out cars --minutes 30
"""

from __future__ import annotations

import argparse
import pathlib
import re
from collections.abc import Iterator

import cv2
import numpy as np
import torch
import training
from eventgan import Shards
from eventgan.torch import (DetectionDataset, EventAugmentation, collate_yolo, exchange_first_convolution, fitted,
                            move_boxes)


def read_args() -> argparse.Namespace:
    parser = training.options(__doc__.splitlines()[0], batch=8, lr=1e-3)
    parser.add_argument("--trainer", required=True, help="folder of ultralytics/yolov3")
    parser.add_argument("--cfg", default="yolov3-tiny.cfg", help="name of a file in the trainer's cfg/, or a path")
    parser.add_argument("--classes", default="Car",
                        help="class names, separated by commas; the first one's AP is the result")
    parser.add_argument("--scale", type=float, default=2.0,
                        help="input pixels per volume pixel; small objects need more than 1")
    return training.begin(parser)


def collate(items: list) -> tuple:
    return (*collate_yolo(items)[:2], items)


def anchors_of(shards: Shards, classes: list[str], view: np.ndarray, count: int) -> np.ndarray:
    """[count, 2] widths and heights in input pixels: means of the training boxes, by k-means of their logarithms,
    smallest first."""
    boxes = [np.empty((0, 4))]
    for i in range(len(shards)):
        rows, names = shards.labels(i)["boxes"], np.array(shards.class_names(i))
        boxes.append(move_boxes(rows["xyxy"][(rows["ignore"] == 0) & np.isin(names[rows["class_id"]], classes)], view))
    sides = np.log(np.maximum(np.concatenate(boxes)[:, 2:] - np.concatenate(boxes)[:, :2], 1)).astype(np.float32)
    if len(sides) < count:
        raise SystemExit(f"expected {count} boxes or more of {', '.join(classes)} to learn, got {len(sides)}")
    cv2.setRNGSeed(1)
    _, _, means = cv2.kmeans(sides, count, None, (cv2.TERM_CRITERIA_MAX_ITER, 50, 0), 5, cv2.KMEANS_PP_CENTERS)
    return np.exp(means[np.argsort(means.sum(1))])


def adapted(cfg: str, channels: int, classes: int, anchors: np.ndarray) -> str:
    """The cfg's text with the numbers that go with a dataset: channels, classes, filters of the layers before [yolo],
    anchors."""
    pairs = ",  ".join(f"{width:.1f},{height:.1f}" for width, height in anchors)
    for pattern, text in ((r"(?m)^channels *=.*", f"channels={channels}"),
                          (r"(?m)^classes *=.*", f"classes={classes}"),
                          (r"(?m)^anchors *=.*", f"anchors = {pairs}"),
                          (r"filters *= *\d+(\s+activation *= *linear\s+\[yolo\])", rf"filters={3 * (classes + 5)}\1"),
                          # yolov3-tiny's own leaves its smallest anchor out
                          (r"(?m)^mask *= *1,2,3$", "mask = 0,1,2")):
        cfg = re.sub(pattern, text, cfg)
    return cfg


def main() -> None:
    args = read_args()
    folder = training.use_trainer(args.trainer, "models.py", "train.py", "cfg")
    from models import Darknet
    from train import hyp
    from utils.utils import clip_coords, compute_loss, non_max_suppression

    train_shards, validation_shards = training.divided(args, training.with_boxes)
    classes = args.classes.split(",")
    area = train_shards.image_area()  # what a letterbox has added costs time and shows nothing
    width, height = (32 * int(np.ceil(side * args.scale / 32)) for side in (area[2:] - area[:2]))
    view = fitted(area, (height, width))
    augmentation = EventAugmentation(scale=(0.8, 1.25), shift=0.1)
    try:
        train_set = DetectionDataset(train_shards, classes, (height, width), augmentation, view=view)
        validation_set = DetectionDataset(validation_shards, classes, (height, width), view=view)
        searched = training.tested(args, train_shards, validation_shards, training.with_boxes)
        test, test_view = training.detection_test(args, searched, classes, (height, width), view)
    except ValueError as error:
        raise SystemExit(str(error))

    path = pathlib.Path(args.cfg) if pathlib.Path(args.cfg).exists() else folder / "cfg" / args.cfg
    if not path.exists():
        raise SystemExit(f"expected a cfg, got none, in {path}")
    cfg = path.read_text()
    anchors = anchors_of(train_shards, classes, view, int(re.search(r"(?m)^num *= *(\d+)", cfg)[1]))
    own = pathlib.Path(args.out, "model.cfg")
    channels = len(validation_set[0]["volume"])
    own.write_text(adapted(cfg, channels, len(classes), anchors))
    # its first biases are set in place, which fails where gradients are kept: then boxes are everywhere
    with torch.no_grad():
        model = Darknet(str(own), (height, width))
    model = exchange_first_convolution(model, channels)
    training.load_fitting(model, args.pretrained)
    model = model.to(args.device).to(memory_format=torch.channels_last)
    # it makes its grids only if it does not begin with training
    model.eval()(torch.zeros(1, channels, height, width, device=args.device))
    model.nc, model.hyp = len(classes), {**hyp, "cls": hyp["cls"] * len(classes) / 80,
                                         "obj": hyp["obj"] * max(height, width) / 320}

    def loss_of(batch: tuple, progress: float) -> torch.Tensor:
        model.gr = min(progress / 0.05, 1.0)  # at first every true box counts as an object, then as far as it is found
        imgs, targets, _ = batch
        return compute_loss(model(imgs.to(args.device)), targets.to(args.device), model)[0]

    def detect(imgs: torch.Tensor, threshold: float) -> list[torch.Tensor]:
        """[n, 6] for each: left, top, right, bottom in input pixels, score, class."""
        found = non_max_suppression(model(imgs.to(args.device))[0], threshold, 0.6, multi_label=len(classes) > 1)
        found = [torch.zeros(0, 6) if each is None else each.cpu() for each in found]
        for each in found:
            clip_coords(each, (height, width))
        return found

    def search(dataset: DetectionDataset) -> Iterator[tuple[dict, tuple[torch.Tensor, ...]]]:
        """Each item with the boxes, labels and scores that are found in it."""
        for imgs, _, items in training.batches(args, dataset, collate):
            yield from ((item, (each[:, :4], each[:, 5], each[:, 4])) for item, each in zip(items, detect(imgs, 0.001)))

    def measure() -> dict[str, float]:
        return training.average_precisions(search(validation_set), classes)

    groups = {True: [], False: []}
    for name, weight in model.named_parameters():
        groups["Conv2d.weight" in name].append(weight)
    optimizer = torch.optim.AdamW([{"params": groups[True], "weight_decay": 0.01},
                                   {"params": groups[False], "weight_decay": 0}], lr=args.lr)
    print(f"input {width}x{height}, anchors " + ", ".join(f"{w:.0f}x{h:.0f}" for w, h in anchors))
    training.fit(args, model, optimizer, training.batches(args, train_set, collate, shuffle=True), loss_of, measure,
                 f"AP50 {classes[0]}")

    def image_of(i: int) -> tuple[str, np.ndarray]:
        item = validation_set[i]
        found = detect(item["volume"][None], 0.3)[0]
        return item["id"], training.draw_item(item, found[:, :4],
                                              [f"{classes[int(c)]} {score:.2f}" for score, c in found[:, 4:]])

    training.write_predictions(args, searched, (entry for item, found in search(test) for entry in
                                                training.box_predictions(item, found, classes, test_view)))
    training.write_images(args, len(validation_set), image_of)


if __name__ == "__main__":
    main()

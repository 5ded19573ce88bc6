#!/usr/bin/python3
"""Trains a small detector on the boxes of event-volume shards: minutes on one core, and no other trainer is needed.

    train_detector.py --data out --classes person --out persons

It sees one channel, positive minus negative events (`eventgan.signed_channel`), unless --channels says that it sees the
volume. In a map of an eighth of the image's size it finds how likely the middle of an object is at each place, and how
far the object's edges are from there, as TTFNet does (Liu et al. 2020, "Training-Time-Friendly Network for Real-Time
Object Detection").
"""

from __future__ import annotations

import argparse
import functools
import itertools
import json
import math
import pathlib
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import takeaway
import torch
import torch.nn.functional as F
import training
from eventgan import Shards, read_description, signed_channel
from eventgan.detection_scores import Detections, non_maximum_suppression
from eventgan.torch import DetectionDataset, EventAugmentation, fitted
from torch import nn
from torch.utils.data import Dataset

STRIDE = 8  # input pixels per cell of the map
LEAST_SIDE = 2 * STRIDE  # input pixels: few boxes with a shorter side are learnt
STEPS = 3000  # unless the options say; ten times those of a first look
POOR = 0.1  # an AP below that finds hardly anything
SURE = 0.3  # the score from which on a box is drawn, and told by detect.py
WINDOW_S = 0.05  # of detect.py, where the training pairs have no times
Norm = Callable[[int], nn.Module]  # channels -> layer
SPREAD = 0.54 / 6  # standard deviation of a box's Gaussian, as a share of its sides: TTFNet's
# What the events of another scene or camera may look like: measured on real cameras, manifests/guides/real_cameras.md.
AUGMENTATION = EventAugmentation(invert=0.5, scale=(0.7, 2.0), shift=0.15, threshold=(0.0, 0.3), lost=(0.0, 0.4),
                                 isolated=(0.005, 0.03))


def convolution(inputs: int, outputs: int, stride: int = 1, norm: Norm = nn.BatchNorm2d) -> nn.Sequential:
    return nn.Sequential(nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False), norm(outputs), nn.ReLU(inplace=True))


class Trunk(nn.Module):
    """Of events [N, C, H, W], sides multiples of 32: what is `seen`, [N, 64, H/8, W/8]. A U-Net down to 1/32 of the
    size; 0.5 million parameters."""

    def __init__(self, channels: int, norm: Norm) -> None:
        super().__init__()
        layer = functools.partial(convolution, norm=norm)
        self.eighth = nn.Sequential(layer(channels, 16, 2), layer(16, 32, 2), layer(32, 32), layer(32, 64, 2),
                                    layer(64, 64))
        self.sixteenth = nn.Sequential(layer(64, 96, 2), layer(96, 96))
        self.thirtysecond = nn.Sequential(layer(96, 96, 2), layer(96, 96))
        self.to_sixteenth, self.to_eighth = layer(96 + 96, 32), layer(64 + 32, 64)

    def seen(self, events: torch.Tensor) -> torch.Tensor:
        eighth = self.eighth(events)
        sixteenth = self.sixteenth(eighth)
        below = F.interpolate(self.thirtysecond(sixteenth), scale_factor=2.0)
        below = F.interpolate(self.to_sixteenth(torch.cat([sixteenth, below], 1)), scale_factor=2.0)
        return self.to_eighth(torch.cat([eighth, below], 1))


class Detector(Trunk):
    """Of events [N, C, H, W], sides multiples of 32: logits of the classes [N, K, H/8, W/8], and the distances of the
    left, top, right and bottom edge from each cell's middle, in input pixels, [N, 4, H/8, W/8]."""

    def __init__(self, channels: int, classes: int, norm: Norm = nn.BatchNorm2d) -> None:
        super().__init__(channels, norm)
        self.logits, self.edges = nn.Conv2d(64, classes, 1), nn.Conv2d(64, 4, 1)
        nn.init.constant_(self.logits.bias, -4.6)  # at first an object has a chance of 1 % everywhere
        nn.init.constant_(self.edges.bias, np.log(4))  # and is 64 pixels wide and high

    def forward(self, events: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        seen = self.seen(events)
        return self.logits(seen).float(), STRIDE * self.edges(seen).float().clamp(max=5).exp()


def middles(height: int, width: int, device: torch.device | None = None) -> torch.Tensor:
    """[H, W, 2]: x and y of the cells' middles, in input pixels."""
    y, x = torch.meshgrid(torch.arange(height, device=device), torch.arange(width, device=device), indexing="ij")
    return STRIDE * (torch.stack([x, y], -1) + 0.5)


def target_of(item: dict[str, Any], classes: int,
              height: int, width: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Of an item of DetectionDataset, for a map of that size: the height of the Gaussians [K, H, W], 1 in the cell of a
    box's middle, -1 where a box is to be ignored; the box [4, H, W] that a cell is to give, the smallest where several
    overlap; and how much that counts [H, W]."""
    heat, boxes, weight = torch.zeros(classes, height, width), torch.zeros(4, height, width), torch.zeros(height, width)
    at = middles(height, width)
    ignored = item["boxes"][item["ignore"]]
    inside = ((at[..., None, :] > ignored[:, :2]) & (at[..., None, :] < ignored[:, 2:])).all(-1).any(-1)
    heat[:, inside] = -1
    kept = ~item["ignore"]
    sides = item["boxes"][kept, 2:] - item["boxes"][kept, :2]
    for i in sides.prod(1).argsort(descending=True).tolist():
        box, label = item["boxes"][kept][i], int(item["labels"][kept][i])
        cell = ((box[:2] + box[2:]) / 2 / STRIDE).long().clamp(max=torch.tensor([width - 1, height - 1]))
        deviation = (SPREAD * sides[i]).clamp(min=STRIDE / 4)
        gauss = torch.exp(-((at - at[cell[1], cell[0]]) ** 2 / (2 * deviation**2)).sum(-1))
        heat[label] = torch.where(gauss > 0.01, torch.maximum(heat[label], gauss), heat[label])
        there = gauss > 0.1
        boxes[:, there] = box[:, None]
        weight[there] = (gauss * sides[i].prod().log() / gauss[there].sum())[there]
    return heat, boxes, weight


def corners(edges: torch.Tensor) -> torch.Tensor:
    """[N, 4, H, W]: left, top, right, bottom of the boxes, of their distances from the cells' middles."""
    at = middles(*edges.shape[2:], edges.device).permute(2, 0, 1)
    return torch.cat([at - edges[:, :2], at + edges[:, 2:]], 1)


def giou(first: torch.Tensor, second: torch.Tensor) -> torch.Tensor:
    """[n], of boxes [4, n]: generalised intersection over union (Rezatofighi et al. 2019)."""
    overlap = (torch.minimum(first[2:], second[2:]) - torch.maximum(first[:2], second[:2])).clamp(min=0).prod(0)
    hull = (torch.maximum(first[2:], second[2:]) - torch.minimum(first[:2], second[:2])).prod(0)
    union = (first[2:] - first[:2]).prod(0) + (second[2:] - second[:2]).prod(0) - overlap
    return overlap / union - (hull - union) / hull


def detection_loss(logits: torch.Tensor, edges: torch.Tensor, heat: torch.Tensor, boxes: torch.Tensor,
                   weight: torch.Tensor) -> torch.Tensor:
    """The focal loss of CornerNet (Law and Deng 2018) of the classes, and 5 (1 - GIoU) of the boxes,
    as TTFNet has them."""
    score = logits.sigmoid()
    found = (1 - score) ** 2 * F.logsigmoid(logits) * (heat == 1)
    nothing = (1 - heat.clamp(min=0)) ** 4 * score**2 * F.logsigmoid(-logits) * ((heat < 1) & (heat >= 0))
    focal = -(found + nothing).sum() / (heat == 1).sum().clamp(min=1)
    there = weight > 0
    true, given = (each.permute(1, 0, 2, 3)[:, there] for each in (boxes, corners(edges)))
    return focal + 5 * (weight[there] * (1 - giou(given, true))).sum() / weight.sum().clamp(min=1e-6)


def likeliest(logits: torch.Tensor, edges: torch.Tensor,
              most: int = 50) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Of the network's output the `most` likeliest objects of each image, the first one before all: boxes [N, most, 4],
    cut to the image, labels and scores [N, most]."""
    scores = logits.sigmoid()
    scores = (scores * (scores == F.max_pool2d(scores, 3, 1, 1))).flatten(1)
    scores, places = scores.topk(min(most, scores.shape[1]))
    height, width = edges.shape[2:]
    labels, cells = places.div(height * width, rounding_mode="floor"), places % (height * width)
    boxes = corners(edges).flatten(2).gather(2, cells[:, None].expand(-1, 4, -1)).transpose(1, 2)
    return torch.minimum(boxes.clamp(min=0), STRIDE * torch.tensor([width, height] * 2)), labels, scores


def detect(model: Detector, volumes: torch.Tensor) -> Iterator[tuple[torch.Tensor, torch.Tensor, torch.Tensor]]:
    """Of each volume [N, C, H, W]: boxes [n, 4], labels [n], scores [n]. The model must be in evaluation mode."""
    with torch.no_grad():
        output = [each.cpu() for each in model(volumes.to(next(model.parameters()).device))]
    for boxes, labels, scores in zip(*likeliest(*output)):
        kept = (scores > 0.001) & (boxes[:, 2:] > boxes[:, :2]).all(1)
        boxes, labels, scores = boxes[kept], labels[kept], scores[kept]
        sole = non_maximum_suppression(Detections(np.zeros(len(scores), int), labels.numpy(),
                                                  boxes.numpy(), scores.numpy()), 0.5)
        yield boxes[sole], labels[sole], scores[sole]


class InMemory(Dataset):
    """Items of DetectionDataset, read once, changed anew each time and with the detector's targets."""

    def __init__(self, items: Iterable[dict[str, Any]], classes: int, augmentation: EventAugmentation | None) -> None:
        self.items, self._classes, self._augmentation = list(items), classes, augmentation

    def __len__(self) -> int:
        return len(self.items)

    def __getitem__(self, index: int) -> tuple[torch.Tensor, ...]:
        item = self._augmentation(self.items[index]) if self._augmentation else self.items[index]
        return (item["volume"], *target_of(item, self._classes, *(side // STRIDE for side in item["volume"].shape[1:])))


def train(args: argparse.Namespace, items: Iterable[dict[str, Any]], classes: Sequence[str],
          augmentation: EventAugmentation | None,
          check: Sequence[dict[str, Any]], norm: Norm = nn.BatchNorm2d,
          tuned: Iterable[dict[str, Any]] = ()) -> Detector:
    """The detector trained on the items, by the options of `training`, in evaluation mode; `check`:
    items whose AP is reported; `tuned`: others, which are drawn as often as the items."""
    data, more = (InMemory(each, len(classes), augmentation) for each in (items, tuned))
    model = Detector(len(data.items[0]["volume"]), len(classes), norm)
    training.load_fitting(model, args.pretrained)
    model = model.to(args.device).to(memory_format=torch.channels_last)
    if args.last_layer:
        for layer in (model.requires_grad_(False).logits, model.edges):
            layer.requires_grad_(True)
    optimizer = torch.optim.AdamW([each for each in model.parameters() if each.requires_grad], args.lr,
                                  weight_decay=0.01)

    def loss_of(batch: tuple, _: float) -> torch.Tensor:
        if args.last_layer:
            model.eval()  # nor do the other layers' means and variances change
        volumes, *targets = (each.to(args.device) for each in batch)
        with torch.autocast(args.device, torch.bfloat16, enabled=args.bfloat16):
            logits, edges = model(volumes.contiguous(memory_format=torch.channels_last))
        return detection_loss(logits, edges, *targets)

    training.fit(args, model, optimizer, training.batches(args, data, shuffle=True, tuned=more), loss_of,
                 lambda: training.average_precisions(search(model, check, args.batch), classes), f"AP50 {classes[0]}")
    return model


def search(model: Detector,
           items: Sequence[dict[str, Any]], batch: int) -> Iterator[tuple[dict, tuple[torch.Tensor, ...]]]:
    """Each item with the boxes, labels and scores that are found in it."""
    for first in range(0, len(items), batch):
        some = [items[i] for i in range(first, min(first + batch, len(items)))]
        yield from zip(some, detect(model, torch.stack([item["volume"] for item in some])))


def signed(sample: Mapping[str, Any]) -> np.ndarray:
    return signed_channel(sample["volume"])


def size_of(area: np.ndarray, scale: float) -> tuple[int, int]:
    """H, W of the input that shows the area of the volumes at `scale`: multiples of 32."""
    height, width = (32 * math.ceil(side * scale / 32) for side in (area[2:] - area[:2])[::-1])
    return height, width


def shorter_sides(items: Iterable[dict[str, Any]], classes: Sequence[str]) -> dict[str, np.ndarray]:
    """For each class the shorter sides of its boxes, in input pixels, ignored ones left out."""
    kept = [(item["boxes"][~item["ignore"]], item["labels"][~item["ignore"]]) for item in items]
    boxes, labels = (torch.cat(each) for each in zip(*kept))
    sides = (boxes[:, 2:] - boxes[:, :2]).amin(1)
    return {name: sides[labels == i].numpy() for i, name in enumerate(classes)}


def larger_scale(area: np.ndarray, scale: float, side: float) -> tuple[float, float]:
    """The least multiple of 0.5 as --scale that makes `side`, in input pixels at `scale`, LEAST_SIDE or more, at most
    4; and the side at it."""
    def seen(at: float) -> float:
        return float(fitted(area, size_of(area, at))[0, 0])

    steps = itertools.count(math.floor(2 * scale) + 1)
    found = next(at / 2 for at in steps if at >= 8 or side * seen(at / 2) / seen(scale) >= LEAST_SIDE)
    return found, side * seen(found) / seen(scale)


def warn_of_small(sides: Mapping[str, np.ndarray], area: np.ndarray, scale: float) -> float | None:
    """Prints how many boxes there are, and how large; warns if the network will hardly see half of those of a class.
    The --scale at which it does, None: it does at this one."""
    medians = {name: float(np.median(each)) for name, each in sides.items() if len(each)}
    print("boxes for training, and the median of their shorter side in the network's input: "
          + ", ".join(f"{len(each)} {name}" + (f" {medians[name]:.3g} px" if len(each) else "")
                      for name, each in sides.items()))
    name = min(medians, key=medians.__getitem__)
    if medians[name] >= LEAST_SIDE:
        return None
    warning = (f"warning: half of the boxes of {name} are narrower than {medians[name]:.3g} pixels in the network's "
               f"input, and its map has a cell for {STRIDE}")
    if scale >= 4:
        print(f"{warning}: such boxes need larger volumes (image.width, image.height of convert's manifest)",
              file=sys.stderr)
        return None
    larger, side = larger_scale(area, scale, medians[name])
    print(f"{warning}: --scale {larger:g} makes them {side:.3g}" + (
        "" if side >= LEAST_SIDE else ", which is little; larger volumes (image.width, image.height of convert's "
        "manifest) have more to see"), file=sys.stderr)
    return larger


def advice(summary: Mapping[str, Any], items: int, larger: float | None) -> str | None:
    """What to do about the result, `summary` of metrics.json; None: it is not poor."""
    score, steps = summary[summary["metric"]], summary["history"][-1]["step"]
    if score is None:
        return f"there is no {summary['metric']}: the validation samples have no box of that class"
    if score >= POOR and (score > summary["untrained"] or not steps):
        return None
    todo = [f"--steps {max(STEPS, 2 * steps)} in place of {steps}"]
    todo += [f"--scale {larger:g} (and another --out)"] if larger else []
    todo += [f"more labelled images than {items}"] if items < 400 else []
    return (f"{summary['metric']} {score:.2g} on the validation samples is next to nothing. What helps: "
            f"{'; '.join(todo)}")


def main() -> None:
    parser = training.options(__doc__.splitlines()[0], batch=16, lr=2e-3, steps=STEPS)
    parser.epilog = (f"{STEPS} steps of 320x192 take about 6 minutes on a core with AVX512-BF16 and --bfloat16; "
                     "--steps 300 is for a first look.")
    parser.add_argument("--classes", default="Car",
                        help="class names, separated by commas; the first one's AP is the result")
    parser.add_argument("--channels", choices=["signed", "volume"], default="signed", help="what the network sees")
    parser.add_argument("--scale", type=float, default=1.0,
                        help="input pixels per volume pixel; objects of less than 16 pixels need more than 1")
    parser.add_argument("--bfloat16", action="store_true", help="compute convolutions in bfloat16, twice as fast where "
                        "the processor has AVX512-BF16 or AMX")
    training.add_tune(parser)
    args = training.begin(parser)
    train_shards, validation_shards = training.divided(args, training.with_boxes)
    test_shards = training.tested(args, train_shards, validation_shards, training.with_boxes)
    area = train_shards.image_area()  # what a letterbox has added shows nothing
    size, classes = size_of(area, args.scale), args.classes.split(",")
    view = fitted(area, size)

    def seen(shards: Shards) -> Shards:
        return shards.changed(signed) if args.channels == "signed" else shards

    def read(dataset: DetectionDataset) -> list[dict[str, Any]]:
        return [dataset[i] for i in range(len(dataset))]

    tune_shards = training.tuned_on(args, training.with_boxes, test_shards) if args.tune else None
    try:
        items, validation = (read(DetectionDataset(seen(shards), classes, size, view=view))
                             for shards in (train_shards, validation_shards))
        test_set, test_view = training.detection_test(args, seen(test_shards), classes, size, view)
        test = read(test_set)
        tuned = read(training.items_of(seen(tune_shards), classes, size,
                                       fitted(tune_shards.image_area(), size))) if tune_shards else []
    except ValueError as error:
        raise SystemExit(str(error))
    sides = shorter_sides(items, classes)
    if not len(sides[classes[0]]):
        there = [f"{count} of {name}" for name, count in train_shards.class_counts().items() if count]
        raise SystemExit(f"expected boxes of {classes[0]} to train on, got none, in {args.data}; its training samples "
                         f"have {', '.join(there) or 'no boxes that are not to be ignored'}")
    larger = warn_of_small(sides, area, args.scale)
    model = train(training.untuned(args), items, classes, AUGMENTATION, validation)
    metrics = json.loads(pathlib.Path(args.out, "metrics.json").read_text(encoding="utf-8"))
    poor = None if tuned else advice(metrics, len(items), larger)
    if tuned:
        args = training.tuning(args, len(tuned))
        model = train(args, items, classes, AUGMENTATION, validation, tuned=tuned)

    def image_of(i: int) -> tuple[str, np.ndarray]:
        boxes, labels, scores = next(detect(model, validation[i]["volume"][None]))
        sure = scores >= SURE
        texts = [f"{classes[label]} {score:.2f}" for label, score in zip(labels[sure].tolist(), scores[sure].tolist())]
        return validation[i]["id"], training.draw_item(validation[i], boxes[sure], texts)

    if not args.frames:
        gaps = (tune_shards or train_shards).column("gap_s")
        takeaway.write(pathlib.Path(args.out), model, likeliest, len(items[0]["volume"]), size, {
            "classes": classes, "bins": len(train_shards.sample(0, {"volume"})["volume"]) // 2,
            "normalize": read_description(args.data)["settings"].get("volume", {}).get("normalize", "none"),
            "channels": args.channels, "score": SURE,
            "window_ms": round(1000 * float(np.median(gaps[gaps > 0] if (gaps > 0).any() else WINDOW_S)), 3)})
        script = shlex.quote(str(pathlib.Path(args.out, "detect.py")))
        print(f"to find {' and '.join(classes)} in a recording: {script} RECORDING (this folder's detect.py and "
              "detector.pt are all it needs)")
    found = search(model, test, args.batch)
    training.write_predictions(args, test_shards, (entry for item, boxes in found for entry in
                                                   training.box_predictions(item, boxes, classes, test_view)))
    training.write_images(args, len(validation), image_of)
    if poor:
        print(f"warning: {poor}", file=sys.stderr)


if __name__ == "__main__":
    main()

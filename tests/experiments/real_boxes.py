"""Boxes of persons and cars for `experiment.py real`: the detector of train_detector.py, and its scores."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np
import torch
import train_detector
import training
from eventgan.detection_scores import Detections, GroundTruth, curve, detection_scores, match_as_voc, overlapping
from eventgan.torch import EventAugmentation
from labelled_recordings import Item, Network

BATCH = 16  # of tests

Boxes = Sequence[tuple[torch.Tensor, torch.Tensor, torch.Tensor]]  # for each item: boxes [n, 4], labels, scores


def make(channels: int, norm: train_detector.Norm) -> train_detector.Detector:
    return train_detector.Detector(channels, 1, norm)


def train(run: argparse.Namespace, items: list[Item], augmentation: EventAugmentation,
          norm: train_detector.Norm) -> None:
    train_detector.train(run, items, run.classes, augmentation, items[:run.batch], norm)


def find(model: train_detector.Detector, items: Sequence[Item]) -> Boxes:
    return [boxes for _, boxes in train_detector.search(model, items, BATCH)]


def scores_of(items: Sequence[Item], found: Boxes) -> dict[str, float]:
    """AP@0.5, AP@0.75, AP@[.5:.95]; precision, recall and F1 at the score where F1 is greatest; and the share of
    windows in which the box with the highest score lies on an object (IoU 0.5 or more)."""
    predicted, truth, best = [], [], []
    for i, (item, (boxes, labels, scores)) in enumerate(zip(items, found)):
        predicted.append((np.full(len(boxes), i), labels.numpy(), boxes.numpy(), scores.numpy()))
        there = item["boxes"].numpy()
        truth.append((np.full(len(there), i), item["labels"].numpy(), there, item["ignore"].numpy(),
                      np.full(len(there), -1)))
        first = boxes[scores.argmax()[None]].numpy() if len(boxes) else np.zeros((0, 4))
        best.append(len(overlapping(np.zeros(len(first), int), first, np.zeros(len(there), int), there, 0.5)[0]) > 0)
    predictions, labelled = (Detections.of(*map(np.concatenate, zip(*predicted))),
                             GroundTruth(*map(np.concatenate, zip(*truth))))
    at = {iou: detection_scores(predictions, labelled, {"": 0}, iou)[""] for iou in (0.5, 0.75)}
    matched, counts = match_as_voc(predictions, labelled)
    recall, precision = (np.append(each, 0) for each in curve(matched[counts] >= 0, (~labelled.ignore).sum()))
    f1 = 2 * recall * precision / np.maximum(recall + precision, 1e-9)
    return {"ap50": at[0.5]["ap_voc"], "ap75": at[0.75]["ap_voc"], "ap": at[0.5]["ap_coco"],
            "precision": float(precision[f1.argmax()]), "recall": float(recall[f1.argmax()]), "f1": float(f1.max()),
            "best": float(np.mean(best))}


def constant(items: Sequence[Item]) -> Boxes:
    """In each item the same box: that of their labels which lies on an object in most items (IoU 0.5 or more)."""
    boxes = torch.cat([item["boxes"] for item in items]).numpy()
    of = np.repeat(np.arange(len(items)), [len(item["boxes"]) for item in items])
    pairs = overlapping(np.zeros(len(boxes), int), boxes, np.zeros(len(boxes), int), boxes, 0.5)
    hits = [len(np.unique(of[pairs.second[pairs.first == i]])) for i in range(len(boxes))]
    box = torch.from_numpy(boxes[np.argmax(hits)][None])
    return [(box, torch.zeros(1, dtype=torch.int64), torch.ones(1))] * len(items)


def draw(item: Item, found: tuple[torch.Tensor, torch.Tensor, torch.Tensor]) -> np.ndarray:
    """What is found (blue: the best two) beside the boxes (green)."""
    boxes, _, scores = found
    best = scores.argsort(descending=True)[:2]
    return training.draw_item(item, boxes[best], [f"{score:.2f}" for score in scores[best].tolist()])


DETECTOR = Network(make, train, find, scores_of, constant, draw)

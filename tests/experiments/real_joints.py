"""Joints of persons for `experiment.py real`: a small network that finds them in a person's crop, and its scores.

Items are those of labelled_recordings with `joints`. A person is cropped to SIDE x SIDE pixels by the joints that are
annotated, in training and in tests alike.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
import torch.nn.functional as F
import train_detector
import training
from eventgan import drawing
from eventgan.augmentation import EventAugmentation, move_points, moved
from eventgan.pose_scores import head_lengths, near_head
from eventgan.torch import flip_pairs, heatmaps
from labelled_recordings import JOINTS, Item, Network
from torch import nn
from torch.utils.data import Dataset

SIDE, STRIDE = 128, 4  # of crops, and pixels of one for each cell of the maps
AROUND = 1.4  # sides of the crop per longer side of the box around the joints
SIGMA = 1.5  # of a joint's Gaussian, cells
ROTATION = 15.0  # of crops in training, standard deviation in degrees, at most twice that
PAIRS = flip_pairs(JOINTS)
MIRRORED = np.arange(len(JOINTS))
MIRRORED[np.array(PAIRS)] = np.array(PAIRS)[:, ::-1]
TORSO = [(JOINTS.index(f"{side}_shoulder"), JOINTS.index(f"{other}_hip"))
         for side, other in (("left", "right"), ("right", "left"))]

Found = Sequence[np.ndarray]  # for each item, joints [J, 2] in pixels of its crop


class Pose(train_detector.Trunk):
    """Of crops [N, C, SIDE, SIDE]: for each joint the logit of its place, [N, J, SIDE / 4, SIDE / 4]."""

    def __init__(self, channels: int, norm: train_detector.Norm) -> None:
        super().__init__(channels, norm)
        self.maps = nn.Conv2d(64, 4 * len(JOINTS), 1)

    def forward(self, crops: torch.Tensor) -> torch.Tensor:
        return F.pixel_shuffle(self.maps(self.seen(crops)), 2).float()


def view_of(joints: np.ndarray, angle: float = 0.0) -> np.ndarray:
    """[2, 3], of joints [J, 2] (NaN: not annotated): the map of the volume's points to those of the person's crop,
    turned by an angle in degrees around its middle."""
    low, high = np.nanmin(joints, 0), np.nanmax(joints, 0)
    scale = SIDE / (AROUND * max((high - low).max(), 1))
    cos, sin = scale * np.cos(np.deg2rad(angle)), scale * np.sin(np.deg2rad(angle))
    linear = np.array([[cos, -sin], [sin, cos]])
    return np.column_stack([linear, (SIDE - 1) / 2 - linear @ ((low + high) / 2)])


def crop_of(item: Item, angle: float = 0.0,
            augmentation: EventAugmentation | None = None) -> tuple[torch.Tensor, np.ndarray]:
    """The person's crop [C, SIDE, SIDE] and its joints [J, 2] in it."""
    joints = item["joints"].double().numpy()
    crop, affine = moved(item["volume"].float(), math.nan, augmentation, (SIDE, SIDE), view_of(joints, angle))
    joints = move_points(joints, affine)
    return crop, joints[MIRRORED] if np.linalg.det(affine[:, :2]) < 0 else joints


def facing(joints: np.ndarray) -> np.ndarray:
    """Joints [J, 2] with the sides named as of somebody who faces the camera. Scores do not ask which side is which,
    and events of somebody's back hardly tell."""
    across = [joints[left, 0] - joints[right, 0] for left, right in PAIRS
              if "shoulder" in JOINTS[left] or "hip" in JOINTS[left]]
    return joints[MIRRORED] if np.nansum(across) < 0 else joints


class Crops(Dataset):
    """Crops, changed anew each time, with the maps of their joints [J, H, W] and which of these count [J, 1]."""

    def __init__(self, items: Sequence[Item], augmentation: EventAugmentation) -> None:
        self.items = items
        self._augmentation = dataclasses.replace(augmentation, scale=(0.8, 1.25), shift=0.05)

    def __len__(self) -> int:
        return len(self.items)

    def __getitem__(self, index: int) -> tuple[Any, ...]:
        angle = ROTATION * float(torch.randn(()).clamp(-2, 2))
        crop, joints = crop_of(self.items[index], angle, self._augmentation)
        joints = facing(joints)
        cells = (joints - (STRIDE - 1) / 2) / STRIDE
        there = np.isfinite(cells).all(-1) & (cells > -0.5).all(-1) & (cells < SIDE / STRIDE - 0.5).all(-1)
        return crop, *heatmaps(np.nan_to_num(cells), there, SIDE // STRIDE, SIDE // STRIDE, SIGMA)


def loss_of_maps(logits: torch.Tensor, maps: torch.Tensor, weight: torch.Tensor) -> torch.Tensor:
    """The cross entropy of the joints' places, mean over those that count."""
    wanted = maps.flatten(2) / maps.flatten(2).sum(-1, keepdim=True).clamp(min=1e-6)
    return -(wanted * F.log_softmax(logits.flatten(2), -1) * weight).sum() / weight.sum().clamp(min=1)


def train(run: argparse.Namespace, items: list[Item], augmentation: EventAugmentation,
          norm: train_detector.Norm) -> None:
    """With run.last_layer the others stay as they are in run.pretrained."""
    data = Crops(items, augmentation)
    model = Pose(len(data.items[0]["volume"]), norm)
    training.load_fitting(model, run.pretrained)
    model = model.to(memory_format=torch.channels_last)
    if run.last_layer:
        model.requires_grad_(False).maps.requires_grad_(True)
    optimizer = torch.optim.AdamW([each for each in model.parameters() if each.requires_grad], run.lr,
                                  weight_decay=0.01)

    def loss_of(batch: tuple, _: float) -> torch.Tensor:
        if run.last_layer:
            model.eval()  # nor do the other layers' means and variances change
        crops, maps, weight = batch
        with torch.autocast("cpu", torch.bfloat16, enabled=run.bfloat16):
            logits = model(crops.contiguous(memory_format=torch.channels_last))
        return loss_of_maps(logits, maps, weight)

    training.fit(run, model, optimizer, training.batches(run, data, shuffle=True), loss_of,
                 lambda: scores_of(items[:run.batch], find(model, items[:run.batch])), "pck")


@torch.no_grad()
def find(model: Pose, items: Sequence[Item], batch: int = 32) -> Found:
    found = []
    for first in range(0, len(items), batch):
        maps = model(torch.stack([crop_of(item)[0] for item in items[first:first + batch]]))
        places = F.interpolate(maps, scale_factor=float(STRIDE), mode="bicubic").flatten(2).argmax(-1)
        found += [*torch.stack([places % SIDE, places // SIDE], -1).double().numpy()]
    return found


def either_way(found: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Joints [J, 2] as they were found or, where that is nearer to the true ones on the whole, with left and right
    exchanged: which side is which is not sure in all recordings."""
    ways = (found, found[MIRRORED])
    return min(ways, key=lambda way: np.nanmean(np.linalg.norm(way - true, axis=-1)))


def scores_of(items: Sequence[Item], found: Found) -> dict[str, float]:
    """pckh: the EventGAN paper's PCKh@0.5; pck: the share of the joints within a fifth of the torso, the mean of its
    two diagonals; mpjpe: the mean distance in pixels of the crop. All with the better of both sides."""
    true = np.stack([crop_of(item)[1] for item in items])
    error = np.linalg.norm(np.stack([*map(either_way, found, true)]) - true, axis=-1)
    there = np.isfinite(error)
    near, of = near_head(error, there, head_lengths(JOINTS, true, there))
    torso = np.mean([np.linalg.norm(true[:, a] - true[:, b], axis=-1) for a, b in TORSO], axis=0)[:, None]
    known = there & np.isfinite(torso)
    return {"pckh": float(near.sum() / max(of.sum(), 1)), "pck": float((error <= 0.2 * torso)[known].mean()),
            "mpjpe": float(error[there].mean())}


def constant(items: Sequence[Item]) -> Found:
    """The items' own mean pose, for each of them."""
    return [np.nanmean([crop_of(item)[1] for item in items], axis=0)] * len(items)


def draw(item: Item, found: np.ndarray) -> np.ndarray:
    crop, true = crop_of(item)
    canvas = drawing.of_events(torch.cat([crop, 0 * crop]).numpy())
    drawing.draw_joints(canvas, true, drawing.TRUE)
    drawing.draw_joints(canvas, either_way(found, true), drawing.FOUND, true)
    return canvas


POSE = Network(Pose, train, find, scores_of, constant, draw)

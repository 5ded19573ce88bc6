"""Changes of volumes together with their boxes: augmentations, and maps of points to another place and size."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch
from torch import nn

from .words import listed

Item = dict[str, Any]


@dataclasses.dataclass(frozen=True)
class EventAugmentation:
    """Random changes of events that leave them like a camera's. Drawn from torch's random numbers.

    Values are not changed: a volume has no brightness or hue. A volume is [2B, H, W] here, or [1, H, W] as
    `signed_channel` makes it. `threshold`, `lost` and `isolated` are applied last, to the pixels that a network sees.

    Parameters
    ----------
    flip : float, default 0.5
        Probability that left and right are exchanged.
    reverse : float, default 0
        Probability that time runs backwards, which exchanges the polarities and reverses the bins. Labels keep their
        place and so end up at the other end of time: only samples whose labels lie half-way (`label_position` 0.5) are
        reversed.
    drop : float, default 0
        Probability that one polarity (either) is lost, as in a sensor with one threshold set high.
    scale : (float, float)
        Range of the factor by which the image is enlarged, uniform in its logarithm; what lies outside is cut off, what
        is missing is filled with 0 (no events).
    shift : float, default 0
        The scaled image is moved by at most this share of width and height.
    reverse_all : bool, default False
        True: `reverse` applies to all samples.
    invert : float, default 0
        Probability that the polarities are exchanged while time runs forwards: bright becomes dark.
    threshold : (float, float)
        Imitates another sensor's threshold: pixels with fewer events than a share of the volume's strongest ones (98th
        percentile of the sums over its channels, of pixels with events) lose theirs. The share is drawn uniformly from
        this range.
    lost : (float, float)
        The share of the pixels with events that lose them, drawn uniformly from this range.
    isolated : (float, float)
        The share of all pixels that get an event of their own, as from noise, drawn uniformly from this range: in a
        random channel (one channel: of random sign), 0.3 to 1 times as strong as the strongest ones.
    turn : float, default 0
        The image is turned around its middle by at most so many degrees either way. A box becomes the bounds of the
        turned one, of which what lies outside is cut: an object that left over a corner may keep a box.

    Raises
    ------
    ValueError
        A probability, factor or share is out of range.
    """

    flip: float = 0.5
    reverse: float = 0.0
    drop: float = 0.0
    scale: tuple[float, float] = (1.0, 1.0)
    shift: float = 0.0
    reverse_all: bool = False
    invert: float = 0.0
    threshold: tuple[float, float] = (0.0, 0.0)
    lost: tuple[float, float] = (0.0, 0.0)
    isolated: tuple[float, float] = (0.0, 0.0)
    turn: float = 0.0

    def __post_init__(self) -> None:
        for name in ("flip", "reverse", "drop", "invert"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"expected {name} to be a probability, got {getattr(self, name)}")
        for name in ("threshold", "lost", "isolated"):
            least, most = getattr(self, name)
            if not 0 <= least <= most <= 1:
                raise ValueError(f"expected {name} to be a range of shares from 0 to 1, got {least}, {most}")
        if not 0 <= self.turn <= 180:
            raise ValueError(f"expected turn to be 0 to 180 degrees, got {self.turn}")
        if not 0 < self.scale[0] <= self.scale[1] < math.inf or not 0 <= self.shift < math.inf:
            raise ValueError("expected factors above 0, the smaller one first, and a shift of at least 0, got "
                             f"{self.scale}, {self.shift}")

    def __call__(self, item: Item) -> Item:
        """An item of DetectionDataset or FramePairs with volume and boxes changed alike, for items that are kept in
        memory and drawn again each epoch.

        Parameters
        ----------
        item : dict
            With `volume`, `boxes`, `labels`, `ignore` and `label_position`; without the latter time is not reversed,
            unless `reverse_all`.

        Returns
        -------
        dict
            A new item, which keeps whatever else `item` has.
        """
        boxes, labels, ignore = (item[name].numpy() for name in ("boxes", "labels", "ignore"))
        return {**item, **detection_item(item["volume"], boxes, boxes, labels, ignore,
                                         item.get("label_position", math.nan), self)}

    def affine(self, height: int, width: int) -> np.ndarray:
        """Draws a map of points of a volume of this size, float64 [2, 3]."""
        flip, size, dx, dy = (float(each) for each in torch.rand(4))
        s = math.exp(math.log(self.scale[0]) + size * math.log(self.scale[1] / self.scale[0]))
        middle = np.array([(width - 1) / 2, (height - 1) / 2])
        moved = middle + (2 * np.array([dx, dy]) - 1) * self.shift * np.array([width, height])
        linear = np.diag([-s if flip < self.flip else s, s])
        if self.turn:
            angle = math.radians(self.turn) * (2 * float(torch.rand(())) - 1)
            linear = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]) @ linear
        return np.column_stack([linear, moved - linear @ middle])

    def events(self, volume: torch.Tensor, label_position: float = 0.5) -> torch.Tensor:
        """The volume, perhaps backwards in time (see `reverse`), inverted or without one polarity.

        Parameters
        ----------
        volume : torch.Tensor, [2B, H, W] or [1, H, W]
        label_position : float, default 0.5
            Where in time the labels lie: 0 at the start, 1 at the end.

        Returns
        -------
        torch.Tensor
            Of the same shape.
        """
        is_signed = len(volume) == 1
        reverse, drop, which = (float(each) for each in torch.rand(3))
        if reverse < self.reverse and (self.reverse_all or label_position == 0.5):
            volume = -volume if is_signed else volume.flip(0)
        if self.invert and float(torch.rand(())) < self.invert:
            volume = -volume if is_signed else volume.roll(len(volume) // 2, 0)
        if drop < self.drop and is_signed:
            volume = volume.clamp(max=0) if which >= 0.5 else volume.clamp(min=0)
        elif drop < self.drop:
            volume = volume.clone()
            volume.chunk(2)[int(which < 0.5)].zero_()
        return volume

    def sensor(self, volume: torch.Tensor) -> torch.Tensor:
        """The volume as another sensor might have seen it: `threshold`, `lost` and `isolated`;
        itself if all three are off."""
        ranges = torch.tensor([self.threshold, self.lost, self.isolated])
        if not ranges.any():
            return volume
        threshold, lost, isolated = (ranges[:, 0] + torch.rand(3) * (ranges[:, 1] - ranges[:, 0])).tolist()
        strength = volume.abs().sum(0)
        there = strength[strength > 0]
        strongest = float(np.percentile(there.numpy(), 98)) if len(there) else 0.0
        kept = (strength >= threshold * strongest) & (torch.rand(strength.shape) >= lost)
        volume = (volume * kept).contiguous()
        count = round(isolated * strength.numel())
        at = torch.randint(max(volume.numel(), 1), (count,))
        signs = 2 * torch.randint(2, (count,)) - 1 if len(volume) == 1 else 1
        volume.view(-1)[at] = strongest * (0.3 + 0.7 * torch.rand(count)) * signs
        return volume


def warp(volume: torch.Tensor, affine: np.ndarray, height: int, width: int) -> torch.Tensor:
    """Moves the pixels of a volume bilinearly and fills with 0. A shift by whole pixels, mirrored or not, is exact.

    Parameters
    ----------
    volume : torch.Tensor, [C, H, W]
    affine : numpy.ndarray, [2, 3]
        The map of its points to those of the result.
    height, width : int
        Of the result, pixels.

    Returns
    -------
    torch.Tensor
        [C, height, width].
    """
    back = inverse(affine)
    close = functools.partial(np.allclose, rtol=0, atol=1e-9)
    if close(np.abs(back[:, :2]), np.eye(2)) and close(back, back.round()):
        return _shifted(volume, back.round().astype(int), height, width)
    xs = torch.arange(width, dtype=torch.float64)
    ys = torch.arange(height, dtype=torch.float64)[:, None]
    grid = volume.new_empty(height, width, 2)  # from -1 to 1, edge to edge
    for axis, (row, side) in enumerate(zip(back.tolist(), (volume.shape[2], volume.shape[1]))):
        grid[..., axis] = (2 * row[0] / side) * xs + ((2 * row[1] / side) * ys + ((2 * row[2] + 1) / side - 1))
    return nn.functional.grid_sample(volume[None], grid[None], mode="bilinear", padding_mode="zeros",
                                     align_corners=False)[0]


def _shifted(volume: torch.Tensor, back: np.ndarray, height: int, width: int) -> torch.Tensor:
    result = volume.new_zeros(volume.shape[0], height, width)
    sources = []
    for axis, (row, size, limit) in enumerate(((back[0], width, volume.shape[2]), (back[1], height, volume.shape[1]))):
        at = row[axis] * np.arange(size) + row[2]
        inside = np.flatnonzero((at >= 0) & (at < limit))
        sources.append((torch.from_numpy(inside), torch.from_numpy(at[inside])))
    (to_x, from_x), (to_y, from_y) = sources
    result[:, to_y[:, None], to_x] = volume[:, from_y[:, None], from_x]
    return result


def move_points(points: np.ndarray, affine: np.ndarray) -> np.ndarray:
    """Points [..., 2] moved by an affine map [2, 3]."""
    return points @ affine[:, :2].T + affine[:, 2]


def move_boxes(boxes: np.ndarray, affine: np.ndarray) -> np.ndarray:
    """Boxes [n, 4] (left, top, right, bottom, by edges) moved by a map of points [2, 3]; of turned ones the bounds."""
    corners = np.asarray(boxes, float).reshape(-1, 4)[:, [0, 1, 2, 1, 0, 3, 2, 3]].reshape(-1, 4, 2)
    corners = move_points(corners - 0.5, affine) + 0.5
    return np.concatenate([corners.min(1), corners.max(1)], 1)


def move_flow(flow: np.ndarray, valid: np.ndarray, affine: np.ndarray, height: int, width: int,
              label_position: float) -> tuple[np.ndarray, np.ndarray]:
    """Flow of moved images: each pixel has that of the nearest one of before.

    Parameters
    ----------
    flow, valid : numpy.ndarray, [2, H, W], [H, W]
        As a shard has them: from the previous image to the next, at the pixels of the labelled one.
    affine : numpy.ndarray, [2, 3]
        The map of points that both images went through.
    height, width : int
        Of the result, pixels.
    label_position : float
        0: labelled is the previous image; else the next one.

    Returns
    -------
    (numpy.ndarray, numpy.ndarray)
        [2, height, width], and bool [height, width]: False also where the flow leads out of the result.
    """
    here = np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1)
    before = np.rint(move_points(here, inverse(affine))).astype(int)
    limit = np.array(valid.shape[::-1]) - 1
    x, y = np.moveaxis(np.clip(before, 0, limit), -1, 0)
    inside = ((before >= 0) & (before <= limit)).all(-1)
    there = np.einsum("ij,jyx->iyx", affine[:, :2], flow[:, y, x]) * inside
    target = here + np.moveaxis(there if label_position == 0 else -there, 0, -1)
    return there, inside & (valid[y, x] != 0) & ((target >= 0) & (target <= [width - 1, height - 1])).all(-1)


def inverse(affine: np.ndarray) -> np.ndarray:
    """The inverse of an affine map, [2, 3]."""
    linear = np.linalg.inv(affine[:, :2])
    return np.column_stack([linear, -linear @ affine[:, 2]])


def fitted(area: Sequence[float], size: tuple[int, int]) -> np.ndarray:
    """The map of points that scales an area to fit a size and centres it, with the same factor for both sides.

    With the area of Shards.image_area() it leaves out the borders of a letterbox.

    Parameters
    ----------
    area : sequence of 4 floats
        Left, top, right, bottom in volume pixels, by edges.
    size : (int, int)
        H, W.

    Returns
    -------
    numpy.ndarray
        float64 [2, 3].
    """
    left, top, right, bottom = area
    height, width = size
    s = min(width / (right - left), height / (bottom - top))
    to_middle = np.array([width - s * (left + right), height - s * (top + bottom)]) / 2
    return np.column_stack([s * np.eye(2), to_middle + (s - 1) / 2])


def moved(volume: torch.Tensor, label_position: float, augmentation: EventAugmentation | None,
          size: tuple[int, int] | None = None,
          view: np.ndarray | None = None) -> tuple[torch.Tensor, np.ndarray | None]:
    """The volume moved by `view`, then by the augmentation, cut to `size`; and the map of its points, [2, 3],
    or None if they stay."""
    if augmentation:
        volume = augmentation.events(volume, label_position)
    elif not size and view is None:
        return volume, None
    height, width = size or volume.shape[1:]
    view = np.eye(2, 3) if view is None else view
    if not augmentation:
        return warp(volume, view, height, width), view
    affine = augmentation.affine(height, width) @ np.vstack([view, [0, 0, 1]])
    return augmentation.sensor(warp(volume, affine, height, width)), affine


def detection_item(volume: torch.Tensor, boxes: np.ndarray, whole: np.ndarray, labels: np.ndarray, ignore: np.ndarray,
                   label_position: float, augmentation: EventAugmentation | None, size: tuple[int, int] | None = None,
                   view: np.ndarray | None = None, visible: float = 0.25) -> Item:
    """`volume`, `boxes`, `labels` and `ignore` of an item of DetectionDataset, of boxes [n, 4] in volume pixels;
    `whole`: before they were clipped.
    """
    volume, affine = moved(volume, label_position, augmentation, size, view)
    boxes, whole = (each if affine is None else move_boxes(each, affine) for each in (boxes, whole))
    height, width = volume.shape[1:]
    cut = np.clip(boxes, 0, [width, height, width, height])
    ignore = ignore | (_areas(cut) < visible * np.maximum(_areas(whole), 1e-9))
    kept = _areas(cut) > 0
    return {"volume": volume, "boxes": torch.from_numpy(cut[kept]).float(), "labels": torch.from_numpy(labels[kept]),
            "ignore": torch.from_numpy(ignore[kept])}


def _areas(boxes: np.ndarray) -> np.ndarray:
    return np.prod(np.maximum(boxes[:, 2:] - boxes[:, :2], 0), 1)


def numbered(classes: Sequence[str] | Mapping[str, int]) -> dict[str, int]:
    """The number of each class, by default its position."""
    return dict(classes) if isinstance(classes, Mapping) else {
        name: i for i, name in enumerate(listed(classes, "classes"))}

"""PyTorch datasets of event volumes: boxes to detect, persons to find joints of.

    from torch.utils.data import DataLoader
    from eventgan import Shards
    from eventgan.torch import DetectionDataset, collate_yolo

    cars = DetectionDataset(Shards("out", split="train"), classes=["Car", "Pedestrian"])
    for imgs, targets, ids in DataLoader(cars, batch_size=8, shuffle=True, num_workers=4, collate_fn=collate_yolo):
        ...

A volume is a tensor [2B, H, W], float32: channels 0..B-1 are the positive polarity in time order, B..2B-1 the negative. Points are
x, y in pixels whose centres are whole numbers; boxes are left, top, right, bottom of edges between pixels, so that a whole image is
0, 0, W, H: the edge x is the left edge of pixel x, half a pixel left of its centre, the point x (shard_format.md, Geometry).
"""

from __future__ import annotations

import dataclasses
import functools
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
import torch.nn.functional
from torch import nn
from torch.utils.data import ConcatDataset, Dataset, WeightedRandomSampler

from .detection_scores import DONT_CARE
from .shards import Shards

if TYPE_CHECKING:
    from .frame_pairs import FrameAugmentation, FramePairs

Item = dict[str, Any]


def __getattr__(name: str) -> Any:
    """What makes volumes of images: in a file of its own, which needs this one."""
    if name not in ("FrameAugmentation", "FramePairs"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from . import frame_pairs

    return getattr(frame_pairs, name)


@dataclasses.dataclass(frozen=True)
class EventAugmentation:
    """What may happen to events without making them unlike a camera's. Drawn by torch's random numbers.

    There is no change of values: a volume has no brightness or hue. A volume is [2B, H, W] here, or [1, H, W] as `signed_channel` makes it.
    `threshold`, `lost` and `isolated` come last, at the pixels that a network sees.

    Parameters
    ----------
    flip : float, default 0.5
        Probability of left and right exchanged.
    reverse : float, default 0
        Probability of time running backwards, which exchanges polarities and turns the bins round. Labels stay where they are
        and so come to the other end of time: only samples whose labels lie half-way (`label_position` 0.5) are reversed.
    drop : float, default 0
        Probability of one polarity (either) being lost, as in a sensor with one threshold set high.
    scale : (float, float)
        Factors between which the image is enlarged, uniformly in its logarithm; what lies outside is cut, what is
        missing is filled with 0, no events.
    shift : float, default 0
        By at most this share of width and height the scaled image is moved.
    reverse_all : bool, default False
        True reverses others, too.
    invert : float, default 0
        Probability of the polarities being exchanged, time running as it does: what was bright is dark.
    threshold : (float, float)
        Another sensor's threshold: pixels with fewer events than a share of the volume's strongest ones (98th percentile of the sums over its
        channels, where there are any) have none. The share is drawn uniformly from this range.
    lost : (float, float)
        The share of the pixels with events that lose them, drawn uniformly from this range.
    isolated : (float, float)
        The share of all pixels that get an event of their own, as noise makes them, drawn uniformly from this range: in a random channel (one channel: of
        random sign), 0.3 to 1 times as strong as the strongest ones.

    Raises
    ------
    ValueError
        A probability, factor or share is none.
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

    def __post_init__(self) -> None:
        for name in ("flip", "reverse", "drop", "invert"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"expected {name} to be a probability, got {getattr(self, name)}")
        for name in ("threshold", "lost", "isolated"):
            least, most = getattr(self, name)
            if not 0 <= least <= most <= 1:
                raise ValueError(f"expected {name} to be a range of shares from 0 to 1, got {least}, {most}")
        if not 0 < self.scale[0] <= self.scale[1] < math.inf or not 0 <= self.shift < math.inf:
            raise ValueError(f"expected factors above 0, the smaller one first, and a shift of at least 0, got {self.scale}, {self.shift}")

    def __call__(self, item: Item) -> Item:
        """An item of DetectionDataset or FramePairs, volume and boxes changed alike: for items that are kept in memory and drawn again each epoch.

        Parameters
        ----------
        item : dict
            With `volume`, `boxes`, `labels`, `ignore` and `label_position`; without the latter time is not reversed, unless `reverse_all`.

        Returns
        -------
        dict
            A new item; what else is in `item` is there, too.
        """
        boxes, labels, ignore = (item[name].numpy() for name in ("boxes", "labels", "ignore"))
        return {**item, **_detection_item(item["volume"], boxes, boxes, labels, ignore, item.get("label_position", math.nan), self)}

    def affine(self, height: int, width: int) -> np.ndarray:
        """Where a point of the volume goes, drawn again.

        Parameters
        ----------
        height, width : int
            Of the volume, pixels.

        Returns
        -------
        numpy.ndarray
            float64 [2, 3].
        """
        flip, size, dx, dy = (float(each) for each in torch.rand(4))
        s = math.exp(math.log(self.scale[0]) + size * math.log(self.scale[1] / self.scale[0]))
        middle = np.array([(width - 1) / 2, (height - 1) / 2])
        moved = middle + (2 * np.array([dx, dy]) - 1) * self.shift * np.array([width, height])
        linear = np.diag([-s if flip < self.flip else s, s])
        return np.column_stack([linear, moved - linear @ middle])

    def events(self, volume: torch.Tensor, label_position: float = 0.5) -> torch.Tensor:
        """The volume, perhaps backwards in time (see `reverse`), perhaps without one polarity.

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
        """The volume as another sensor might have seen it: `threshold`, `lost` and `isolated`.

        Parameters
        ----------
        volume : torch.Tensor, [2B, H, W] or [1, H, W]

        Returns
        -------
        torch.Tensor
            Of the same shape; the one given if all three are off.
        """
        ranges = torch.tensor([self.threshold, self.lost, self.isolated])
        if not ranges.any():
            return volume
        threshold, lost, isolated = (ranges[:, 0] + torch.rand(3) * (ranges[:, 1] - ranges[:, 0])).tolist()
        strength = volume.abs().sum(0)
        there = strength[strength > 0]
        strongest = float(np.percentile(there.numpy(), 98)) if len(there) else 0.0
        volume = volume * ((strength >= threshold * strongest) & (torch.rand(strength.shape) >= lost))
        count = round(isolated * strength.numel())
        at = torch.randint(max(volume.numel(), 1), (count,))
        signs = 2 * torch.randint(2, (count,)) - 1 if len(volume) == 1 else 1
        volume.view(-1)[at] = strongest * (0.3 + 0.7 * torch.rand(count)) * signs
        return volume


def warp(volume: torch.Tensor, affine: np.ndarray, height: int, width: int) -> torch.Tensor:
    """Moves the pixels of a volume, bilinearly, with 0 where there is nothing. A shift by whole pixels, flipped or not, is exact.

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
    if np.allclose(np.abs(back[:, :2]), np.eye(2), rtol=0, atol=1e-9) and np.allclose(back, back.round(), rtol=0, atol=1e-9):
        return _shifted(volume, back.round().astype(int), height, width)
    xs = torch.arange(width, dtype=torch.float64)
    ys = torch.arange(height, dtype=torch.float64)[:, None]
    grid = volume.new_empty(height, width, 2)  # from -1 to 1, edge to edge
    for axis, (row, side) in enumerate(zip(back.tolist(), (volume.shape[2], volume.shape[1]))):
        grid[..., axis] = (2 * row[0] / side) * xs + ((2 * row[1] / side) * ys + ((2 * row[2] + 1) / side - 1))
    return nn.functional.grid_sample(volume[None], grid[None], mode="bilinear", padding_mode="zeros", align_corners=False)[0]


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
    """Points moved by an affine map.

    Parameters
    ----------
    points : numpy.ndarray, [..., 2]
    affine : numpy.ndarray, [2, 3]

    Returns
    -------
    numpy.ndarray
        [..., 2].
    """
    return points @ affine[:, :2].T + affine[:, 2]


def move_boxes(boxes: np.ndarray, affine: np.ndarray) -> np.ndarray:
    """Boxes moved by a map that flips or scales but does not rotate.

    Parameters
    ----------
    boxes : numpy.ndarray, [n, 4]
        Left, top, right, bottom, by edges.
    affine : numpy.ndarray, [2, 3]
        The map of points.

    Returns
    -------
    numpy.ndarray
        [n, 4].
    """
    corners = move_points(np.asarray(boxes, float).reshape(-1, 2, 2) - 0.5, affine) + 0.5
    return np.concatenate([corners.min(1), corners.max(1)], 1)


def inverse(affine: np.ndarray) -> np.ndarray:
    """The map back.

    Parameters
    ----------
    affine : numpy.ndarray, [2, 3]

    Returns
    -------
    numpy.ndarray
        [2, 3].
    """
    linear = np.linalg.inv(affine[:, :2])
    return np.column_stack([linear, -linear @ affine[:, 2]])


def fitted(area: Sequence[float], size: tuple[int, int]) -> np.ndarray:
    """The map of points that scales an area to fit and lays it into the middle, both sides by the same factor. Of Shards.image_area(): what a
    letterbox has added is left out.

    Parameters
    ----------
    area : sequence of 4 floats
        Left, top, right, bottom in volume pixels, edges.
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


def _decoded(sample: Mapping[str, Any]) -> torch.Tensor:
    """[2B, H, W] float32: the sample's volume, also where its shards leave it as it is stored (decode=False)."""
    volume = sample["volume"]
    return torch.from_numpy(np.multiply(volume, sample["scale"], dtype=np.float32) if "scale" in sample else volume)


def _moved(volume: torch.Tensor, label_position: float, augmentation: EventAugmentation | None, size: tuple[int, int] | None = None,
           view: np.ndarray | None = None) -> tuple[torch.Tensor, np.ndarray | None]:
    """The volume, its points moved by `view`, then by the augmentation, cut to `size`; and [2, 3], where a point has gone, None if it stays."""
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


def _detection_item(volume: torch.Tensor, boxes: np.ndarray, whole: np.ndarray, labels: np.ndarray, ignore: np.ndarray, label_position: float,
                    augmentation: EventAugmentation | None, size: tuple[int, int] | None = None, view: np.ndarray | None = None,
                    visible: float = 0.25) -> Item:
    """`volume`, `boxes`, `labels` and `ignore` of an item of DetectionDataset, of boxes [n, 4] in pixels of the volume; `whole`: before they were cut."""
    volume, affine = _moved(volume, label_position, augmentation, size, view)
    boxes, whole = (each if affine is None else move_boxes(each, affine) for each in (boxes, whole))
    height, width = volume.shape[1:]
    cut = np.clip(boxes, 0, [width, height, width, height])
    ignore = ignore | (_areas(cut) < visible * np.maximum(_areas(whole), 1e-9))
    kept = _areas(cut) > 0
    return {"volume": volume, "boxes": torch.from_numpy(cut[kept]).float(), "labels": torch.from_numpy(labels[kept]),
            "ignore": torch.from_numpy(ignore[kept])}


def _numbered(classes: Sequence[str] | Mapping[str, int]) -> dict[str, int]:
    return dict(classes) if isinstance(classes, Mapping) else {name: i for i, name in enumerate(classes)}


class DetectionDataset(Dataset):
    """Volumes with boxes. An item is a dictionary:

    volume : [2B, H, W] float32
    boxes : [n, 4] float32, left, top, right, bottom in its pixels, cut to it
    labels : [n] int64, position in `classes`; -1 for DontCare, to be ignored whatever the class
    ignore : [n] bool: neither for training nor for scoring (annotated so, or less than `visible` of it is left)
    id : str, sample_id
    index : int, of the sample in `shards`
    label_position : float, where in time the boxes lie: 0 at the start, 1 at the end

    Parameters
    ----------
    shards : Shards
    classes : sequence of str, or mapping of str to int, optional
        Names in the order of their numbers, or name → number, which may join classes: {"Car": 0, "Van": 0}. Boxes of
        other classes are left out, but for DontCare. None: all names that the shards have, in their order, without DontCare: the same
        numbers for any part of them.
    size : (int, int), optional
        H, W that volumes are filled up to with zeros, or cut to, at the right and at the bottom. None: as they are.
    augmentation : EventAugmentation, optional
        Changes volume and boxes alike. None: nothing.
    visible : float, default 0.25
        Share of a box's area that must be left for it not to be ignored.
    view : numpy.ndarray, [2, 3], optional
        Where points of a volume go before that, such as `fitted(area, size)`. None: they stay.

    Raises
    ------
    ValueError
        No shard knows a name, or there are no samples of sources with boxes.
    """

    def __init__(self, shards: Shards, classes: Sequence[str] | Mapping[str, int] | None = None,
                 size: tuple[int, int] | None = None, augmentation: EventAugmentation | None = None, visible: float = 0.25,
                 view: np.ndarray | None = None) -> None:
        self._shards = shards
        known = shards.known_classes()
        if not known:
            raise ValueError(f"expected samples of sources with boxes, got none, in {shards._described_as}")
        if classes is None:
            classes = [name for name in known if name != DONT_CARE]
        self.classes = _numbered(classes)
        unknown = [name for name in self.classes if name not in known]
        if unknown:
            raise ValueError(f"expected classes of {', '.join(known)}, got {', '.join(unknown)}, in {shards._described_as}")
        self._size, self._augmentation, self._visible, self._view = size, augmentation, visible, view

    def __len__(self) -> int:
        return len(self._shards)

    def __getitem__(self, index: int) -> Item:
        sample = self._shards.sample(index, {"volume", "pair", "boxes"})
        volume = _decoded(sample)
        rows = sample["boxes"]
        names = self._shards.class_names(index)
        labels = np.array([self.classes.get(names[each], -1) for each in rows["class_id"]], np.int64)
        ignore = rows["ignore"] != 0
        wanted = (labels >= 0) | ignore & np.isin(rows["class_id"], [i for i, name in enumerate(names) if name == DONT_CARE])
        item = _detection_item(volume, rows["xyxy"][wanted], rows["xyxy_unclipped"][wanted], labels[wanted], ignore[wanted],
                               sample["pair"]["label_position"], self._augmentation, self._size, self._view, self._visible)
        return {**item, "id": sample["pair"]["sample_id"], "index": int(index), "label_position": float(sample["pair"]["label_position"])}


def _areas(boxes: np.ndarray) -> np.ndarray:
    return np.prod(np.maximum(boxes[:, 2:] - boxes[:, :2], 0), 1)


def collate_yolo(items: Sequence[Item]) -> tuple[torch.Tensor, torch.Tensor, list[str]]:
    """Items as YOLO's trainers take them. Boxes to be ignored are left out.

    Parameters
    ----------
    items : sequence of dict
        DetectionDataset's, with volumes of one size (its `size`).

    Returns
    -------
    imgs : torch.Tensor
        float32 [N, 2B, H, W].
    targets : torch.Tensor
        float32 [n, 6]: number of the image in the batch, class, and centre x, centre y, width, height as shares of W and H, 0..1.
    ids : list of str
    """
    imgs = torch.stack([item["volume"] for item in items])
    height, width = imgs.shape[2:]
    targets = []
    for number, item in enumerate(items):
        kept = ~item["ignore"]
        boxes = item["boxes"][kept] / torch.tensor([width, height, width, height])
        target = torch.empty(len(boxes), 6)
        target[:, 0] = number
        target[:, 1] = item["labels"][kept]
        target[:, 2:4] = (boxes[:, :2] + boxes[:, 2:]) / 2
        target[:, 4:] = boxes[:, 2:] - boxes[:, :2]
        targets.append(target)
    return imgs, torch.cat(targets), [item["id"] for item in items]


def collate_torchvision(items: Sequence[Item]) -> tuple[list[torch.Tensor], list[Item]]:
    """Items as torchvision's detectors take them. Boxes to be ignored are left out.

    Parameters
    ----------
    items : sequence of dict
        DetectionDataset's or KeypointDataset's, with volumes of any sizes.

    Returns
    -------
    volumes : list of torch.Tensor
        [2B, H, W].
    targets : list of dict
        boxes [n, 4], labels [n] from 1 (0 is their background), `keypoints` [n, J, 3] if the items have them, and `id`.
    """
    targets = []
    for item in items:
        kept = ~item["ignore"]
        target = {"boxes": item["boxes"][kept], "labels": item["labels"][kept] + 1, "id": item["id"]}
        if "keypoints" in item:
            target["keypoints"] = item["keypoints"][kept]
        targets.append(target)
    return [item["volume"] for item in items], targets


# What a name says of a side: "left" and "right"; "l" and "r" that stand alone, or are told from their word by its case ("lWrist", "LWrist", "wristL").
_SIDE = re.compile(r"left|Left|LEFT|right|Right|RIGHT|(?<![^\W_])[lrLR](?![^\W_])|(?<![^\W_])[lrLR](?=[A-Z][a-z])|(?<=[a-z0-9])[LR](?![^\W_])")
_PERHAPS_SIDES = re.compile("^[lrLR]"), re.compile("[lrLR]$")  # sides if its mirror name is there
_OTHER_SIDE = {"left": "right", "Left": "Right", "LEFT": "RIGHT", "l": "r", "L": "R"}
_OTHER_SIDE |= {right: left for left, right in _OTHER_SIDE.items()}
_NAMELESS = re.compile("joint_[0-9]+")  # what eventgan calls joints of which it knows nothing


def flip_pairs(names: Sequence[str]) -> list[tuple[int, int]]:
    """Joints that a mirror exchanges.

    Parameters
    ----------
    names : sequence of str
        Those that differ by the side alone are a pair, such as l_hip (MPII), left_hip and LeftFoot (Human3.6M), hipL (DHP19), LHip; lhip, too,
        where there is rhip.

    Returns
    -------
    list of (int, int)
        Positions (left, right).

    Raises
    ------
    ValueError
        A name suggests a side and has no counterpart, or says nothing (joint_3): a mirror would leave it where it is.
    """
    places, pairs, alone = {name: i for i, name in enumerate(names)}, [], []
    for name, place in places.items():
        suggested = _SIDE.search(name)
        for pattern in (_SIDE,) if suggested else _PERHAPS_SIDES:
            side, other = pattern.search(name), pattern.sub(lambda side: _OTHER_SIDE[side[0]], name)
            if side and other in places:
                if side[0][0] in "lL":
                    pairs.append((place, places[other]))
                break
        else:
            if suggested or _NAMELESS.fullmatch(name):
                alone.append(name)
    if alone:
        raise ValueError(f"expected joints whose names come in pairs of left and right, to be mirrored, got {', '.join(alone)} without a counterpart "
                         "(flip=0 mirrors nothing)")
    return pairs


class _Joints:
    """The wanted joints, whatever order a source has them in."""

    def __init__(self, shards: Shards, names: Sequence[str] | None, mirrored: bool) -> None:
        self._shards = shards
        self.names = list(names) if names is not None else shards.default_joints()
        if not self.names:
            raise ValueError(f"expected samples of sources with joints, got none, in {shards._described_as}")
        if mirrored:
            flip_pairs(self.names)  # what it refuses is refused now, not in the midst of an epoch
        self._places: dict[tuple[str, ...], list[int]] = {}

    def of(self, persons: Mapping[str, np.ndarray], index: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """[P, J, 2] in volume pixels; [P, J] bool, annotated; [P, J] bool, annotated and hidden."""
        known = tuple(self._shards.joint_names(index))
        if known not in self._places:
            self._places[known] = self._shards.joint_places(index, self.names)
        places = self._places[known]
        annotated = ~np.all(persons["joints_source"][:, places] == -1, axis=-1)
        return persons["joints"][:, places], annotated, annotated & (persons["visible"][:, places] == 0)

    @functools.cached_property
    def pairs(self) -> list[tuple[int, int]]:
        return flip_pairs(self.names)

    def mirrored(self, rows: np.ndarray) -> np.ndarray:
        """`rows` [..., J, k] with left and right exchanged."""
        order = np.arange(len(self.names))
        for left, right in self.pairs:
            order[[left, right]] = right, left
        return rows[..., order, :]


class KeypointDataset(Dataset):
    """Volumes with persons as boxes and keypoints, as Keypoint R-CNN learns them. Items are DetectionDataset's, all labels 0
    ("person"), and

    keypoints : [n, J, 3] float32: x, y, and 0 not annotated or outside, 1 hidden, 2 visible or annotated without a word on that

    A person's box holds its annotated joints and a margin around them; one without any annotated joint inside is to be ignored.

    Parameters
    ----------
    shards : Shards
    joints : sequence of str, optional
        Names to take, in that order. None: those of the first source, of Human3.6M the 17 in common use.
    size, augmentation, view
        As DetectionDataset's. An augmentation that mirrors needs names with counterparts (`flip_pairs`).
    margin : float, default 0.15
        The box's margin, as a share of its longer side.

    Raises
    ------
    ValueError
        A source has not these joints.
    """

    def __init__(self, shards: Shards, joints: Sequence[str] | None = None, size: tuple[int, int] | None = None,
                 augmentation: EventAugmentation | None = None, margin: float = 0.15, view: np.ndarray | None = None) -> None:
        self._shards, self._joints = shards, _Joints(shards, joints, bool(augmentation and augmentation.flip))
        shards.annotated(self._joints.names)  # a source that does not have them is refused now, too
        self._size, self._augmentation, self._margin, self._view = size, augmentation, margin, view
        self.classes, self.joint_names = {"person": 0}, self._joints.names

    def __len__(self) -> int:
        return len(self._shards)

    def __getitem__(self, index: int) -> Item:
        sample = self._shards.sample(index, {"volume", "pair", "persons"})
        joints, annotated, hidden = self._joints.of(sample["persons"], index)
        volume, affine = _moved(_decoded(sample), sample["pair"]["label_position"], self._augmentation, self._size, self._view)
        height, width = volume.shape[1:]
        if affine is not None:
            joints = move_points(joints, affine)
            if affine[0, 0] < 0:
                joints = self._joints.mirrored(joints)
                annotated, hidden = (self._joints.mirrored(each[..., None])[..., 0] for each in (annotated, hidden))
        annotated = annotated & np.all((joints > -0.5) & (joints < [width - 0.5, height - 0.5]), axis=-1)
        boxes, found = _around(joints, annotated, self._margin)
        boxes = np.clip(boxes, 0, [width, height, width, height])
        keypoints = np.concatenate([joints, np.where(annotated, np.where(hidden, 1, 2), 0)[..., None]], -1)
        keypoints[~annotated] = 0
        return {"volume": volume, "boxes": torch.from_numpy(boxes).float(), "labels": torch.zeros(len(boxes), dtype=torch.int64),
                "ignore": torch.from_numpy(~found), "keypoints": torch.from_numpy(keypoints).float(),
                "id": sample["pair"]["sample_id"], "index": int(index)}


def _around(joints: np.ndarray, annotated: np.ndarray, margin: float) -> tuple[np.ndarray, np.ndarray]:
    """[P, 4] boxes around annotated joints [P, J, 2], and [P] whether there are any."""
    found = annotated.any(-1)
    low = np.where(annotated[..., None], joints, np.inf).min(1, initial=np.inf)
    high = np.where(annotated[..., None], joints, -np.inf).max(1, initial=-np.inf) + 1
    low[~found] = high[~found] = 0
    wide = margin * (high - low).max(-1, initial=0, keepdims=True)
    return np.concatenate([low - wide, high + wide], -1), found


@dataclasses.dataclass(frozen=True)
class PoseAugmentation:
    """How a person's crop may vary, as Simple Baselines (Xiao et al. 2018) have it.

    Parameters
    ----------
    scale : float, default 0.25
        Its scale by normal factors of this deviation around 1, cut off at 1 ± scale.
    rotation : float, default 30
        Turned by normal angles of this deviation in degrees, cut off at twice that.
    rotated : float, default 0.6
        The share of the crops that is turned.
    flip : float, default 0.5
        Probability of left and right exchanged.
    events : EventAugmentation
        What may happen to its events: `reverse`, `drop`, `invert`, `threshold`, `lost` and `isolated`. Its geometry is not used.
    """

    scale: float = 0.25
    rotation: float = 30.0
    rotated: float = 0.6
    flip: float = 0.5
    events: EventAugmentation = EventAugmentation(flip=0)


class PoseDataset(Dataset):
    """Persons, one an item, cut out as Microsoft's Simple Baselines do (lib/dataset/JointsDataset.py), which its trainer and
    those that follow it take as they are: (input, target, target_weight, meta).

    input : [2B, H, W] float32
    target : [J, H/4, W/4] float32: a Gaussian of `sigma` pixels and height 1 around each joint
    target_weight : [J, 1] float32: 1 where the joint is annotated and some of its Gaussian inside
    meta : joints [J, 3] and joints_vis [J, 3] in input pixels (z 0; visible = annotated), center [2] and scale [2] of
        the crop in volume pixels, rotation (degrees), score 1, flipped, image (sample_id), index, person;
        to_volume and to_source [2, 3] float64: maps of input points to those of the volume and of the source

    The crop is 200 x scale volume pixels wide, around the person's centre, turned by `rotation`; it fills the input's width, so a
    higher input shows more above and below, a lower one less. MPII's centres are moved down by 15 x scale and its scales enlarged by
    1.25 first, as there. A person without annotated centre or scale has those of its annotated joints' bounding box, enlarged by
    1.25; one without annotated joints is left out.

    Parameters
    ----------
    shards : Shards
    size : (int, int)
        H, W of the input, multiples of 4.
    joints : sequence of str, optional
        Names to take, in that order. None: those of the first source, of Human3.6M the 17 in common use.
    sigma : float, default 2
        Of the Gaussians, pixels of the target.
    augmentation : PoseAugmentation, optional
        One that mirrors needs names with counterparts (`flip_pairs`).
    moved : bool, default False
        True for shards of a table such as valid.h5 (`mpii_list`), whose centres and scales are moved and enlarged already.

    Raises
    ------
    ValueError
        The size is not of multiples of 4, a source has not these joints, or nobody has one that is annotated.
    """

    def __init__(self, shards: Shards, size: tuple[int, int] = (256, 256), joints: Sequence[str] | None = None,
                 sigma: float = 2.0, augmentation: PoseAugmentation | None = None, moved: bool = False) -> None:
        if size[0] % 4 or size[1] % 4:
            raise ValueError(f"expected sides that are multiples of 4, got {size}")
        self._shards, self._joints = shards, _Joints(shards, joints, bool(augmentation and augmentation.flip))
        self.joint_names = self._joints.names
        self._size, self._sigma, self._augmentation, self._moved = size, sigma, augmentation, moved
        self.persons = shards.persons[shards.annotated(self.joint_names)]
        if not len(self.persons):
            raise ValueError(f"expected persons of whom one of {', '.join(self.joint_names)} is annotated, got none, in {shards._described_as}")

    @property
    def flip_pairs(self) -> list[tuple[int, int]]:
        """The joints that a mirror exchanges, as `flip_pairs` has them."""
        return self._joints.pairs

    def __len__(self) -> int:
        return len(self.persons)

    def __getitem__(self, number: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, Item]:
        index, row = self.persons[number]
        joints, annotated, center, scale, sample = self._person(index, row)
        height, width = self._size
        volume = _decoded(self._shards.sample(index, {"volume"}))
        rotation, flipped = 0.0, False
        if self._augmentation:
            volume = self._augmentation.events.events(volume, sample["pair"]["label_position"])
            scale, rotation, flipped = self._varied(self._augmentation, scale)
        to_input = _crop(center, scale, rotation, height, width)
        if flipped:
            to_input = np.array([[-1, 0, width - 1], [0, 1, 0]]) @ np.vstack([to_input, [0, 0, 1]])
        joints = move_points(joints, to_input)
        if flipped:
            joints, annotated = self._joints.mirrored(joints), self._joints.mirrored(annotated[:, None])[:, 0]
        target, weight = heatmaps(joints / 4, annotated, height // 4, width // 4, self._sigma)
        to_volume = inverse(to_input)
        to_source = inverse(sample["pair"]["source_to_volume"]) @ np.vstack([to_volume, [0, 0, 1]])
        meta = {"joints": np.column_stack([np.where(annotated[:, None], joints, 0), np.zeros(len(joints))]),
                "joints_vis": np.repeat(annotated[:, None], 3, 1).astype(float) * [1, 1, 0], "center": center,
                "scale": np.array([scale, scale]), "rotation": rotation, "score": 1.0, "flipped": flipped,
                "image": sample["pair"]["sample_id"], "index": int(index), "person": int(row),
                "to_volume": to_volume, "to_source": to_source}
        volume = warp(volume, to_input, height, width)
        if self._augmentation:
            volume = self._augmentation.events.sensor(volume)
        return volume, torch.from_numpy(target), torch.from_numpy(weight), meta

    def _person(self, index: int, row: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, float, Item]:
        sample = self._shards.sample(index, {"pair", "persons"})
        joints, annotated, _ = (each[row] for each in self._joints.of(sample["persons"], index))
        center, scale = sample["persons"]["center"][row].copy(), float(sample["persons"]["scale_volume"][row])
        if scale > 0 and not np.all(sample["persons"]["center_source"][row] == -1):
            if sample["pair"]["dataset"].startswith("mpii") and not self._moved:
                center[1] += 15 * scale
                scale *= 1.25
        elif annotated.any():
            low, high = joints[annotated].min(0), joints[annotated].max(0)
            center, scale = (low + high) / 2, 1.25 * max(*(high - low), 1.0) / 200
        return joints, annotated, center, scale, sample

    @staticmethod
    def _varied(spread: PoseAugmentation, scale: float) -> tuple[float, float, bool]:
        factor, angle = torch.randn(2).tolist()
        rotated, flip = torch.rand(2).tolist()
        return (scale * (1 + spread.scale * min(max(factor, -1), 1)),
                spread.rotation * min(max(angle, -2), 2) if rotated < spread.rotated else 0.0, flip < spread.flip)


def _crop(center: np.ndarray, scale: float, rotation: float, height: int, width: int) -> np.ndarray:
    """[2, 3], volume → input: 200 x scale px around `center` fill the width; the centre comes to (W / 2, H / 2), as in Simple
    Baselines' get_affine_transform."""
    turn = math.radians(rotation)
    zoom = width / (200 * scale)
    linear = zoom * np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
    return np.column_stack([linear, np.array([width / 2, height / 2]) - linear @ center])


def heatmaps(joints: np.ndarray, annotated: np.ndarray, height: int, width: int, sigma: float) -> tuple[np.ndarray, np.ndarray]:
    """Targets of joints, as Simple Baselines' generate_target makes them: for each joint, rounded to a pixel, exp(-d² / 2σ²) within 3 σ.

    Parameters
    ----------
    joints : numpy.ndarray, [J, 2]
        x, y in pixels of the maps.
    annotated : numpy.ndarray, bool [J]
    height, width : int
        Of the maps, pixels.
    sigma : float

    Returns
    -------
    maps : numpy.ndarray
        float32 [J, height, width].
    weights : numpy.ndarray
        float32 [J, 1]: 1 if the joint is annotated and any of its map inside, else 0, and its map is 0.
    """
    at, reach = np.floor(joints + 0.5), math.floor(3 * sigma)
    weight = annotated & np.all((at + reach >= 0) & (at - reach < [width, height]), axis=-1)
    x = np.arange(width) - np.where(weight, at[:, 0], 0)[:, None]
    y = np.arange(height) - np.where(weight, at[:, 1], 0)[:, None]
    along_x = np.exp(-(x**2) / (2 * sigma**2)) * (np.abs(x) <= reach)
    along_y = np.exp(-(y**2) / (2 * sigma**2)) * (np.abs(y) <= reach)
    maps = along_y[:, :, None] * along_x[:, None, :] * weight[:, None, None]
    return maps.astype(np.float32), weight[:, None].astype(np.float32)


def mixture(datasets: Iterable[Dataset], shares: Sequence[float], length: int | None = None,
            generator: torch.Generator | None = None) -> tuple[ConcatDataset, WeightedRandomSampler]:
    """Several datasets as one, and a sampler that draws from each its share, whatever their sizes: 0.8 and 0.2 for MPII and
    Human3.6M as in the EventGAN paper. For DataLoader(dataset, sampler=sampler).

    Parameters
    ----------
    datasets : iterable of Dataset
    shares : sequence of float
        One for each dataset, >= 0.
    length : int, optional
        Draws an epoch. None: as many as there are items.
    generator : torch.Generator, optional
        What the sampler draws with.

    Returns
    -------
    (ConcatDataset, WeightedRandomSampler)

    Raises
    ------
    ValueError
        There are not as many shares as datasets, one is below 0, or a dataset is empty.
    """
    joined = ConcatDataset(datasets)
    sizes = np.diff([0, *joined.cumulative_sizes])
    if len(shares) != len(sizes) or min(shares) < 0 or min(sizes) < 1:
        raise ValueError(f"expected a share ≥ 0 for each of {len(sizes)} datasets that hold items, got {list(shares)} for {list(sizes)}")
    weights = np.repeat(np.asarray(shares, float) / sizes, sizes)
    return joined, WeightedRandomSampler(torch.from_numpy(weights), length or len(joined), generator=generator)


def exchange_first_convolution(model: nn.Module, channels: int) -> nn.Module:
    """Gives the model's first Conv2d (in the order of modules()) another number of inputs, in place: the layer is initialised again,
    all other weights stay, as the EventGAN paper does with networks pretrained on images.

    Parameters
    ----------
    model : torch.nn.Module
    channels : int

    Returns
    -------
    torch.nn.Module
        The model; of one that is that layer alone the new one.

    Raises
    ------
    ValueError
        There is no Conv2d, or the first one has groups.
    """
    for name, layer in model.named_modules():
        if not isinstance(layer, nn.Conv2d):
            continue
        if layer.groups != 1:
            raise ValueError(f"expected a first convolution of one group, got {layer.groups}, in {name}")
        new = nn.Conv2d(channels, layer.out_channels, layer.kernel_size, layer.stride, layer.padding, layer.dilation,
                        bias=layer.bias is not None, padding_mode=layer.padding_mode)
        new = new.to(layer.weight.device, layer.weight.dtype)
        if not name:
            return new
        parent, _, last = name.rpartition(".")
        setattr(model.get_submodule(parent), last, new)
        return model
    raise ValueError("expected a model with a Conv2d, got none")

"""PyTorch datasets of event volumes: boxes to detect, persons to find joints of.

    from torch.utils.data import DataLoader
    from eventgan import Shards
    from eventgan.torch import DetectionDataset, collate_yolo

    cars = DetectionDataset(Shards("out", split="train"), classes=["Car", "Pedestrian"])
    for imgs, targets, ids in DataLoader(cars, batch_size=8, shuffle=True, num_workers=4, collate_fn=collate_yolo):
        ...

A volume is a tensor [2B, H, W], float32: channels 0..B-1 are the positive polarity in time order, B..2B-1 the negative.
Points are x, y in pixels whose centres are whole numbers; boxes are left, top, right, bottom of edges between pixels,
so that a whole image is 0, 0, W, H: the edge x is the left edge of pixel x, half a pixel left of its centre, the point
x (shard_format.md, Geometry).
"""

from __future__ import annotations

import dataclasses
import functools
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from torch import nn
from torch.utils.data import ConcatDataset, Dataset, WeightedRandomSampler

from .augmentation import (EventAugmentation, Item, detection_item, fitted, inverse, move_boxes, move_flow, move_points,
                           moved, numbered, warp)
from .detection_scores import DONT_CARE
from .frame_pairs import FrameAugmentation, FramePairs
from .shards import Shards
from .words import did_you_mean, sides

__all__ = [
    "DetectionDataset", "EventAugmentation", "FlowDataset", "FrameAugmentation", "FramePairs", "HalfVolumes", "Item",
    "KeypointDataset", "PoseAugmentation", "PoseDataset", "collate_torchvision", "collate_yolo",
    "exchange_first_convolution", "fitted", "flip_pairs", "heatmaps", "inverse", "mixture", "move_boxes", "move_points",
    "warp",
]


def _decoded(sample: Mapping[str, Any]) -> torch.Tensor:
    """[2B, H, W] float32: the sample's volume, also of shards with decode=False."""
    volume = sample["volume"]
    return torch.from_numpy(np.multiply(volume, sample["scale"], dtype=np.float32) if "scale" in sample else volume)


class DetectionDataset(Dataset):
    """Volumes with boxes. An item is a dictionary:

    volume : [2B, H, W] float32
    boxes : [n, 4] float32, left, top, right, bottom in its pixels, clipped to it
    labels : [n] int64, position in `classes`; -1 for DontCare, which is ignored for every class
    ignore : [n] bool: not for training or scoring (annotated so, or less than `visible` of the box is left)
    id : str, sample_id
    index : int, of the sample in `shards`
    label_position : float, where in time the boxes lie: 0 at the start, 1 at the end

    Parameters
    ----------
    shards : Shards
    classes : sequence of str, or mapping of str to int, optional
        Names in the order of their numbers, or name → number, which may join classes: {"Car": 0, "Van": 0}. Boxes of
        other classes are left out, except DontCare. None: all names in the shards, in their order, without DontCare:
        any part of the same shards has the same numbers.
    size : (int, int), optional
        H, W to which volumes are padded with zeros, or cut, at the right and at the bottom. None: unchanged.
    augmentation : EventAugmentation, optional
        Changes volume and boxes alike. None: no changes.
    visible : float, default 0.25
        A box of which a smaller share is left is ignored.
    view : numpy.ndarray, [2, 3], optional
        A map of the volume's points that is applied first, such as `fitted(area, size)`. None: none.

    Raises
    ------
    ValueError
        A class is in no shard, or no sample is of a source with boxes.
    """

    def __init__(self, shards: Shards, classes: Sequence[str] | Mapping[str, int] | None = None,
                 size: tuple[int, int] | None = None, augmentation: EventAugmentation | None = None,
                 visible: float = 0.25, view: np.ndarray | None = None) -> None:
        self._shards = shards
        known = shards.known_classes()
        if not known:
            raise ValueError(f"expected samples of sources with boxes, got none, in {shards._described_as}")
        if classes is None:
            classes = [name for name in known if name != DONT_CARE]
        self.classes = numbered(classes)
        unknown = [name for name in self.classes if name not in known]
        if unknown:
            raise ValueError(f"expected classes of {', '.join(known)}, got {', '.join(unknown)}, in "
                             f"{shards._described_as}{did_you_mean(unknown, known)}")
        self._size, self._augmentation, self._visible, self._view = size and sides(size), augmentation, visible, view

    def __len__(self) -> int:
        return len(self._shards)

    def __getitem__(self, index: int) -> Item:
        sample = self._shards.sample(index, {"volume", "pair", "boxes"})
        volume = _decoded(sample)
        rows = sample["boxes"]
        names = self._shards.class_names(index)
        labels = np.array([self.classes.get(names[each], -1) for each in rows["class_id"]], np.int64)
        ignore = rows["ignore"] != 0
        wanted = (labels >= 0) | ignore & np.isin(rows["class_id"],
                                                  [i for i, name in enumerate(names) if name == DONT_CARE])
        item = detection_item(volume, rows["xyxy"][wanted], rows["xyxy_unclipped"][wanted], labels[wanted],
                              ignore[wanted], sample["pair"]["label_position"], self._augmentation, self._size,
                              self._view, self._visible)
        return {**item, "id": sample["pair"]["sample_id"], "index": int(index),
                "label_position": float(sample["pair"]["label_position"])}


class FlowDataset(Dataset):
    """Volumes with optical flow, of shards made with `"flow": true`. An item is a dictionary:

    volume : [2B, H, W] float32
    flow : [2, H, W] float32, x, then y, pixels: the motion from the previous image to the next
    valid : [H, W] bool: seen in both images
    label_position : float: 1: `flow` is at the pixels of the next image, 0: of the previous one
    id : str, sample_id
    index : int, of the sample in `shards`

    Parameters
    ----------
    shards : Shards
    size : (int, int), optional
        H, W to which volumes are padded with zeros, or cut, at the right and at the bottom. None: unchanged.
    augmentation : EventAugmentation, optional
        Changes volume and flow alike; `reverse` where `reverse_all` is True: then the flow leads the other way. None:
        no changes.
    view : numpy.ndarray, [2, 3], optional
        A map of the volume's points that is applied first, such as `fitted(area, size)`. None: none.
    """

    def __init__(self, shards: Shards, size: tuple[int, int] | None = None,
                 augmentation: EventAugmentation | None = None, view: np.ndarray | None = None) -> None:
        self._shards, self._size, self._augmentation, self._view = shards, size and sides(size), augmentation, view

    def __len__(self) -> int:
        return len(self._shards)

    def __getitem__(self, index: int) -> Item:
        sample = self._shards.sample(index, {"volume", "pair", "flow"})
        name, position = sample["pair"]["sample_id"], float(sample["pair"]["label_position"])
        if "flow" not in sample or np.isnan(sample["flow"]).all():
            raise ValueError(f'expected a sample with flow ("flow": true in its source; take others, shards[[0, 2]]), '
                             f'got none, in {sample["shard"]} ({name})')
        volume, flow, valid = _decoded(sample), sample["flow"].astype(np.float32), sample["flow_valid"] != 0
        augmentation = self._augmentation
        if augmentation and augmentation.reverse:
            if augmentation.reverse_all and float(torch.rand(())) < augmentation.reverse:
                volume, flow, position = -volume if len(volume) == 1 else volume.flip(0), -flow, 1 - position
            augmentation = dataclasses.replace(augmentation, reverse=0.0)
        volume, affine = moved(volume, position, augmentation, self._size, self._view)
        if affine is not None:
            flow, valid = move_flow(flow, valid, affine, volume.shape[1], volume.shape[2], position)
        return {"volume": volume, "flow": torch.from_numpy(flow).float(), "valid": torch.from_numpy(valid),
                "label_position": position, "id": name, "index": int(index)}


def collate_yolo(items: Sequence[Item]) -> tuple[torch.Tensor, torch.Tensor, list[str]]:
    """Items as YOLO's trainers take them. Ignored boxes are left out.

    Parameters
    ----------
    items : sequence of dict
        DetectionDataset's, with volumes of one size (its `size`).

    Returns
    -------
    imgs : torch.Tensor
        float32 [N, 2B, H, W]; float16 of HalfVolumes.
    targets : torch.Tensor
        float32 [n, 6]: number of the image in the batch, class, and centre x, centre y, width, height as shares of W
        and H, 0..1.
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
    """Items as torchvision's detectors take them. Ignored boxes are left out.

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


# The side in a name: "left" and "right"; "l" and "r" alone, or set off by case ("lWrist", "LWrist", "wristL").
_SIDE = re.compile(r"left|Left|LEFT|right|Right|RIGHT|(?<![^\W_])[lrLR](?![^\W_])|(?<![^\W_])[lrLR](?=[A-Z][a-z])"
                   r"|(?<=[a-z0-9])[LR](?![^\W_])")
_PERHAPS_SIDES = re.compile("^[lrLR]"), re.compile("[lrLR]$")  # sides if the mirrored name is there
_OTHER_SIDE = {"left": "right", "Left": "Right", "LEFT": "RIGHT", "l": "r", "L": "R"}
_OTHER_SIDE |= {right: left for left, right in _OTHER_SIDE.items()}
_NAMELESS = re.compile("(joint_)?[0-9]+")  # eventgan's names for joints without names


def flip_pairs(names: Sequence[str]) -> list[tuple[int, int]]:
    """The joints that a mirror exchanges.

    Parameters
    ----------
    names : sequence of str
        Names that differ only in the side are a pair, such as l_hip (MPII), left_hip and LeftFoot (Human3.6M), hipL
        (DHP19), LHip; also lhip, if there is rhip.

    Returns
    -------
    list of (int, int)
        Positions (left, right).

    Raises
    ------
    ValueError
        A name suggests a side and has no counterpart, or says nothing (joint_3, or 3) beside others, so that a mirror
        would leave it where it is.
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
            if suggested or (len(names) > 1 and _NAMELESS.fullmatch(name)):
                alone.append(name)
    if alone:
        raise ValueError("expected joints whose names come in pairs of left and right, to be mirrored, got "
                         f"{', '.join(alone)} without a counterpart (flip=0 mirrors nothing)")
    return pairs


class _Joints:
    """The wanted joints, in whatever order a source has them."""

    def __init__(self, shards: Shards, names: Sequence[str] | None, mirrored: bool) -> None:
        self._shards = shards
        self.names = list(names) if names is not None else shards.default_joints()
        if not self.names:
            raise ValueError(f"expected samples of sources with joints, got none, in {shards._described_as}")
        if mirrored:
            flip_pairs(self.names)  # an error now, not in the middle of an epoch
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
    """Volumes with persons as boxes and keypoints, for Keypoint R-CNN. Items are those of DetectionDataset with all
    labels 0 ("person"), and

    keypoints : [n, J, 3] float32: x, y, and 0 not annotated or outside, 1 hidden, 2 visible or not known whether hidden

    A person's box holds the annotated joints and a margin around them; one without any annotated joint inside is
    ignored.

    Parameters
    ----------
    shards : Shards
    joints : sequence of str, optional
        Names to take, in that order. None: those of the first source, of Human3.6M the 17 in common use.
    size, augmentation, view
        As of DetectionDataset. An augmentation that mirrors needs names with counterparts (`flip_pairs`).
    margin : float, default 0.15
        The box's margin, as a share of its longer side.

    Raises
    ------
    ValueError
        A source does not have these joints.
    """

    def __init__(self, shards: Shards, joints: Sequence[str] | None = None, size: tuple[int, int] | None = None,
                 augmentation: EventAugmentation | None = None, margin: float = 0.15,
                 view: np.ndarray | None = None) -> None:
        self._shards, self._joints = shards, _Joints(shards, joints, bool(augmentation and augmentation.flip))
        shards.annotated(self._joints.names)  # an error now if a source does not have them
        self._size, self._augmentation, self._margin, self._view = size and sides(size), augmentation, margin, view
        self.classes, self.joint_names = {"person": 0}, self._joints.names

    def __len__(self) -> int:
        return len(self._shards)

    def __getitem__(self, index: int) -> Item:
        sample = self._shards.sample(index, {"volume", "pair", "persons"})
        joints, annotated, hidden = self._joints.of(sample["persons"], index)
        volume, affine = moved(_decoded(sample), sample["pair"]["label_position"], self._augmentation, self._size,
                               self._view)
        height, width = volume.shape[1:]
        if affine is not None:
            joints = move_points(joints, affine)
            if np.linalg.det(affine[:, :2]) < 0:
                joints = self._joints.mirrored(joints)
                annotated, hidden = (self._joints.mirrored(each[..., None])[..., 0] for each in (annotated, hidden))
        annotated = annotated & np.all((joints > -0.5) & (joints < [width - 0.5, height - 0.5]), axis=-1)
        boxes, found = _around(joints, annotated, self._margin)
        boxes = np.clip(boxes, 0, [width, height, width, height])
        keypoints = np.concatenate([joints, np.where(annotated, np.where(hidden, 1, 2), 0)[..., None]], -1)
        keypoints[~annotated] = 0
        return {"volume": volume, "boxes": torch.from_numpy(boxes).float(),
                "labels": torch.zeros(len(boxes), dtype=torch.int64),
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
    """How a person's crop may vary, as in Simple Baselines (Xiao et al. 2018).

    Parameters
    ----------
    scale : float, default 0.25
        Standard deviation of the factor of its scale, which is normal around 1 and clipped to 1 ± scale.
    rotation : float, default 30
        Standard deviation of its angle in degrees, which is normal and clipped to twice that.
    rotated : float, default 0.6
        The share of the crops that is rotated.
    flip : float, default 0.5
        Probability that left and right are exchanged.
    events : EventAugmentation
        Changes of its events: `reverse`, `drop`, `invert`, `threshold`, `lost` and `isolated`. Its geometry is not
        used.
    """

    scale: float = 0.25
    rotation: float = 30.0
    rotated: float = 0.6
    flip: float = 0.5
    events: EventAugmentation = EventAugmentation(flip=0)


class PoseDataset(Dataset):
    """One person an item, cropped as in Microsoft's Simple Baselines (lib/dataset/JointsDataset.py), for its trainer
    and those derived from it: (input, target, target_weight, meta).

    input : [2B, H, W] float32
    target : [J, H/4, W/4] float32: a Gaussian of `sigma` pixels and height 1 around each joint
    target_weight : [J, 1] float32: 1 if the joint is annotated and some of its Gaussian is inside
    meta : joints [J, 3] and joints_vis [J, 3] in input pixels (z 0; visible = annotated), center [2] and scale [2] of
        the crop in volume pixels, rotation (degrees), score 1, flipped, image (sample_id), index, person;
        to_volume and to_source [2, 3] float64: maps of input points to those of the volume and of the source

    The crop is 200 x scale volume pixels wide, around the person's centre, turned by `rotation`; it fills the input's
    width, so a higher input shows more above and below, a lower one less. As there, MPII's centres are first moved down
    by 15 x scale and its scales enlarged by 1.25. For a person without annotated centre or scale both come from the
    bounding box of the annotated joints, enlarged by 1.25; one without annotated joints is left out.

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
        True for shards of a table such as valid.h5 (`mpii_list`), whose centres and scales are moved and enlarged
        already.

    Raises
    ------
    ValueError
        The size is not of multiples of 4, a source does not have these joints, or none of them is annotated.
    """

    def __init__(self, shards: Shards, size: tuple[int, int] = (256, 256), joints: Sequence[str] | None = None,
                 sigma: float = 2.0, augmentation: PoseAugmentation | None = None, moved: bool = False) -> None:
        size = sides(size)
        if size[0] % 4 or size[1] % 4:
            raise ValueError(f"expected sides that are multiples of 4, got {size}")
        self._shards, self._joints = shards, _Joints(shards, joints, bool(augmentation and augmentation.flip))
        self.joint_names = self._joints.names
        self._size, self._sigma, self._augmentation, self._moved = size, sigma, augmentation, moved
        self.persons = shards.persons[shards.annotated(self.joint_names)]
        if not len(self.persons):
            raise ValueError(f"expected persons of whom one of {', '.join(self.joint_names)} is annotated, got none, "
                             f"in {shards._described_as}")

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
    """[2, 3], volume → input: 200 x scale px around `center` fill the width, and the centre goes to (W / 2, H / 2),
    as in Simple Baselines' get_affine_transform.
    """
    turn = math.radians(rotation)
    zoom = width / (200 * scale)
    linear = zoom * np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
    return np.column_stack([linear, np.array([width / 2, height / 2]) - linear @ center])


def heatmaps(joints: np.ndarray, annotated: np.ndarray, height: int,
             width: int, sigma: float) -> tuple[np.ndarray, np.ndarray]:
    """Targets of joints as in generate_target of Simple Baselines: for each joint, rounded to a pixel,
    exp(-d² / 2σ²) within 3 σ.

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
        float32 [J, 1]: 1 if the joint is annotated and some of its map is inside, else 0, with a map of zeros.
    """
    at, reach = np.floor(joints + 0.5), math.floor(3 * sigma)
    weight = annotated & np.all((at + reach >= 0) & (at - reach < [width, height]), axis=-1)
    x = np.arange(width) - np.where(weight, at[:, 0], 0)[:, None]
    y = np.arange(height) - np.where(weight, at[:, 1], 0)[:, None]
    along_x = np.exp(-(x**2) / (2 * sigma**2)) * (np.abs(x) <= reach)
    along_y = np.exp(-(y**2) / (2 * sigma**2)) * (np.abs(y) <= reach)
    maps = along_y[:, :, None] * along_x[:, None, :] * weight[:, None, None]
    return maps.astype(np.float32), weight[:, None].astype(np.float32)


class HalfVolumes(Dataset):
    """Another dataset with volumes of float16: half as many bytes for the workers of a DataLoader to move, which take
    longer to move a large volume than to read it. The trainer makes them float32 again on its device: `imgs.float()`.

    Volumes of shards with float16 keep their values unless they are augmented; others are rounded as in such shards:
    to 11 bits, and to 65504 at most.

    Parameters
    ----------
    dataset : Dataset
        One of these: its items are dictionaries with a `volume`, or tuples with a volume in front.
    """

    def __init__(self, dataset: Dataset) -> None:
        self._dataset: Any = dataset

    def __len__(self) -> int:
        return len(self._dataset)

    def __getitem__(self, index: int) -> Any:
        item = self._dataset[index]
        if isinstance(item, Mapping):
            return {**item, "volume": _half(item["volume"])}
        return _half(item[0]), *item[1:]


def _half(volume: torch.Tensor) -> torch.Tensor:
    largest = torch.finfo(torch.float16).max
    return volume.clamp(-largest, largest).half()


def mixture(datasets: Iterable[Dataset], shares: Sequence[float], length: int | None = None,
            generator: torch.Generator | None = None) -> tuple[ConcatDataset, WeightedRandomSampler]:
    """Several datasets as one, and a sampler that draws from each its share, whatever their sizes, for
    DataLoader(dataset, sampler=sampler): 0.8 and 0.2 for MPII and Human3.6M as in the EventGAN paper.

    Parameters
    ----------
    datasets : iterable of Dataset
    shares : sequence of float
        One for each dataset, >= 0.
    length : int, optional
        Draws per epoch. None: as many as there are items.
    generator : torch.Generator, optional
        Of the sampler.

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
        raise ValueError(f"expected a share ≥ 0 for each of {len(sizes)} datasets that hold items, got "
                         f"{list(shares)} for {list(sizes)}")
    weights = np.repeat(np.asarray(shares, float) / sizes, sizes)
    return joined, WeightedRandomSampler(torch.from_numpy(weights), length or len(joined), generator=generator)


def exchange_first_convolution(model: nn.Module, channels: int) -> nn.Module:
    """Gives the model's first Conv2d (in the order of modules()) another number of inputs, in place.

    That layer is initialised again and all other weights stay, as the EventGAN paper does with networks pretrained on
    images.

    Parameters
    ----------
    model : torch.nn.Module
    channels : int

    Returns
    -------
    torch.nn.Module
        The model; if it is that layer alone, the new layer.

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

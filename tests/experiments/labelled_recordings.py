"""Tasks, and recordings of real cameras with labels, for `experiment.py real`.

The windows of recordings become items of `DetectionDataset`, or items with `joints` in place of boxes, which are kept
in OUT/items. `args` is experiment.py's: out, and its task, a row of real_cameras.TASKS.
"""

from __future__ import annotations

import argparse
import collections
import csv
import dataclasses
import functools
import math
import os
import pathlib
import zlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import cv2
import numpy as np
import torch
from eventgan import Shards, convert, signed_channel
from eventgan.torch import DetectionDataset, EventAugmentation
from torch import nn

SIZE, DAVIS346 = (192, 320), (260, 346)  # of volumes and of the camera, H, W
PERSON = "person"  # the class of labels that name none
# of items with joints; LSP's head is from the neck to its top, CDEHP's is its middle
JOINTS = ["head", *(f"{side}_{name}" for name in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
                    for side in ("right", "left"))]

# the names of right and left in joints.csv: of CDEHP, and of DHP19, which has surfaces
SIDES = {False: ("red", "green"), True: ("a", "b")}

Item = dict[str, Any]  # of DetectionDataset, its volume in half precision


@dataclasses.dataclass(frozen=True)
class Network:
    """What a task is learnt with: `train` writes weights.pt for `make`, by the options of `training`, classes and
    last_layer; `find` answers for each of some items, `scores` judges the answers, `constant` gives one answer for all
    that has seen their labels, and `draw` shows one."""

    make: Callable[[int, Callable[[int], nn.Module]], nn.Module]  # of channels and a norm
    train: Callable[[argparse.Namespace, list[Item], EventAugmentation, Callable[[int], nn.Module]], None]
    find: Callable[[Any, Sequence[Item]], Sequence[Any]]
    scores: Callable[[Sequence[Item], Sequence[Any]], dict[str, float]]
    constant: Callable[[Sequence[Item]], Sequence[Any]]
    draw: Callable[[Item, Any], np.ndarray]


@dataclasses.dataclass(frozen=True)
class Task:
    """What is learnt from which frames, and on what it is tested."""

    classes: tuple[str, ...]
    stills: tuple[str, ...]
    # of every so many labelled frames one is used: its neighbours are nearly the same
    clips: Mapping[str, int]
    network: Network
    # the first windows of a recording: settings are chosen on these, which are in no table
    development: Mapping[str, int]
    columns: Mapping[str, str]  # scores with their titles; rows are compared by the first one
    least_px: float = 0  # boxes with a smaller side, in a volume's pixels, are neither right nor wrong in training
    joints: bool = False  # in place of boxes
    polarity: bool = True  # False: networks see events without it, as some of the recordings have them
    # recordings are surfaces, which events raise and later ones around them lower (DHP19's); networks learn from
    # those of clips, or from frames
    surfaces: bool = False
    upright: bool = False  # of photographs with joints those of persons who stand, their hands below their shoulders
    # the first windows of a recording that rows may learn from, which are then tested on the others
    learnt: Mapping[str, int] = dataclasses.field(default_factory=dict)
    # so many of these: networks of the first method are tuned on each number, the others' on the last
    windows: tuple[int, ...] = ()
    methods: tuple[str, ...] = ()  # of SOURCES, all with so many steps; (): those of persons
    steps: int = 0


def recordings_in(args: argparse.Namespace, folder: pathlib.Path) -> list[pathlib.Path]:
    """The task's recordings: of joints, folders with a joints.csv in CDEHP's form, or in DHP19's if they are surfaces;
    of persons, folders of windows (NAME.npz and NAME.txt) or of drawn events (images/ with labels/ beside it); of these
    and others, folders of drawn events (images/) with boxes in the boxes.csv of the folder above."""
    folders = [each for each in (folder, *sorted(folder.iterdir())) if each.is_dir()]
    if args.task.joints:
        known = {surfaces: f"{side}_shoulder_x" for surfaces, (side, _) in SIDES.items()}[args.task.surfaces]
        found = [path.parent for path in (each / "joints.csv" for each in folders)
                 if path.exists() and known in path.read_text(encoding="utf-8").partition("\n")[0]]
    else:
        found = [each for each in folders if PERSON in args.task.classes
                 and (any(each.glob("*.npz")) and any(each.glob("*.txt")) or
                      (each / "images").is_dir() and (each / "labels").is_dir())]
        for path in sorted([*folder.glob("boxes.csv"), *folder.glob("*/boxes.csv")]):
            # sets without such an object are for other tasks
            found += sorted({path.parent / image.split("/")[0]
                             for image, boxes in _table(path, args.task.classes).items()
                             if image.count("/") == 2 and len(boxes)})
    if not found:
        raise SystemExit("expected folders with windows (NAME.npz, NAME.txt) or drawn events (images/ with labels/, "
                         f"a boxes.csv or a joints.csv), got none for {args.task.classes[0]}, in {folder}")
    return found


@functools.cache
def _table(path: pathlib.Path, classes: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Of a boxes.csv, by the image: the boxes of the classes, f64 [N, 4] in pixels, left, top, right, bottom."""
    boxes = collections.defaultdict(list)
    with open(path, newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            boxes[row["image"]] += [[float(row[edge]) for edge in ("x1", "y1", "x2", "y2")]] * (row["class"] in classes)
    return {image: np.array(each).reshape(-1, 4) for image, each in boxes.items()}


@functools.cache
def _joints(path: pathlib.Path) -> dict[str, np.ndarray]:
    """Of a joints.csv, by the image: joints [J, 2] in the order of JOINTS, NaN where it calls them uncertain. Which
    side is left is not sure."""
    found = {}
    with open(path, newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            right, left = next(sides for sides in SIDES.values() if f"{sides[0]}_shoulder_x" in row)
            names = [name.replace("right", right).replace("left", left).replace("wrist", "hand")
                     .replace("ankle", "foot") for name in JOINTS]
            uncertain = row.get("uncertain", "")
            found[row["image"]] = np.array([[math.nan if name in uncertain else float(row[f"{name}_{axis}"])
                                             for axis in "xy"] for name in names])
    return found


def test_items(args: argparse.Namespace, folder: pathlib.Path, size: tuple[int, int], signed: bool = True,
               shown: str = "images") -> list[Item]:
    """The windows of a recording, brought to the size: signed channels, or volumes divided by their 98th percentiles
    and clipped at 1; [] if it has drawings of events alone and volumes are asked for. `shown` "frames": its grey
    frames; [] if it has none."""
    def make() -> list[Item]:
        if (folder / "images").is_dir():
            paths = sorted((folder / shown).iterdir()) if signed and (folder / shown).is_dir() else []
            return [_drawn(args, path, size) for path in paths]
        if shown == "frames":
            return []
        windows = DetectionDataset(windows_of(args, folder, DAVIS346, "none"), [PERSON])
        return [smaller(windows[i], size, signed_channel if signed else normalized) for i in range(len(windows))]

    return kept(args, f"{key_of(folder)}-{size[0]}x{size[1]}{'' if signed else '-volume'}"
                 f"{'-frames' * (shown == 'frames')}", make)


def _drawn(args: argparse.Namespace, path: pathlib.Path, size: tuple[int, int]) -> Item:
    """Of an image in which somebody has drawn positive minus negative events in grey, stretched to 0..255 by its own
    range, or events without their polarity; or of a grey frame, in a folder of that name. Where the task has polarity,
    one is drawn for each pixel of a drawing that has none."""
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise ValueError(f"expected an image, got none, in {path}")
    # What is no event is known before the image is made smaller, when values are still whole.
    events = image.astype(np.float32) - np.bincount(image.ravel()).argmax()
    if not args.task.polarity:
        events = np.abs(events)
    elif events.min() == 0 or events.max() == 0:
        events *= np.random.default_rng(zlib.crc32(path.stem.encode())).choice(np.float32([-1, 1]), events.shape)
    item = {"volume": torch.from_numpy(events[None]), "id": path.stem}
    if path.parent.name == "frames":
        item["volume"] = torch.from_numpy(frame_channel(args, image))
    if args.task.joints:
        item["joints"] = torch.from_numpy(_joints(path.parents[1] / "joints.csv")[path.name]).float()
    else:
        item |= _with_boxes(args, path, image.shape)
    return smaller(item, size, (lambda grey: grey) if path.parent.name == "frames" else
                   lambda signed: signed_channel(np.concatenate([signed.clip(0), (-signed).clip(0)])))


def frame_channel(args: argparse.Namespace, image: np.ndarray) -> np.ndarray:
    """A grey frame, uint8 [H, W], in place of events: as these have a polarity, or from 0 to 1."""
    return signed_channel(image) if args.task.polarity else image[None] / np.float32(255)


def _with_boxes(args: argparse.Namespace, path: pathlib.Path, shape: tuple[int, int]) -> Item:
    """`boxes`, `labels` and `ignore` of an image of the shape H, W or of its frame."""
    folder = path.parent.parent
    texts = folder / "labels"
    boxes = torch.from_numpy(_boxes(texts / f"{path.stem}.txt", shape) if texts.is_dir() else
                             _table(folder.parent / "boxes.csv",
                                    args.task.classes)[f"{folder.name}/images/{path.name}"]).float()
    return {"boxes": boxes, "labels": torch.zeros(len(boxes), dtype=torch.int64),
            "ignore": torch.zeros(len(boxes), dtype=torch.bool)}


def smaller(item: Item, size: tuple[int, int], finish: Callable[[np.ndarray], np.ndarray]) -> Item:
    """The item in a letterbox of the size, each pixel the mean of those that it covers, and then finished: pixels taken
    singly, or events put into the pixel in which they fall, would make a pattern of lines where the sides' quotient is
    no whole number."""
    events = item["volume"].numpy()
    lines, columns = shown = shown_in(events.shape[1:], size)
    height, width = lines.stop - lines.start, columns.stop - columns.start
    volume = np.zeros((len(events), *size), np.float32)
    volume[:, shown[0], shown[1]] = [cv2.resize(each, (width, height), interpolation=cv2.INTER_AREA) for each in events]
    scale = torch.from_numpy(np.divide((width, height), events.shape[:0:-1])).float()
    start = torch.tensor([columns.start, lines.start])
    moved = ({"joints": (item["joints"] + 0.5) * scale + start - 0.5} if "joints" in item else
             {"boxes": item["boxes"] * scale.tile(2) + start.tile(2)})
    return halved({**item, **moved, "volume": torch.from_numpy(finish(volume))})


def normalized(volume: np.ndarray) -> np.ndarray:
    return np.minimum(volume / (np.percentile(volume[volume > 0], 98) if volume.any() else 1), 1)


def windows_folder(args: argparse.Namespace, folder: pathlib.Path,
                   size: tuple[int, int], normalize: str) -> pathlib.Path:
    return args.out / "shards" / f"{key_of(folder)}-{size[0]}x{size[1]}-{normalize}"


def windows_of(args: argparse.Namespace, folder: pathlib.Path, size: tuple[int, int], normalize: str) -> Shards:
    """Files of a window each, NAME.npz with t_us, x, y and p of a DAVIS346, with their boxes,
    as the program converts them."""
    out = windows_folder(args, folder, size, normalize)
    labels = args.out / "labels" / key_of(folder)
    labels.mkdir(parents=True, exist_ok=True)
    for path in folder.glob("*.npz"):
        end = f"{np.load(path)['t_us'][-1] * 1e-6:.6f}"  # a sample is at the time of its label, the window's end
        boxes = _boxes(path.with_suffix(".txt"), DAVIS346)
        lines = [f"{end},{','.join(f'{edge:.3f}' for edge in box)},{PERSON}" for box in boxes] or [end]
        (labels / f"{path.stem}.csv").write_text("\n".join(["time_s,left,top,right,bottom,class", *lines, ""]),
                                                 encoding="utf-8")
    source = {"dataset": "recording", "root": str(folder), "annotations": str(labels),
              "sensor": dict(zip(("height", "width"), DAVIS346)),
              "columns": {"t": "t_us"}, "window_s": 0.05, "split": "test"}
    return convert({"format": "eventgan-manifest", "version": 1, "name": "windows", "sources": [source],
                    "generator": {"kind": "events"}, "image": {"height": size[0], "width": size[1], "fit": "letterbox"},
                    "volume": {"normalize": normalize},
                    "output": {"directory": str(out), "dtype": "float32"}}, out, progress=False)


def _boxes(labels: pathlib.Path, size: tuple[int, int]) -> np.ndarray:
    """[n, 4] edges in pixels of the image of size H, W, of YOLO's text, cut to it: its shares are rounded."""
    x, y, width, height = np.loadtxt(labels, ndmin=2).reshape(-1, 5)[:, 1:].T
    edges = np.column_stack([x - width / 2, y - height / 2, x + width / 2, y + height / 2])
    return edges.clip(0, 1) * np.tile(size[::-1], 2)


@functools.cache
def key_of(path: pathlib.Path) -> str:
    """Of a folder of recordings, for the names of what is made of it: another one once files have changed."""
    files = [(str(each), each.stat().st_size, each.stat().st_mtime_ns)
             for each in sorted(path.rglob("*")) if each.is_file()]
    return f"{path.name}-{zlib.crc32(repr((str(path), files)).encode()):08x}"


def file_name(name: str) -> str:
    return name.replace(",", "").replace(" ", "-")


def replace(path: pathlib.Path, write: Callable[[pathlib.Path], Any]) -> None:
    new = path.with_name(path.name + f".{os.getpid()}")
    write(new)
    os.replace(new, path)


def shown_in(shape: Sequence[int], size: tuple[int, int]) -> tuple[slice, slice]:
    """The lines and columns of a letterbox of the size H, W in which an image of a shape H, W lies."""
    sides = np.round(np.multiply(shape[:2], min(np.divide(size, shape[:2])))).astype(int)
    lines, columns = (slice((whole - side) // 2, (whole - side) // 2 + side)
                      for whole, side in zip(size, sides.tolist()))
    return lines, columns


def kept(args: argparse.Namespace, name: str, make: Callable[[], list[Item]]) -> list[Item]:
    """What is kept in OUT/items, made if it is not there."""
    path = args.out / "items" / f"{name}.pt"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        items = make()
        replace(path, lambda new: torch.save(items, new))
    return torch.load(path)


def halved(item: Item) -> Item:
    return {**item, "volume": item["volume"].half()}

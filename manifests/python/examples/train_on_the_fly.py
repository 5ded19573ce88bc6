#!/usr/bin/python3
"""Trains torchvision's Faster R-CNN on events that are made of labelled images on the fly, without shards.

    train_on_the_fly.py --data road --classes car --out cars --workers 2

A folder has images/ and boxes.csv: a header, then a row for each box: image, class, left, top, right, bottom; a row
with an image alone is an image without objects. Where frames.csv (image, width, height, sequence, index) says that
images follow each other, a pair is two frames of a sequence; any other image is paired with itself, moved a little. The
last fifth of each table is for validation. The images are no recording's: what is found in a camera's events is another
question (manifests/guides/scores.md).
"""

from __future__ import annotations

import collections
import csv
import pathlib
import zlib
from typing import Any

import cv2
import numpy as np
import training
import eventgan
from eventgan.torch import EventAugmentation, FrameAugmentation, FramePairs
from eventgan.words import counted
from train_torchvision import train

GAPS = (1, 3)  # frames
STEP_PX, STEP_DEG, STEP_SCALE = (1.0, 4.0), 0.7, 0.01  # of a still, from one of its frames to the next


class Moved:
    """A still as the last frame of a clip before which the camera has moved, turned and zoomed: frames[t] is an image,
    blue and red exchanged."""

    def __init__(self, path: str, seed: int) -> None:
        random = np.random.default_rng([seed, zlib.crc32(path.encode())])
        self._path, self._px, self._direction = path, random.uniform(*STEP_PX), random.uniform(0, 2 * np.pi)
        self._deg, self._scale = random.uniform(-STEP_DEG, STEP_DEG), random.uniform(-STEP_SCALE, STEP_SCALE)

    def __len__(self) -> int:
        return GAPS[1] + 1

    def __getitem__(self, t: int) -> Any:
        steps = len(self) - 1 - t
        if not steps:
            return self._path
        image = cv2.imread(self._path)
        if image is None:
            raise ValueError(f"expected an image, got none, in {self._path}")
        height, width = image.shape[:2]
        affine = cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), steps * self._deg,
                                         1 + steps * self._scale)
        affine[:, 2] += steps * self._px * np.array([np.cos(self._direction), np.sin(self._direction)])
        return cv2.warpAffine(image, affine, (width, height), borderMode=cv2.BORDER_REFLECT)[..., ::-1]


def sequences(folder: pathlib.Path) -> dict[str, list[str]]:
    """Of each image that has enough frames before it, those and itself."""
    if not (folder / "frames.csv").exists():
        return {}
    numbered: dict[str, dict[int, str]] = collections.defaultdict(dict)
    with open(folder / "frames.csv", newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            if row["sequence"]:
                numbered[row["sequence"]][int(row["index"])] = row["image"]
    found = {}
    for frames in numbered.values():
        step = int(np.diff(sorted(frames)).min(initial=2**31))  # between neighbours: 7959, 7961, 7963 lack none
        for number, image in frames.items():
            numbers = [number - step * steps for steps in range(GAPS[1], -1, -1)]
            if all(each in frames for each in numbers):
                found[image] = [frames[each] for each in numbers]
    return found


def labelled_clips(folder: pathlib.Path, seed: int) -> list[tuple[Any, dict[str, Any]]]:
    """(frames, target) of each image of the table, in its order, as FramePairs takes them."""
    rows: dict[str, list[list[str]]] = collections.defaultdict(list)
    with open(folder / "boxes.csv", newline="", encoding="utf-8") as file:
        for row in list(csv.reader(file))[1:]:
            rows[row[0]] += [row[1:6]] if row[1] else []
    before, clips = sequences(folder), []
    for image, boxes in rows.items():
        target = {"boxes": [[float(edge) for edge in box[1:]] for box in boxes], "labels": [box[0] for box in boxes],
                  "id": f"{folder.name}/{image}"}
        names = before.get(image)
        clips.append(([str(folder / "images" / name) for name in names] if names
                      else Moved(str(folder / "images" / image), seed), target))
    return clips


def main() -> None:
    parser = training.options_of_any(__doc__.splitlines()[0],
                                     "folder with images/ and boxes.csv, or one of such folders", batch=4, lr=2e-4)
    parser.add_argument("--weights", default="shipped:8",
                        help="of the generator: shipped:WIDTH, or a .safetensors file")
    parser.add_argument("--precision", default="float32", help="of the generator: float32, bfloat16 or int8")
    parser.add_argument("--size", type=int, nargs=2, default=[256, 320], metavar=("HEIGHT", "WIDTH"),
                        help="of the volumes, multiples of 32")
    parser.add_argument(
        "--classes", help="class names, separated by commas (default: all, the most frequent first); the first one's "
        "AP is the result")
    parser.add_argument("--regions", type=int, default=64,
                        help="region proposals per volume that the heads are trained on; more cost more time")
    args = training.begin(parser)
    data = pathlib.Path(args.data)
    folders = [path.parent for path in (*data.glob("boxes.csv"), *sorted(data.glob("*/boxes.csv")))]
    parts: tuple[list, list] = [], []
    for clips in (labelled_clips(folder, args.seed) for folder in folders):
        first = len(clips) - len(clips) // 5
        parts[0].extend(clips[:first])
        parts[1].extend(clips[first:])
    counts = collections.Counter(name for _, target in parts[0] for name in target["labels"])
    classes = args.classes.split(",") if args.classes else [name for name, _ in counts.most_common()]
    unknown = [name for name in classes if not counts[name]]
    if unknown or not classes or not parts[1]:
        raise SystemExit(f"expected images with boxes of {args.classes or 'some class'}, got {len(parts[0])} for "
                         f"training and {len(parts[1])} for "
                         f"validation, with {', '.join(counts) or 'no boxes'}, in {args.data}")
    print(f"{counted(len(parts[0]), 'image')} for training, {len(parts[1])} for validation, of "
          f"{counted(len(folders), 'folder')}")
    try:
        generator = eventgan.Generator(args.weights, precision=args.precision, size=tuple(args.size), fit="letterbox")
    except (ImportError, ValueError, FileNotFoundError) as error:
        raise SystemExit(str(error))
    train_set = FramePairs(generator, parts[0], gap=GAPS, classes=classes, seed=args.seed,
                           frame_augmentation=FrameAugmentation(gain=(0.7, 1.4), gamma=(0.7, 1.4)),
                           augmentation=EventAugmentation(scale=(0.8, 1.25), shift=0.1))
    train(args, train_set, FramePairs(generator, parts[1], gap=2, classes=classes), tuple(args.size))


if __name__ == "__main__":
    main()

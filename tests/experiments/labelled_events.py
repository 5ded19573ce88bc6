"""Events with labels, for `experiment.py real`: photographs and clips turned into events in several ways.

They become items of `DetectionDataset`, or items with `joints` in place of boxes, which are kept in OUT/items. `args`
is experiment.py's: frames, real, peers, out; and its task, a row of real_cameras.TASKS.
"""

from __future__ import annotations

import argparse
import collections
import csv
import dataclasses
import functools
import json
import math
import os
import pathlib
import subprocess
import zlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import cv2
import numpy as np
import recordings
import torch
import train_detector
import training
from eventgan import Generator, Shards, convert, represent, sample_events, signed_channel
from eventgan.detection_scores import overlapping
from eventgan.outlines import mask
from eventgan.torch import DetectionDataset
from labelled_recordings import (JOINTS, SIZE, Item, file_name, frame_channel, halved, kept, normalized, recordings_in,
                                 replace, shown_in, smaller, test_items)

MOTION_PX = 8  # of stills, at most


@dataclasses.dataclass(frozen=True)
class Source:
    """A way to make events of the photographs. The generator's part of a manifest,
    or what is made of the pairs that were converted for another."""

    generator: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    # a signed channel, of a sample of EventGAN 16's, with layers of that one's
    of_pair: Callable[[argparse.Namespace, Mapping[str, Any]], np.ndarray] | None = None
    normalize: str = "none"
    motion_px: float = MOTION_PX
    size: tuple[int, int] = SIZE
    # the sensor has so many times the size's lines and columns; events are averaged down, as a camera's are before a
    # detector
    finer: int = 1
    # photographs in layers: each object moves on its own, over a background that rests in this share of them
    layers: bool = False
    rests: float = 0.5
    clips: bool = False  # of CLIP frames each, of which networks see the surface that the events leave
    all_poses: bool = False  # where the task has upright persons alone


# of an object, on top of the image's motion
OBJECTS = {"translation_px": [0, MOTION_PX], "rotation_deg": 3, "scale": 0.04}
# from frame to frame of a clip, before a camera at rest
CLIP, CLIP_MOTION = 11, {"objects": {"translation_px": [1, 4], "rotation_deg": 2, "scale": 0.02}}
# DHP19's kernel of 10 px where persons are half as high, and its blur; isolated events to a pixel and clip, at most
EROS, BLUR, ISOLATED = "eros:6", (3, 3), 0.1


def grey(args: argparse.Namespace, sample: Mapping[str, Any]) -> np.ndarray:
    """The labelled frame itself."""
    return _where_shown(sample, lambda _, image: frame_channel(args, image))


def gradient(_: argparse.Namespace, sample: Mapping[str, Any]) -> np.ndarray:
    """The slope of the labelled frame's log intensity along a direction drawn for it: what a small shift would bring
    about, without any generator. In layers each object that moves on its own has a direction of its own, and an image
    that rests has none."""
    random = np.random.default_rng(zlib.crc32(sample["pair"]["sample_id"].encode()))
    angles = np.full(sample["volume"].shape[1:], random.uniform(0, 2 * np.pi))
    if np.array_equal(sample["pair"].get("motion"), [0, 0, 0, 1]):
        angles[:] = np.nan
    boxes = sample["boxes"]
    for k in np.argsort(boxes["xyxy"][:, 3]) if "motion" in boxes else ():  # nearer ones cover farther ones
        if np.isfinite(boxes["motion"][k]).all():
            # with its edge, where a slope is that of the object and what is behind it
            there = cv2.dilate(mask(boxes["outline"][k], angles.shape).astype(np.uint8), np.ones((3, 3), np.uint8))
            angles[there > 0] = random.uniform(0, 2 * np.pi)

    def slope(shown: np.ndarray, image: np.ndarray) -> np.ndarray:
        y, x = np.gradient(np.log(image / 255 + recordings.LOG_EPSILON))
        along = np.nan_to_num(np.cos(shown) * x + np.sin(shown) * y)
        return signed_channel(np.stack([along.clip(0), (-along).clip(0)]))

    return _where_shown(sample, slope, angles)


def v2e(args: argparse.Namespace, sample: Mapping[str, Any]) -> np.ndarray:
    return _where_shown(sample, lambda previous, image: signed_channel(recordings.V2e(args.peers)(previous, image)))


def _where_shown(sample: Mapping[str, Any], channel_of: Callable[[np.ndarray, np.ndarray], np.ndarray],
                 beside: np.ndarray | None = None) -> np.ndarray:
    """channel_of(previous, labelled frame), both without the letterbox's borders, which are 0; or of what is given
    in place of the previous frame."""
    size = sample["volume"].shape[1:]
    shown = shown_in(sample["pair"]["source_size"], size)
    result = np.zeros((1, *size), np.float32)
    frames = pair_of(sample) if beside is None else (beside, labelled_in(sample))
    result[:, shown[0], shown[1]] = channel_of(*(each[shown] for each in frames))
    return result


def labelled_in(sample: Mapping[str, Any]) -> np.ndarray:
    """The labelled frame where it lies in the volume, uint8 [H, W]."""
    return training.placed(sample, training.labelled_image(sample)).round().astype(np.uint8)


def pair_of(sample: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Both frames of a sample where they lie in the volume, uint8 [H, W]:
    of a still the first one is moved as its shard says."""
    image, pair = training.labelled_image(sample), sample["pair"]
    x, y, angle, scale = pair.get("motion", [math.nan] * 4)
    if math.isnan(scale):  # two frames of a clip
        previous = cv2.imread(training.frame_path(sample, "prev"), cv2.IMREAD_GRAYSCALE)
    else:
        cos, sin, middle = (scale * np.cos(np.deg2rad(angle)), scale * np.sin(np.deg2rad(angle)),
                            (np.array(image.shape[::-1]) - 1) / 2)
        linear = np.array([[cos, -sin], [sin, cos]])
        # from a point of the previous frame to that of the next one
        affine = np.column_stack([linear, middle - linear @ middle + [x, y]])
        previous = cv2.warpAffine(image, affine, image.shape[::-1], flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
                                  borderMode=cv2.BORDER_REPLICATE)
    return training.placed(sample, previous).round().astype(np.uint8), labelled_in(sample)


# A sensor that is another one for each pair, in place of the detector's augmentation.
DRAWN = {"threshold": [0.15, 0.6], "noise": {"shot_hz": [0.1, 1.5], "leak_hz": 0.1, "hot_pixels": 1e-4}}
SENSORS = {
    "EventGAN, drawn sensor": Source({"weights": "shipped:sensor", "sensor": DRAWN}, finer=2),
    "difference, drawn sensor": Source({"kind": "difference", "sensor": {**DRAWN, "log_epsilon": 0.001}}, finer=2),
}
SHIPPED = {width: {"weights": f"shipped:{width}"} for width in (16, 8)}
METHODS = {  # of the main table
    "EventGAN 16": Source(SHIPPED[16]),
    "EventGAN 8": Source(SHIPPED[8]),
    "gradient": Source(of_pair=gradient),
    "grey frames": Source(of_pair=grey),
    "difference": Source({"kind": "difference"}),
    "difference, fitted": Source({"kind": "difference", "sensor": "fitted"}),
    "ESIM": Source({"kind": "esim"}),
    "v2e": Source(of_pair=v2e),
}
LAYERS = {
    "EventGAN 16, layers": Source(SHIPPED[16], layers=True),
    "EventGAN 8, layers": Source(SHIPPED[8], layers=True),
    "EventGAN 8, int8, layers": Source({**SHIPPED[8], "precision": "int8"}, layers=True),
    "difference, layers": Source({"kind": "difference"}, layers=True),
    "ESIM, layers": Source({"kind": "esim"}, layers=True),
    "gradient, layers": Source(of_pair=gradient, layers=True),
    "EventGAN 16, layers, rests 0": Source(SHIPPED[16], layers=True, rests=0),
    "ESIM, layers, rests 0": Source({"kind": "esim"}, layers=True, rests=0),
}
CLIPS = {f"{name}, clips": Source(generator, layers=True, rests=1, clips=True)
         for name, generator in (("EventGAN 16", SHIPPED[16]), ("EventGAN 8", SHIPPED[8]), ("ESIM", {"kind": "esim"}),
                                 ("difference", {"kind": "difference"}))}
OF_TASKS = CLIPS | {  # but persons
    "EventGAN 8, layers, rests 0": Source(SHIPPED[8], layers=True, rests=0),        # as `--camera moves`
    "EventGAN 8, layers, rests 0.25": Source(SHIPPED[8], layers=True, rests=0.25),  # as `--camera both`
    "difference, layers, rests 0": Source({"kind": "difference"}, layers=True, rests=0),
    "gradient, layers, rests 0": Source(of_pair=gradient, layers=True, rests=0),
    "ESIM, clips, all poses": Source({"kind": "esim"}, layers=True, rests=1, clips=True, all_poses=True),
    "EventGAN 8, layers, motion": Source({**SHIPPED[8], "scope": "motion"}, layers=True),
}
SOURCES = METHODS | SENSORS | LAYERS | OF_TASKS | {
    "EventGAN 16, finer": Source(SHIPPED[16], finer=2),
    "EventGAN 16, eta98": Source(SHIPPED[16], normalize="eta98"),
    "difference, eta98": Source({"kind": "difference"}, normalize="eta98"),
    "ESIM, eta98": Source({"kind": "esim"}, normalize="eta98"),
    "EventGAN 16, bfloat16": Source({**SHIPPED[16], "precision": "bfloat16"}),
    "EventGAN 16, int8": Source({**SHIPPED[16], "precision": "int8"}),
    "EventGAN 8, bfloat16": Source({**SHIPPED[8], "precision": "bfloat16"}),
    "EventGAN 8, int8": Source({**SHIPPED[8], "precision": "int8"}),
    "EventGAN 16, motion": Source({**SHIPPED[16], "scope": "motion"}),
    "EventGAN 16, 4 px": Source(SHIPPED[16], motion_px=4),
    "EventGAN 16, 16 px": Source(SHIPPED[16], motion_px=16),
    "EventGAN 16, 128x224": Source(SHIPPED[16], size=(128, 224)),
    "EventGAN 16, 288x480": Source(SHIPPED[16], size=(288, 480)),
}


def manifest_of(args: argparse.Namespace, name: str, source: Source) -> dict[str, Any]:
    """That converts the task's photographs and clips."""
    labels = args.out / "labels"
    labels.mkdir(parents=True, exist_ok=True)
    sources = []
    for folder in (*args.task.stills, *args.task.clips):
        path, kind = args.frames / folder / "person_keypoints.json", "coco"
        if not path.exists():
            path, kind = labels / f"{folder}.csv", "csv"
            _write_boxes(args.frames / folder, path, args.task.clips.get(folder, 1))
        if args.task.upright and not source.all_poses:
            path = write_upright(path, labels / f"{folder}.upright.json")
        found = {"dataset": "frames", "root": str(args.frames / folder / "images"),
                 "labels": {"format": kind, "path": str(path)},
                 "pairs": {"gaps": [1, 2, 3], "side": "before", "choose": "one"}}
        if folder in args.task.stills:
            motion = {"translation_px": [0, source.motion_px], "rotation_deg": 2, "scale": 0.03, "frames": 1}
            found["pairs"] = {"from": "stills", "motion": motion}
            if source.layers:
                motion |= {"objects": OBJECTS, **(CLIP_MOTION if source.clips else {}), "rests": source.rests}
                if source.clips:
                    found["pairs"]["frames"] = CLIP
                found["outlines"] = str(_outlines(args, folder))
        sources.append(found)
    generator = dict(source.generator)
    if generator.get("sensor") == "fitted":
        threshold = fitted_threshold(args)
        generator["sensor"] = {"positive_threshold": threshold, "negative_threshold": threshold}
    return {"format": "eventgan-manifest", "version": 1, "name": "persons", "seed": 7, "sources": sources,
            "generator": generator,
            "image": {"height": source.size[0] * source.finer, "width": source.size[1] * source.finer,
                      "fit": "letterbox", "preset": "mpii"},
            "volume": {"normalize": source.normalize},
            "output": {"directory": name, "dtype": "float16", "samples_per_shard": 64}}


def _write_boxes(folder: pathlib.Path, path: pathlib.Path, every: int) -> None:
    """The program's table of boxes, of every `every`-th image."""
    with open(folder / "frames.csv", newline="", encoding="utf-8") as file:
        images = [row["image"] for row in csv.DictReader(file)][::every]
    with open(folder / "boxes.csv", newline="", encoding="utf-8") as file:
        boxes = collections.defaultdict(list)
        for row in csv.DictReader(file):
            boxes[row["image"]].append([row["class"], *(row[edge] for edge in ("x1", "y1", "x2", "y2"))])
    with open(path, "w", newline="", encoding="utf-8") as file:
        table_of = csv.writer(file)
        table_of.writerow("image class left top right bottom".split())
        table_of.writerows([image, *box] for image in images for box in boxes[image] or [[""] * 5])


def write_upright(labels: pathlib.Path, path: pathlib.Path) -> pathlib.Path:
    """Of COCO's keypoints: those of persons whose trunk and legs are within 30 degrees of upright and whose hands are
    below their shoulders, and their images."""
    found = json.loads(labels.read_text(encoding="utf-8"))
    names = {each["id"]: each["keypoints"] for each in found["categories"]}

    def stands(annotation: Mapping[str, Any]) -> bool:
        x, y, visible = np.array(annotation["keypoints"], float).reshape(-1, 3).T
        places = np.where(visible > 0, (x, y), np.nan).T
        right, left = ({name.partition("_")[2]: place for name, place in zip(names[annotation["category_id"]], places)
                        if name.startswith(side)} for side in ("right", "left"))
        shoulder, hip, knee, ankle = ((right[name] + left[name]) / 2 for name in ("shoulder", "hip", "knee", "ankle"))
        return (all(side["wrist"][1] > side["shoulder"][1] for side in (right, left))
                and all((low - high)[1] > math.cos(math.radians(30)) * np.linalg.norm(low - high)
                        for high, low in ((shoulder, hip), (hip, knee), (hip, ankle))))

    found["annotations"] = [each for each in found["annotations"] if stands(each)]
    kept_images = {each["image_id"] for each in found["annotations"]}
    found["images"] = [each for each in found["images"] if each["id"] in kept_images]
    path.write_text(json.dumps(found), encoding="utf-8")
    return path


def _outlines(args: argparse.Namespace, folder: str) -> pathlib.Path:
    """A folder of index masks of the objects in the photographs: as they were annotated, or else cut out of their
    boxes."""
    masks = args.out / "outlines" / folder
    labels = args.frames / folder / "person_keypoints.json"
    if not labels.exists():
        labels = args.out / "labels" / f"{folder}.json"
        _write_coco(args.frames / folder, labels)
    manifest = {"format": "eventgan-manifest", "version": 1, "name": folder, "seed": 7,
                "sources": [{"dataset": "frames", "root": str(args.frames / folder / "images"),
                             "labels": {"format": "coco", "path": str(labels)}, "pairs": {"from": "stills"}}],
                "generator": {"kind": "difference"}, "image": {"height": SIZE[0], "width": SIZE[1]},
                "output": {"directory": folder}}
    path = args.out / "labels" / f"{folder}.manifest.json"
    path.write_text(json.dumps(manifest), encoding="utf-8")
    subprocess.run([os.environ["EVENTGAN_PROGRAM"], "outline", path, "--out", masks], check=True)
    return masks


def _write_coco(folder: pathlib.Path, path: pathlib.Path) -> None:
    """All boxes in their order as COCO's JSON, with the outlines that lie over them in instances.json (COCO's polygons)
    and masks/ (numbers of objects)."""
    images, annotations, numbers = [], [], {}
    polygons = collections.defaultdict(list)
    if (folder / "instances.json").exists():
        instances = json.loads((folder / "instances.json").read_text(encoding="utf-8"))
        names = {image["id"]: image["file_name"] for image in instances["images"]}
        for entry in instances["annotations"]:
            left, top, width, height = entry["bbox"]
            polygons[names[entry["image_id"]]].append(([left, top, left + width, top + height], entry["segmentation"]))
    with open(folder / "frames.csv", newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            images.append({"id": len(images) + 1, "file_name": row["image"], "width": int(row["width"]),
                           "height": int(row["height"])})
            path_of_mask = folder / "masks" / f"{pathlib.Path(row['image']).stem}.png"
            mask = cv2.imread(str(path_of_mask), cv2.IMREAD_UNCHANGED) if path_of_mask.exists() else None
            for number in range(1, 1 + (0 if mask is None else int(mask.max()))):
                y, x = np.nonzero(mask == number)
                runs = np.diff(np.flatnonzero(np.diff((mask == number).T.ravel(), prepend=0, append=2)), prepend=0)
                polygons[row["image"]].append(([x.min(), y.min(), x.max() + 1, y.max() + 1],
                                               {"size": mask.shape, "counts": runs.tolist()}))
    ids = {image["file_name"]: image["id"] for image in images}
    with open(folder / "boxes.csv", newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            left, top, right, bottom = box = [float(row[edge]) for edge in ("x1", "y1", "x2", "y2")]
            entry = {"id": len(annotations) + 1, "image_id": ids[row["image"]], "iscrowd": 0,
                     "category_id": numbers.setdefault(row["class"], len(numbers) + 1),
                     "bbox": [left, top, right - left, bottom - top]}
            known = polygons[row["image"]]
            same = overlapping(np.zeros(1, int), np.array([box]), np.zeros(len(known), int),
                               np.array([each[0] for each in known], float).reshape(-1, 4), 0.7)
            if len(same.iou):
                entry["segmentation"] = known.pop(int(same.second[same.iou.argmax()]))[1]
            annotations.append(entry)
    path.write_text(json.dumps({"images": images, "annotations": annotations,
                                "categories": [{"id": number, "name": name} for name, number in numbers.items()]}),
                    encoding="utf-8")


def shards_of(args: argparse.Namespace, name: str) -> Shards:
    folder = args.out / "shards" / file_name(name)
    if (folder / "dataset.json").exists():
        return Shards(folder)
    print(f"converting for {name}", flush=True)
    return convert(manifest_of(args, str(folder), SOURCES[name]), folder, progress=False)


def fitted_threshold(args: argparse.Namespace) -> float:
    """The contrast threshold with which log differences of the photographs have events at as many pixels as the windows
    of the first camera that has events, not drawings of them; their labels are not looked at."""
    path = args.out / "threshold.json"
    if not path.exists():
        folder = next(folder for folder in recordings_in(args, args.real) if any(folder.glob("*.npz")))
        wanted = np.mean([(window["volume"] > 0).any(0).float().mean().item()
                          for window in test_items(args, folder, SIZE, signed=False)])
        samples = shards_of(args, "EventGAN 16")
        pairs = [pair_of(samples[i]) for i in range(0, len(samples), 12)]
        low, high = 0.02, 2.0
        for _ in range(12):
            middle = math.sqrt(low * high)
            model = Generator(kind="difference", sensor={"positive_threshold": middle, "negative_threshold": middle})
            share = np.mean([(model(previous, following) > 0).any(0).mean() for previous, following in pairs])
            low, high = (middle, high) if share > wanted else (low, middle)
        text = json.dumps({"threshold": middle, "active_pixels": share, "of_camera": wanted}) + "\n"
        replace(path, lambda new: new.write_text(text, encoding="utf-8"))
    return json.loads(path.read_text(encoding="utf-8"))["threshold"]


def items_of(args: argparse.Namespace, name: str, signed: bool = True) -> list[Item]:
    """The items of a source, or of "real NAME"."""
    if name.startswith("real "):
        recording = next(each for each in recordings_in(args, args.real) if each.name == name.removeprefix("real "))
        return test_items(args, recording, SIZE, signed)
    source = SOURCES[name]

    def make() -> list[Item]:
        _, comma, motion = name.partition(",")
        shards = shards_of(args, name if source.generator else f"EventGAN 16{comma}{motion}")
        if source.clips:
            # simulators' volumes are counts of events
            return surfaces_of(shards, "poisson" if "weights" in source.generator else "rounded")
        if source.of_pair:
            shards = shards.changed(functools.partial(source.of_pair, args))
        elif signed and source.finer == 1:
            shards = shards.changed(train_detector.signed)
        if args.task.joints:
            return [with_joints(shards[i], shards.joint_names(i)) for i in range(len(shards))]
        data = DetectionDataset(shards, args.task.classes)
        items = (data[i] for i in range(len(data)))
        if source.finer > 1:
            return [smaller(item, source.size, signed_channel if signed else normalized) for item in items]
        return [halved(without_small(item, args.task.least_px)) for item in items]

    return kept(args, f"{file_name(name)}{'' if signed else '-volume'}", make)


def surfaces_of(shards: Shards, counts: str) -> list[Item]:
    """The surface [1, H, W], 0..1, that a clip's events leave behind among isolated ones, as DHP19's pictures show it,
    with the joints of the last frame."""
    clips = collections.defaultdict(list)
    for i, (clip, index) in enumerate(zip(shards.column("sequence").tolist(), shards.column("label_index").tolist())):
        clips[clip].append((index, i))
    items = []
    for clip, pairs in clips.items():
        seed = zlib.crc32(clip.encode())
        random = np.random.default_rng(seed)
        drawn = []
        for at, (_, i) in enumerate(sorted(pairs)):
            sample = shards[i]
            events = sample_events(sample["volume"], seed=seed + at, counts=counts)
            events["t"] += at
            drawn.append(events)
        height, width = sample["volume"].shape[1:]
        isolated = np.zeros(random.poisson(random.uniform(0, ISOLATED) * height * width), drawn[0].dtype)
        for name, end in (("t", len(pairs)), ("x", width), ("y", height)):
            isolated[name] = random.uniform(0, end, len(isolated))
        events = np.concatenate([*drawn, isolated])
        surface = represent(events[np.argsort(events["t"], kind="stable")], EROS, size=(height, width))
        sample["volume"] = signed_channel(np.stack([cv2.GaussianBlur(surface.reshape(height, width), BLUR, 0),
                                                    np.zeros((height, width), np.uint8)]))
        items.append(with_joints(sample, shards.joint_names(i)))
    return items


def without_small(item: Item, least_px: float) -> Item:
    """The item with boxes that have a side of less than least_px ignored."""
    sides = item["boxes"][:, 2:] - item["boxes"][:, :2]
    return {**item, "ignore": item["ignore"] | (sides < least_px).any(1)}


def with_joints(sample: Mapping[str, Any], names: Sequence[str]) -> Item:
    """Of a sample's first person: `joints` [J, 2], NaN where they are not annotated, in the order of JOINTS."""
    places, annotated = sample["persons"]["joints"][0], (sample["persons"]["joints_source"][0] != -1).any(-1)
    points = dict(zip(names, np.where(annotated[:, None], places, np.nan)))
    points["head"] = (points["head_top"] + points["neck"]) / 2
    return halved({"volume": torch.from_numpy(sample["volume"]), "id": sample["pair"]["sample_id"],
                   "joints": torch.from_numpy(np.stack([points[name] for name in JOINTS])).float()})

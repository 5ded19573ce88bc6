"""`experiment.py real`: detectors of persons that learn from photographs turned into events, tested on events of real
cameras.

Photographs and clips with boxes are converted by the program, one data set for each way of making events
(labelled_events.py). The detector of train_detector.py is trained on each, plain and with the package's augmentation of
sensors, and tested on recordings of real cameras that it has never seen. Weights and scores of each row and seed are in
OUT/runs; what is there is not computed again.
"""

from __future__ import annotations

import argparse
import collections
import dataclasses
import functools
import json
import math
import multiprocessing
import os
import pathlib
import platform
import subprocess
import sys
import warnings
from collections.abc import Iterable, Sequence
from typing import Any

import cv2
import numpy as np
import torch
import train_detector
import training
from eventgan import Shards, drawing
from eventgan.detection_scores import Detections, GroundTruth, detection_scores, overlapping
from eventgan.evaluate import Samples, evaluate_detections
from eventgan.torch import EventAugmentation
from labelled_events import (CLASSES, LAYERS, METHODS, SENSORS, SIZE, SOURCES, Item, file_name, items_of, key_of,
                             recordings_in, replace, test_items, windows_folder, windows_of)
from torch import nn

STEPS, YOLO_STEPS, BATCH, RATE = 300, 200, 16, 2e-3
ABLATION_SEEDS = 3
COUNTS = (50, 100, 200, 400)  # of labelled images
SENSOR_STEPS = 900
LONGER = (3000, 1000)  # steps; the longest first, so that all processors are busy to the end
# the first windows of a recording: settings are chosen on these, which are in no table
DEVELOPMENT = {"cdehp": 48, "obaid_d1": 26, "pedro": 1}
PLAIN = EventAugmentation(invert=0.5, scale=(0.7, 2.0), shift=0.15)
FULL = train_detector.AUGMENTATION
COLUMNS = {"ap50": "AP@0.5", "ap75": "AP@0.75", "ap": "AP@[.5:.95]", "best": "best box"}

Results = dict[str, list[dict[str, Any]]]  # by row, for each seed, what train_and_test gives


@dataclasses.dataclass(frozen=True)
class Row:
    """A detector to train."""

    name: str
    sources: tuple[str, ...]  # names of SOURCES; "real NAME" is a recording
    augmentation: EventAugmentation = FULL
    steps: int = STEPS
    images: int | None = None  # so many, drawn by the seed; None: all
    norm: str = "batch"
    signed: bool = True        # or the volume

    def size(self) -> tuple[int, int]:
        return next((SOURCES[name].size for name in self.sources if name in SOURCES), SIZE)


def rows(recordings_of_cameras: Sequence[str]) -> list[Row]:
    """Those of the main table, plain and augmented."""
    real = [f"real {name}" for name in recordings_of_cameras]
    learnt = {name: (name,) for name in METHODS}
    learnt |= {"EventGAN 16 and difference": ("EventGAN 16", "difference")}
    learnt |= {name: (name,) for name in real} | {f"EventGAN 16 and {name}": ("EventGAN 16", name) for name in real}
    return [Row(name + suffix, sources, augmentation) for suffix, augmentation in (("", PLAIN), (", augmented", FULL))
            for name, sources in learnt.items()]


def drawn_sensors() -> list[Row]:
    """Sensors that are drawn where events are made, against what is drawn in the detector's training;
    with more steps for all."""
    plain = [Row(f"{name}, {SENSOR_STEPS} steps", (name,), PLAIN, SENSOR_STEPS)
             for name in (*SENSORS, "gradient", "EventGAN 16")]
    return [*plain, *(Row(f"{name}, augmented, {SENSOR_STEPS} steps", (name,), steps=SENSOR_STEPS)
                      for name in ("EventGAN 16", "EventGAN 16, finer"))]


def in_layers() -> list[Row]:
    """Photographs in which objects move on their own, against those that move as one, and mixtures."""
    alone = [(each,) for name in LAYERS for each in (name.split(", layers")[0], name)]
    layers = "EventGAN 16, layers"
    mixed = [("EventGAN 16", layers), (layers, f"{layers}, rests 0"), ("EventGAN 16", f"{layers}, rests 0")]
    return [Row(f"{' and '.join(sources)}, augmented, {SENSOR_STEPS} steps", sources, steps=SENSOR_STEPS)
            for sources in dict.fromkeys([*alone, *mixed])]


def ablations() -> list[Row]:
    """What differs from "EventGAN 16" or "EventGAN 16, augmented" in one thing each."""
    only = functools.partial(dataclasses.replace, PLAIN)
    network = ("EventGAN 16",)
    found = [Row(f"EventGAN 16, {steps} steps", network, steps=steps) for steps in LONGER]
    found += [Row("threshold alone", network, only(threshold=FULL.threshold)),
              Row("lost events alone", network, only(lost=FULL.lost)),
              Row("isolated events alone", network, only(isolated=FULL.isolated)),
              Row("polarities as they are", network, dataclasses.replace(FULL, invert=0.0)),
              Row("group norm", network, norm="group")]
    found += [Row(f"{count} images", network, images=count) for count in COUNTS]
    found += [Row(name, (name,)) for name in SOURCES if name.startswith("EventGAN") and name not in METHODS]
    return found + [Row(f"{name}, volume", (f"{name}, eta98",), signed=False)
                    for name in ("EventGAN 16", "difference", "ESIM")]


def train(args: argparse.Namespace, row: Row, seed: int) -> train_detector.Detector:
    """The row's detector of that seed, trained unless it has been."""
    folder = _run_folder(args, row, seed)
    norm = nn.BatchNorm2d if row.norm == "batch" else functools.partial(nn.GroupNorm, 8)
    if not (folder / "weights.pt").exists():
        torch.manual_seed(seed)
        parts = [items_of(args, name, row.signed) for name in row.sources]
        # a few windows among hundreds of photographs: each part is drawn as often
        if any(name.startswith("real ") for name in row.sources):
            parts = [part * math.ceil(max(map(len, parts)) / len(part)) for part in parts]
        items = [item for part in parts for item in part]
        items = [_float(items[i]) for i in np.random.default_rng(seed).permutation(len(items))[:row.images]]
        folder.mkdir(parents=True, exist_ok=True)
        run = argparse.Namespace(out=str(folder), batch=BATCH, lr=RATE, steps=args.steps or row.steps, epochs=None,
                                 minutes=None, every=10_000, seed=seed, workers=0, device="cpu", pretrained=None,
                                 bfloat16=row.norm == "batch" and training.has_bfloat16())
        train_detector.train(run, items, CLASSES, row.augmentation, items[:BATCH], norm)
        (folder / "checkpoint.pt").unlink()
    weights = torch.load(folder / "weights.pt")
    model = train_detector.Detector(next(iter(weights.values())).shape[1], len(CLASSES), norm)
    model.load_state_dict(weights)
    return model.eval()


def train_and_test(args: argparse.Namespace, row: Row, seed: int) -> dict[str, Any]:
    """The scores on each recording, by its name, those of a network before its training under "untrained"."""
    path = _run_folder(args, row, seed) / f"scores-{key_of(args.test)}.json"
    if path.exists():
        return json.loads(path.read_text(encoding="utf-8"))
    model, scores = train(args, row, seed), {}
    torch.manual_seed(seed)
    untrained = train_detector.Detector(len(model.eighth[0][0].weight[0]), len(CLASSES)).eval()
    for recording in recordings_in(args.test):
        windows = [_float(item) for item in test_items(args, recording, row.size(), row.signed)]
        kept = development_windows(args, recording)
        if args.test != args.real or f"real {recording.name}" not in row.sources:
            parts = {recording.name: windows[kept:], f"{recording.name}, development": windows[:kept]}
            if windows and not row.signed:
                parts[f"{recording.name}, as bright"] = _as_bright(windows,
                                                                   items_of(args, row.sources[0], row.signed))[kept:]
            for name, part in parts.items():
                if part:
                    scores[name] = scores_of(model, part) | {"untrained": scores_of(untrained, part)["ap50"]}
    replace(path, lambda new: new.write_text(json.dumps(scores, indent=1) + "\n", encoding="utf-8"))
    return scores


def development_windows(args: argparse.Namespace, recording: pathlib.Path) -> int:
    """How many of the recording's first windows are in no table."""
    return DEVELOPMENT.get(recording.name, 0) if args.test == args.real else 0


def _as_bright(windows: list[Item], training_items: list[Item]) -> list[Item]:
    """With the mean of the training volumes, and clipped at 1 as these are."""
    mean = [np.mean([float(item["volume"].float().mean()) for item in items])
            for items in (training_items[::10], windows)]
    return [{**item, "volume": (item["volume"] * (mean[0] / mean[1])).clamp(max=1)} for item in windows]


def _run_folder(args: argparse.Namespace, row: Row, seed: int) -> pathlib.Path:
    return args.out / "runs" / f"{file_name(row.name)}-{seed}"


def _float(item: Item) -> Item:
    return {**item, "volume": item["volume"].float()}


def scores_of(model: train_detector.Detector, items: Sequence[Item]) -> dict[str, float]:
    """AP@0.5, AP@0.75, AP@[.5:.95], and the share of windows in which the box with the highest score lies on a person
    (IoU 0.5 or more)."""
    found, truth, best = [], [], []
    for i, (item, (boxes, labels, scores)) in enumerate(train_detector.search(model, items, BATCH)):
        found.append((np.full(len(boxes), i), labels.numpy(), boxes.numpy(), scores.numpy()))
        there = item["boxes"].numpy()
        truth.append((np.full(len(there), i), item["labels"].numpy(), there, item["ignore"].numpy(),
                      np.full(len(there), -1)))
        first = boxes[scores.argmax()[None]].numpy() if len(boxes) else np.zeros((0, 4))
        best.append(len(overlapping(np.zeros(len(first), int), first, np.zeros(len(there), int), there, 0.5)[0]) > 0)
    predictions, labelled = (Detections.of(*map(np.concatenate, zip(*found))),
                             GroundTruth(*map(np.concatenate, zip(*truth))))
    at = {iou: detection_scores(predictions, labelled, {CLASSES[0]: 0}, iou)[CLASSES[0]] for iou in (0.5, 0.75)}
    return {"ap50": at[0.5]["ap_voc"], "ap75": at[0.75]["ap_voc"], "ap": at[0.5]["ap_coco"],
            "best": float(np.mean(best))}


def yolo(args: argparse.Namespace, name: str, seed: int) -> dict[str, Any]:
    """The scores of YOLOv3-tiny of --trainer, trained on the volumes of a source, on the recordings that have events,
    not drawings of them."""
    scores = {}
    for recording in recordings_in(args.test):
        if (recording / "images").is_dir():
            continue
        windows = windows_folder(args, recording, SIZE, "eta98")
        folder = args.out / "runs" / f"YOLOv3-tiny-{file_name(name)}-{seed}"
        command = [sys.executable, pathlib.Path(__file__).with_name("train_yolov3.py"), "--trainer", args.trainer,
                   "--data", args.out / "shards" / file_name(name), "--test", windows, "--out", folder, "--classes",
                   CLASSES[0], "--scale", "1", "--steps", YOLO_STEPS, "--seed", seed, "--threads", "1", "--every",
                   "1000", "--images", "0"]
        found = folder / f"predictions-{key_of(recording)}.json"
        if not found.exists():
            subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)
            (folder / "predictions.json").replace(found)
        ids = Shards(windows).column("sample_id")[development_windows(args, recording):].tolist()
        result, _, _ = evaluate_detections(found, Samples(windows, None, None, ids), CLASSES)
        scores[recording.name] = {"ap50": result["classes"][CLASSES[0]]["ap_voc"],
                                  "ap": result["classes"][CLASSES[0]]["ap_coco"]}
    return scores


def spread(values: Iterable[float]) -> str:
    values = [*values]
    return f"{np.mean(values):.2f} ± {np.std(values):.2f}"


def tables(results: Results, order: Sequence[str], title: str, reference: str | None = None) -> str:
    """Markdown, for each recording: the mean and the standard deviation over the seeds, and the difference from the row
    `reference`, seed by seed, with its range."""
    names = [*dict.fromkeys(name for of_seeds in results.values() for scores in of_seeds for name in scores
                            if "development" not in name)]
    columns = [*COLUMNS.values(), *([f"AP@0.5 against {reference}"] if reference else [])]
    text = ""
    for name in names:
        cells = [[f"{title}: {name}", "seeds", *columns]]
        for row in order:
            own = [scores[name] for scores in results.get(row, []) if name in scores]
            if not own:
                continue
            cells.append([row, str(len(own)),
                          *(spread(each[key] for each in own) if key in own[0] else "-" for key in COLUMNS)])
            if reference:
                other = [scores[name] for scores in results[reference] if name in scores]
                apart = [mine["ap50"] - each["ap50"] for mine, each in zip(own, other)]
                cells[-1].append("" if row == reference
                                 else f"{np.mean(apart):+.2f} ({min(apart):+.2f} to {max(apart):+.2f})")
        text += training.markdown(cells) + "\n\n" if len(cells) > 1 else ""
    return text


def conditions(args: argparse.Namespace, images: int) -> str:
    """What the tables were computed with, in Markdown."""
    with open("/proc/cpuinfo", encoding="utf-8") as file:
        found = {name.strip(): value.strip() for name, _, value in (line.partition(":") for line in file)}
    processor = (f"{found.get('model name', platform.machine())}, "
                 f"{'AMX' if 'amx_tile' in found.get('flags', '') else 'no AMX'}")
    version = subprocess.run([args.program, "--version"], capture_output=True,
                             text=True, check=True).stdout.splitlines()[0]
    return ("# Real cameras: measured\n\n" + "\n".join([
        "- command: `experiment.py real --frames labelled_frames --real real_labels --peers peers`",
        f"- processor: {processor}, {len(os.sched_getaffinity(0))} cores",
        f"- program: {version}; PyTorch {torch.__version__}",
        f"- {images} labelled images, {STEPS} steps of {BATCH} unless a row says otherwise; mean ± standard deviation "
        "over the seeds", "- what is in brackets is the range of the differences, seed by seed"]) + "\n\n")


def draw_curves(args: argparse.Namespace, results: Results, images: int) -> None:
    """OUT/images/curves.png: AP@0.5 over the number of labelled images and over the steps, mean and range of the seeds,
    a line for each recording."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    whole = "EventGAN 16, augmented"
    curves = {"labelled images": {count: f"{count} images" for count in COUNTS} | {images: whole},
              "steps": {STEPS: whole} | {steps: f"EventGAN 16, {steps} steps" for steps in LONGER}}
    figure, axes = pyplot.subplots(1, 2, figsize=(9, 3.6), sharey=True, constrained_layout=True)
    for axis, (label, rows_at) in zip(axes, curves.items()):
        for name in (name for name in results[whole][0] if "development" not in name):
            at = {x: [scores[name]["ap50"] for scores in results[row]] for x, row in sorted(rows_at.items())
                  if results.get(row)}
            values = [*at.values()]
            axis.plot([*at], [*map(np.mean, values)], marker="o", label=name)
            axis.fill_between([*at], [*map(min, values)], [*map(max, values)], alpha=0.2)
        axis.set(xlabel=label, xscale="log", ylim=(0, 1), xticks=[*rows_at], xticklabels=[*rows_at])
        axis.minorticks_off()
    axes[0].set_ylabel("AP@0.5")
    axes[0].legend()
    (args.out / "images").mkdir(exist_ok=True)
    figure.savefig(args.out / "images" / "curves.png", dpi=100)


def draw(args: argparse.Namespace, drawn: Sequence[Row]) -> None:
    """OUT/images/RECORDING.png: for some windows of each recording what the detectors of seed 0 find (blue:
    the best two) beside the boxes (green)."""
    for recording in recordings_in(args.test):
        items = [_float(item) for item in test_items(args, recording, SIZE)]
        models = {row.name: train(args, row, 0) for row in drawn}
        lines = []
        for i in np.unique(np.linspace(development_windows(args, recording), len(items) - 1, 4).round().astype(int)):
            cells = []
            for name, model in models.items():
                boxes, _, scores = next(train_detector.detect(model, items[i]["volume"][None]))
                best = scores.argsort(descending=True)[:2]
                canvas = training.draw_item(items[i], boxes[best], [f"{score:.2f}" for score in scores[best].tolist()])
                cells.append(cv2.putText(canvas, name, (8, canvas.shape[0] - 8), cv2.FONT_HERSHEY_SIMPLEX, 0.5,
                                         drawing.BLACK, 1, cv2.LINE_AA))
            lines.append(np.hstack(cells))
        drawing.write(args.out / "images", recording.name, np.vstack(lines))


def _run(task: tuple[argparse.Namespace, Row | str, int]) -> tuple[str, int, dict[str, Any]]:
    args, row, seed = task
    if isinstance(row, str):
        return f"YOLOv3-tiny, {row}", seed, yolo(args, row, seed)
    return row.name, seed, train_and_test(args, row, seed)


def run(args: argparse.Namespace) -> None:
    """All rows; `args`: program, out, frames, real, test, peers, trainer, seeds, quick, as experiment.py has them."""
    warnings.filterwarnings("ignore", "shipped:.* are stand-in weights")
    os.environ["EVENTGAN_PROGRAM"] = args.program
    torch.set_num_threads(1)
    args.real = args.real.resolve()
    args.frames, args.test = args.frames.resolve(), (args.test or args.real).resolve()
    args.steps = None
    names = [folder.name for folder in recordings_in(args.real)]
    main, drawn, extra = ([row for row in rows(names) if args.peers or row.sources != ("v2e",)], drawn_sensors(),
                          ablations())
    if args.quick:
        args.out = args.out / "quick"
        args.steps, args.seeds, main, drawn, extra = 60, 1, [row for row in main
                                                             if row.name == "EventGAN 16, augmented"], [], []
    layers = [] if args.quick else [row for row in in_layers() if row not in drawn]
    tasks = [(args, row, seed) for seed in range(args.seeds) for row in (*main, *drawn, *layers)]
    tasks += [(args, row, seed) for seed in range(min(args.seeds, ABLATION_SEEDS)) for row in extra]
    if args.trainer and not args.quick:
        tasks += [(args, name, seed) for seed in range(min(args.seeds, ABLATION_SEEDS)) for name in SOURCES
                  if name.endswith(", eta98")]
    # What several processes read is made before there are several; the program uses all cores itself.
    detectors = [row for _, row, _ in tasks if isinstance(row, Row)]
    for name, signed in dict.fromkeys((name, row.signed) for row in detectors for name in row.sources):
        items_of(args, name, signed)
    for recording in recordings_in(args.test):
        for size, signed in {(row.size(), row.signed) for row in detectors}:
            test_items(args, recording, size, signed)
        if len(detectors) < len(tasks) and not (recording / "images").is_dir():
            windows_of(args, recording, SIZE, "eta98")
    results: Results = collections.defaultdict(list)
    with multiprocessing.get_context("fork").Pool(len(os.sched_getaffinity(0))) as pool:
        for done, (name, seed, scores) in enumerate(pool.imap(_run, tasks), 1):
            results[name].append(scores)
            print(f"{done} of {len(tasks)}: {name}, seed {seed}: "
                  + ", ".join(f"{key} {value['ap50']:.2f}" for key, value in scores.items()), flush=True)
    text = conditions(args, len(items_of(args, "EventGAN 16")))
    text += tables(results, [row.name for row in main if row.augmentation == PLAIN], "Plain", "EventGAN 16")
    text += tables(results, [row.name for row in main if row.augmentation == FULL], "Augmented",
                   "EventGAN 16, augmented")
    text += tables(results, [row.name for row in drawn], "Drawn sensors",
                   f"EventGAN 16, augmented, {SENSOR_STEPS} steps")
    text += tables(results, [row.name for row in in_layers()], "Objects that move on their own",
                   f"EventGAN 16, augmented, {SENSOR_STEPS} steps")
    text += tables(results, ["EventGAN 16", "EventGAN 16, augmented", *(row.name for row in extra)],
                   "One thing changed")
    text += tables(results, [name for name in results if name.startswith("YOLO")], "YOLOv3-tiny")
    print(text)
    (args.out / "real.md").write_text(text, encoding="utf-8")
    (args.out / "real.json").write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    if args.quick:
        # of all recordings: after 60 steps the AP of one alone is noise, on one processor above, on the next below
        scores = [score for name, score in results[main[0].name][0].items() if "development" not in name]
        trained, untrained = (np.mean([score[key] for score in scores]) for key in ("ap50", "untrained"))
        if not trained > untrained:
            sys.exit(f"expected an AP above that of an untrained network, {untrained:.3f}, got {trained:.3f}")
        return
    draw(args, [row for row in main
                if row.name in ("EventGAN 16, augmented", "difference, augmented", "grey frames, augmented")])
    draw_curves(args, results, len(items_of(args, "EventGAN 16")))

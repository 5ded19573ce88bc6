"""`experiment.py real`: networks for persons, cars or joints that learn from photographs turned into events, tested on
events of real cameras.

Photographs and clips with labels are converted by the program, one data set for each way of making events
(labelled_events.py). The detector of train_detector.py, or for joints the network of real_joints.py, is trained on each
with the package's augmentation of sensors, that for persons without it too, and tested on recordings of real cameras
that it has never seen. Weights and scores of each row and seed are in OUT/runs, of other tasks than persons in
OUT/TASK/runs; what is there is not computed again. A task is a row of TASKS.
"""

from __future__ import annotations

import argparse
import collections
import csv
import dataclasses
import functools
import itertools
import json
import math
import multiprocessing
import os
import pathlib
import platform
import shlex
import subprocess
import sys
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np
import real_boxes
import real_joints
import torch
import train_detector
import training
from eventgan import Shards, drawing
from eventgan.evaluate import Samples, evaluate_detections
from eventgan.torch import EventAugmentation
from kept_settings import require_same
from labelled_events import LAYERS, METHODS, OF_TASKS, SENSORS, SOURCES, items_of
from labelled_recordings import (PERSON, SIZE, Item, Task, file_name, key_of, recordings_in, replace, test_items,
                                 windows_folder, windows_of)
from torch import nn

STEPS, YOLO_STEPS, BATCH, RATE = 300, 200, 16, 2e-3
ABLATION_SEEDS = 3
COUNTS = (50, 100, 200, 400)  # of labelled images
SENSOR_STEPS = 900
LONGER = (3000, 1000)  # steps; the longest first, so that all processors are busy to the end
PLAIN = EventAugmentation(invert=0.5, scale=(0.7, 2.0), shift=0.15)
FULL = train_detector.AUGMENTATION
LAST_LAYER_STEPS = 200
ALL = "all recordings"
TUNED, CONSTANT = ", last layer tuned", "the same answer everywhere, of the test's own labels"
IN_LAYERS = ("EventGAN 16, layers", "EventGAN 8, layers", "EventGAN 8, int8, layers", "difference, layers",
             "ESIM, layers", "gradient, layers", "grey frames")
TASKS = {
    "persons": Task(
        classes=(PERSON,), stills=("pennfudan", "coco256", "voc100"), clips={"sot_person": 3, "davis_tennis": 3},
        network=real_boxes.DETECTOR, development={"cdehp": 48, "obaid_d1": 26, "pedro": 1},
        columns={"ap50": "AP@0.5", "ap75": "AP@0.75", "ap": "AP@[.5:.95]", "best": "best box"}),
    "cars": Task(
        classes=("car",), stills=("coco256", "voc100", "kitti_mini"),
        clips={"cdnet_highway": 4, "cdnet_traffic": 2, "sot_car": 2, "davis_carshadow": 1, "camvid": 1}, least_px=8,
        polarity=False, network=real_boxes.DETECTOR,
        development={"davis346_clip04": 6, "gen1_drive": 4, "gen1_mosaic": 1},
        columns={"ap50": "AP@0.5", "precision": "precision", "recall": "recall", "f1": "F1", "best": "best box"},
        methods=IN_LAYERS, steps=3000),
    "joints": Task(
        classes=(PERSON,), stills=("lsp_extended",), clips={}, joints=True, polarity=False,
        network=real_joints.POSE,
        development={"cdehp": 48}, learnt={"cdehp": 48 + 60},  # the first clip, and the first two of four
        columns={"pck": "PCK@0.2 of the torso", "pckh": "PCKh@0.5", "mpjpe": "MPJPE px"},
        methods=IN_LAYERS, steps=3000),
}
# the joints of the EventGAN paper's own benchmark, whose pictures are surfaces of somebody who stands
TASKS["dhp19"] = dataclasses.replace(
    TASKS["joints"], development={"dhp19": 48}, learnt={"dhp19": 48}, surfaces=True, upright=True, steps=600,
    methods=("ESIM, clips", "ESIM, clips, all poses", "EventGAN 16, clips", "EventGAN 8, clips", "difference, clips",
             "gradient, layers", "grey frames"),
    windows=(5, 10, 20, 48))  # of the first of six clips
# what photographs' motion teaches about cars before a camera that moves
TASKS["cars_motion"] = dataclasses.replace(
    TASKS["cars"], steps=900,
    methods=(*(f"EventGAN 8{motion}" for motion in ("", ", layers", ", layers, rests 0.25", ", layers, rests 0")),
             "ESIM, layers", *(f"{name}, layers, rests 0" for name in ("ESIM", "difference", "gradient")),
             "difference", "gradient"))
TASKS["cars_motion_longer"] = dataclasses.replace(
    TASKS["cars_motion"], steps=3000, methods=("EventGAN 8, layers, rests 0", "ESIM, layers, rests 0"))
# what is lost where the network generates only what moves
TASKS |= {f"{name}_scope": dataclasses.replace(TASKS[name], steps=900,
                                               methods=("EventGAN 8, layers", "EventGAN 8, layers, motion"))
          for name in ("persons", "cars", "joints")}
# `--tune` of the trainers: how many labelled windows of a camera bring what, tested on its other clips
TASKS |= {task: dataclasses.replace(TASKS[name], learnt={"cdehp": 48 + 60},  # the first two of four clips
                                    methods=("ESIM, layers",), windows=(5, 10, 20, 50, 108), steps=600)
          for task, name in (("tuning", "persons"), ("joints_tuning", "joints"))}

Results = dict[str, list[dict[str, Any]]]  # by row, for each seed, what train_and_test gives


class Unsigned(EventAugmentation):
    """Of events without polarity, also those that it adds."""

    def sensor(self, volume: torch.Tensor) -> torch.Tensor:
        return super().sensor(volume).abs()


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
    base: Row | None = None    # it begins with that row's weights,
    last_layer: bool = False   # and learns its last layer, or all
    # so many real windows, drawn by the seed: a row with a base is tuned on these, one without sees nothing else
    windows: int | None = None

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
    alone = [(each,) for name in LAYERS for each in (name.split(", layers")[0], name)] + [("grey frames",)]
    layers = "EventGAN 16, layers"
    mixed = [("EventGAN 16", layers), (layers, f"{layers}, rests 0"), ("EventGAN 16", f"{layers}, rests 0")]
    return [Row(f"{' and '.join(sources)}, augmented, {SENSOR_STEPS} steps", sources, steps=SENSOR_STEPS)
            for sources in dict.fromkeys([*alone, *mixed])]


def task_rows(task: Task) -> list[Row]:
    """Of a task other than persons: its methods; where it has windows to learn from, networks that have learnt from
    these alone, and those that have been tuned on them: the first method's on some, all layers or the last one alone,
    the others' on most; without numbers of windows on all of a recording's, the last layer."""
    found = [Row(f"{name}, augmented, {task.steps} steps", (name,), steps=task.steps) for name in task.methods]
    if task.windows:
        real, (first, *others) = tuple(f"real {name}" for name in task.learnt), found
        tuned = [(first, what, count) for what in ("", "last layer ") for count in (0, *task.windows)]
        tuned += [(base, "", task.windows[-1]) for base in others]
        found += [Row(f"{base.name}, {what}tuned on {count} windows", base.sources + real * (count > 0), base=base,
                      last_layer=bool(what), steps=training.TUNING_STEPS, windows=count)
                  for base, what, count in tuned]
        return found + [Row(f"{count} windows alone", real, windows=count) for count in task.windows]
    for real in (f"real {name}" for name in task.learnt):
        found += [Row(f"{real}, augmented, {task.steps} steps", (real,), steps=task.steps),
                  *(Row(row.name + TUNED, (real,), steps=LAST_LAYER_STEPS, base=row, last_layer=True)
                    for row in found)]
    return found


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
    found += [Row(name, (name,)) for name in SOURCES if name.startswith("EventGAN") and name not in METHODS | OF_TASKS]
    return found + [Row(f"{name}, volume", (f"{name}, eta98",), signed=False)
                    for name in ("EventGAN 16", "difference", "ESIM")]


def train(args: argparse.Namespace, row: Row, seed: int) -> nn.Module:
    """The row's network of that seed, trained unless it has been."""
    folder, task = _run_folder(args, row, seed), args.task
    norm = nn.BatchNorm2d if row.norm == "batch" else functools.partial(nn.GroupNorm, 8)
    if not (folder / "weights.pt").exists():
        if row.base:
            train(args, row.base, seed)
        torch.manual_seed(seed)
        parts = [items_of(args, name, row.signed)[:task.learnt.get(name.removeprefix("real "))]
                 for name in row.sources]
        if row.windows:
            parts[-1] = [parts[-1][i] for i in np.random.default_rng(seed).permutation(len(parts[-1]))[:row.windows]]
        # a few windows among hundreds of photographs: each part is drawn as often
        if any(name.startswith("real ") for name in row.sources):
            most = max([BATCH if row.windows else 1, *map(len, parts)])
            parts = [part * math.ceil(most / len(part)) for part in parts]
        items = [item for part in parts for item in part]
        items = [_float(args, items[i]) for i in np.random.default_rng(seed).permutation(len(items))[:row.images]]
        folder.mkdir(parents=True, exist_ok=True)
        rate = RATE if row.last_layer or not row.base else RATE * training.TUNING_RATE
        run = argparse.Namespace(out=str(folder), batch=BATCH, lr=rate, steps=args.steps or row.steps, epochs=None,
                                 minutes=None, every=10_000, seed=seed, workers=0, device="cpu",
                                 pretrained=str(_run_folder(args, row.base, seed) / "weights.pt") if row.base else None,
                                 classes=task.classes, last_layer=row.last_layer,
                                 bfloat16=row.norm == "batch" and training.has_bfloat16())
        augmentation = row.augmentation if task.polarity else Unsigned(**dataclasses.asdict(row.augmentation))
        task.network.train(run, items, augmentation, norm)
        (folder / "checkpoint.pt").unlink()
    weights = torch.load(folder / "weights.pt")
    model = task.network.make(next(iter(weights.values())).shape[1], norm)
    model.load_state_dict(weights)
    return model.eval()


def train_and_test(args: argparse.Namespace, row: Row, seed: int) -> dict[str, Any]:
    """The scores on each recording, by its name, those of a network before its training under "untrained"."""
    path = _run_folder(args, row, seed) / f"tested-{key_of(args.test)}.json"
    if path.exists():
        return json.loads(path.read_text(encoding="utf-8"))
    model, network, first = train(args, row, seed), args.task.network, [*args.task.columns][0]
    torch.manual_seed(seed)
    untrained = network.make(len(model.eighth[0][0].weight[0]), nn.BatchNorm2d).eval()
    scores = {}
    for name, part in parts_of(args, row).items():
        scores[name] = (network.scores(part, network.find(model, part))
                        | {"untrained": network.scores(part, network.find(untrained, part))[first]})
    replace(path, lambda new: new.write_text(json.dumps(scores, indent=1) + "\n", encoding="utf-8"))
    return scores


def parts_of(args: argparse.Namespace, row: Row) -> dict[str, list[Item]]:
    """What the row is tested on: of each recording it has not learnt from, the windows behind the first ones; these
    ("development"); its grey frames; and, where rows may learn from its first windows, those behind these
    ("others"). Of tasks without numbers of windows also all recordings together."""
    found: dict[str, list[Item]] = {ALL: []}
    recordings, own = recordings_in(args, args.test), recordings_in(args, args.real)
    for recording in recordings:
        name = recording.name
        windows = [_float(args, item) for item in test_items(args, recording, row.size(), row.signed)]
        kept, seen = development_windows(args, recording), args.task.learnt.get(name, 0) if recording in own else 0
        if recording not in own or f"real {name}" not in row.sources:
            found |= {name: windows[kept:], f"{name}, development": windows[:kept]}
            # few in each; of tuned rows they would be others than of the rest
            if args.task.methods and len(recordings) > 1 and not args.task.windows:
                found[ALL] += windows[kept:]
            if row.signed:
                frames = test_items(args, recording, row.size(), shown="frames")
                found[f"{name}, grey frames"] = [_float(args, item) for item in frames[kept:]]
            else:
                found[f"{name}, as bright"] = _as_bright(windows, items_of(args, row.sources[0], False))[kept:]
        if seen:
            found[f"{name}, others"] = windows[seen:]
    return {name: part for name, part in found.items() if part}


def development_windows(args: argparse.Namespace, recording: pathlib.Path) -> int:
    """How many of the recording's first windows are in no table."""
    return args.task.development.get(recording.name, 0) if recording in recordings_in(args, args.real) else 0


def _as_bright(windows: list[Item], training_items: list[Item]) -> list[Item]:
    """With the mean of the training volumes, and clipped at 1 as these are."""
    if not windows:
        return []
    mean = [np.mean([float(item["volume"].float().mean()) for item in items])
            for items in (training_items[::10], windows)]
    return [{**item, "volume": (item["volume"] * (mean[0] / mean[1])).clamp(max=1)} for item in windows]


def _run_folder(args: argparse.Namespace, row: Row, seed: int) -> pathlib.Path:
    return args.out / "runs" / f"{file_name(row.name)}-{seed}"


def _float(args: argparse.Namespace, item: Item) -> Item:
    volume = item["volume"].float()
    return {**item, "volume": volume if args.task.polarity else volume.abs()}


def yolo(args: argparse.Namespace, name: str, seed: int) -> dict[str, Any]:
    """The scores of YOLOv3-tiny of --trainer, trained on the volumes of a source, on the recordings that have events,
    not drawings of them."""
    scores = {}
    for recording in recordings_in(args, args.test):
        if (recording / "images").is_dir():
            continue
        windows = windows_folder(args, recording, SIZE, "eta98")
        folder = args.out / "runs" / f"YOLOv3-tiny-{file_name(name)}-{seed}"
        script = pathlib.Path(train_detector.__file__).with_name("train_yolov3.py")
        command = [sys.executable, script, "--trainer", args.trainer, "--data", args.out / "shards" / file_name(name),
                   "--test", windows, "--out", folder, "--classes", PERSON, "--scale", "1", "--steps", YOLO_STEPS,
                   "--seed", seed, "--threads", "1", "--every", "1000", "--images", "0"]
        found = folder / f"predictions-{key_of(recording)}.json"
        if not found.exists():
            subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)
            (folder / "predictions.json").replace(found)
        ids = Shards(windows).column("sample_id")[development_windows(args, recording):].tolist()
        result, _, _ = evaluate_detections(found, Samples(windows, None, None, ids), [PERSON])
        scores[recording.name] = {"ap50": result["classes"][PERSON]["ap_voc"],
                                  "ap": result["classes"][PERSON]["ap_coco"]}
    return scores


def table_of(results: Results, order: Sequence[str], titles: Mapping[str, str],
             reference: str | None = None) -> list[dict[str, Any]]:
    """The lines of a CSV file, for each recording: the mean and the standard deviation over the seeds, and the
    difference from the row `reference`, seed by seed, with its range. `titles`: scores with their titles."""
    first = next(iter(titles))
    names = dict.fromkeys(name for of_seeds in results.values() for scores in of_seeds for name in scores
                          if "development" not in name)
    lines: list[dict[str, Any]] = []
    for name, row in itertools.product(names, order):
        own = [scores[name] for scores in results.get(row, []) if name in scores]
        if not own:
            continue
        line: dict[str, Any] = {"recording": name, "trained on": row, "seeds": len(own)}
        for key, title in titles.items():
            values = [each[key] for each in own if key in each]
            line |= {title: f"{np.mean(values):.2f}" if values else "",
                     f"{title} sd": f"{np.std(values):.2f}" if values else ""}
        if reference:
            others = [scores[name] for scores in results[reference] if name in scores]
            apart = [mine[first] - each[first] for mine, each in zip(own, others)]
            line["against"] = "" if row == reference else reference
            line |= {f"{titles[first]} difference{which}": "" if row == reference else f"{of_all(apart):.2f}"
                     for which, of_all in (("", np.mean), (" least", min), (" most", max))}
        lines.append(line)
    return lines


def write_table(path: pathlib.Path, lines: Sequence[Mapping[str, Any]]) -> None:
    if lines:
        with open(path, "w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, lines[0], lineterminator="\n")
            writer.writeheader()
            writer.writerows(lines)
        print(path.read_text(encoding="utf-8"))


def settings_of(args: argparse.Namespace, learnt: Sequence[Row]) -> dict[str, Any]:
    """What decides the results that are kept in OUT."""
    apart = ("network", "columns", "methods", "windows", "steps")  # what of it decides results is in rows
    sources = {name: dataclasses.replace(SOURCES[name], of_pair=None)
               for row in learnt for name in row.sources if name in SOURCES}
    return {"frames": args.frames, "real": args.real,
            "task": {each.name: getattr(args.task, each.name) for each in dataclasses.fields(args.task)
                     if each.name not in apart},
            **{f"source {name}": str(source) for name, source in sources.items()},
            **{f"row {row.name}": str(row) for row in learnt}}


def conditions(args: argparse.Namespace, images: Mapping[str, int]) -> dict[str, Any]:
    """What the tables were computed with; `images`: how many each source has."""
    with open("/proc/cpuinfo", encoding="utf-8") as file:
        found = {name.strip(): value.strip() for name, _, value in (line.partition(":") for line in file)}
    version = subprocess.run([args.program, "--version"], capture_output=True, text=True, check=True).stdout
    return {"command": shlex.join([pathlib.Path(sys.argv[0]).name, *sys.argv[1:]]),
            "processor": found.get("model name", platform.machine()), "amx": "amx_tile" in found.get("flags", ""),
            "cores": len(os.sched_getaffinity(0)), "program": version.splitlines()[0], "pytorch": torch.__version__,
            "images": images, "steps": args.task.steps or STEPS, "batch": BATCH}


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
    """OUT/images/RECORDING.png: for some windows of each part what the networks of seed 0 find."""
    models = {row.name: train(args, row, 0) for row in drawn}
    for name, items in parts_of(args, drawn[0]).items():
        items = [items[i] for i in np.unique(np.linspace(0, len(items) - 1, 4).round().astype(int))]
        columns = []
        for title, model in models.items():
            cells = map(args.task.network.draw, items, args.task.network.find(model, items))
            columns.append(np.vstack([cv2.putText(cell, title, (8, cell.shape[0] - 8), cv2.FONT_HERSHEY_SIMPLEX, 0.5,
                                                  drawing.BLACK, 1, cv2.LINE_AA) for cell in cells]))
        drawing.write(args.out / "images", file_name(name), np.hstack(columns))


def _run(task: tuple[argparse.Namespace, Row | str, int]) -> tuple[str, int, dict[str, Any]]:
    args, row, seed = task
    try:
        if isinstance(row, str):
            return f"YOLOv3-tiny, {row}", seed, yolo(args, row, seed)
        return row.name, seed, train_and_test(args, row, seed)
    except SystemExit as error:  # of a trainer: it would end the pool's process alone, and the others would wait for it
        raise RuntimeError(str(error)) from error


@dataclasses.dataclass(frozen=True)
class Section:
    """Rows with a table of their own, OUT/TASK_TITLE.csv, which are compared with one of them."""

    title: str
    rows: Sequence[Row]
    reference: str | None
    seeds: int = 1_000_000  # at most


def sections(args: argparse.Namespace) -> list[Section]:
    task = args.task
    if task.methods:
        found = task_rows(task)
        quick = found[:1] + [row for row in found if row.base == found[0] and row.windows][-1:]
        return [Section("", quick if args.quick else found, found[0].name)]
    main = rows([folder.name for folder in recordings_in(args, args.real)])
    if args.quick:
        return [Section("augmented", [row for row in main if row.name == "EventGAN 16, augmented"], None)]
    main = [row for row in main if args.peers or row.sources != ("v2e",)]
    longer = f"EventGAN 16, augmented, {SENSOR_STEPS} steps"
    return [Section("plain", [row for row in main if row.augmentation == PLAIN], "EventGAN 16"),
            Section("augmented", [row for row in main if row.augmentation == FULL], "EventGAN 16, augmented"),
            Section("drawn_sensors", drawn_sensors(), longer),
            Section("in_layers", in_layers(), longer),
            Section("one_change", ablations(), None, ABLATION_SEEDS)]


def run(args: argparse.Namespace) -> None:
    """All rows; `args`: task, program, out, frames, real, test, peers, trainer, seeds, quick, as experiment.py has
    them."""
    warnings.filterwarnings("ignore", "shipped:.* are stand-in weights")
    os.environ["EVENTGAN_PROGRAM"] = args.program
    torch.set_num_threads(1)
    args.real = args.real.resolve()
    args.frames, args.test = args.frames.resolve(), (args.test or args.real).resolve()
    args.steps = None
    if args.quick:
        args.out, args.steps, args.seeds = args.out / "quick", 60, 1
    task = args.task
    if task != "persons":
        args.out = args.out / task
    args.task = TASKS[task]
    args.out.mkdir(parents=True, exist_ok=True)
    parts = sections(args)
    tasks = sorted(((args, row, seed) for part in parts for seed in range(min(args.seeds, part.seeds))
                    for row in part.rows), key=lambda each: each[2])
    tasks = [*{(row.name, seed): (args, row, seed) for args, row, seed in tasks}.values()]
    if args.trainer and not args.task.methods and not args.quick:
        tasks += [(args, name, seed) for seed in range(min(args.seeds, ABLATION_SEEDS)) for name in SOURCES
                  if name.endswith(", eta98")]
    learnt = [row for _, row, _ in tasks if isinstance(row, Row)]
    require_same(args.out, args.program, settings_of(args, learnt))
    # What several processes read is made before there are several; the program uses all cores itself.
    images = {name: len(items_of(args, name, signed))
              for name, signed in dict.fromkeys((name, row.signed) for row in learnt for name in row.sources)}
    for row in {(row.size(), row.signed): row for row in learnt}.values():
        parts_of(args, dataclasses.replace(row, sources=row.sources[:1]))
    if len(learnt) < len(tasks):
        for recording in recordings_in(args, args.test):
            if not (recording / "images").is_dir():
                windows_of(args, recording, SIZE, "eta98")
    network, first = args.task.network, [*args.task.columns][0]
    same = {name: network.scores(items, network.constant(items))
            for name, items in parts_of(args, Row(CONSTANT, ())).items()}
    results: Results = collections.defaultdict(list, {CONSTANT: [same] * args.seeds})
    with multiprocessing.get_context("fork").Pool(len(os.sched_getaffinity(0))) as pool:
        # those with a base come last: two processes would train it at once
        in_turn = [[each for each in tasks if bool(getattr(each[1], "base", None)) == tuned] for tuned in (False, True)]
        finished = itertools.chain.from_iterable(pool.imap(_run, each) for each in in_turn)
        for done, (name, seed, scores) in enumerate(finished, 1):
            results[name].append(scores)
            print(f"{done} of {len(tasks)}: {name}, seed {seed}: "
                  + ", ".join(f"{key} {value[first]:.2f}" for key, value in scores.items()), flush=True)
    found = conditions(args, images)
    (args.out / "conditions.json").write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    for part in parts:
        write_table(args.out / f"{'_'.join(filter(None, (task, part.title)))}.csv",
                    table_of(results, [*(row.name for row in part.rows), CONSTANT], args.task.columns, part.reference))
    write_table(args.out / f"{task}_yolov3_tiny.csv",
                table_of(results, [name for name in results if name.startswith("YOLO")], args.task.columns))
    (args.out / "real.json").write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    if args.quick and args.task.methods:
        # dozens of labels and 60 steps say nothing about a recording
        summary = json.loads((_run_folder(args, learnt[0], 0) / "metrics.json").read_text(encoding="utf-8"))
        if not summary[summary["metric"]] > summary["untrained"]:
            sys.exit(f"expected a {summary['metric']} of what was learnt above that of an untrained network, "
                     f"{summary['untrained']:.3f}, got {summary[summary['metric']]:.3f}")
        return
    if args.quick:
        # of all recordings: after 60 steps the AP of one alone is noise, on one processor above, on the next below
        scores = [score for name, score in results[learnt[0].name][0].items() if "development" not in name]
        trained, untrained = (np.mean([score[key] for score in scores]) for key in (first, "untrained"))
        if not trained > untrained:
            sys.exit(f"expected scores above those of an untrained network, {untrained:.3f}, got {trained:.3f}")
        return
    drawn = parts[-1 if args.task.methods else 1].rows
    if args.task.windows:
        draw(args, [row for row in drawn if row.windows == args.task.windows[-1]])
    else:
        first = {row.name.split(",")[0]: row for row in reversed(drawn)}
        shown = [first[name] for name in ("EventGAN 16", "difference", "grey frames") if name in first]
        draw(args, shown if len(shown) > 1 else drawn[:3])
    if not args.task.methods:
        draw_curves(args, results, images["EventGAN 16"])

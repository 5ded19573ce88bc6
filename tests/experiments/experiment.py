#!/usr/bin/python3
"""The EventGAN paper's experiments on a small scale: networks trained on generated events, tested on those of a
simulated camera.

    experiment.py detection --program build/release/eventgan --trainer yolov3 --out cars
    experiment.py pose --program build/release/eventgan --trainer human-pose-estimation.pytorch --out poses
    experiment.py trade --program build/release/eventgan --trainer yolov3 --out cars
    experiment.py real --program build/release/eventgan --frames labelled_frames --real real_labels --peers peers --out
    persons
    experiment.py real --task cars --program build/release/eventgan --frames labelled_frames --real real_labels --out
    persons

detection: the demo's streets are converted by the network, by log differences and by ESIM; YOLOv3-tiny is trained on
each, and on the grey frames. The detectors of the three kinds of events are tested on the "camera's" events of other
streets, as they are and made as bright as the training volumes, that of the frames on their frames.
pose: pose_resnet is trained on the demo's figures as the network converts them, and is tested on the "camera's" events
of others: as they are, without those that stand alone, and after its last layer was trained on the camera's for 1 and
for 5 epochs; and one that was trained on the camera's alone. trade: as detection, of the network's volumes in several
widths, precisions and scopes: what their errors mean to a detector. real: detectors of persons or cars, or
networks for joints, trained on labelled photographs turned into events, on those of models and on frames, are tested on
real cameras' events.

The "camera" of the first three is the sensor model with noise, before which the scenes move as they do: drawn at 160
images a second. The same command resumes where it was.
"""

from __future__ import annotations

import argparse
import json
import pathlib
import shutil
import subprocess
import sys
from collections.abc import Mapping
from typing import Any

import numpy as np

EXAMPLES = pathlib.Path(__file__).resolve().parents[2] / "manifests" / "python" / "examples"
sys.path.append(str(EXAMPLES))  # the trainers, which find the package if it is not installed

import training
from eventgan import Shards, read_description
from eventgan.evaluate import PAPER_COLUMNS, Samples, evaluate_detections, evaluate_poses, table
from kept_settings import require_same

SIZE = {"width": 346, "height": 260}
GENERATORS = {"EventGAN": {"weights": "shipped"}, "log difference": {"kind": "difference"}, "ESIM": {"kind": "esim"}}
TRADE = {
    "EventGAN": GENERATORS["EventGAN"],  # width 16, float32; the errors of the others are taken against it
    "width 16, int8": {"weights": "shipped:16", "precision": "int8"},
    "width 16, bfloat16, motion": {"weights": "shipped:16", "precision": "bfloat16", "scope": "motion"},
    "width 8, bfloat16": {"weights": "shipped:8", "precision": "bfloat16"},
}
CAMERA = {"kind": "events"}
FRAMES_PER_SECOND = 10
BETWEEN = 15  # intermediate frames between two frames that the "camera" sees
OTHERS = ("--seed", 1_000_000, "--between", BETWEEN)  # scenes for the "camera"
# of the "camera"
SENSOR = {"threshold_spread": 0.03, "refractory_s": 0.0005, "leak_rate_hz": 0.1, "shot_noise_rate_hz": 0.2}
CATEGORIES = {0: {"category": "easy"}, 1: {"category": "hard"}, 2: {"category": "hard"}, -1: {}}  # by difficulty
TRADE_COLUMNS = {"error": "volume error"} | PAPER_COLUMNS
POSE_COLUMNS = {"mpjpe_volume": "MPJPE, volume px", "pckh": "PCKh@0.5"}  # of the EventGAN paper's Table 2
STEPS = {"detection": 200, "pose": 250, "trade": 200}


def read_args() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    shared = argparse.ArgumentParser(add_help=False)
    shared.add_argument("--program", default="eventgan", help="the eventgan program")
    shared.add_argument("--out", required=True, type=pathlib.Path,
                        help="folder for all results; run the same command again to resume")
    kinds = parser.add_subparsers(dest="what", required=True)
    for name in STEPS:
        kind = kinds.add_parser(name, parents=[shared])
        kind.add_argument("--trainer", required=True,
                          help="folder of ultralytics/yolov3, for pose of microsoft/human-pose-estimation.pytorch")
        kind.add_argument("--scenes", type=int, default=400,
                          help="synthetic sequences to train on; the camera sees a quarter as many others, at least 8")
        kind.add_argument("--steps", type=int, default=STEPS[name],
                          help="training steps of each network (default: %(default)s)")
        kind.add_argument("--seeds", type=int, default=3)
        kind.add_argument("--truth", type=pathlib.Path,
                          help="finalized folder of a camera's volumes with labels, instead of the simulated camera")
        kind.add_argument("--small", action="store_true",
                          help="8 sequences, one seed, a step: tests that it runs; the scores mean nothing")
    real = kinds.add_parser("real", parents=[shared])
    real.add_argument("--task", default="persons",
                      choices=["persons", "cars", "joints", "cars_motion", "cars_motion_longer",
                               "persons_scope", "cars_scope", "joints_scope", "dhp19", "tuning",
                               "joints_tuning"],
                      help="what is learnt (default: %(default)s); results of the others are in OUT/TASK")
    real.add_argument("--frames", required=True, type=pathlib.Path,
                      help="folder of photographs and clips with boxes.csv and frames.csv")
    real.add_argument("--real", required=True, type=pathlib.Path,
                      help="folder of real recordings with boxes, for the rows that learn from these, and to test on")
    real.add_argument("--test", type=pathlib.Path,
                      help="test on the recordings of this folder instead; detectors that are trained are kept")
    real.add_argument("--peers", type=pathlib.Path, help="folder with v2e/, a checkout of SensorsINI/v2e, for its row")
    real.add_argument("--trainer", help="folder of ultralytics/yolov3, for the rows of YOLOv3-tiny")
    real.add_argument("--seeds", type=int, default=5)
    real.add_argument("--quick", action="store_true",
                      help="first rows alone, one seed, 60 steps; fails unless it finds more than an untrained network")
    args = parser.parse_args()
    if getattr(args, "small", False):
        args.scenes, args.seeds, args.steps = 8, 1, 1
    args.out = args.out.resolve()
    return args


def run(*command: Any, **options: Any) -> None:
    print("$", *command, flush=True)
    done = subprocess.run([str(word) for word in command], **options)
    if done.returncode:
        sys.exit(f"error: expected exit code 0, got {done.returncode}, of {command[0]}")


def convert(args: argparse.Namespace, scenes: pathlib.Path, name: str, sources: list[dict[str, Any]],
            generator: Mapping[str, Any]) -> pathlib.Path:
    """SCENES/NAME, complete: volumes made by the generator, divided by their 98th percentile as in the paper."""
    folder = scenes / name
    if (folder / "dataset.json").exists():
        return folder
    # so that --frames finds the frames from anywhere
    sources = [{**source, "root": str(scenes / source["root"])} for source in sources]
    manifest = {"format": "eventgan-manifest", "version": 1, "name": name, "seed": 7, "sources": sources,
                "generator": generator,
                "image": {**SIZE, "fit": "letterbox", **({} if generator == CAMERA else {"preset": "mpii"})},
                "volume": {"bins": 9, "normalize": "eta98"},
                "output": {"directory": name, "samples_per_shard": 64, "dtype": "float16"}}
    path = scenes / f"{name}.json"
    path.write_text(json.dumps(manifest, indent=1), encoding="utf-8")
    run(args.program, "convert", path, "--progress", "none")
    return folder


def make_scenes(args: argparse.Namespace, name: str, count: int, *more: Any) -> pathlib.Path:
    """OUT/NAME: a demo dataset of so many scenes."""
    folder = args.out / name
    if not (folder / "manifest.json").exists():  # it comes last
        shutil.rmtree(folder, ignore_errors=True)
        run(args.program, "make-demo", folder, "--scenes", count, *more)
    return folder


def camera_recordings(args: argparse.Namespace, scenes: pathlib.Path, intermediate: str,
                      labelled: Shards) -> pathlib.Path:
    """A recording of each scene by the "camera", which sees each of the images in the folder SCENES/INTERMEDIATE/NAME:
    SCENES/recordings/NAME.hdf5. Its pixels are those of the volumes of `labelled`."""
    folder = scenes / "recordings"
    sources = [{"path": str(path.relative_to(scenes)), "name": path.name, "method": "difference",
                "frames_per_second": (BETWEEN + 1) * FRAMES_PER_SECOND}
               for path in sorted((scenes / intermediate).iterdir())]
    path = scenes / "camera.json"
    size = dict(zip(("width", "height"), training.place_of(labelled.labels(0))[2:]))
    path.write_text(json.dumps({"format": "eventgan-simulation", "version": 1, "name": "camera", "seed": 1,
                                "sources": sources, "size": size,
                                "sensor": SENSOR, "output": {"directory": folder.name}}, indent=1), encoding="utf-8")
    run(args.program, "simulate", path, "--progress", "none", stdout=subprocess.DEVNULL)
    return folder


def write_labels(samples: Shards, recordings: pathlib.Path) -> None:
    """The labels of each sample, at its frame's time and in the camera's pixels, beside its recording."""
    joint_names = samples.default_joints() if len(samples.persons) else []
    for i in range(len(samples)):
        sample = samples.labels(i)
        corner = np.array(training.place_of(sample)[:2])  # of the image in the volume
        columns, classes = sample["boxes"], samples.class_names(i)
        difficulty = columns.get("difficulty", np.full(len(columns["xyxy"]), -1))  # KITTI's labels have it
        boxes = [{**dict(zip(("left", "top", "right", "bottom"), box)), "class": classes[class_id],
                  **({"category": "dont_care"} if ignore else CATEGORIES[rank])}
                 for box, class_id, ignore, rank in zip((columns["xyxy_unclipped"] - np.tile(corner, 2)).tolist(),
                                                        columns["class_id"].tolist(),
                                                        columns["ignore"].tolist(), difficulty.tolist())]
        columns, places = sample["persons"], samples.joint_places(i, joint_names)
        annotated = ~(columns["joints"] == -1).all(-1)
        joints = columns["joints"] - corner
        persons = [
            {"joints": [[*joints[row, j].tolist(), *[int(seen) for seen in columns["visible"][row, [j]] if seen >= 0]]
                        if annotated[row, j] else []
                        for j in places],
             "center": (columns["center"][row] - corner).tolist(), "scale": float(columns["scale_volume"][row]),
             "head_box": (columns["head_box"][row] - np.tile(corner, 2)).tolist()} for row in range(len(joints))]
        labels = {"format": "eventgan-labels", "version": 1, "joint_names": joint_names,
                  "samples": [{"time_s": 1 / FRAMES_PER_SECOND, "boxes": boxes, "persons": persons}]}
        (recordings / f"{sample['pair']['sample_id']}.json").write_text(json.dumps(labels), encoding="utf-8")


def train(args: argparse.Namespace, script: str, name: str, data: pathlib.Path, test: pathlib.Path, seed: int,
          *options: Any, trained: pathlib.Path | None = None) -> pathlib.Path:
    """The folder of a network that was trained on `data`, for --steps unless `options` have its epochs, with what it
    finds in `test`; or of the network of the folder `trained`, which is not trained further."""
    out = args.out / "runs" / f"{name}-{seed}".replace(",", "").replace(" ", "-")
    if not (out / "predictions.json").exists():
        if trained:
            shutil.copytree(trained, out, ignore=shutil.ignore_patterns("predictions.json"), dirs_exist_ok=True)
        limit = () if "--epochs" in options else ("--steps", args.steps)
        run(sys.executable, EXAMPLES / script, "--trainer", args.trainer, "--data", data, "--out", out, "--test", test,
            "--seed", seed, "--every", 1000, *limit, *options)
    return out


def samples_of(folder: pathlib.Path) -> Samples:
    """Those that `train` tests on."""
    return Samples(folder, training.validation_split(read_description(folder)), None, None)


def pairs_of(dataset: str, splits: Mapping[str, list[int]]) -> list[dict[str, Any]]:
    """The sources of the demo's streets or figures: for each split its gaps.
    Of two splits the first has four fifths of the scenes."""
    source = {"kitti_object": {"root": "kitti/training", "pairs": {"side": "before", "choose": "one"}},
              "mpii": {"root": "mpii", "pairs": {"side": "around", "choose": "one"}}}[dataset]
    return [{"dataset": dataset, **source, **part, "pairs": {**source["pairs"], "gaps": gaps}}
            for part, gaps in zip(parts(list(splits)), splits.values())]


def parts(splits: list[str]) -> list[dict[str, Any]]:
    fractions = [[0, 1]] if len(splits) == 1 else [[0, 0.8], [0.8, 1]]
    return [{"split": split, "fraction": fraction} for split, fraction in zip(splits, fractions)]


def camera(args: argparse.Namespace, scenes: pathlib.Path, labelled: pathlib.Path, intermediate: str,
           window: Mapping[str, Any], splits: list[str]) -> pathlib.Path:
    """The folder of the "camera's" volumes of the scenes, with the labels of those of the folder `labelled`;
    or --truth."""
    if args.truth:
        return args.truth
    samples = Shards(labelled)
    recordings = camera_recordings(args, scenes, intermediate, samples)
    write_labels(samples, recordings)
    return convert(args, scenes, "events",
                   [{"dataset": "recording", "root": recordings.name, **window, **part} for part in parts(splits)],
                   CAMERA)


def detection(args: argparse.Namespace) -> dict[str, list[dict[str, float]]]:
    """The scores of each seed, by what the detectors were trained on; with `trade` the error of that, too."""
    generators = computable(args, TRADE) if args.what == "trade" else GENERATORS
    scenes, seen = make_scenes(args,
                               "scenes", args.scenes), make_scenes(args, "camera", max(args.scenes // 4, 8), *OTHERS)
    sources = pairs_of("kitti_object", {"train": [1, 2, 3], "val": [1]})
    data = {name: convert(args, scenes, name.replace(",", "").replace(" ", "-"), sources, generator)
            for name, generator in generators.items()}
    errors = {name: {"error": error_of(folder, data[next(iter(TRADE))])}
              for name, folder in data.items()} if args.what == "trade" else {}
    labelled = convert(args, seen, "labelled", pairs_of("kitti_object", {"test": [1]}), {"kind": "difference"})
    real = camera(args, seen, labelled, "kitti/training/between_2", {"window_s": 1 / FRAMES_PER_SECOND}, ["test"])
    scores: dict[str, list[dict[str, float]]] = {}
    for seed in range(args.seeds):
        scale = "--scale", 0.5 if args.small else 1.5  # cheaper than its default by half
        tests = {}
        for name, folder in data.items():
            trained, row = train(args, "train_yolov3.py", name, folder, real, seed, *scale), f"{name}, as bright"
            tests[name] = trained, real
            tests[row] = train(args, "train_yolov3.py", row, folder, real, seed, *scale, "--as-bright",
                               trained=trained), real
        if args.what == "detection":
            frames = data["log difference"]  # or any other of the same pairs: --frames leaves the events
            tests["Frame"] = train(args, "train_yolov3.py", "Frame", frames, labelled, seed,
                                   *scale, "--frames"), labelled
        for row, (out, test) in tests.items():
            result, _, _ = evaluate_detections(out / "predictions.json", samples_of(test), ["Car"])
            scores.setdefault(row, []).append(result["classes"]["Car"]
                                              | errors.get(row.removesuffix(", as bright"), {}))
    return scores


def computable(args: argparse.Namespace, generators: Mapping[str, Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    """Those of a precision that this processor can compute: bfloat16 needs AVX-512."""
    version = subprocess.run([args.program, "--version"], capture_output=True, text=True, check=True).stdout
    left_out = [] if "avx512" in version else [name for name, generator in generators.items()
                                               if generator.get("precision") == "bfloat16"]
    for name in left_out:
        print(f"{name} is left out: this processor has no AVX-512")
    return {name: generator for name, generator in generators.items() if name not in left_out}


def error_of(folder: pathlib.Path, reference: pathlib.Path) -> float:
    """Mean of |v - r| / |r| over the training volumes, both divided by their 98th percentiles."""
    volumes, references = (Shards(each, split="train", fields=["volume"]) for each in (folder, reference))
    pairs = ((volumes[i]["volume"], references[i]["volume"]) for i in range(len(references)))
    return float(np.mean([np.linalg.norm(v - r) / np.linalg.norm(r) for v, r in pairs if r.any()]))


def pose(args: argparse.Namespace) -> dict[str, list[dict[str, float]]]:
    """The scores of each seed, by what the networks were trained on."""
    scenes, seen = make_scenes(args,
                               "scenes", args.scenes), make_scenes(args, "camera", max(args.scenes // 4, 8), *OTHERS)
    made = convert(args, scenes, "EventGAN", pairs_of("mpii", {"train": [2, 4], "val": [2]}), GENERATORS["EventGAN"])
    labelled = convert(args, seen, "labelled", pairs_of("mpii", {"train": [2]}), {"kind": "difference"})
    real = camera(args, seen, labelled, "mpii/between", {"window_s": 2 / FRAMES_PER_SECOND, "label_at": "middle"},
                  ["train", "val"])
    of_camera = ("--dataset", next(iter(read_description(real)["counts"]["by_dataset"])))
    scores: dict[str, list[dict[str, float]]] = {}
    for seed in range(args.seeds):
        size = ("--size", 64, "--filters", 16) if args.small else ()
        trained = train(args, "train_pose.py", "EventGAN", made, real, seed, *size)
        row = "EventGAN, without noise"
        quiet = train(args, "train_pose.py", row, made, real, seed, *size, "--without-noise", trained=trained)
        tests = {"EventGAN": (trained, real), row: (quiet, real)}
        for epochs, name in ((1, "1 epoch"), (5, "5 epochs")):
            tuned = "--pretrained", trained / "weights.pt", "--last-layer", "--epochs", epochs, *size
            tests[f"EventGAN, last layer {name}"] = train(args, "train_pose.py", f"tuned-{epochs}", real, real, seed,
                                                          *tuned, *of_camera), real
        tests["camera"] = train(args, "train_pose.py", "camera", real, real, seed, *of_camera, *size), real
        for name, (out, test) in tests.items():
            result, _, _ = evaluate_poses(out / "predictions.json", samples_of(test))
            scores.setdefault(name, []).append(result["joints"]["all"])
    return scores


def spread(values: list[float]) -> str:
    return "-" if np.isnan(values).all() else f"{np.nanmean(values):.3f} ± {np.nanstd(values):.3f}"


def main() -> None:
    args = read_args()
    if args.what == "real":
        import real_cameras  # it needs libeventgan

        real_cameras.run(args)
        return
    require_same(args.out, args.program, {"scenes": args.scenes, "steps": args.steps, "truth": args.truth,
                                          "poses": args.what == "pose"})
    columns = {"detection": PAPER_COLUMNS, "pose": POSE_COLUMNS, "trade": TRADE_COLUMNS}[args.what]
    scores = pose(args) if args.what == "pose" else detection(args)
    rows = {name: {key: [each[key] for each in of_seeds] for key in columns} for name, of_seeds in scores.items()}
    (args.out / f"{args.what}.json").write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    print(table("", {name: {key: spread(values) for key, values in row.items()} for name, row in rows.items()},
                columns))


if __name__ == "__main__":
    main()

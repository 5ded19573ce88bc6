#!/usr/bin/python3
"""The EventGAN paper's experiments, in small, with a stand-in for the camera: networks trained on made events, tested on "real" ones.

    experiment.py detection --program build/release/eventgan --trainer ../shared/trainers/yolov3 --out cars
    experiment.py pose --program build/release/eventgan --trainer ../shared/trainers/pose_resnet --out poses

detection: the demo's streets are converted by the network, by log differences and by ESIM; YOLOv3-tiny learns on each, and on the grey frames. The
detectors of the three kinds of events are tested on the "camera's" volumes, that of the frames on frames.
pose: pose_resnet learns on the demo's figures as the network converts them, and is tested on the "camera's" volumes: as it is, and after its last layer has
learnt on the camera's for 1 and for 5 epochs; and one that has learnt on the camera's alone.

The "camera" is the sensor model with noise, moved from frame to frame along their optical flow. The same line again goes on where it was.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import pathlib
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from typing import Any

import cv2
import h5py
import numpy as np
import training
from eventgan_shards import Sample, Shards, read_description
from eventgan_shards.evaluate import PAPER_COLUMNS, Samples, evaluate_detections, evaluate_poses, table

EXAMPLES = pathlib.Path(__file__).resolve().parent
GENERATORS = {"EventGAN": {"weights": "shipped"}, "log difference": {"kind": "difference"}, "ESIM": {"kind": "esim"}}
SENSOR = {"threshold_spread": 0.03, "refractory_s": 0.0005, "leak_rate_hz": 0.1, "shot_noise_rate_hz": 0.2}  # of the "camera"
FRAMES_PER_SECOND = 10
POSE_COLUMNS = {"mpjpe_volume": "MPJPE, volume px", "pckh": "PCKh@0.5"}  # of the EventGAN paper's Table 2


def read_args() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=["detection", "pose"])
    parser.add_argument("--program", default="eventgan", help="the eventgan program")
    parser.add_argument("--trainer", required=True, help="detection: folder of ultralytics/yolov3; pose: of microsoft/human-pose-estimation.pytorch")
    parser.add_argument("--out", required=True, type=pathlib.Path, help="folder for everything; the same line again goes on")
    parser.add_argument("--scenes", type=int, default=400)
    parser.add_argument("--minutes", type=float, default=6.0, help="that each network learns")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--truth", type=pathlib.Path, help="finalized folder of a camera's volumes with labels, in place of the stand-in")
    parser.add_argument("--small", action="store_true", help="15 scenes, one seed, 5 steps: whether it runs, not what comes out")
    args = parser.parse_args()
    if args.small:
        args.scenes, args.seeds = 15, 1
    args.out = args.out.resolve()
    return args


def run(*command: Any, **options: Any) -> None:
    print("$", *command, flush=True)
    done = subprocess.run([str(word) for word in command], **options)
    if done.returncode:
        sys.exit(f"error: expected exit code 0, got {done.returncode}, of {command[0]}")


def manifest(demo: pathlib.Path, name: str, dataset: str, generator: Mapping[str, Any], splits: Mapping[str, list[int]]) -> dict[str, Any]:
    """The demo's own, of these splits of the dataset alone, each with its gaps. Volumes of events are divided by their 98th percentile, as in the
    paper."""
    text = re.sub(r"(?m)^\s*//.*$", "", (demo / "manifest.json").read_text(encoding="utf-8"))
    whole = json.loads(text)
    sources = [source for source in whole["sources"] if source["dataset"] == dataset and source.get("split", "train") in splits]
    for source in sources:
        source["pairs"]["gaps"] = splits[source.get("split", "train")]
    # Not compressed, so that volumes can be exchanged in place.
    return {**whole, "name": name, "sources": sources, "generator": generator,
            "volume": {"bins": 9, "normalize": "none" if name == "frames" else "eta98"},
            "output": {"directory": name, "samples_per_shard": 64, "dtype": "float16", "deflate_level": 0}}


def convert(args: argparse.Namespace, name: str, dataset: str, generator: Mapping[str, Any], splits: Mapping[str, list[int]],
            volume_of: Callable[[Sample], np.ndarray] | None = None) -> pathlib.Path:
    """OUT/demo/NAME, finalized: its volumes made by the generator or, where it is given, by `volume_of`."""
    demo = args.out / "demo"
    folder = demo / name
    if (folder / "dataset.json").exists():
        return folder
    if volume_of:  # half of them may be exchanged
        shutil.rmtree(folder, ignore_errors=True)
    path = demo / f"{name}.json"
    path.write_text(json.dumps(manifest(demo, name, dataset, generator, splits), indent=1), encoding="utf-8")
    run(args.program, "convert", path, "--progress", "none")
    if volume_of:
        exchange_volumes(folder, volume_of)
    run(args.program, "finalize", folder)
    return folder


def exchange_volumes(folder: pathlib.Path, volume_of: Callable[[Sample], np.ndarray]) -> None:
    """Puts `volume_of` each sample, [2B, H, W] from 0 to 1, in place of its volume, with its statistics, and the shards' new hashes into their
    markers."""
    for path in sorted(folder.glob("*.h5")):
        with h5py.File(path, "r+") as file, Shards(path) as samples:
            for sample in (samples.labels(i) for i in range(len(samples))):
                slot, volume = sample["slot"], volume_of(sample).astype(np.float16).astype(float)
                file["events/volume"][slot] = volume
                positive, negative = volume.reshape(2, -1)
                file["events/eta98"][slot] = eta98(volume)
                for name, value in {"nonzero_fraction": (volume > 0).mean(), "sum_positive": positive.sum(), "sum_negative": negative.sum(),
                                    "max": volume.max(), "flags": not volume.any()}.items():
                    file["events/statistics"][name][slot] = value
        marker = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
        marker.update(size_bytes=path.stat().st_size, sha256=hashlib.sha256(path.read_bytes()).hexdigest())
        path.with_suffix(".json").write_text(json.dumps(marker), encoding="utf-8")


def eta98(volume: np.ndarray) -> float:
    """The 98th percentile of the values that are not zero, as shards have it; 0 if there are none."""
    values = np.sort(volume[volume > 0])
    return float(values[max(int(0.98 * len(values)), 1) - 1]) if len(values) else 0.0


def place_of(sample: Sample) -> tuple[int, int, int, int]:
    """Where the picture lies in the volume, in whole pixels: left, top, width, height."""
    (scale_x, _, x), (_, scale_y, y) = sample["pair"]["source_to_volume"]
    height, width = sample["pair"]["source_size"]
    return round(x - scale_x / 2 + 0.5), round(y - scale_y / 2 + 0.5), round(width * scale_x), round(height * scale_y)


def frame_volume(demo: pathlib.Path, shape: tuple[int, int, int], sample: Sample) -> np.ndarray:
    """The labelled frame, grey from 0 to 1, in the first channel."""
    picture = cv2.imread(str(demo / sample["pair"]["next_path"]), cv2.IMREAD_GRAYSCALE)
    left, top, width, height = place_of(sample)
    volume = np.zeros(shape, np.float32)
    volume[0, top:top + height, left:left + width] = cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA) / 255
    return volume


def camera(args: argparse.Namespace, dataset: str, splits: Mapping[str, list[int]]) -> pathlib.Path:
    """The folder of the "camera's" volumes, or --truth."""
    if args.truth:
        return args.truth
    placed = Shards(convert(args, "placed", dataset, {"kind": "difference"}, splits))  # for the frames and labels; its volumes are not used
    recordings = simulate(args, placed)
    shape = placed[0]["volume"].shape
    return convert(args, "camera", dataset, {"kind": "difference"}, splits, lambda sample: camera_volume(recordings, shape, sample))


def simulate(args: argparse.Namespace, placed: Shards) -> pathlib.Path:
    """A recording of the "camera" for each sample, from its previous to its next frame: SAMPLE.hdf5 in the folder."""
    demo, folder = args.out / "demo", args.out / "camera"
    sources = []
    for i in range(len(placed)):
        pair = placed.labels(i)["pair"]
        frames = folder / "frames" / pair["sample_id"]
        frames.mkdir(parents=True, exist_ok=True)
        for number, name in enumerate(("prev_path", "next_path")):
            shutil.copy(demo / pair[name], frames / (str(number) + pathlib.Path(pair[name]).suffix))
        sources.append({"path": f"frames/{pair['sample_id']}", "name": pair["sample_id"], "frames_per_second": FRAMES_PER_SECOND})
    _, _, width, height = place_of(placed.labels(0))
    path = folder / "camera.json"
    path.write_text(json.dumps({"format": "eventgan-simulation", "version": 1, "name": "camera", "seed": 1, "sources": sources, "sensor": SENSOR,
                                "size": {"width": width, "height": height}, "output": {"directory": "recordings"}}, indent=1), encoding="utf-8")
    run(args.program, "simulate", path, "--progress", "none", stdout=subprocess.DEVNULL)
    return folder / "recordings"


def camera_volume(recordings: pathlib.Path, shape: tuple[int, int, int], sample: Sample) -> np.ndarray:
    """The volume of the sample's recording: each event spread over the two bins nearest to it in time, positive ones first; divided by its
    own 98th percentile, as the paper does, and cut to 1."""
    left, top, _, _ = place_of(sample)
    with h5py.File(recordings / (sample["pair"]["sample_id"] + ".hdf5")) as file:
        x, y, t, polarity = file["davis/left/events"][:].T
    volume = np.zeros(shape)
    if not len(t):
        return volume
    last = shape[0] // 2 - 1
    at = last * (t - t[0]) / max(t[-1] - t[0], 1e-9)
    lower = np.minimum(np.floor(at), last - 1)
    for channel, weight in ((lower, 1 - (at - lower)), (lower + 1, at - lower)):
        rows = (channel + (last + 1) * (polarity < 0)).astype(int), y.astype(int) + top, x.astype(int) + left
        np.add.at(volume, rows, weight)
    return np.minimum(volume / eta98(volume), 1)


def train(args: argparse.Namespace, script: str, name: str, data: pathlib.Path, test: pathlib.Path, seed: int, *options: Any) -> pathlib.Path:
    """The folder of a network that has learnt on `data`, with what it finds in `test`."""
    out = args.out / "runs" / f"{name}-{seed}".replace(" ", "-")
    if not (out / "predictions.json").exists():
        limits = options or (["--steps", 5] if args.small else ["--minutes", args.minutes])
        run(sys.executable, EXAMPLES / script, "--trainer", args.trainer, "--data", data, "--out", out, "--test", test, "--seed", seed, "--every", 1000,
            *limits)
    return out


def samples_of(folder: pathlib.Path) -> Samples:
    """Those that `train` tests on."""
    return Samples(folder, training.checked_split(read_description(folder)), None, None)


def detection(args: argparse.Namespace) -> dict[str, list[dict[str, float]]]:
    """The scores of each seed, by what the detectors have learnt on."""
    both, dataset = {"train": [1, 2, 3], "val": [1]}, "kitti_object"
    data = {name: convert(args, name.replace(" ", "-"), dataset, generator, both) for name, generator in GENERATORS.items()}
    real = camera(args, dataset, {"val": [1]})
    shape = Shards(data["EventGAN"])[0]["volume"].shape
    data["Frame"] = convert(args, "frames", dataset, {"kind": "difference"}, both, lambda sample: frame_volume(args.out / "demo", shape, sample))
    scores: dict[str, list[dict[str, float]]] = {}
    for seed in range(args.seeds):
        for name, folder in data.items():
            test = folder if name == "Frame" else real
            out = train(args, "train_yolov3.py", name, folder, test, seed)
            result, _, _ = evaluate_detections(out / "predictions.json", samples_of(test), ["Car"])
            scores.setdefault(name, []).append(result["classes"]["Car"])
    return scores


def pose(args: argparse.Namespace) -> dict[str, list[dict[str, float]]]:
    """The scores of each seed, by what the networks have learnt on."""
    dataset = "mpii"
    made = convert(args, "EventGAN", dataset, GENERATORS["EventGAN"], {"train": [2, 4], "val": [2]})
    real = camera(args, dataset, {"train": [2], "val": [2]})
    scores: dict[str, list[dict[str, float]]] = {}
    for seed in range(args.seeds):
        learnt = train(args, "train_pose.py", "EventGAN", made, real, seed)
        outs = {"EventGAN": learnt}
        for epochs, name in ((1, "1 epoch"), (5, "5 epochs")):
            tuned = "--pretrained", learnt / "weights.pt", "--last-layer", "--epochs", epochs
            outs[f"EventGAN, last layer {name}"] = train(args, "train_pose.py", f"tuned-{epochs}", real, real, seed, *tuned)
        outs["camera"] = train(args, "train_pose.py", "camera", real, real, seed)
        for name, out in outs.items():
            result, _, _ = evaluate_poses(out / "predictions.json", samples_of(real))
            scores.setdefault(name, []).append(result["joints"]["all"])
    return scores


def spread(values: list[float]) -> str:
    return "-" if np.isnan(values).all() else f"{np.nanmean(values):.3f} ± {np.nanstd(values):.3f}"


def main() -> None:
    args = read_args()
    if not (args.out / "demo" / "manifest.json").exists():  # it comes last
        shutil.rmtree(args.out / "demo", ignore_errors=True)
        run(args.program, "make-demo", args.out / "demo", "--scenes", args.scenes)
    columns = PAPER_COLUMNS if args.what == "detection" else POSE_COLUMNS
    scores = detection(args) if args.what == "detection" else pose(args)
    rows = {name: {key: [each[key] for each in of_seeds] for key in columns} for name, of_seeds in scores.items()}
    (args.out / "scores.json").write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    print(table("", {name: {key: spread(values) for key, values in row.items()} for name, row in rows.items()}, columns))


if __name__ == "__main__":
    main()

#!/usr/bin/python3
"""Networks for optical flow that learn from photographs, of which every pixel's motion is known, tested on the real
events of cameras.

    supervised_flow.py --program build/release/eventgan --frames labelled_frames/coco256 labelled_frames/voc100
    --recordings recordings slider_depth_mvsec_layout.hdf5 --out flows

Each photograph is a clip, in which image and labelled objects move on their own; each way of making its events has a
row, of the same motions, and of ESIM's there are some with other motions or fewer photographs. The network and its
training are those of train_flow.py; networks see no recording. Scored is how far the previous frame, moved by the flow,
is from the next one at pixels with events, as a share of that without flow. The controls have learnt nothing: among
them is what the network has at first, the flow by least squares, and the best constant flow, which is chosen on the
test. The same command resumes.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import io
import json
import pathlib
import subprocess
import sys
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import recordings
import self_supervised
import torch
import train_flow
import training
from kept_settings import require_same, write
from self_supervised import CONTROLS, REAL, Pair

TRAINER = pathlib.Path(train_flow.__file__)
SOURCES = [TRAINER, pathlib.Path(training.__file__)]  # of what a network is and how it learns
UNTAUGHT = "least squares"  # the network that has learnt nothing
SIDE, CLIP = 160, 5  # pixels of the volumes; frames of each photograph


def motion(times: float = 1) -> dict[str, Any]:
    """In pixels of the photographs, which are two to three times as large as the volumes: half of all pixels move by
    less than 2 px there, a hundredth by more than 7."""
    return {"translation_px": [0, 7 * times], "rotation_deg": times, "scale": 0.02 * times, "rests": 0,
            "objects": {"translation_px": [0, 7 * times], "rotation_deg": 2 * times, "scale": 0.03 * times,
                        "rests": 0.25}}


class Row(NamedTuple):
    """What makes the events, how the photographs move, and which share of them is taken."""

    generator: dict[str, Any]
    motion: dict[str, Any] = motion()
    share: float = 1


ESIM = {"kind": "esim"}
WHOLE = {key: value for key, value in motion().items() if key != "objects"}
ROWS = {"EventGAN 8": Row({"weights": "shipped:8"}), "EventGAN 16": Row({"weights": "shipped:16"}), "esim": Row(ESIM),
        "difference": Row({"kind": "difference"}), "esim, image and objects as one": Row(ESIM, WHOLE),
        "esim, half as far": Row(ESIM, motion(0.5)), "esim, twice as far": Row(ESIM, motion(2)),
        "esim, a tenth of the photographs": Row(ESIM, share=0.1),
        "esim, a third of the photographs": Row(ESIM, share=0.33)}


def read_args() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", default="eventgan", help="the eventgan program")
    parser.add_argument("--frames", required=True, nargs="+", type=pathlib.Path,
                        help="folders of photographs: `images`, and boxes.csv if there are objects in them")
    parser.add_argument("--recordings", required=True, nargs="+", type=pathlib.Path,
                        help="recordings in MVSEC's layout, or folders of such")
    parser.add_argument("--out", required=True, type=pathlib.Path,
                        help="folder for shards, networks, results.json and table.csv")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--steps", type=int, default=train_flow.STEPS)
    parser.add_argument("--with", nargs="*", choices=ROWS, default=[*ROWS], dest="rows", metavar="ROW",
                        help=f"only these rows, of: {'; '.join(ROWS)}; without one only the controls")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--bfloat16", action="store_true", help="as of train_flow.py")
    args = parser.parse_args()
    args.out = args.out.resolve()
    return args


def photographs(args: argparse.Namespace, row: str) -> pathlib.Path:
    """The folder of the row's shards, made if it is not there yet."""
    folder = args.out / "photographs" / row.replace(",", "").replace(" ", "-")
    generator, motion_of_row, share = ROWS[row]
    if not (folder / "dataset.json").exists():
        sources = []
        for frames in map(pathlib.Path.resolve, args.frames):
            sources.append({"dataset": "frames", "root": str(frames / "images"), "flow": True,
                            "fraction": [0, share],
                            "pairs": {"from": "stills", "frames": CLIP, "motion": motion_of_row}})
            if (frames / "boxes.csv").exists():
                sources[-1]["labels"] = {"path": str(frames / "boxes.csv"), "format": "csv"}
            if (frames / "masks").is_dir():
                sources[-1]["outlines"] = str(frames / "masks")
        manifest = {"format": "eventgan-manifest", "version": 1, "name": folder.name, "sources": sources,
                    "image": {"width": SIDE, "height": SIDE, "fit": "crop", "preset": "kitti"},
                    "generator": generator, "output": {"directory": folder.name}}
        folder.parent.mkdir(parents=True, exist_ok=True)
        file = folder.with_name(f"{folder.name}.json")
        file.write_text(json.dumps(manifest, indent=1), encoding="utf-8")
        subprocess.run([args.program, "convert", file, "--threads", str(args.threads), "--progress", "none"],
                       check=True, stdout=subprocess.DEVNULL)
    return folder


def version(args: argparse.Namespace) -> str:
    """Another one once the trainer, or what of its options decides a result, has changed."""
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in SOURCES)).hexdigest()[:8]
    return f"trainer {digest}{' bfloat16' * args.bfloat16}"


def learnt(args: argparse.Namespace, row: str, name: str, seed: int) -> train_flow.FlowNetwork:
    """The row's network, in its evaluation mode; what has been trained is kept under the name."""
    out = args.out / "networks" / name.replace(",", "").replace(" ", "-")
    if not (out / "scores.json").exists():
        subprocess.run([sys.executable, TRAINER, "--data", photographs(args, row), "--out", out, "--seed", str(seed),
                        "--steps", str(args.steps), "--threads", str(args.threads), "--images", "2",
                        *(["--bfloat16"] if args.bfloat16 else [])], check=True)
    network = train_flow.FlowNetwork(2 * recordings.BINS)
    network.load_state_dict(torch.load(out / "weights.pt", weights_only=True))
    return network.eval()


def error_of(network: train_flow.FlowNetwork, pairs: Sequence[Pair]) -> float:
    """Of the previous frames, moved by the network's flow, in grey levels."""
    def error(previous: torch.Tensor, following: torch.Tensor, volume: torch.Tensor) -> float:
        flow = train_flow.predict(network, volume[0])  # of stills that end with the labelled image
        return train_flow.errors_of_frames(flow, 1, previous, following, volume)[0]

    return 127.5 * float(np.mean([error(*self_supervised.tensors([pair])) for pair in pairs]))


def main() -> None:
    args = read_args()
    torch.set_num_threads(args.threads)
    paths = [path for half in self_supervised.halves_of(args.recordings) for path in half]
    require_same(args.out, args.program, {"frames": [frames.resolve() for frames in args.frames],
                                          "recordings": {path.stem: path.stat().st_size for path in paths}})
    tests = {path.stem: self_supervised.read_pairs(args, REAL, path) for path in paths}
    file = args.out / "results.json"
    results = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}

    def kept(name: str, measure: Any) -> dict[str, float]:
        """Errors by recording."""
        if name not in results:
            results[name] = {recording: measure(pairs) for recording, pairs in tests.items()}
            write(file, json.dumps(results, indent=1) + "\n")
        return results[name]

    rows = {name: [kept(name, lambda pairs, name=name: self_supervised.control_scores(name, pairs)["error"])]
            for name in CONTROLS}
    rows[UNTAUGHT] = [kept(f"{UNTAUGHT}, {version(args)}",
                           lambda pairs: error_of(train_flow.FlowNetwork(2 * recordings.BINS).eval(), pairs))]
    plain = np.array([*rows[next(iter(CONTROLS))][0].values()])
    for seed in range(args.seeds):  # all rows of a seed first: they can be compared early
        for row in args.rows:
            name = f"{row}, {args.steps} steps, seed {seed}, {version(args)}"
            if name not in results:
                network = learnt(args, row, name, seed)
                kept(name, lambda pairs, network=network: error_of(network, pairs))
            rows.setdefault(row, []).append(results[name])
            print(name, round(float(np.mean([*results[name].values()] / plain)), 3), flush=True)
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(["learnt on", "steps", "seeds", "mean", "sd", *tests])
    for row, of_seeds in rows.items():
        shares = np.array([[*each.values()] for each in of_seeds]) / plain  # [seed, recording]
        means = shares.mean(1)
        writer.writerow([row, args.steps if row in ROWS else 0, len(shares), f"{means.mean():.3f}",
                         f"{means.std():.3f}" if len(means) > 1 else "", *(f"{share:.2f}" for share in shares.mean(0))])
    write(args.out / "table.csv", table.getvalue())
    print(table.getvalue())


if __name__ == "__main__":
    main()

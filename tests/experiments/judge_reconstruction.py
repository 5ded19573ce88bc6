#!/usr/bin/python3
"""How well FireNet+, a network that was trained on events of other origin, reconstructs images from generated event
volumes, and from a camera's.

    judge_reconstruction.py --program build/release/eventgan --recordings recordings slider_depth.hdf5 --judge model.pth
    --peers peers --out judge

Each recording's windows, the intervals between its frames, are given to the network one after the other: as the
camera's volumes, and as those that each method makes of the frames. Image t is compared (SSIM) with the frame at the
end of window t, as a whole and around the pixels where the camera has events, and with the image of the camera's
events. All images are normalised by their 1st and 99th percentile. OUT gets results.json, judge.csv, and an image of
each recording; the same command resumes.

Recordings of large sensors are reduced to the size of a DAVIS before anything else, events and frames alike: EVREAL
uses the network at such sizes.

The volumes of a row are multiplied by one factor for each recording, with which they sum up to as many events as the
camera's: the network's are no counts, and FireNet+ is not blind to brightness.
Not counted are a recording's first images (SETTLING; of a short recording all but the last), in which what has not
moved yet is missing, and windows whose events do not fit the frames: where the sum of polarities correlates with the
change of log intensity by less than LEAST_CORRELATION. Their volumes are given to the network all the same, or its
state would miss what moved.

To read the table: the frames are both what methods make events of and what images are compared with, so a quotient
above 1 does not mean "more real". A camera's events have noise: the row "camera, denoised" (without pixels with events
that have fewer than two such neighbours) shows what that costs. Its frames may be blurred by motion, and the image of
its events be sharper than the frame. And SSIM of whole images is mostly that of what is flat or does not move: see the
row "flat grey", an image of one value. Where the camera has events it says more, and how like an image is to that of
the camera's events does not ask the frames at all.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import json
import pathlib
import warnings
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import cv2
import numpy as np
import torch
from recordings import METHODS, frames_of, real_volumes  # first: it finds the package and the trainers

import training
from eventgan.drawing import write
from kept_settings import require_same
from reconstruction import load_firenet, reconstruct, robust_normalized, ssim, ssim_map

LONGEST_PX = 346  # a DAVIS346's
SETTLING = 3  # images: the SSIM of the long recordings rises until then
LEAST_CORRELATION = 0.5
CAMERA, DENOISED, FLAT = "camera", "camera, denoised", "flat grey"
CONTROLS = (CAMERA, DENOISED, FLAT)
TILE_PX, TILES = 240, 6  # width in the images, and how many in a line


def read_args() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", default="eventgan", help="the eventgan program")
    parser.add_argument("--recordings", required=True, nargs="+", type=pathlib.Path,
                        help="HDF5 files in MVSEC's layout, and folders of such")
    parser.add_argument("--judge", required=True, type=pathlib.Path,
                        help="weights of FireNet+ (EVREAL's pretrained/FireNet+/model.pth)")
    parser.add_argument("--peers", type=pathlib.Path, help="folder with v2e, a checkout of SensorsINI/v2e")
    parser.add_argument("--with", dest="methods", nargs="+", choices=METHODS, default=list(METHODS), metavar="METHOD",
                        help=f"of {', '.join(map(repr, METHODS))} (default: all)")
    parser.add_argument("--after", nargs="+", default=[], metavar="NAME=FRAME",
                        help="of these recordings only windows from that frame on count: the "
                        "weights have seen what is before (manifests/weights/train-*.json)")
    parser.add_argument("--out", required=True, type=pathlib.Path,
                        help="folder for all results; run the same command again to resume")
    args = parser.parse_args()
    if args.peers is None and any(name.startswith("v2e") for name in args.methods):
        parser.error("expected --peers for v2e, got none (--with leaves it out)")
    try:
        args.after = {name: int(frame) for name, frame in (each.split("=") for each in args.after)}
    except ValueError:
        parser.error(f"expected --after NAME=FRAME, got {' '.join(args.after)}")
    args.recordings = [path for given in args.recordings
                       for path in (sorted(given.glob("*.hdf5")) if given.is_dir() else [given])]
    if len({path.stem for path in args.recordings}) < max(len(args.recordings), 1):
        parser.error("expected recordings of different names, got none or some twice, in --recordings")
    if not {*args.after} <= {path.stem for path in args.recordings}:
        parser.error(f"expected recordings of {', '.join(path.stem for path in args.recordings)}, got "
                     f"{', '.join(args.after)}, in --after")
    return args


def reduced(frames: np.ndarray, volumes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frames and volumes as of a camera with fewer, larger pixels, by the least whole factor with which no side is
    longer than LONGEST_PX: means over blocks of pixels, for an edge makes as many events in a large pixel as in a small
    one."""
    factor = -(-max(frames.shape[1:]) // LONGEST_PX)
    height, width = (side // factor for side in frames.shape[1:])

    def means(images: np.ndarray) -> np.ndarray:
        blocks = images[..., :height * factor,
                        :width * factor].reshape(*images.shape[:-2], height, factor, width, factor)
        return blocks.mean((-3, -1), dtype=np.float32)

    return (frames, volumes) if factor == 1 else (means(frames).round().astype(np.uint8),
                                                  np.stack([means(volume) for volume in volumes]))


def correlation(volume: np.ndarray, previous: np.ndarray, following: np.ndarray) -> float:
    """Of the sum of polarities with the change of log intensity, both blurred (sigma 1 px)."""
    positive, negative = volume.reshape(2, -1, *previous.shape).sum(1)
    change = np.log((following + 1.0) / (previous + 1.0))
    return float(np.corrcoef(*(cv2.GaussianBlur(one.astype(np.float64), (0, 0), 1).ravel()
                               for one in (positive - negative, change)))[0, 1])


def counted_windows(real: np.ndarray, frames: np.ndarray) -> list[int]:
    """Which windows' images count (see above)."""
    first = min(SETTLING, len(real) - 1)
    return [i for i in range(first, len(real)) if correlation(real[i], frames[i], frames[i + 1]) >= LEAST_CORRELATION]


def volume_maker(row: str, real: np.ndarray, frames: np.ndarray,
                 peers: pathlib.Path | None) -> Callable[[int], np.ndarray]:
    """The window's number -> the row's volume of it, float32 [2B, H, W]."""
    if row == CAMERA:
        return lambda i: real[i]
    if row == DENOISED:
        return lambda i: training.without_noise({"volume": real[i]})
    if row == FLAT:
        return lambda i: np.zeros_like(real[i])
    method = METHODS[row](frames, real.sum((1, 2, 3)), peers)
    return lambda i: method(frames[i], frames[i + 1])


def judge_recording(args: argparse.Namespace, network: torch.nn.Module, path: pathlib.Path,
                    done: dict[str, Any]) -> Iterable[None]:
    """Adds the scores of each row to `done`, and writes its image of the middle window; yields after each."""
    rows = [*CONTROLS, *args.methods]
    if all(row in done.get("rows", {}) for row in rows):
        return
    frames, real = reduced(frames_of(path)[0], real_volumes(args.program, path, args.out / "volumes" / path.stem))
    counted = counted_windows(real, frames)
    if not counted:
        raise SystemExit(f"expected windows whose events fit the frames, got none, in {path}")
    done.update(windows=len(real), counted=counted)
    references = [robust_normalized(frame) for frame in frames[1:]]
    real_images = [robust_normalized(image) for image in reconstruct(network, real)]
    # the pixels that an SSIM's map has
    there = [training.without_noise({"volume": volume}).any(0)[5:-5, 5:-5] for volume in real]
    middle = counted[len(counted) // 2]
    write(args.out / path.stem, "frame", _image(references[middle]))
    for row in rows:
        if row in done.setdefault("rows", {}):
            continue
        volume = volume_maker(row, real, frames, args.peers)
        share = sum(volume(i).sum(dtype=np.float64) for i in range(len(real))) / real.sum(dtype=np.float64)
        scaled = (volume(i) / np.float32(share) for i in range(len(real)))
        images = (real_images if row == CAMERA else [np.full_like(image, 0.5) for image in real_images] if row == FLAT
                  else [robust_normalized(image) for image in reconstruct(network, scaled)])
        maps = [ssim_map(*pair) for pair in zip(images, references)]
        write(args.out / path.stem, row, _image(images[middle]))
        done["rows"][row] = {"events": share, "frame": [each.mean() for each in maps],
                             "moving": [each[at].mean() for each, at in zip(maps, there)],
                             "camera": [ssim(*pair) for pair in zip(images, real_images)]}
        yield


def _image(image: np.ndarray) -> np.ndarray:
    return cv2.cvtColor((255 * image).round().astype(np.uint8), cv2.COLOR_GRAY2BGR)


def draw(folder: pathlib.Path, rows: Iterable[str]) -> None:
    """FOLDER.png: the frame at the end of the middle window and each row's image of it, TILES side by side."""
    tiles = []
    for row in ("frame", *rows):
        image = cv2.imread(str(folder / f"{row}.png"))
        height, width = image.shape[:2]
        tile = cv2.resize(image, (TILE_PX, round(height * TILE_PX / width)),
                          interpolation=cv2.INTER_AREA if width > TILE_PX else cv2.INTER_CUBIC)
        tile = cv2.copyMakeBorder(tile, 18, 0, 0, 4, cv2.BORDER_CONSTANT, value=(255, 255, 255))
        cv2.putText(tile, row, (2, 13), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (0, 0, 0), 1, cv2.LINE_AA)
        tiles.append(tile)
    tiles += [np.full_like(tiles[0], 255)] * (-len(tiles) % TILES)
    write(folder.parent, folder.name, np.vstack([np.hstack(tiles[i:i + TILES]) for i in range(0, len(tiles), TILES)]))


def mean(one: Mapping[str, Any], row: str, measure: str) -> float:
    """Of a recording's results, over the windows that count."""
    return float(np.mean([one["rows"][row][measure][i] for i in one["counted"]]))


MEASURES: dict[str, Callable[[Mapping[str, Any], str], float]] = {  # of a recording's results and a row
    "SSIM with the frame": lambda one, row: mean(one, row, "frame"),
    "SSIM with the frame, generated ÷ camera": lambda one, row: mean(one, row, "frame") / mean(one, CAMERA, "frame"),
    "SSIM where the camera has events": lambda one, row: mean(one, row, "moving"),
    "SSIM where the camera has events, generated ÷ camera": lambda one, row: mean(one, row, "moving")
    / mean(one, CAMERA, "moving"),
    "SSIM with the image of the camera's events": lambda one, row: mean(one, row, "camera"),
    "events, generated ÷ camera, before they are scaled": lambda one, row: one["rows"][row]["events"],
}


def scores_of(results: Mapping[str, Any], rows: Iterable[str]) -> dict[str, dict[str, dict[str, float]]]:
    """By measure and row, of each recording and the mean of them."""
    scores = {title: {row: {name: measure(one, row) for name, one in results.items()} for row in rows}
              for title, measure in MEASURES.items()}
    return {title: {row: {**values, "mean": float(np.mean(list(values.values())))} for row, values in by_row.items()}
            for title, by_row in scores.items()}


def main() -> None:
    args = read_args()
    try:
        network = load_firenet(args.judge)
    except (OSError, ValueError) as error:
        raise SystemExit(str(error))
    file = args.out / "results.json"
    require_same(args.out, args.program, {"judge": hashlib.sha256(args.judge.read_bytes()).hexdigest(),
                                          **{path.stem: path.stat().st_size for path in args.recordings}})
    kept: dict[str, Any] = (json.loads(file.read_text(encoding="utf-8")) if file.exists() else {"recordings": {}})
    rows = [*CONTROLS, *args.methods]
    for path in args.recordings:
        done = kept["recordings"].setdefault(path.stem, {})
        for _ in judge_recording(args, network, path, done):
            file.with_suffix(".new").write_text(json.dumps(kept, indent=1), encoding="utf-8")
            file.with_suffix(".new").replace(file)
            print(f"{path.stem}: {len(done['rows'])} of {len(rows)} rows", flush=True)
        draw(args.out / path.stem, rows)
    results = {path.stem: kept["recordings"][path.stem] for path in args.recordings}
    for name, one in results.items():
        one["counted"] = [i for i in one["counted"] if i >= args.after.get(name, 0)]
        if not one["counted"]:
            raise SystemExit(f"expected windows from frame {args.after[name]} on that count, got none, in {name}")
    text = "; ".join(f"{name}: {len(one['counted'])} of {one['windows']} windows count"
                     for name, one in results.items()) + ".\n"
    print(text)
    with open(args.out / "judge.csv", "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["measure", "events of", *results, "mean"])
        for title, by_row in scores_of(results, rows).items():
            writer.writerows([title, row, *(f"{value:.3f}" for value in of_row.values())]
                             for row, of_row in by_row.items())
    print((args.out / "judge.csv").read_text(encoding="utf-8"))


if __name__ == "__main__":
    warnings.filterwarnings("ignore", "shipped:.* are stand-in weights")
    main()

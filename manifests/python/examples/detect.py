#!/usr/bin/python3
"""Finds the objects in a camera's events, with the detector.pt that train_detector.py has written beside this file.

    ./detect.py recording.npz > boxes.csv

Needs NumPy and PyTorch, for HDF5 h5py, for pictures OpenCV. A recording has x, y, p and t (microseconds, or seconds if
floating-point): .npy, .npz, or HDF5 in MVSEC's or DSEC's layout, as eventgan simulates and exports. Live:

    import detect
    detector = detect.Detector("detector.pt")
    for window in camera:  # arrays t, x, y, p by name
        boxes, classes, scores = detector(window, (height, width))
"""

import argparse
import csv
import json
import os
import pathlib
import re
import sys

import numpy as np
import torch


class Detector:
    def __init__(self, path):
        files = {"detector.json": ""}
        self.model = torch.jit.load(str(path), "cpu", files)
        self.told = json.loads(files["detector.json"])

    def __call__(self, events, size, score=None):
        """Of events in time order, of a sensor of the size H, W: boxes [n, 4] (left, top, width, height in pixels, cut
        to the sensor), classes and scores, the surest first, of at least `score` (None: as the training says)."""
        with torch.no_grad():
            boxes, labels, scores = (each.double().numpy() for each in
                                     self.model(*map(torch.from_numpy, columns(events)), *size))
        boxes = boxes.clip(0, [size[1], size[0]] * 2)
        kept = (scores >= (self.told["score"] if score is None else score)) & (boxes[:, 2:] > boxes[:, :2]).all(1)
        boxes[:, 2:] -= boxes[:, :2]
        return boxes[kept], [self.told["classes"][int(label)] for label in labels[kept]], scores[kept]


def columns(events):
    """t in microseconds, x, y and p (positive: 1, else 0 or -1) of a structured array, or of arrays by their names."""
    known = events.dtype.names or () if hasattr(events, "dtype") else [*events]
    found = [next((name for name in names if name in known), None) for names in
             (("t", "t_us", "ts", "timestamp"), ("x",), ("y",), ("p", "pol", "polarity"))]
    if None in found:
        raise ValueError(f"expected columns t, x, y and p, got {', '.join(map(str, known)) or 'none with a name'}")
    t, x, y, p = (np.asarray(events[name]) for name in found)
    wrong = p[~np.isin(p, (1, 0, -1, 2**8 - 1, 2**16 - 1, 2**32 - 1))]  # the last three: -1 of an unsigned type
    if len(wrong):
        raise ValueError(f"expected polarities -1 and 1 or 0 and 1, got {wrong[0]}")
    if (p == 0).any() and not np.isin(p, (0, 1)).all():
        raise ValueError("expected polarities -1 and 1 or 0 and 1, got both")
    t = np.rint(t * 1e6 if t.dtype.kind == "f" else t)
    return tuple(each.astype(int) for each in (t, x, y, p == 1))


def read(path):
    """A recording's columns, int64 [4, N], in time order, and its sensor's size H, W, if the file has it."""
    size = None
    if path.suffix in (".npy", ".npz"):
        events = np.load(path)
    else:
        import h5py

        with h5py.File(path) as file:
            if "davis/left" in file:
                events, size = dict(zip("xytp", file["davis/left/events"][:].T)), file["davis/left/image_raw"].shape[1:]
            else:
                events = {name: file["events"][name][:] for name in "xyp"}
                events["t"] = file["events/t"][:].astype(int) + int(file["t_offset"][()] if "t_offset" in file else 0)
    events = np.stack(columns(events))
    return events[:, np.argsort(events[0], kind="stable")], size


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recording", type=pathlib.Path)
    parser.add_argument("--sensor", help="its size, as 346x260 (default: the file's, or as far as its events reach)")
    parser.add_argument("--window-ms", type=float, help="(default: as in training)")
    parser.add_argument("--score", type=float, help="least score of a box (default: as the training says)")
    parser.add_argument("--images", type=pathlib.Path, help="folder for a picture of each window")
    args = parser.parse_args()
    if args.sensor is not None and not re.fullmatch("[1-9][0-9]*x[1-9][0-9]*", args.sensor):
        sys.exit(f"expected --sensor as 346x260, got {args.sensor}")
    for name, least, most in (("window_ms", 0.001, 1e9), ("score", 0, 1)):
        value = getattr(args, name)
        if value is not None and not least <= value <= most:
            sys.exit(f"expected --{name.replace('_', '-')} from {least:g} to {most:g}, got {value:g}")
    model = pathlib.Path(__file__).with_name("detector.pt")
    for path in (model, args.recording):
        if not path.is_file():
            sys.exit(f"expected a file, got none, in {path}")
    try:
        detector = Detector(model)
    except Exception as error:  # PyTorch's have many lines
        reason = f"{type(error).__name__}: {error}".splitlines()[0]
        sys.exit(f"expected train_detector.py's detector, got one that cannot be read ({reason}), in {model}")
    try:
        events, size = read(args.recording)
    except Exception as error:  # each reader has its own
        sys.exit("expected a recording (.npy, .npz, HDF5 in MVSEC's or DSEC's layout), got one that cannot be read "
                 f"({error}), in {args.recording}")
    if not events.size:
        sys.exit(f"expected events, got none, in {args.recording}")
    size = [int(side) for side in args.sensor.split("x")][::-1] if args.sensor else size or (events[[2, 1]].max(1) + 1)
    outside = ((events[[2, 1]] < 0) | (events[[2, 1]] >= np.reshape(size, (2, 1)))).any(0)
    if outside.any():
        x, y = events[1:3, outside.argmax()]
        sys.exit(f"expected events within {size[1]}x{size[0]}, got one at {x}, {y}, in {args.recording}")
    window_us, t = 1000 * (detector.told["window_ms"] if args.window_ms is None else args.window_ms), events[0]
    # each window begins after the end of the one before
    ends = t[0] + window_us * np.arange(1, max(np.ceil((t[-1] - t[0]) / window_us), 1) + 1)
    places = [0, *np.searchsorted(t, ends, side="right").tolist()]
    out = csv.writer(sys.stdout, lineterminator="\n")
    out.writerow(["t_us", "x", "y", "w", "h", "class", "score"])
    for end, first, last in zip(ends.round().astype(int).tolist(), places, places[1:]):
        window = dict(zip("txyp", events[:, first:last]))
        boxes, classes, scores = detector(window, [int(side) for side in size], args.score)
        out.writerows([end, *box, name, score] for box, name, score in
                      zip(boxes.round(2).tolist(), classes, scores.round(4).tolist()))
        if args.images:
            import cv2

            picture = np.full((*size, 3), 128, np.uint8)
            picture[window["y"], window["x"]] = 255 * window["p"][:, None]
            for x, y, w, h in boxes.round().astype(int).tolist():
                cv2.rectangle(picture, (x, y), (x + w - 1, y + h - 1), (230, 90, 20), 1)
            args.images.mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(args.images / f"{end}.png"), picture)


if __name__ == "__main__":
    try:
        main()
    except BrokenPipeError:  # as of `| head`; what is left to write has no reader
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())

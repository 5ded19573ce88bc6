"""Weights made ready for int8, on pairs of the frames that are converted later."""

import json
import pathlib
import subprocess

from measuring.conversion import Job
from measuring.frames import fainter_copies, frames_to_calibrate_on, link_frames

MOST_PAIRS = {"full": 18, "quick": 4, "trial": 2}


class NotCalibrated(Exception):
    """Why not: the last line the program wrote to stderr."""


def calibrated(bench, weights, size, contrast=1):
    """The file; calibrated once for each of these arguments. `contrast`:
    what the frames' distance from mid-grey is multiplied with."""
    name = f"{pathlib.Path(weights).stem.replace(':', '-')}-{contrast}"
    path = bench.folder("calibrated") / f"{name}-{size[0]}x{size[1]}.safetensors"
    if not path.exists():
        originals = frames_to_calibrate_on(bench)[:MOST_PAIRS[bench.effort] + 1]
        if contrast != 1:
            originals = fainter_copies(path.with_suffix(".originals"), originals, contrast)
        frames = link_frames(path.with_suffix(".frames"), originals, len(originals))
        manifest = path.with_suffix(".json")
        manifest.write_text(json.dumps(Job(frames, *size, weights).manifest()))
        done = subprocess.run([bench.program, "calibrate", manifest, "--pairs", str(len(originals) - 1), "--out", path,
                               "--progress", "none"],
                              capture_output=True, text=True)
        if done.returncode != 0:
            raise NotCalibrated((done.stderr.strip().splitlines() or ["no word"])[-1])
    return str(path)

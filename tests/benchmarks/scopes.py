"""What `"scope": "motion"` saves and loses at other thresholds and sides of tiles: how its defaults were chosen.

By `eventgan tradeoff`, on a camera that rests, one held by hand and one that drives, as far as their data is at hand.
"""

import dataclasses
import itertools
import json
import subprocess

from measuring.bench import DATA
from measuring.frames import link_frames, original_frames
from measuring.report import Part, Table


@dataclasses.dataclass(frozen=True)
class Settings:
    weights: str
    pairs: int
    rounds: int
    thresholds: list  # grey levels
    sides: list       # of a tile, pixels
    size: tuple       # height, width; none: each job's own


SETTINGS = {
    "full": Settings("shipped:16", 6, 5, [4, 6, 8, 12], [8, 16, 32], None),
    "quick": Settings("shipped:16", 4, 3, [4, 6, 8], [16], None),
    "trial": Settings("untrained:2", 1, 1, [6], [16], (32, 32)),
}


def jobs(bench):
    """Source, height and width by name."""
    known = {
        "camera at rest (MPII sequence)": (DATA / "mpii/sequences/000000001", "mpii", [1, 2, 3, 4, 5, 6], 360, 640),
        "camera in a hand (clip of a dog)": (DATA / "clips/01_dog.mp4", "mpii", [1, 2, 3], 360, 640),
        "camera on a car (KITTI raw)": (DATA / "kitti_raw", "kitti", [1, 2], 260, 861),
    }
    found = {name: job for name, job in known.items() if job[0].exists()}
    if found:
        return found
    return {"frames": (link_frames(bench.scratch / "frames", original_frames(bench)[0], 20), "mpii", [1], 180, 320)}


def trade(bench, settings, folder, job, threshold, side):
    """The configurations `whole` and `motion` of tradeoff.json."""
    root, preset, gaps, *size = job
    height, width = settings.size or size
    dataset = "kitti_raw" if preset == "kitti" else "frames"
    manifest = folder / "job.json"
    manifest.write_text(json.dumps({
        "format": "eventgan-manifest", "version": 1, "name": "job",
        "sources": [{"dataset": dataset, "root": str(root),
                     "pairs": {"gaps": gaps, "side": "before", "choose": "one"}}],
        "image": {"width": width, "height": height, "preset": preset}, "output": {"directory": "out"},
        "generator": {"weights": settings.weights, "motion_threshold": threshold, "tile_px": side}}))
    subprocess.run([bench.program, "tradeoff", manifest, "--pairs", str(settings.pairs), "--rounds",
                    str(settings.rounds), "--widths", settings.weights, "--precisions", "float32", "--methods",
                    "network", "--sizes", "1", "--dtypes", "float32", "--scopes", "whole,motion", "--threads", "1",
                    "--progress", "none", "--out", folder / "trade"], check=True,
                   capture_output=True)
    by_scope = {one["scope"]: one for one in json.loads((folder / "trade/tradeoff.json").read_text())["configurations"]}
    return by_scope["whole"], by_scope["motion"]


def measure(bench):
    settings = SETTINGS[bench.effort]
    table = Table("scopes", ["camera", "motion_threshold", "tile_px", "generator: whole / motion", "error L2",
                             "F1 over time"])
    for name, job in jobs(bench).items():
        for threshold, side in itertools.product(settings.thresholds, settings.sides):
            whole, motion = trade(bench, settings, bench.folder(f"{name}-{threshold}-{side}"), job, threshold, side)
            table.add(name, threshold, side, whole["generator_s"]["median"] / motion["generator_s"]["median"],
                      motion["relative_l2"], motion["f1_time"])
    return Part([table])

"""What a trainer's reader costs: samples with labels from `eventgan` against the same volumes alone from h5py."""

import dataclasses
import json
import shutil
import subprocess
import sys
import time

import h5py
import numpy as np

from measuring.report import Part, Table
from measuring.spread import spread


@dataclasses.dataclass(frozen=True)
class Settings:
    rounds: int
    shards: int = 72
    size: tuple = (260, 861)
    dtypes: tuple = ("uint8", "float16")


SETTINGS = {
    "full": Settings(7),
    "quick": Settings(3, dtypes=("uint8",)),
    "trial": Settings(1, shards=2, size=(32, 32), dtypes=("uint8",)),
}


def demo_shards(bench, settings, dtype):
    """So many shards, copies of one of the demo's KITTI-like ones, with its labels; eight samples each."""
    demo = bench.scratch / "demo"
    if not demo.exists():
        subprocess.run([bench.program, "make-demo", demo], check=True, stdout=subprocess.DEVNULL)
    manifest = {"format": "eventgan-manifest", "version": 1, "name": "reading", "seed": 7,
                "sources": [{"dataset": "kitti_object", "root": "kitti/training",
                             "pairs": {"gaps": [1, 2, 3], "side": "before", "choose": "one"}}],
                "image": {"height": settings.size[0], "width": settings.size[1], "fit": "stretch", "preset": "kitti"},
                "output": {"directory": dtype, "samples_per_shard": 8, "dtype": dtype, "deflate_level": 1}}
    (demo / "reading.json").write_text(json.dumps(manifest))
    subprocess.run([bench.program, "convert", demo / "reading.json", "--progress", "none"], check=True,
                   capture_output=True)
    first = min((demo / dtype).glob("*-of-*.h5"))
    return [shutil.copy(first, demo / f"{dtype}-{number:02}.h5") for number in range(settings.shards)]


class PlainVolumes:
    """Volumes alone, with stock h5py: each file opened once."""

    def __init__(self, paths):
        self._files = [h5py.File(path) for path in paths]
        self._places = [(file["events/volume"], file["events/scale"], slot) for file in self._files
                        for slot in np.flatnonzero(file["valid"][:])]

    def __len__(self):
        return len(self._places)

    def __getitem__(self, index):
        volumes, scales, slot = self._places[index]
        return volumes[slot].astype("float32") * scales[slot]

    def close(self):
        for file in self._files:
            file.close()


def seconds(samples, order):
    start = time.process_time()
    for index in order:
        samples[index]
    return time.process_time() - start


def measure(bench):
    settings = SETTINGS[bench.effort]
    sys.path.insert(0, str(bench.build / "python"))
    from eventgan import Shards

    table = Table("reading", ["dtype", "order", "h5py, volume alone, ms", "eventgan, volume and labels, ms",
                              "times h5py's"])
    for dtype in settings.dtypes:
        paths = demo_shards(bench, settings, dtype)
        orders = {"in order": None, "shuffled": np.random.default_rng(7)}
        for name, random in orders.items():
            plain, ours = [], []
            for turn in range(settings.rounds):
                readers = [(PlainVolumes, plain), (Shards, ours)]
                for make, times in readers if turn % 2 else reversed(readers):
                    reader = make(paths)
                    order = np.arange(len(reader)) if random is None else random.permutation(len(reader))
                    times.append(1e3 * seconds(reader, order) / len(reader))
                    reader.close()
            table.add(dtype, name, spread(plain), spread(ours), spread([o / p for o, p in zip(ours, plain)]).median)
    return Part([table])

"""How volumes are stored: type and deflate level against bytes, time and error, on volumes of the shipped weights."""

import dataclasses
import pathlib
import time

import h5py
import numpy as np

from measuring.conversion import Job, convert
from measuring.frames import link_frames, original_frames
from measuring.report import Part, Table
from measuring.spread import spread

EXACT = ("float32", 0)  # what the others are compared with


@dataclasses.dataclass(frozen=True)
class Settings:
    rounds: int
    pairs: int
    size: tuple
    dtypes: tuple = ("float32", "float16", "uint8")
    levels: tuple = (0, 1, 4, 6, 9)


SETTINGS = {
    "full": Settings(3, 8, (260, 861)),
    "quick": Settings(1, 4, (260, 861), levels=(0, 1, 6)),
    "trial": Settings(1, 2, (32, 32), dtypes=("float32", "uint8"), levels=(0, 1)),
}


@dataclasses.dataclass
class Read:
    """A shard's volumes as h5py gives them, dequantised."""
    volumes: np.ndarray = None
    seconds: float = 0

    def __call__(self, folder):
        shard, = pathlib.Path(folder).glob("*-of-*.h5")
        with h5py.File(shard) as file:
            start = time.process_time()
            stored = file["events/volume"][:]
            self.seconds = time.process_time() - start
            self.volumes = stored * file["events/scale"][:][:, None, None, None]


def relative_error(volumes, exact):
    return np.linalg.norm((volumes - exact).ravel()) / np.linalg.norm(exact.ravel())


def measure(bench):
    settings = SETTINGS[bench.effort]
    originals, _ = original_frames(bench)
    frames = link_frames(bench.scratch / "storage", originals, settings.pairs + 1)
    choices = [(dtype, level) for dtype in settings.dtypes for level in settings.levels]
    runs, reading, errors = ({choice: [] for choice in choices} for _ in range(3))
    exact = None
    for _ in range(settings.rounds):
        for choice in choices:
            read = Read()
            runs[choice].append(convert(bench.program, Job(frames, *settings.size, "shipped", dtype=choice[0],
                                                           deflate_level=choice[1]), read))
            exact = read.volumes if choice == EXACT else exact
            reading[choice].append(1e3 * read.seconds / settings.pairs)
            errors[choice].append(relative_error(read.volumes, exact))

    table = Table("storage", ["dtype", "deflate level", "kB a pair", "times smaller than float32, 0", "finish ms",
                              "write ms", "h5py reads in ms", "error L2"])
    largest = runs[EXACT][0].stored_bytes
    for choice in choices:
        stored = runs[choice][0].stored_bytes
        stages = [[1e3 * run.stage_s[stage] / run.pairs for run in runs[choice]] for stage in ("finish", "write")]
        table.add(*choice, stored / settings.pairs / 1e3, largest / stored, spread(stages[0]),
                  spread(stages[1]).median, spread(reading[choice]).median, float(max(errors[choice])))
    return Part([table])

"""The whole conversion against the number of pairs: pairs a second and peak memory must stay as they are."""

import dataclasses

from measuring.conversion import Job, convert
from measuring.cores import usable
from measuring.frames import link_frames, original_frames, small_copies
from measuring.report import Part, Table
from measuring.spread import spread


@dataclasses.dataclass(frozen=True)
class Settings:
    rounds: int
    counts: list
    size: tuple = (96, 128)
    weights: str = "untrained:8"


SETTINGS = {
    "full": Settings(2, [500, 1000, 2000, 5000]),
    "quick": Settings(1, [100, 400, 1000], size=(64, 96)),
    "trial": Settings(1, [2, 4], size=(32, 32), weights="untrained:2"),
}


def measure(bench):
    settings = SETTINGS[bench.effort]
    originals, _ = original_frames(bench)
    small = small_copies(bench.scratch / "small", originals, *settings.size)
    threads = len(usable())
    rates = {count: [] for count in settings.counts}
    peaks = {count: [] for count in settings.counts}
    folders = {count: link_frames(bench.scratch / f"pairs-{count}", small, count + 1) for count in settings.counts}
    for _ in range(settings.rounds):
        for count, folder in folders.items():
            done = convert(bench.program, Job(folder, *settings.size, settings.weights, threads=threads))
            rates[count].append(done.pairs / done.wall_s)
            peaks[count].append(done.peak_mb)

    table = Table("pair_counts", ["pairs", "pairs/s", "peak MB", "times the first's MB"])
    for count in settings.counts:
        table.add(count, spread(rates[count]), max(peaks[count]), max(peaks[count]) / max(peaks[settings.counts[0]]))
    return Part([table])

"""The whole conversion against threads, as many cores for each: pairs a second, peak memory, and the same bytes."""

import dataclasses

from measuring.conversion import Job, convert, pair_cost
from measuring.cores import usable
from measuring.frames import link_frames, original_frames
from measuring.report import Part, Table
from measuring.spread import rotated, spread


@dataclasses.dataclass(frozen=True)
class Settings:
    rounds: int
    few: int   # pairs a thread
    many: int  # pairs a thread
    size: tuple
    weights: str


SETTINGS = {
    "full": Settings(5, 3, 12, (260, 861), "untrained:32"),
    "quick": Settings(1, 2, 6, (260, 861), "untrained:16"),
    "trial": Settings(1, 2, 4, (32, 32), "untrained:2"),
}


def thread_counts(cores):
    """1, 2, 4 ... and all of them."""
    counts = [1]
    while counts[-1] * 2 < cores:
        counts.append(counts[-1] * 2)
    return counts if cores == 1 else [*counts, cores]


def measure(bench):
    settings = SETTINGS[bench.effort]
    counts = thread_counts(len(usable()))
    originals, _ = original_frames(bench)
    # The same pairs for every number of threads: the shards are compared.
    most = counts[-1]
    folders = [link_frames(bench.scratch / f"threads-{pairs}", originals, pairs * most + 1)
               for pairs in (settings.few, settings.many)]
    rates = {count: [] for count in counts}
    peaks = {count: [] for count in counts}
    digests = {count: set() for count in counts}
    for turn in range(settings.rounds):
        for count in rotated(counts, turn):
            few, many = (convert(bench.program, Job(folder, *settings.size, settings.weights, threads=count))
                         for folder in folders)
            rates[count].append(1 / pair_cost(few, many).wall_s)
            peaks[count].append(many.peak_mb)
            digests[count].add(many.digest)

    table = Table("threads", ["threads", "pairs/s", "times one thread's", "peak MB", "bytes"])
    for count in counts:
        ratio = spread([rate / one for rate, one in zip(rates[count], rates[1])])
        same = digests[count] == digests[1] and len(digests[1]) == 1
        table.add(count, spread(rates[count]), ratio, max(peaks[count]), "equal" if same else "DIFFERENT")
    return Part([table])

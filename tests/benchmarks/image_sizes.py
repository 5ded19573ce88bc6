"""The whole conversion against the size of the volumes: processor time a pair, and peak memory."""

import dataclasses

from measuring.conversion import Job, convert, pair_cost
from measuring.frames import link_frames, original_frames
from measuring.report import Part, Table
from measuring.spread import rotated, spread


@dataclasses.dataclass(frozen=True)
class Settings:
    rounds: int
    few: int
    many: int
    sizes: list
    weights: str = "untrained:32"


SETTINGS = {
    "full": Settings(3, 2, 10, [(128, 128), (192, 256), (260, 346), (260, 861), (375, 1242)]),
    "quick": Settings(3, 2, 10, [(128, 128), (260, 346), (260, 861)]),
    "trial": Settings(1, 1, 2, [(32, 32), (32, 48)], "untrained:2"),
}


def measure(bench):
    settings = SETTINGS[bench.effort]
    originals, _ = original_frames(bench)
    folders = [link_frames(bench.scratch / f"sizes-{pairs}", originals, pairs + 1)
               for pairs in (settings.few, settings.many)]
    costs = {size: [] for size in settings.sizes}
    peaks = {size: [] for size in settings.sizes}
    for turn in range(settings.rounds):
        for size in rotated(settings.sizes, turn):
            few, many = (convert(bench.program, Job(folder, *size, settings.weights)) for folder in folders)
            costs[size].append(pair_cost(few, many))
            peaks[size].append(many.peak_mb)

    table = Table("image_sizes", ["size", "ms a pair", "of them the generator's", "ns a pixel", "peak MB"])
    for size in settings.sizes:
        whole = spread([1e3 * cost.cpu_s for cost in costs[size]])
        generator = spread([1e3 * cost.stage_s["generate"] for cost in costs[size]])
        table.add(f"{size[0]}x{size[1]}", whole, generator.median, 1e6 * whole.median / (size[0] * size[1]),
                  max(peaks[size]))
    return Part([table])

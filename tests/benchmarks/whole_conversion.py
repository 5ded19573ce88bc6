"""The whole `eventgan convert` on real frames: processor seconds a pair, split by stage, beside the generator's alone.

What a pair costs is the difference between a long and a short run, so that starting up does not count.
"""

import dataclasses

from measuring.calibration import NotCalibrated, calibrated
from measuring.conversion import ConversionRefused, Job, convert, pair_cost
from measuring.frames import link_frames, original_frames
from measuring.machine import native_precisions
from measuring.report import Part, Table
from measuring.spread import rotated, spread

STAGES = ["read", "generate", "finish", "write"]


@dataclasses.dataclass(frozen=True)
class Settings:
    rounds: int
    few: int    # pairs of the short run
    many: int   # pairs of the long run
    size: tuple
    weights: list


SETTINGS = {
    "full": Settings(5, 5, 40, (260, 861), ["untrained:32", "shipped:16", "shipped:8"]),
    "quick": Settings(2, 4, 16, (260, 861), ["shipped:16", "shipped:8"]),
    "trial": Settings(1, 1, 3, (32, 32), ["untrained:2"]),
}


def make_jobs(bench, settings, folders):
    """A short and a long job by name, and why the others are missing."""
    jobs, refused = {}, {}
    for weights in settings.weights:
        for precision in native_precisions():
            name = f"{weights} {precision}"
            try:
                prepared = calibrated(bench, weights, settings.size) if precision == "int8" else weights
                jobs[name] = [Job(folder, *settings.size, prepared, precision) for folder in folders]
            except NotCalibrated as fault:
                refused[name] = str(fault)
    return jobs, refused


def measure_costs(bench, jobs, rounds, refused):
    """Costs of a pair by job's name, a round each, and the libraries;
    adds to `refused` what the program will not do."""
    costs, libraries = {name: [] for name in jobs}, set()
    for turn in range(rounds):
        for name in rotated(list(jobs), turn):
            if name in refused:
                continue
            try:
                few, many = (convert(bench.program, job) for job in jobs[name])
                costs[name].append(pair_cost(few, many))
                libraries.add(many.libraries)
            except ConversionRefused as fault:
                refused[name] = str(fault)
    return {name: rounds for name, rounds in costs.items() if rounds}, libraries


def milliseconds(values):
    return 1e3 * spread(values).median


def measure(bench):
    settings = SETTINGS[bench.effort]
    originals, _ = original_frames(bench)
    folders = [link_frames(bench.scratch / f"frames-{pairs}", originals, pairs + 1)
               for pairs in (settings.few, settings.many)]
    jobs, refused = make_jobs(bench, settings, folders)
    costs, libraries = measure_costs(bench, jobs, settings.rounds, refused)

    table = Table("whole_conversion", ["weights and precision", "ms a pair", *STAGES, "other", "whole / generator"])
    for name, rounds in costs.items():
        stages = [[cost.stage_s.get(stage, 0) for cost in rounds] for stage in STAGES]
        other = [cost.cpu_s - sum(cost.stage_s.values()) for cost in rounds]
        ratio = spread([cost.cpu_s / cost.stage_s["generate"] for cost in rounds])
        table.add(name, milliseconds([cost.cpu_s for cost in rounds]), *map(milliseconds, stages), milliseconds(other),
                  ratio)
    return Part([table], refused, libraries)

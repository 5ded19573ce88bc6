#!/usr/bin/python3
"""The inference engines side by side with the plain PyTorch program: one core, the same for all, taking turns.

In every round each contender makes one forward pass, in an order that rotates; a ratio is that of two passes of one
round.
"""

import contextlib
import dataclasses
import pathlib
import subprocess
import sys

from measuring.bench import DATA, run_part
from measuring.calibration import NotCalibrated, calibrated
from measuring.contender import Contender, ContenderFailed
from measuring.frames import write_input
from measuring.report import Curves, Section, Table, number
from measuring.spread import rotated, spread

BASELINE = "eager PyTorch float32"
ENGINES = [("torch", "float32"), ("torch", "bfloat16"), ("onednn", "float32"), ("onednn", "bfloat16"),
           ("onednn", "int8")]


@dataclasses.dataclass(frozen=True)
class Settings:
    rounds: int
    sizes: dict          # base width → image sizes (height, width)
    shipped_size: tuple  # image size at which errors of trained weights are taken


SIZES = [(260, 861), (375, 1242), (256, 320), (128, 128)]
SETTINGS = {
    "full": Settings(20, {32: SIZES, 16: SIZES, 8: SIZES}, (260, 861)),
    "quick": Settings(5, {32: [(260, 861), (128, 128)], 8: [(260, 861)]}, (260, 861)),
    "trial": Settings(1, {2: [(32, 32)]}, (32, 32)),
}


def engine_command(bench, engine, precision, weights, *more):
    return [bench.benchmark_program("eventgan_engine_benchmark"), "--engine", engine, "--precision", precision,
            "--weights", weights, *more]


def start_contenders(bench, width, sizes, stack):
    """Contenders by name, and why the others are missing."""
    baseline = [sys.executable, pathlib.Path(__file__).with_name("eager_baseline.py"), "--base-width", str(width)]
    contenders = {BASELINE: stack.enter_context(Contender(baseline))}
    missing = {}
    for engine, precision in ENGINES:
        name = f"{engine} {precision}"
        try:
            contenders[name] = stack.enter_context(start_engine(bench, engine, precision, f"untrained:{width}",
                                                                sizes[0]))
        except (ContenderFailed, NotCalibrated) as fault:
            missing[name] = str(fault)
    return contenders, missing


def start_engine(bench, engine, precision, weights, size):
    """int8 with weights calibrated on images of that size."""
    if precision == "int8":
        weights = calibrated(bench, weights, size)
    return Contender(engine_command(bench, engine, precision, weights))


def play_rounds(contenders, rounds):
    """Passes by contender, in the order of the rounds."""
    passes = {name: [] for name in contenders}
    for turn in range(rounds):
        for name in rotated(list(contenders), turn):
            passes[name].append(contenders[name].run())
    return passes


def times_table(width):
    return Table(["engine", "ms", "least ms", "wall ms", "times the baseline's speed", "error L2", "largest error"],
                 caption=f"Base width {width}")


def add_rows(table, size, contenders, passes):
    """Rows of one size; the engines' ratios to the baseline by name."""
    ratios = {}
    for name, contender in contenders.items():
        cpu = spread([one["cpu_ms"] for one in passes[name]])
        wall = spread([one["wall_ms"] for one in passes[name]])
        ratio = spread([base["cpu_ms"] / one["cpu_ms"] for base, one in zip(passes[BASELINE], passes[name])])
        ratios[name] = ratio.median
        shown = f"{size[0]}x{size[1]} {name}" + ("" if contender.native else " (not native here)")
        errors = ("", "")
        if name != BASELINE:
            error = contender.error()
            errors = number(error["relative_l2"], 2), number(error["relative_largest"], 2)
        table.add(shown, cpu.median_and_quartiles(), number(cpu.least), number(wall.median),
                  ratio.median_and_quartiles(), *errors)
    return ratios


def trained_errors(bench, size):
    """Errors on weights that are not random: the shipped ones, and those of the golden checkpoint where it is at
    hand."""
    table = Table(["weights and engine", "error L2", "largest error"],
                  caption=f"Errors on other weights, {size[0]}x{size[1]}")
    weights = {"shipped": "shipped"}
    checkpoint = DATA / "golden" / "checkpoint_zip.pt"
    if checkpoint.exists():
        weights["golden"] = str(bench.scratch / "golden.safetensors")
        subprocess.run([bench.program, "import-weights", checkpoint, weights["golden"]], check=True,
                       capture_output=True)
    for name, value in weights.items():
        for engine, precision in ENGINES:
            with contextlib.suppress(ContenderFailed, NotCalibrated):  # told of above
                with start_engine(bench, engine, precision, value, size) as contender:
                    contender.set_input(size, write_input(bench, size))
                    error = contender.error()
                    table.add(f"{name}, {engine} {precision}", number(error["relative_l2"], 2),
                              number(error["relative_largest"], 2))
    return table


def measure(bench):
    settings = SETTINGS[bench.effort]
    tables, curves, missing, described = [], [], {}, set()
    for width, sizes in settings.sizes.items():
        with contextlib.ExitStack() as stack:
            contenders, absent = start_contenders(bench, width, sizes, stack)
            missing |= {f"{name}, base width {width}": why for name, why in absent.items()}
            described |= {contender.description for contender in contenders.values()}
            table = times_table(width)
            lines = {name: [] for name in contenders}
            for size in sizes:
                frames = write_input(bench, size)
                for contender in contenders.values():
                    contender.set_input(size, frames)
                ratios = add_rows(table, size, contenders, play_rounds(contenders, settings.rounds))
                for name, ratio in ratios.items():
                    lines[name].append((size[0] * size[1], ratio))
        tables.append(table)
        curves.append(Curves(f"Engines, base width {width}, one core", "pixels", "times the speed of eager PyTorch",
                             {name: sorted(points) for name, points in lines.items()}, ideal=BASELINE,
                             logarithmic=True))
    tables.append(trained_errors(bench, settings.shipped_size))
    text = (f"One core, {settings.rounds} rounds. ms: processor time of a forward pass, median (middle half of the "
            "rounds); sizes are height x width. Errors are against LibTorch in float32 on the same input: of the whole "
            "volume, and the largest difference as a share of the largest value.")
    text += "".join(f"\n\nNot taking part: {name} ({why})." for name, why in missing.items())
    return Section("Engines", text, tables, curves[:1], described)


if __name__ == "__main__":
    run_part(__doc__, measure)

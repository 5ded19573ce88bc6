"""The inference engines side by side with the plain PyTorch program: one core, the same for all, taking turns.

In every round each contender makes one forward pass, in an order that rotates; a ratio is that of two passes of one
round.
"""

import contextlib
import dataclasses
import pathlib
import subprocess
import sys

from measuring.bench import DATA
from measuring.calibration import NotCalibrated, calibrated
from measuring.contender import Contender, ContenderFailed
from measuring.frames import write_input
from measuring.report import Part, Table
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


def add_rows(table, width, size, contenders, passes):
    for name, contender in contenders.items():
        cpu = spread([one["cpu_ms"] for one in passes[name]])
        wall = spread([one["wall_ms"] for one in passes[name]])
        ratio = spread([base["cpu_ms"] / one["cpu_ms"] for base, one in zip(passes[BASELINE], passes[name])])
        error = contender.error() if name != BASELINE else {"relative_l2": "", "relative_largest": ""}
        table.add(width, f"{size[0]}x{size[1]}", name + ("" if contender.native else " (not native here)"), cpu,
                  cpu.least, wall.median, ratio, error["relative_l2"], error["relative_largest"])


def trained_errors(bench, size):
    """Errors on weights that are not random: the shipped ones, and those of the golden checkpoint where it is at
    hand."""
    table = Table("engine_errors", ["weights", "size", "engine", "error L2", "largest error"])
    weights = {"shipped": "shipped"}
    checkpoint = DATA / "golden" / "checkpoint_zip.pt"
    if checkpoint.exists():
        weights["golden"] = str(bench.scratch / "golden.safetensors")
        subprocess.run([bench.program, "import-weights", checkpoint, weights["golden"]], check=True,
                       capture_output=True)
    for name, value in weights.items():
        for engine, precision in ENGINES:
            with contextlib.suppress(ContenderFailed, NotCalibrated):  # start_contenders says why
                with start_engine(bench, engine, precision, value, size) as contender:
                    contender.set_input(size, write_input(bench, size))
                    error = contender.error()
                    table.add(name, f"{size[0]}x{size[1]}", f"{engine} {precision}", error["relative_l2"],
                              error["relative_largest"])
    return table


def measure(bench):
    settings = SETTINGS[bench.effort]
    missing, described = {}, set()
    table = Table("engines", ["base width", "size", "engine", "ms", "least ms", "wall ms",
                              "times the baseline's speed", "error L2", "largest error"])
    for width, sizes in settings.sizes.items():
        with contextlib.ExitStack() as stack:
            contenders, absent = start_contenders(bench, width, sizes, stack)
            missing |= {f"{name}, base width {width}": why for name, why in absent.items()}
            described |= {contender.description for contender in contenders.values()}
            for size in sizes:
                frames = write_input(bench, size)
                for contender in contenders.values():
                    contender.set_input(size, frames)
                add_rows(table, width, size, contenders, play_rounds(contenders, settings.rounds))
    return Part([table, trained_errors(bench, settings.shipped_size)], missing, described)

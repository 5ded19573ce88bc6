#!/usr/bin/python3
"""How much small changes of the frames change the volume, what int8 loses beyond its calibration, and the time of
subnormal numbers.

The tables of manifests/guides/numerics.md:

    tests/benchmarks/numerics.py > numerics.md
"""

import contextlib
import dataclasses

from engines import ENGINES, engine_command, play_rounds, start_engine
from measuring.bench import run_part
from measuring.calibration import NotCalibrated, calibrated
from measuring.contender import Contender, ContenderFailed
from measuring.frames import write_input
from measuring.report import Section, Table, number
from measuring.spread import spread


@dataclasses.dataclass(frozen=True)
class Settings:
    weights: list
    size: tuple       # height, width
    tries: int        # changes of each kind
    contrasts: list   # of the images that int8 is calibrated on
    shrinks: list     # powers of two
    rounds: int


SETTINGS = {
    "full": Settings(["shipped:8", "shipped:16"], (260, 861), 20, [1, 0.7, 0.5, 0.3, 0.2, 0.1], [0, 100, 126, 135, 140],
                     10),
    "quick": Settings(["shipped:8"], (128, 424), 20, [1, 0.5, 0.2], [0, 126, 135], 5),
    "trial": Settings(["shipped:8"], (32, 32), 1, [1, 0.5], [0, 126], 1),
}


def stability(bench, settings):
    table = Table(["weights and engine", "one level: amplification", "one level: largest change",
                   "noise: amplification", "noise: largest change", "noise: change L2"],
                  caption=f"Stability, {settings.size[0]}x{settings.size[1]}, the largest of {settings.tries} changes "
                  "of each kind")
    for weights in settings.weights:
        for engine, precision in ENGINES:
            with contextlib.suppress(ContenderFailed, NotCalibrated):  # engines.py says why
                with start_engine(bench, engine, precision, weights, settings.size) as contender:
                    contender.set_input(settings.size, write_input(bench, settings.size))
                    level = contender.amplification("level", settings.tries)
                    noise = contender.amplification("noise", settings.tries)
                    table.add(f"{weights}, {engine} {precision}", number(level["l2"], 2), number(level["largest"], 2),
                              number(noise["l2"], 2), number(noise["largest"], 2), number(noise["relative_l2"], 2))
    return table


def saturation(bench, settings):
    table = Table(["weights, contrast of the calibration's images", "clipped activations", "error L2", "largest error"],
                  caption="int8 on images of more contrast than it was calibrated for")
    for weights in settings.weights:
        for contrast in settings.contrasts:
            with contextlib.suppress(ContenderFailed, NotCalibrated):
                file = calibrated(bench, weights, settings.size, contrast)
                with Contender(engine_command(bench, "onednn", "int8", file)) as contender:
                    contender.set_input(settings.size, write_input(bench, settings.size))
                    error = contender.error()
                    table.add(f"{weights}, {contrast}", number(contender.saturation()["share"], 2),
                              number(error["relative_l2"], 2), number(error["relative_largest"], 2))
    return table


def subnormals(bench, settings):
    table = Table(["engine, activations divided by 2^N", "ms", "times that of N = 0"],
                  caption=f"Time of a pair, {settings.weights[0]}")
    for engine, precision in ENGINES:
        if precision == "int8":  # stores whole numbers
            continue
        with contextlib.ExitStack() as stack, contextlib.suppress(ContenderFailed):
            contenders = {shrink: stack.enter_context(
                Contender(engine_command(bench, engine, precision, settings.weights[0], "--shrink",
                                         str(shrink)))) for shrink in settings.shrinks}
            for contender in contenders.values():
                contender.set_input(settings.size, write_input(bench, settings.size))
            passes = play_rounds(contenders, settings.rounds)
            for shrink, rounds in passes.items():
                ratio = spread([one["cpu_ms"] / base["cpu_ms"] for base, one in zip(passes[0], rounds)])
                table.add(f"{engine} {precision}, {shrink}", number(spread([one["cpu_ms"] for one in rounds]).median),
                          ratio.median_and_quartiles())
    return table


def measure(bench):
    settings = SETTINGS[bench.effort]
    text = ("One core. A change is of one grey level in one pixel, or noise of up to 1e-6 on every value, as other "
            "rounding would be. Amplification: length of the volume's change over that of the frames', as vectors; "
            "largest change: of a value, as a share of the volume's largest; errors are against LibTorch in float32.")
    return Section("Numbers at the extremes", text,
                   [stability(bench, settings), saturation(bench, settings), subnormals(bench, settings)])


if __name__ == "__main__":
    run_part(__doc__, measure)

"""How much small changes of the frames change the volume, what int8 loses beyond its calibration, and the time of
subnormal numbers.
"""

import contextlib
import dataclasses

from engines import ENGINES, engine_command, play_rounds, start_engine
from measuring.calibration import NotCalibrated, calibrated
from measuring.contender import Contender, ContenderFailed
from measuring.frames import write_input
from measuring.report import Part, Table
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
    table = Table("stability", ["weights", "engine", "one level: amplification", "one level: largest change",
                                "noise: amplification", "noise: largest change", "noise: change L2"])
    for weights in settings.weights:
        for engine, precision in ENGINES:
            with contextlib.suppress(ContenderFailed, NotCalibrated):  # engines.py says why
                with start_engine(bench, engine, precision, weights, settings.size) as contender:
                    contender.set_input(settings.size, write_input(bench, settings.size))
                    level = contender.amplification("level", settings.tries)
                    noise = contender.amplification("noise", settings.tries)
                    table.add(weights, f"{engine} {precision}", level["l2"], level["largest"], noise["l2"],
                              noise["largest"], noise["relative_l2"])
    return table


def saturation(bench, settings):
    table = Table("saturation", ["weights", "contrast of the calibration's images", "clipped activations", "error L2",
                                 "largest error"])
    for weights in settings.weights:
        for contrast in settings.contrasts:
            with contextlib.suppress(ContenderFailed, NotCalibrated):
                file = calibrated(bench, weights, settings.size, contrast)
                with Contender(engine_command(bench, "onednn", "int8", file)) as contender:
                    contender.set_input(settings.size, write_input(bench, settings.size))
                    error = contender.error()
                    table.add(weights, contrast, contender.saturation()["share"], error["relative_l2"],
                              error["relative_largest"])
    return table


def subnormals(bench, settings):
    table = Table("subnormals", ["weights", "engine", "N: activations divided by 2^N", "ms", "times that of N = 0"])
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
                table.add(settings.weights[0], f"{engine} {precision}", shrink,
                          spread([one["cpu_ms"] for one in rounds]).median, ratio)
    return table


def measure(bench):
    settings = SETTINGS[bench.effort]
    return Part([stability(bench, settings), saturation(bench, settings), subnormals(bench, settings)])

"""One generator a core with a thread each, against fewer generators with more threads: what a pair takes on all cores.

The program always does the former, since the last bits of a convolution depend on the number of threads within it. Only
LibTorch's engine can be asked for more: oneDNN's keeps to one thread whatever OpenMP would give it.
"""

import contextlib
import dataclasses

from engines import engine_command, play_rounds
from measuring.contender import Contender, ContenderFailed
from measuring.cores import usable
from measuring.frames import write_input
from measuring.report import Part, Table
from measuring.spread import spread

ENGINES = [("torch", "float32")]


@dataclasses.dataclass(frozen=True)
class Settings:
    rounds: int
    width: int
    sizes: list


SETTINGS = {
    "full": Settings(10, 32, [(260, 861), (128, 128)]),
    "quick": Settings(3, 32, [(260, 861), (128, 128)]),
    "trial": Settings(1, 2, [(32, 32)]),
}


def divisions(cores):
    """(generators, threads of each) that use all cores, most generators first."""
    return [(generators, cores // generators) for generators in range(cores, 0, -1) if cores % generators == 0]


def start(bench, width, cores, stack):
    contenders = {}
    for engine, precision in ENGINES:
        for generators, threads in divisions(cores):
            command = engine_command(bench, engine, precision, f"untrained:{width}", "--instances", str(generators),
                                     "--intra-op", str(threads))
            with contextlib.suppress(ContenderFailed):  # engines.py says why
                contender = stack.enter_context(Contender(command, cores, {"OMP_NUM_THREADS": str(threads)}))
                if contender.native:
                    contenders[engine, precision, generators, threads] = contender
    return contenders


def measure(bench):
    settings = SETTINGS[bench.effort]
    cores = len(usable())
    table = Table("intra_op", ["size", "engine", "generators", "threads of each", "wall ms a pair",
                               "times one generator a core", "busy cores"])
    with contextlib.ExitStack() as stack:
        contenders = start(bench, settings.width, cores, stack)
        for size in settings.sizes:
            frames = write_input(bench, size)
            for contender in contenders.values():
                contender.set_input(size, frames)
            passes = play_rounds(contenders, settings.rounds)
            for (engine, precision, generators, threads), rounds in passes.items():
                wall = spread([one["wall_ms"] / generators for one in rounds])
                whole = passes[engine, precision, cores, 1]
                ratio = spread([(base["wall_ms"] / cores) / (one["wall_ms"] / generators)
                                for base, one in zip(whole, rounds)])
                busy = spread([one["cpu_ms"] / one["wall_ms"] for one in rounds])
                table.add(f"{size[0]}x{size[1]}", f"{engine} {precision}", generators, threads, wall, ratio,
                          busy.median)
    return Part([table])

"""The generator in Python: a call against the engine alone, what importing it takes, many()
and a DataLoader by one and by two."""

import contextlib
import dataclasses
import itertools
import json
import os
import pathlib
import subprocess
import sys

from engines import engine_command, play_rounds
from measuring.calibration import NotCalibrated, calibrated
from measuring.contender import Contender, ContenderFailed
from measuring.cores import pin_to
from measuring.frames import write_input
from measuring.machine import native_precisions
from measuring.report import Part, Table
from measuring.spread import rotated, spread

LOADED = ("shipped:8", "bfloat16")  # what many() and the DataLoader are measured with, where the processor has it


@dataclasses.dataclass(frozen=True)
class Settings:
    rounds: int      # of calls; of all else a tenth, at least three
    weights: tuple
    size: tuple = (260, 861)
    pairs: int = 64  # of an epoch; of many() a quarter

    @property
    def few(self):
        return 1 if self.rounds == 1 else max(3, self.rounds // 10)


SETTINGS = {
    "full": Settings(100, ("shipped:8", "shipped:16")),
    "quick": Settings(30, ("shipped:8", "shipped:16")),
    "trial": Settings(1, ("shipped:8",), (32, 32), 8),
}

# Processor time of a fresh process, behind NumPy's own import.
STARTING = """
import json, sys, time, warnings
import numpy
warnings.simplefilter("ignore")
times = [time.process_time()]
import eventgan
times.append(time.process_time())
generator = eventgan.Generator(*sys.argv[1:2], precision=sys.argv[2])
times.append(time.process_time())
frame = numpy.zeros((int(sys.argv[3]), int(sys.argv[4])), "uint8")
generator(frame, frame)
times.append(time.process_time())
print(json.dumps([1e3 * (b - a) for a, b in zip(times, times[1:])]))
"""


def environment(bench):
    return {"PYTHONPATH": str(bench.build / "python")}


def start_caller(bench, weights, precision, cores=1):
    caller = pathlib.Path(__file__).with_name("python_caller.py")
    return Contender([sys.executable, caller, "--weights", weights, "--precision", precision], cores,
                     environment(bench))


def call_table(bench, settings, missing):
    table = Table("python_call", ["weights", "precision", "the engine, ms", "the call, ms", "call / engine",
                                  "medians' difference, ms"])
    frames = write_input(bench, settings.size)
    for weights, precision in itertools.product(settings.weights, native_precisions()):
        try:
            prepared = calibrated(bench, weights, settings.size) if precision == "int8" else weights
            with contextlib.ExitStack() as stack:
                engine = stack.enter_context(Contender(engine_command(bench, "onednn", precision, prepared)))
                contenders = {"engine": engine, "call": stack.enter_context(start_caller(bench, prepared, precision))}
                for contender in contenders.values():
                    contender.set_input(settings.size, frames)
                passes = play_rounds(contenders, settings.rounds)
        except (ContenderFailed, NotCalibrated) as fault:
            missing[f"{weights} {precision}"] = str(fault)
            continue
        times = {name: [one["cpu_ms"] for one in each] for name, each in passes.items()}
        engine, call = (spread(each) for each in times.values())
        ratio = spread([b / a for a, b in zip(*times.values())])
        table.add(weights, precision, engine, call, ratio, call.median - engine.median)
    return table


def starting_table(bench, settings, precision):
    steps = ("import eventgan", f"Generator({LOADED[0]!r})", "the first call")
    rounds = []
    for _ in range(settings.few):
        done = subprocess.run([sys.executable, "-c", STARTING, LOADED[0], precision, *map(str, settings.size)],
                              stdout=subprocess.PIPE, text=True,
                              check=True, env={**os.environ, **environment(bench)}, preexec_fn=pin_to(1))
        rounds.append(json.loads(done.stdout))
    table = Table("python_start", ["precision", "step", "ms"])
    for step, times in zip(steps, zip(*rounds)):
        table.add(precision, step, spread(times))
    return table


def rate_table(bench, settings, precision):
    """What two threads or workers make of what one does; needs two cores."""
    few, many = settings.pairs // 4, settings.pairs
    with start_caller(bench, LOADED[0], precision, 2) as caller:
        caller.set_input(settings.size, write_input(bench, settings.size))
        pairs = {"many(), threads": few, "DataLoader, forked workers": many, "DataLoader, spawned workers": many}
        contenders = dict(
            zip(pairs, (lambda threads: caller.many(few, threads), lambda workers: caller.epoch(many, workers, "fork"),
                        lambda workers: caller.epoch(many, workers, "spawn"))))
        answers = {(name, count): [] for name in contenders for count in (1, 2)}
        for turn in range(settings.few):
            for name, count in rotated(list(answers), turn):
                answers[name, count].append(contenders[name](count))

    def ms_a_pair(name, count, key):
        return [answer[key] / pairs[name] for answer in answers[name, count]]

    table = Table("python_workers", [
        "weights", "precision", "volumes by", "one, wall ms a pair", "two, wall ms a pair", "times as fast",
        "times as fast, best rounds", "one, processor ms a pair", "one, its caller's", "two, processor ms a pair",
        "two, their caller's", "times as fast at most"])
    for name in contenders:
        one, two = (ms_a_pair(name, count, "wall_ms") for count in (1, 2))
        own, both = (spread(ms_a_pair(name, count, "cpu_ms")).median for count in (1, 2))
        callers = [spread(ms_a_pair(name, count, "caller_ms")).median for count in (1, 2)]
        table.add(*LOADED[:1], precision, name, spread(one), spread(two), spread([a / b for a, b in zip(one, two)]),
                  min(one) / min(two), own, callers[0], both, callers[1], 2 * own / (both + callers[1]))
    return table


def measure(bench):
    settings = SETTINGS[bench.effort]
    missing = {}
    tables = [call_table(bench, settings, missing)]
    precision = LOADED[1] if LOADED[1] in native_precisions() else "float32"
    tables += [starting_table(bench, settings, precision), rate_table(bench, settings, precision)]
    return Part(tables, missing)

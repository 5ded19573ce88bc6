"""Where the `onednn` engine's time goes: by kind of layer, and what is left for the engine's own loops, at several
widths.

Multiply-adds a second against what the processor can (float32 with AVX-512: 32 a cycle and core) tell which layers are
far from it.
"""

import dataclasses
import json
import os
import re
import statistics
import subprocess

from engines import engine_command
from measuring.calibration import NotCalibrated, calibrated
from measuring.contender import ENVIRONMENT
from measuring.cores import pin_to
from measuring.frames import write_input
from measuring.machine import native_precisions
from measuring.report import Part, Table


@dataclasses.dataclass(frozen=True)
class Settings:
    weights: list
    size: tuple  # height, width
    passes: int


SETTINGS = {
    "full": Settings(["shipped:8", "shipped:16", "untrained:32"], (260, 861), 20),
    "quick": Settings(["shipped:8"], (260, 861), 5),
    "trial": Settings(["untrained:2"], (32, 32), 1),
}
KINDS = ["head", "encoders", "residual blocks", "decoders: doubled part", "decoders: skip part", "prediction"]
OWN = "the engine's own code"
# oneDNN's line of a convolution that was run (since version 3 with the kind of line) ends in its shape and
# milliseconds: [ic, oc, ih, oh, kernel h, stride h, iw, ow].
LINE = re.compile(r"^onednn_verbose,(?:v1,primitive,)?exec,cpu,convolution,"
                  r".*_?ic(\d+)oc(\d+)_ih(\d+)oh(\d+)kh(\d+)sh(\d+).*_iw(\d+)ow(\d+)kw\d+.*,([\d.e-]+)$")


def kind_of(inputs, outputs, kernel, stride, widest):
    if kernel == 1:
        return "prediction"
    if stride == 2:
        return "encoders"
    if inputs == 2:
        return "head"
    if kernel == 2:
        return "decoders: doubled part"
    # Of an odd size the last row and column of the doubled part are convolutions of their own.
    return ("decoders: doubled part" if inputs != outputs else "residual blocks" if outputs == widest
            else "decoders: skip part")


def pass_of(lines):
    """Milliseconds and multiply-adds of one pass by kind of layer, from the lines that it printed."""
    shapes = [[*map(int, found.groups()[:8]), float(found[9])] for found in map(LINE.match, lines) if found]
    widest = max((shape[1] for shape in shapes if shape[5] == 2), default=0)  # float32 by Winograd's kernels has none
    kinds = {kind: [0.0, 0] for kind in KINDS}
    for inputs, outputs, _, rows, kernel, stride, _, columns, milliseconds in shapes:
        sums = kinds[kind_of(inputs, outputs, kernel, stride, widest)]
        sums[0] += milliseconds
        sums[1] += inputs * outputs * kernel * kernel * rows * columns
    return kinds


def measure_passes(bench, settings, weights, precision):
    """Processor milliseconds of each pass, and of each what pass_of finds."""
    requests = (f"input {settings.size[0]} {settings.size[1]} {write_input(bench, settings.size)}\n"
                + "run\n" * settings.passes)
    done = subprocess.run(list(map(str, engine_command(bench, "onednn", precision, weights))), input=requests,
                          text=True, check=True, stdout=subprocess.PIPE, preexec_fn=pin_to(1),
                          env={**os.environ, **ENVIRONMENT, "ONEDNN_VERBOSE": "1"})
    totals, passes, lines = [], [], []
    for line in done.stdout.splitlines():
        if line.startswith('{"') and "cpu_ms" in line:
            totals.append(json.loads(line)["cpu_ms"])
            passes.append(pass_of(lines))
        if line.startswith("{"):
            lines = []
        lines.append(line)
    return totals, passes


def measure(bench):
    settings = SETTINGS[bench.effort]
    table = Table("layers", ["weights", "precision", "layers", "ms", "10^9 multiply-adds a second"])
    for weights in settings.weights:
        for precision in native_precisions():
            try:
                prepared = calibrated(bench, weights, settings.size) if precision == "int8" else weights
            except NotCalibrated:
                continue
            totals, passes = measure_passes(bench, settings, prepared, precision)
            for kind in KINDS:
                milliseconds = statistics.median(one[kind][0] for one in passes)
                table.add(weights, precision, kind, milliseconds,
                          passes[0][kind][1] / milliseconds / 1e6 if milliseconds else "")
            convolutions = [sum(sums[0] for sums in one.values()) for one in passes]
            table.add(weights, precision, OWN,
                      statistics.median(total - part for total, part in zip(totals, convolutions)), "")
            table.add(weights, precision, "all", statistics.median(totals), "")
    return Part([table])

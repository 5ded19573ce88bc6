#!/usr/bin/python3
"""All benchmarks, one after the other: OUT/TABLE.csv, and in OUT/machine.csv how each table was measured.

    cmake --preset release && cmake --build --preset release
    docker/bootstrap.sh packages benchmark
    tests/benchmarks/run.py [--quick] [--parts storage reading] [--v2e V2E] [--out OUT]

Leave the machine alone meanwhile. What takes turns in a round meets the same noise, so ratios can be trusted further
than times.
"""

import argparse
import csv
import dataclasses
import pathlib
import shlex
import sys
import tempfile
import time

import engines
import image_sizes
import intra_op
import layers
import numerics
import on_the_fly
import pair_counts
import photographs
import python_call
import reading
import scopes
import slow_disk
import stages
import storage
import threads
import v2e
import whole_conversion
from measuring.bench import SOURCE, Bench
from measuring.frames import original_frames
from measuring.machine import description
from measuring.report import write_lines

PARTS = {"engines": engines, "intra_op": intra_op, "layers": layers, "numerics": numerics, "stages": stages,
         "whole_conversion": whole_conversion, "image_sizes": image_sizes, "pair_counts": pair_counts,
         "threads": threads, "photographs": photographs, "storage": storage, "reading": reading,
         "on_the_fly": on_the_fly, "python_call": python_call, "slow_disk": slow_disk, "scopes": scopes, "v2e": v2e}


def measure_part(bench, name, out):
    """Writes the part's tables; how each was measured, by its name."""
    start = time.monotonic()
    print(f"{name} ...", end=" ", file=sys.stderr, flush=True)
    part = PARTS[name].measure(dataclasses.replace(bench, scratch=bench.folder(name)))
    print(f"{time.monotonic() - start:.0f} s", file=sys.stderr, flush=True)
    for what, why in part.missing.items():
        print(f"not measured: {what} ({why})", file=sys.stderr)
    measured = {"command": shlex.join(sys.argv), "settings": PARTS[name].SETTINGS[bench.effort],
                "frames": part.frames or original_frames(bench)[1], **description(bench, part.libraries)}
    tables = [table for table in part.tables if table.rows]
    for table in tables:
        table.write(out)
    return {table.name: {"table": table.name, **measured} for table in tables}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=pathlib.Path, default=SOURCE / "build" / "release",
                        help="a build of the preset `release`")
    effort = parser.add_mutually_exclusive_group()
    effort.add_argument("--quick", dest="effort", action="store_const", const="quick",
                        help="fewer rounds, sizes and pairs")
    effort.add_argument("--trial", dest="effort", action="store_const", const="trial",
                        help="only sees that all of it runs; the numbers mean nothing")
    parser.set_defaults(effort="full")
    parser.add_argument("--v2e", type=pathlib.Path, help="a checkout of SensorsINI/v2e; without it its part is skipped")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("."),
                        help="folder of the results; default: this one")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS), help="default: all")
    arguments = parser.parse_args()
    for program in (arguments.build / "eventgan", arguments.build / "tests" / "eventgan_engine_benchmark"):
        if not program.exists():
            raise SystemExit(f"expected {program}, got no such file: cmake --preset release && cmake --build "
                             "--preset release")
    arguments.out.mkdir(parents=True, exist_ok=True)
    machine = arguments.out / "machine.csv"
    lines = {}
    if machine.exists():
        with machine.open(encoding="utf-8", newline="") as file:
            lines = {line["table"]: line for line in csv.DictReader(file)}
    with tempfile.TemporaryDirectory(prefix="eventgan-benchmark-") as scratch:
        bench = Bench(arguments.build.resolve(), arguments.effort, pathlib.Path(scratch), arguments.v2e)
        for name in arguments.parts:
            lines |= measure_part(bench, name, arguments.out)
            if lines:
                write_lines(machine, [next(iter(lines.values())), *(line.values() for line in lines.values())])


if __name__ == "__main__":
    main()

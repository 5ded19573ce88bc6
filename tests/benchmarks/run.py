#!/usr/bin/python3
"""All benchmarks, one after the other: OUT/benchmarks.md and OUT/benchmarks.png.

    cmake --preset release && cmake --build --preset release
    docker/bootstrap.sh packages benchmark
    tests/benchmarks/run.py [--quick] [--out OUT] [--v2e V2E]

Leave the machine alone meanwhile. What takes turns in a round meets the same noise, so ratios can be trusted further
than times. Each part can also be run by itself, for instance tests/benchmarks/engines.py.
"""

import argparse
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
import python_call
import reading
import scopes
import slow_disk
import stages
import storage
import threads
import v2e
import whole_conversion
from measuring.bench import Bench, add_arguments, check_programs
from measuring.machine import description, processor_name
from measuring.curves import draw
from measuring.report import markdown, wrapped

PARTS = {"engines": engines, "intra_op": intra_op, "layers": layers, "numerics": numerics, "stages": stages,
         "whole_conversion": whole_conversion, "image_sizes": image_sizes, "pair_counts": pair_counts,
         "threads": threads, "storage": storage, "reading": reading, "on_the_fly": on_the_fly,
         "python_call": python_call, "slow_disk": slow_disk, "scopes": scopes, "v2e": v2e}


def measure_parts(bench, names):
    for name in names:
        start = time.monotonic()
        print(f"{name} ...", end=" ", file=sys.stderr, flush=True)
        yield PARTS[name].measure(dataclasses.replace(bench, scratch=bench.folder(name)))
        print(f"{time.monotonic() - start:.0f} s", file=sys.stderr, flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_arguments(parser)
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("."),
                        help="folder of the results; default: this one")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS), help="default: all")
    arguments = parser.parse_args()
    check_programs(arguments.build)
    arguments.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="eventgan-benchmark-") as scratch:
        bench = Bench(arguments.build.resolve(), arguments.effort, pathlib.Path(scratch), arguments.v2e)
        sections = list(measure_parts(bench, arguments.parts))
        libraries = {text for section in sections for text in section.libraries}
        machine = "\n".join(description(bench, shlex.join(sys.argv), libraries))
    page = f"# Benchmarks\n\n{wrapped(machine)}\n\n{markdown(sections)}"
    if curves := [curves for section in sections for curves in section.curves]:
        draw(curves, arguments.out / "benchmarks.png", processor_name())
        page += "\n![curves](benchmarks.png)\n"
    (arguments.out / "benchmarks.md").write_text(page, encoding="utf-8")
    print(arguments.out / "benchmarks.md")


if __name__ == "__main__":
    main()

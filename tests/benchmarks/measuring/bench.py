"""What every part of the benchmarks is given, and how a part is run alone."""

import argparse
import dataclasses
import os
import pathlib
import tempfile

from measuring.report import markdown

SOURCE = pathlib.Path(__file__).resolve().parents[3]
DATA = pathlib.Path(os.environ.get("EVENTGAN_TEST_DATA", SOURCE.parent / "shared" / "data"))
EFFORTS = ("full", "quick", "trial")


@dataclasses.dataclass(frozen=True)
class Bench:
    build: pathlib.Path    # the build folder; its programs are measured
    effort: str            # one of EFFORTS, the keys of each part's settings
    scratch: pathlib.Path  # an empty folder, deleted afterwards
    v2e: pathlib.Path | None = None  # a checkout of SensorsINI/v2e, for v2e.py

    @property
    def program(self):
        return self.build / "eventgan"

    def benchmark_program(self, name):
        return self.build / "tests" / name

    def folder(self, name):
        """A folder of its own below the scratch folder."""
        path = self.scratch / name
        path.mkdir(parents=True, exist_ok=True)
        return path


def add_arguments(parser):
    parser.add_argument("--build", type=pathlib.Path, default=SOURCE / "build" / "release",
                        help="a build of the preset `release`")
    effort = parser.add_mutually_exclusive_group()
    effort.add_argument("--quick", dest="effort", action="store_const", const="quick",
                        help="fewer rounds, sizes and pairs")
    effort.add_argument("--trial", dest="effort", action="store_const", const="trial",
                        help="only sees that all of it runs; the numbers mean nothing")
    parser.set_defaults(effort="full")
    parser.add_argument("--v2e", type=pathlib.Path, help="a checkout of SensorsINI/v2e; without it its part is skipped")


def check_programs(build):
    for program in (build / "eventgan", build / "tests" / "eventgan_engine_benchmark"):
        if not program.exists():
            raise SystemExit(f"expected {program}, got no such file: cmake --preset release && cmake --build "
                             "--preset release")


def run_part(documentation, measure):
    """The main program of a part: its section as Markdown on stdout."""
    parser = argparse.ArgumentParser(description=documentation, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_arguments(parser)
    arguments = parser.parse_args()
    check_programs(arguments.build)
    with tempfile.TemporaryDirectory(prefix="eventgan-benchmark-") as scratch:
        print(markdown(
            [measure(Bench(arguments.build.resolve(), arguments.effort, pathlib.Path(scratch), arguments.v2e))]))

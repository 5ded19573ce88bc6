"""What every part of the benchmarks is given."""

import dataclasses
import os
import pathlib

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

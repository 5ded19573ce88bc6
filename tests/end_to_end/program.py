"""Running the program from outside, as a user does, and reading what it wrote with stock h5py."""

import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

PROGRAM = os.environ["EVENTGAN_PROGRAM"]
SOURCE = pathlib.Path(os.environ["EVENTGAN_SOURCE_DIR"])
PACKAGE = pathlib.Path(PROGRAM).parent / "python"  # the Python package, with libeventgan
SHARED = pathlib.Path(os.environ.get("EVENTGAN_TEST_DATA", SOURCE.parent / "shared" / "data"))
SKIPPED = 77  # what ctest knows as skipped


def run(*arguments, expect=0, environment=None):
    """Runs the program, with changes to its environment; its output as (stdout, stderr).
    Fails the test on another exit code."""
    done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True,
                          env={**os.environ, **(environment or {})})
    if done.returncode != expect:
        raise AssertionError(
            f"expected exit code {expect}, got {done.returncode}, of {' '.join(map(str, arguments))}\n"
            f"{done.stdout}\n{done.stderr}")
    return done.stdout, done.stderr


class InFolder(unittest.TestCase):
    """A test with an empty folder of its own."""

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="eventgan-"))
        self.addCleanup(shutil.rmtree, self.folder)

    def write_manifest(self, manifest, name="manifest.json"):
        path = self.folder / name
        path.write_text(json.dumps(manifest))
        return path


def manifest(sources, **changes):
    """A manifest with sensible values around the given sources."""
    result = {
        "format": "eventgan-manifest", "version": 1, "name": "job", "seed": 7, "sources": sources,
        "image": {"preset": "mpii"}, "generator": {"weights": "untrained:2"},
        "output": {"directory": "out", "samples_per_shard": 8},
        "errors": {"policy": "quarantine", "max_count": 0, "max_fraction": 0},
    }
    result.update(changes)
    return result


def read_commented(path):
    """A manifest, whose comments have lines of their own or after two spaces."""
    return json.loads(re.sub(r"(?m)(^|  )\s*//.*$", "", path.read_text()))


def pairs(gaps, side="before", choose="one"):
    return {"gaps": gaps, "side": side, "choose": choose}


def text(value):
    return value.decode() if isinstance(value, bytes) else str(value)


def shard_bytes(folder):
    return {path.name: path.read_bytes() for path in sorted(pathlib.Path(folder).glob("*-of-*.h5"))}


def main(needs_shared_data=False):
    if needs_shared_data and not SHARED.is_dir():
        print("skipped: no ../shared/data")
        sys.exit(SKIPPED)
    unittest.main(verbosity=2)

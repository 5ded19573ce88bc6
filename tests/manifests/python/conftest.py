"""The example shards of tests/stages/shards, for the tests of this folder."""

import os
import pathlib
import runpy
import shutil
import subprocess
import sys
import tempfile
import traceback

import pytest

SOURCE = pathlib.Path(__file__).resolve().parents[3]
PACKAGE = pathlib.Path(os.environ.get("PYTHONPATH", str(SOURCE / "manifests" / "python")).split(os.pathsep)[0])
sys.path[:0] = [str(PACKAGE), str(SOURCE / "tests" / "stages" / "shards")]

from example_shards import NAME, ExampleShards

TRAINERS = pathlib.Path(os.environ.get("EVENTGAN_TEST_TRAINERS", SOURCE.parent / "shared" / "trainers"))
SECOND = "demo-train-00001-of-00002.h5"


def run_script(path, *arguments):
    """What a script says, and its exit code, in a fork of this process: PyTorch is loaded once for all. On one thread:
    those of OpenMP and OpenCV do not outlive a fork."""
    import cv2

    cv2.setNumThreads(1)
    with tempfile.TemporaryFile() as output:
        child = os.fork()
        if not child:
            code = 1
            try:
                for stream in (1, 2):
                    os.dup2(output.fileno(), stream)
                sys.stdout = sys.stderr = os.fdopen(1, "w", closefd=False)
                sys.argv, sys.path[:0] = [str(path), *map(str, arguments)], [str(pathlib.Path(path).parent)]
                os.environ["OMP_NUM_THREADS"] = "1"
                runpy.run_path(str(path), run_name="__main__")
                code = 0
            except SystemExit as end:
                code = end.code or 0
                if isinstance(code, str):
                    print(code)
                    code = 1
            except BaseException:
                traceback.print_exc()
            finally:
                sys.stdout.flush()
                os._exit(code)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        output.seek(0)
        return output.read().decode(), code


@pytest.fixture(scope="session")
def example():
    shards = ExampleShards()
    yield shards
    shards.close()


@pytest.fixture
def folder(example, tmp_path):
    """A folder with one shard of five samples, the third in quarantine, to be changed at will."""
    return pathlib.Path(shutil.copytree(example.path("uint8-1").parent, tmp_path / "out"))


@pytest.fixture
def shards(folder):
    import eventgan

    return eventgan.Shards(folder)


@pytest.fixture
def two_shards(folder):
    """The same with a second shard of the same samples."""
    shutil.copy(folder / NAME, folder / SECOND)
    record = (folder / NAME).with_suffix(".json").read_text()
    (folder / SECOND).with_suffix(".json").write_text(record.replace(NAME, SECOND))
    return folder


@pytest.fixture(scope="session")
def data(tmp_path_factory):
    """The demo, converted at half its size and finalized."""
    demo, program = tmp_path_factory.mktemp("data") / "demo", os.environ["EVENTGAN_PROGRAM"]
    subprocess.run([program, "make-demo", demo], check=True, capture_output=True)
    manifest = (demo / "manifest.json").read_text()
    assert '"width": 346, "height": 260' in manifest
    (demo / "manifest.json").write_text(manifest.replace('"width": 346, "height": 260', '"width": 176, "height": 132'))
    subprocess.run([program, "convert", demo / "manifest.json", "--output", demo / "out", "--progress", "none"],
                   check=True, capture_output=True)
    subprocess.run([program, "finalize", demo / "out"], check=True, capture_output=True)
    return demo / "out"


@pytest.fixture
def trainer(monkeypatch):
    """Puts the folder of a trainer's modules first on the path. Both trainers have a `utils`:
    what others have loaded of them is forgotten."""

    def use(path, *modules):
        if not (TRAINERS / path).is_dir():
            pytest.skip(f"no ../shared/trainers/{path}")
        for module in modules:
            pytest.importorskip(module)
        for name, module in list(sys.modules.items()):
            if str(TRAINERS) in str(getattr(module, "__file__", None)):
                monkeypatch.delitem(sys.modules, name)
        monkeypatch.syspath_prepend(str(TRAINERS / path))

    return use

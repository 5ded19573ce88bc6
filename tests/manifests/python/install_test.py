"""The package as users get it, without a network: with pip from a checkout, from its folder alone, under its old name;
what it loads and what it does not."""

import os
import pathlib
import re
import shutil
import subprocess
import sys

import pytest
from conftest import PACKAGE, SOURCE

BUILD = pathlib.Path(os.environ["EVENTGAN_BUILD"])
HERE = {name: value for name, value in os.environ.items()
        if name not in ("EVENTGAN_BUILD", "PYTHONPATH", "OMP_NUM_THREADS")}
MADE = {**HERE, "PYTHONPATH": str(PACKAGE)}
LIBRARY = "libeventgan.so.1"
HEAVY = {"torch", "h5py", "cv2", "matplotlib", "tqdm"}
VOLUME = """
import eventgan
import numpy as np
random = np.random.default_rng(7)
volume = eventgan.Generator("untrained:2")(*random.integers(0, 256, (2, 16, 24), np.uint8))
"""


def run(*command, environment=HERE, stderr=subprocess.PIPE):
    done = subprocess.run(list(map(str, command)), cwd="/", env=environment, stdout=subprocess.PIPE, stderr=stderr,
                          text=True)
    assert done.returncode == 0, f"{done.stdout}{done.stderr}"
    return done.stdout


def python(code, environment=MADE):
    return run(sys.executable, "-c", code, environment=environment)


def test_pip_installs_the_library(tmp_path):
    source = SOURCE / "manifests" / "python"
    beside = sorted(source.iterdir())
    # With the system's packages, since there is no network to fetch NumPy from.
    run(sys.executable, "-m", "venv", "--system-site-packages", "--without-pip", tmp_path / "venv")
    own = tmp_path / "venv" / "bin" / "python"
    run(own, "-m", "pip", "install", "--no-index", "--no-build-isolation", source,
        environment={**HERE, "EVENTGAN_BUILD": str(BUILD)})
    said = VOLUME + "print(eventgan.__file__, volume.shape, volume.any(), volume.tobytes().hex())"
    installed, there = (run(*command, environment=environment).split(maxsplit=1)
                        for command, environment in [((own, "-c", said), HERE), ((sys.executable, "-c", said), MADE)])
    assert pathlib.Path(installed[0]).is_relative_to(tmp_path)
    assert installed[1] == there[1] and installed[1].startswith("(18, 16, 24) True ")
    site = pathlib.Path(installed[0]).parent
    assert {path.name for path in site.iterdir()} - {"__pycache__"} == {
        LIBRARY, "py.typed", *(path.name for path in (source / "eventgan").glob("*.py*"))}
    version = python("import eventgan; print(eventgan.__version__)").strip()
    assert re.fullmatch(r"\d+\.\d+\.\d+", version)
    info = site.parent / f"eventgan-{version}.dist-info"
    assert re.search(r"(?m)^Tag: py3-none-linux_\w+$", (info / "WHEEL").read_text())  # for every Python
    assert f"CMAKE_PROJECT_VERSION:STATIC={version}\n" in (BUILD / "CMakeCache.txt").read_text()
    assert sorted(source.iterdir()) == beside  # pip leaves nothing there


def test_pip_installs_the_rest_where_the_library_cannot_be_built(tmp_path, example):
    alone, site = tmp_path / "alone", tmp_path / "site"
    shutil.copytree(SOURCE / "manifests" / "python", alone)
    # Beside what is installed pip would ask the network for NumPy, too.
    said = run(sys.executable, "-m", "pip", "install", "-v", "--no-index", "--no-deps", "--no-build-isolation",
               "--target", site, alone, stderr=subprocess.STDOUT)
    assert ("installed without its library" in said
            and f"expected the sources of the program, got none in {alone.parents[1]}\n" in said)
    assert (site / "eventgan" / "py.typed").exists()
    code = f"""
import sys
sys.path.insert(0, {str(site)!r})
import eventgan
print(eventgan.__file__, len(eventgan.Shards({str(example.path("uint8-1"))!r})))
for name in ("Generator", "sample_events"):
    try:
        getattr(eventgan, name)
    except ImportError as error:
        print(error)
"""
    file, *errors = run(sys.executable, "-I", "-c", code).splitlines()
    assert file == f"{site / 'eventgan' / '__init__.py'} 4"
    assert len(errors) == 2
    for error in errors:
        assert re.fullmatch(r"expected the library libeventgan, got none \(libeventgan\.so\.1: .*\): install the "
                            r"Debian packages libeventgan1 and python3-eventgan, "
                            r"or run `pip install -v \./manifests/python` in a checkout, which builds it or says what "
                            r"is missing", error)


class Checkout:
    """A folder in the place of a checkout, and a program in CMake's, which notes how it is called."""

    def __init__(self, folder, cmake):
        self.root, self.programs, self.log = folder / "checkout", folder / "bin", folder / "log"
        shutil.copytree(SOURCE / "manifests" / "python", self.root / "manifests" / "python")
        (self.root / "CMakePresets.json").touch()
        self.programs.mkdir()
        if cmake is not None:
            (self.programs / "cmake").write_text(f'#!/bin/sh\necho "$@" >> {self.log}\n{cmake}\n')
            (self.programs / "cmake").chmod(0o755)

    def build(self, **environment):
        """Exit code, what is said, how CMake was called."""
        self.log.write_text("")
        done = subprocess.run([sys.executable, "setup.py", "build_py", "--build-lib", self.root / "lib"],
                              cwd=self.root / "manifests" / "python",
                              env={**HERE, "PATH": str(self.programs), **environment}, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True)
        return done.returncode, done.stdout, self.log.read_text().splitlines()


@pytest.mark.parametrize("cmake, reason", [
    (None, "expected the program cmake, got none"),
    ("exit 3", "expected cmake --preset release .* to succeed, got exit code 3: see above"),
    ("test $1 != --build", "expected cmake --build .* to succeed, got exit code 1: see above"),
    ("", "expected a library, got none of .*/build/release/libeventgan.so.1")])
def test_what_is_missing_is_said_and_is_no_failure_unless_a_build_is_named(tmp_path, cmake, reason):
    checkout = Checkout(tmp_path, cmake)
    code, said, _ = checkout.build()
    assert code == 0
    assert re.search(f"installed without its library.*\n{reason}\n", said), said
    assert "docker/bootstrap.sh packages build" in said and "python3-eventgan" in said
    assert not list(checkout.root.rglob("*.so"))
    code, said, _ = checkout.build(EVENTGAN_BUILD=str(tmp_path))
    assert code != 0 and "expected " in said


def test_a_build_that_is_there_is_used_as_it_is(tmp_path):
    checkout = Checkout(tmp_path, "exit 0")
    for build, environment in [(checkout.root / "build" / "release", {}),
                               (tmp_path / "other", {"EVENTGAN_BUILD": str(tmp_path / "other")})]:
        build.mkdir(parents=True)
        (build / LIBRARY).write_text("a library")
        if not environment:
            code, said, calls = checkout.build()
            assert calls == [f"--preset release -S {checkout.root} -B {build} -DEVENTGAN_TESTS=OFF",
                             f"--build {build} --target libeventgan"]
            (build / "build.ninja").touch()
        shutil.rmtree(checkout.root / "lib", ignore_errors=True)
        code, said, calls = checkout.build(**environment)
        assert (code, calls) == (0, [f"--build {build} --target libeventgan"]), said
        assert (checkout.root / "lib" / "eventgan" / LIBRARY).read_text() == "a library"


def test_it_loads_no_library_that_it_does_not_need():
    def loaded(code):
        return set(python(f"import sys\n{code}\nprint(*(name for name in sys.modules if '.' not in name))").split())
    assert not loaded("import eventgan") & {*HEAVY, "numpy"}
    after = loaded("import eventgan\neventgan.Generator, eventgan.sample_events")
    assert "numpy" in after and not after & HEAVY
    seconds = min(float(python("import numpy, time\nbefore = time.process_time()\nimport eventgan\neventgan.Generator\n"
                               "print(time.process_time() - before)")) for _ in range(3))
    assert seconds < 0.15  # behind NumPy's own import


@pytest.mark.parametrize("other, code", [
    ("matplotlib", "import matplotlib.pyplot"),
    ("torch", """
import torch
traced = torch.jit.trace(torch.nn.ReLU(), torch.zeros(2))
assert list(traced.graph.nodes())
"""), ("cv2", "import cv2\ncv2.cvtColor(volume[0], cv2.COLOR_GRAY2BGR)"), ("scipy", "import scipy.ndimage")])
def test_packages_that_are_loaded_behind_it_work(other, code):
    """A compiled module once changed how those of others raise errors."""
    pytest.importorskip(other)
    python(VOLUME + code)


@pytest.mark.parametrize("first", ["torch", "eventgan"])
def test_it_lives_beside_pytorch(first):
    """Whichever comes first, both compute what they compute alone, and PyTorch keeps its threads."""
    pytest.importorskip("torch")
    network = """
import torch
def forward():
    torch.manual_seed(7)
    return torch.nn.Conv2d(3, 8, 3, padding=1)(torch.rand(1, 3, 33, 45)).detach().numpy().tobytes()
"""
    alone = [python(network + "print(torch.get_num_threads(), forward().hex())").split(),
             python(VOLUME + "print(volume.tobytes().hex())").split()]
    parts = [network + "of_torch = forward()\n", VOLUME]
    if first == "eventgan":
        parts.reverse()
    together = python("".join(parts) + "print(torch.get_num_threads(), forward().hex(), volume.tobytes().hex(), "
                      "of_torch == forward())").split()
    assert together == [*alone[0], *alone[1], "True"]

"""Puts the library libeventgan.so.1, which CMake builds, beside the package's sources; pyproject.toml has the rest.

It is that of the checkout's build/release, which is made if it is not there; the environment variable EVENTGAN_BUILD
names another folder that CMake has set up. Without it the package is installed even where the library cannot be built,
and what is missing is a warning, which `pip install -v` shows. The library knows nothing of Python, so a wheel is for
every Python.
"""

from __future__ import annotations

import os
import pathlib
import subprocess
import tempfile
from importlib.util import find_spec

from setuptools import Distribution, setup
from setuptools.command.build_py import build_py

try:
    from setuptools.command.bdist_wheel import bdist_wheel
except ImportError:  # before setuptools 70
    from wheel.bdist_wheel import bdist_wheel

CHECKOUT = pathlib.Path(__file__).resolve().parents[2]
LIBRARY = "libeventgan.so.1"
MISSING = """eventgan is installed without its library: Shards and their readers work, eventgan.Generator not.
{reason}
For the library, install from a checkout of eventgan, on Debian 12 or 13, after `docker/bootstrap.sh packages build`; or
the packages libeventgan1 and python3-eventgan that `docker/bootstrap.sh package` makes."""


def run(*command: str | os.PathLike) -> None:
    try:
        subprocess.run(command, check=True)
    except FileNotFoundError:
        raise RuntimeError(f"expected the program {command[0]}, got none") from None
    except subprocess.CalledProcessError as error:
        raise RuntimeError(f"expected {' '.join(map(str, command))} to succeed, got exit code "
                           f"{error.returncode}: see above") from None


def made_library() -> pathlib.Path:
    """The library's file in a build folder, made if need be."""
    if "EVENTGAN_BUILD" in os.environ:
        build = pathlib.Path(os.environ["EVENTGAN_BUILD"]).resolve()
    else:
        if not (CHECKOUT / "CMakePresets.json").exists():
            raise RuntimeError(f"expected the sources of the program, got none in {CHECKOUT}")
        build = CHECKOUT / "build" / "release"
        if not (build / "build.ninja").exists():
            run("cmake", "--preset", "release", "-S", CHECKOUT, "-B", build, "-DEVENTGAN_TESTS=OFF")
    run("cmake", "--build", build, "--target", "libeventgan")
    library = build / LIBRARY
    if not library.exists():
        raise RuntimeError(f"expected a library, got none of {library}")
    return library


class BuildWithLibrary(build_py):
    def run(self) -> None:
        super().run()
        try:
            library = made_library()
        except RuntimeError as error:
            if "EVENTGAN_BUILD" in os.environ:
                raise
            self.warn(MISSING.format(reason=error))
            return
        self.copy_file(library, os.path.join(self.build_lib, "eventgan", LIBRARY))


class Platform(Distribution):
    """With a file for one kind of processor."""

    def has_ext_modules(self) -> bool:
        return True


class AnyPython(bdist_wheel):
    def get_tag(self) -> tuple[str, str, str]:
        return "py3", "none", super().get_tag()[2]


# Debian 12's h5py has a name that pip does not know: where it is there, it is not asked for.
needed = ["numpy"] if find_spec("h5py") else ["numpy", "h5py>=3"]
# Beside the sources, a build would leave files that the next one installs, too.
with tempfile.TemporaryDirectory() as folder:
    setup(install_requires=needed, distclass=Platform,
          cmdclass={"build_py": BuildWithLibrary, "bdist_wheel": AnyPython},
          options={"build": {"build_base": folder}, "egg_info": {"egg_base": folder}})

"""Builds the compiled module eventgan._engine with CMake; pyproject.toml has the rest.

For Debian's Python and pybind11 it is that of the checkout's build/release, which is made if it is not there; others
get a build folder of their own. The environment variable EVENTGAN_BUILD names a folder that CMake has set up elsewhere.
Without it the package is installed even where the module cannot be built, and what is missing is a warning, which `pip
install -v` shows.
"""

from __future__ import annotations

import os
import pathlib
import subprocess
import sys
import sysconfig
import tempfile
from importlib.util import find_spec

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

CHECKOUT = pathlib.Path(__file__).resolve().parents[2]
MISSING = """eventgan is installed without its compiled module: Shards and their readers work, eventgan.Generator not.
{reason}
For the module, install from a checkout of eventgan, on Debian 12 or 13, after `docker/bootstrap.sh packages build`; or
the package python3-eventgan that `docker/bootstrap.sh package` makes."""


def run(*command: str | os.PathLike) -> None:
    try:
        subprocess.run(command, check=True)
    except FileNotFoundError:
        raise RuntimeError(f"expected the program {command[0]}, got none") from None
    except subprocess.CalledProcessError as error:
        raise RuntimeError(f"expected {' '.join(map(str, command))} to succeed, got exit code "
                           f"{error.returncode}: see above") from None


def made_module() -> pathlib.Path:
    """The module's file in a build folder, made if need be."""
    # not the virtual environment's, which may be gone when the folder is used again
    python = os.path.realpath(sys.executable)
    if "EVENTGAN_BUILD" in os.environ:
        build = pathlib.Path(os.environ["EVENTGAN_BUILD"]).resolve()
    else:
        if not (CHECKOUT / "CMakePresets.json").exists():
            raise RuntimeError(f"expected the sources of the program, got none in {CHECKOUT}")
        options = [f"-DPython_EXECUTABLE={python}", "-DEVENTGAN_TESTS=OFF"]
        found = find_spec("pybind11")
        # not Debian's, which CMake finds: that of Debian 12 knows no NumPy 2
        if found and not found.origin.startswith("/usr/lib/python3/"):
            import pybind11
            options.append(f"-Dpybind11_DIR={pybind11.get_cmake_dir()}")
        own = python == os.path.realpath("/usr/bin/python3") and len(options) == 2
        build = CHECKOUT / "build" / ("release" if own else f"release-{sysconfig.get_config_var('SOABI')}")
        if not own or not (build / "build.ninja").exists():
            run("cmake", "--preset", "release", "-S", CHECKOUT, "-B", build, *options)
    run("cmake", "--build", build, "--target", "eventgan_python")
    module = build / "python" / "eventgan" / f"_engine{sysconfig.get_config_var('EXT_SUFFIX')}"
    if not module.exists():
        raise RuntimeError(f"expected a build for {python}, got none of {module}")
    return module


class BuildEngine(build_ext):
    def build_extension(self, extension: Extension) -> None:
        try:
            module = made_module()
        except RuntimeError as error:
            if "EVENTGAN_BUILD" in os.environ:
                raise
            self.warn(MISSING.format(reason=error))
            return
        target = self.get_ext_fullpath(extension.name)
        self.mkpath(os.path.dirname(target))
        self.copy_file(module, target)


# Debian 12's h5py has a name that pip does not know: where it is there, it is not asked for.
needed = ["numpy"] if find_spec("h5py") else ["numpy", "h5py>=3"]
# Beside the sources, a build would leave files that the next one installs, too.
with tempfile.TemporaryDirectory() as folder:
    setup(install_requires=needed, ext_modules=[Extension("eventgan._engine", sources=[], optional=True)],
          cmdclass={"build_ext": BuildEngine},
          options={"build": {"build_base": folder}, "egg_info": {"egg_base": folder}})

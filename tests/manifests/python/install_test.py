"""`pip install ./manifests/python`, as a user would, without a network."""

import shutil
import subprocess
import sys

from conftest import SOURCE


def test_pip_installs_the_package(tmp_path):
    source = shutil.copytree(SOURCE / "manifests" / "python", tmp_path / "source")  # pip builds beside the sources
    subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps", "--no-build-isolation",
                    "--target", tmp_path / "site", source], check=True)
    answer = subprocess.run([sys.executable, "-I", "-c", f"import sys; sys.path.insert(0, {str(tmp_path / 'site')!r}); "
                             "import eventgan; print(eventgan.__file__)"], check=True, capture_output=True, text=True)
    assert answer.stdout.startswith(str(tmp_path / "site"))
    assert (tmp_path / "site" / "eventgan" / "py.typed").exists()

"""manifests/python/examples/*.ipynb: notebooks without outputs that run."""

import ast
import base64
import json
import os
import pathlib
import time

import pytest
from conftest import SOURCE

import eventgan

NOTEBOOKS = sorted((SOURCE / "manifests" / "python" / "examples").glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.name)
def test_a_notebook_is_one_and_has_no_outputs(path):
    notebook = json.loads(path.read_text())
    assert (notebook["nbformat"], notebook["nbformat_minor"]) == (4, 5)
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    for cell in code:
        ast.parse("".join(cell["source"]))
        assert not cell["outputs"] and cell["execution_count"] is None
    assert code and len({cell["id"] for cell in notebook["cells"]}) == len(notebook["cells"])
    pages = (SOURCE / "manifests" / "guides" / "python.md").read_text()
    for link in (part.partition(")")[0] for cell in notebook["cells"]
                 for part in "".join(cell["source"]).split("](")[1:]):
        page, _, heading = link.partition("#")
        assert (path.parent / page).resolve() == SOURCE / "manifests" / "guides" / "python.md"
        assert heading in {line.lstrip("# ").lower().replace(" ", "-") for line in pages.splitlines()
                           if line.startswith("#")}
    try:
        import nbformat
    except ImportError:
        return
    nbformat.validate(nbformat.read(path, as_version=4))


def test_the_quickstart_runs_in_a_minute(tmp_path, monkeypatch):
    nbformat, preprocessors = pytest.importorskip("nbformat"), pytest.importorskip("nbconvert.preprocessors")
    for module in ("ipykernel", "matplotlib", "eventgan._engine"):
        pytest.importorskip(module)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(pathlib.Path(eventgan.__file__).parent.parent),
                                                      os.environ.get("PYTHONPATH", "")]))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.delenv("MPLBACKEND", raising=False)
    notebook, = (nbformat.read(path, as_version=4) for path in NOTEBOOKS if path.name == "quickstart.ipynb")
    start = time.monotonic()
    preprocessors.ExecutePreprocessor(timeout=120,
                                      kernel_name="python3").preprocess(notebook, {"metadata": {"path": str(tmp_path)}})
    assert time.monotonic() - start < 60
    shown = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    data = [output.data for output in shown if "data" in output]
    assert sum("image/png" in each for each in data) == 4
    table, = (each["text/html"] for each in data if each.get("text/html", "").startswith("<table>"))
    assert "<td style=\"text-align:left\">41</td>" in table
    assert any("(18, 188, 621) float32" in output.get("text", "") for output in shown)
    # for eyes: kept by pytest
    for number, each in enumerate(each["image/png"] for each in data if "image/png" in each):
        (tmp_path / f"{number}.png").write_bytes(base64.b64decode(each))

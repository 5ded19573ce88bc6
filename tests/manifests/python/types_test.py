"""The package's type hints: everywhere, and such that mypy agrees with them."""

import ast
import re
import subprocess
import sys

import numpy as np
import pytest
from conftest import SOURCE

PACKAGE = SOURCE / "manifests" / "python"
MODULES = sorted((PACKAGE / "eventgan").glob("*.py"))


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
def test_every_function_says_what_it_takes_and_gives(path):
    for function in ast.walk(ast.parse(path.read_text())):
        if isinstance(function, ast.FunctionDef):
            given = [each for each in (*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs,
                                       function.args.vararg, function.args.kwarg)
                     if each and each.arg not in ("self", "cls")]
            assert function.returns and all(each.annotation
                                            for each in given), f"{path}:{function.lineno}: {function.name}"


def test_mypy_agrees(tmp_path):
    pytest.importorskip("mypy")
    if int(np.__version__.split(".")[0]) > 1:
        pytest.skip("NumPy 1, whose types the hints were written against")
    done = subprocess.run([sys.executable, "-m", "mypy", "--config-file", PACKAGE / "pyproject.toml", "--cache-dir",
                           tmp_path, PACKAGE / "eventgan"],
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def documented(docstring):
    """The names in the section Parameters of a docstring in numpydoc's form; None without one."""
    section = re.search(r"(?ms)^Parameters\n-+\n(.*?)(?=^\S[^\n]*\n---|\Z)", docstring)
    if not section:
        return None
    headings = re.findall(r"(?m)^(\*{0,2}\w+(?:, \*{0,2}\w+)*)(?: :.*)?$", section[1])
    return [name.lstrip("*") for heading in headings for name in heading.split(", ")]


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
def test_public_names_are_described_with_the_parameters_that_they_have(path):
    def check(nodes, prefix):
        for node in nodes:
            if not isinstance(node, (ast.FunctionDef, ast.ClassDef)) or node.name.startswith("_"):
                continue
            name, docstring = f"{path}: {prefix}{node.name}", ast.get_docstring(node)
            assert docstring, name
            function = node
            if isinstance(node, ast.ClassDef):
                check(node.body, f"{node.name}.")
                function = next((each for each in node.body if isinstance(each, ast.FunctionDef)
                                 and each.name == "__init__"), None)
            if function and documented(docstring) is not None:
                arguments = function.args
                given = [*arguments.posonlyargs, *arguments.args, arguments.vararg, *arguments.kwonlyargs,
                         arguments.kwarg]
                assert sorted(documented(docstring)) == sorted(each.arg for each in given if each
                                                               and each.arg not in ("self", "cls")), name

    check(ast.parse(path.read_text()).body, "")

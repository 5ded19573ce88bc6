"""The settings of an experiment's folder, whose results and networks are of these alone; and files that are whole."""

from __future__ import annotations

import json
import pathlib
import subprocess
import sys
from collections.abc import Mapping
from typing import Any


def require_same(folder: pathlib.Path, program: str | pathlib.Path, settings: Mapping[str, Any]) -> None:
    """Keeps the settings and the program's version in FOLDER/settings.json. Those that are there must be the same, and
    more may come: else results that were computed with others would be taken for these, and the experiment ends."""
    version = subprocess.run([program, "--version"], capture_output=True, text=True, check=True).stdout.splitlines()[0]
    path = folder / "settings.json"
    known = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    given = json.loads(json.dumps({"program": version, **settings}, default=str))
    for name, value in given.items():
        if known.get(name, value) != value:
            sys.exit(f"error: expected {name} {known[name]}, as when this folder was begun, got {value}, in {path}: "
                     "choose another --out")
    folder.mkdir(parents=True, exist_ok=True)
    write(path, json.dumps(known | given, indent=1) + "\n")


def write(file: pathlib.Path, content: str) -> None:
    new = file.with_name(file.name + ".new")
    new.write_text(content, encoding="utf-8")
    new.replace(file)

"""kept_settings.py: another setting than that of what lies in a folder is refused, new ones are added."""

import json
import os
import pathlib

import pytest
from kept_settings import require_same

PROGRAM = os.environ["EVENTGAN_PROGRAM"]


def test_settings_of_a_folder_stay(tmp_path):
    out = tmp_path / "out"
    require_same(out, PROGRAM, {"frames": pathlib.Path("a"), "sizes": (1, 2)})
    require_same(out, PROGRAM, {"sizes": [1, 2], "row b": "new"})
    before = (out / "settings.json").read_text()
    with pytest.raises(SystemExit, match="expected frames a, as when this folder was begun, got c, in .*settings.json"):
        require_same(out, PROGRAM, {"row c": "new", "frames": "c"})
    assert (out / "settings.json").read_text() == before and [*out.iterdir()] == [out / "settings.json"]
    known = json.loads(before)
    assert known.pop("program").startswith("eventgan ")
    assert known == {"frames": "a", "sizes": [1, 2], "row b": "new"}


def test_another_version_of_the_program_is_another_setting(tmp_path):
    other = tmp_path / "program"
    other.write_text("#!/bin/sh\necho eventgan 0.1.0\n")
    other.chmod(0o755)
    require_same(tmp_path, PROGRAM, {})
    with pytest.raises(SystemExit, match="expected program eventgan .* got eventgan 0.1.0"):
        require_same(tmp_path, other, {})

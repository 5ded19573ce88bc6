"""supervised_flow.py: a small run fills the table and goes on, and nothing of another trainer's is kept."""

import argparse
import csv
import json
import os
import pathlib
import shutil
import subprocess
import sys

import numpy as np
import pytest
from conftest import EXPERIMENTS, nightly

pytest.importorskip("torch")
pytest.importorskip("matplotlib")
pytest.importorskip("h5py")
cv2 = pytest.importorskip("cv2")

import supervised_flow


def test_results_are_those_of_a_version_of_the_trainer(tmp_path, monkeypatch):
    args = argparse.Namespace(bfloat16=False)
    versions = [supervised_flow.version(args), supervised_flow.version(argparse.Namespace(bfloat16=True))]
    copies = [pathlib.Path(shutil.copy(path, tmp_path)) for path in supervised_flow.SOURCES]
    monkeypatch.setattr(supervised_flow, "SOURCES", copies)
    assert supervised_flow.version(args) == versions[0]
    for path in copies:
        path.write_text(path.read_text() + "WIDTH = 16\n")
        versions.append(supervised_flow.version(args))
    assert len(set(versions)) == 4


@nightly
def test_a_small_run_fills_the_table_and_goes_on(recording_folder, tmp_path):
    random, images = np.random.default_rng(1), tmp_path / "photos" / "images"
    images.mkdir(parents=True)
    for i in range(4):
        blocks = np.kron(random.integers(0, 256, (24, 24)), np.ones((20, 20))).astype(np.uint8)
        assert cv2.imwrite(str(images / f"{i}.png"), blocks)
    (tmp_path / "photos" / "boxes.csv").write_text("image,class,left,top,right,bottom\n"
                                                   + "".join(f"{i}.png,car,100,100,300,250\n" for i in range(4)))

    def run(*more):
        done = subprocess.run([sys.executable, EXPERIMENTS / "supervised_flow.py", "--program",
                               os.environ["EVENTGAN_PROGRAM"], "--frames", tmp_path / "photos", "--recordings",
                               recording_folder, "--out", tmp_path / "out", "--steps", "2", "--seeds", "1", *more],
                              capture_output=True, text=True, env={**os.environ, "OMP_NUM_THREADS": "1"})
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    run("--with", "difference")
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    assert f"difference, 2 steps, seed 0, {supervised_flow.version(argparse.Namespace(bfloat16=False))}" in results
    said = run("--with", "difference", "esim")
    assert "epoch" in said and "difference, 2 steps" in said
    rows = {row["learnt on"]: row for row in csv.DictReader((tmp_path / "out" / "table.csv").open())}
    assert set(rows) == {"previous frame as it is", "previous frame blurred by 1 px",
                         "previous frame moved by half a pixel", "best constant flow of the recording",
                         "least squares", "difference", "esim"}
    assert float(rows["previous frame as it is"]["mean"]) == 1
    # by a pixel to the right, but for what comes in at the edge
    assert float(rows["best constant flow of the recording"]["mean"]) < 0.2
    again = json.loads((tmp_path / "out" / "results.json").read_text())
    assert results.items() < again.items()

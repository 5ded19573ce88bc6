"""experiment.py: the paper's experiments with a simulated camera, in small."""

import json
import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest
from conftest import EXPERIMENTS, SOURCE, nightly

from eventgan import Shards

pytest.importorskip("torch")
PROGRAM = os.environ["EVENTGAN_PROGRAM"]
TRAINERS = pathlib.Path(os.environ.get("EVENTGAN_TEST_TRAINERS", SOURCE.parent / "shared" / "trainers"))
ONE_THREAD = {**os.environ, "OMP_NUM_THREADS": "1"}


def need_trainer(name, *modules):
    if not (TRAINERS / name).is_dir():
        pytest.skip(f"no ../shared/trainers/{name}")
    for module in modules:
        pytest.importorskip(module)
    return TRAINERS / name


DETECTORS = [*(row for name in ("EventGAN", "log difference", "ESIM") for row in (name, f"{name}, as bright")), "Frame"]
YOLO, POSE = ("yolov3", "matplotlib", "tqdm"), ("pose_resnet", "easydict", "yaml")
POSES = ["EventGAN", "EventGAN, without noise", "EventGAN, last layer 1 epoch", "EventGAN, last layer 5 epochs",
         "camera"]


def run(what, trainer, out):
    """What the experiment says, in small; its networks train where they have not."""
    done = subprocess.run([sys.executable, EXPERIMENTS / "experiment.py", what, "--program", PROGRAM, "--trainer",
                           need_trainer(*trainer), "--out", out, "--small"],
                          capture_output=True, text=True, env=ONE_THREAD)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def cars(tmp_path_factory):
    """The folder of detection and trade, which share scenes, the camera and the first of their networks; and what
    detection said."""
    out = tmp_path_factory.mktemp("cars")
    return out, run("detection", YOLO, out)


@nightly
@pytest.mark.parametrize(("what", "score", "names"), [("detection", "ap_voc", DETECTORS), ("pose", "pckh", POSES)])
def test_the_experiments_in_small(tmp_path, request, what, score, names):
    out, said = request.getfixturevalue("cars") if what == "detection" else (tmp_path, run(what, POSE, tmp_path))
    assert said.count("examples/train_") == len(names)
    rows = json.loads((out / f"{what}.json").read_text())
    assert list(rows) == names and all(len(row[score]) == 1 for row in rows.values())
    assert all(name in said for name in names)
    camera = out / "camera"
    events, labelled = Shards(camera / "events"), Shards(camera / "labelled")
    for folder in (camera / "events", camera / "labelled"):
        subprocess.run([PROGRAM, "verify", folder], check=True, capture_output=True)  # nothing has changed them
    if what == "detection":
        train_shards = Shards(out / "scenes" / "ESIM", split="train")
        factor = np.mean([s["volume"].mean() for s in train_shards]) / np.mean([s["volume"].mean() for s in events])
        assert (f"{camera / 'events'} are scaled by {factor:.2f}, to the brightness of those of "
                f"{out / 'scenes' / 'ESIM'}\n" in said)
        for i in range(len(labelled)):
            seen, drawn = events.labels(i), labelled.labels(i)
            assert seen["pair"]["sample_id"].startswith(drawn["pair"]["sample_id"] + "/")
            # the camera's image is whole pixels high
            np.testing.assert_allclose(seen["boxes"]["xyxy"], drawn["boxes"]["xyxy"], atol=0.51)
            np.testing.assert_array_equal(seen["boxes"]["ignore"], drawn["boxes"]["ignore"])
            np.testing.assert_array_equal(seen["boxes"]["difficulty"] > 0, drawn["boxes"]["difficulty"] > 0)
    else:
        assert "examples/train_" not in run(what, POSE, out)  # done before
        joints = {sample["pair"]["sample_id"]: sample["persons"]["joints"]
                  for sample in map(labelled.labels, range(len(labelled)))}
        assert len(events) == len(labelled)
        for sample in map(events.labels, range(len(events))):
            np.testing.assert_allclose(sample["persons"]["joints"], joints[sample["pair"]["sample_id"].split("/")[0]],
                                       atol=0.51)


@nightly
def test_the_trade_in_small(cars):
    out, before = cars
    said = run("trade", YOLO, out)
    errors = {name: row["error"] for name, row in json.loads((out / "trade.json").read_text()).items()}
    made = {line for line in said.splitlines() if "make-demo" in line or "train_" in line}
    assert len(made) == len(errors) - 2 and not made & {*before.splitlines()}  # the others were there
    assert (errors.pop("EventGAN") == errors.pop("EventGAN, as bright") == [0] and errors
            and all(0 < error < 1 for [error] in errors.values()))

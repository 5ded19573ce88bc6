"""manifests/python/examples/train_detector.py: targets, loss and boxes that belong together,
and a few steps on the demo; takeaway.py and detect.py: the same boxes without the training."""

import csv
import io
import json
import os
import pathlib
import shutil
import subprocess
import sys

import numpy as np
import pytest
from conftest import SOURCE, run_script

torch = pytest.importorskip("torch")
pytest.importorskip("cv2")
EXAMPLES = SOURCE / "manifests" / "python" / "examples"
sys.path.append(str(EXAMPLES))

import detect
import takeaway
import train_detector as detector

import eventgan


def item(boxes, labels=None, ignore=None, height=96, width=128):
    boxes = torch.tensor(boxes, dtype=torch.float32).reshape(-1, 4)
    return {"volume": torch.zeros(1, height, width), "boxes": boxes, "labels": torch.tensor(labels or [0] * len(boxes)),
            "ignore": torch.tensor(ignore or [False] * len(boxes), dtype=torch.bool)}


class Learnt(torch.nn.Module):
    """Gives what it was told to."""

    def __init__(self, *output):
        super().__init__()
        self.output, self.scale = output, torch.nn.Parameter(torch.ones(()))

    def forward(self, _):
        return self.output


def perfect(given, classes=1):
    """Output [1, ...] of a network that has learnt the item."""
    heat, boxes, weight = (each[None] for each in detector.target_of(given, classes, 12, 16))
    at = detector.middles(12, 16).permute(2, 0, 1)
    edges = torch.where(weight[:, None] > 0, torch.cat([at - boxes[:, :2], boxes[:, 2:] - at], 1), torch.ones(()))
    return torch.where(heat == 1, 20.0, -20.0), edges, heat, boxes, weight


def test_targets_of_a_box():
    """Its middle, (44, 36), is in the cell from 40 to 48, 32 to 40, whose own middle it is: there the Gaussian has 1,
    and around it what its deviations say, 0.09 of the sides, at least a quarter of a cell."""
    heat, boxes, weight = detector.target_of(item([[4, 16, 84, 56]]), 1, 12, 16)
    assert heat.shape == (1, 12, 16) and heat[0, 4, 5] == 1 and (heat == 1).sum() == 1
    assert (heat[0, 4, 6] == pytest.approx(np.exp(-0.5 * (8 / 7.2) ** 2))
            and heat[0, 5, 5] == pytest.approx(np.exp(-0.5 * (8 / 3.6) ** 2)))
    assert boxes[:, 4, 5].tolist() == [4, 16, 84, 56] and (weight > 0).sum() == (heat > 0.1).sum()
    assert weight.sum() == pytest.approx(np.log(80 * 40), rel=1e-5)  # a large box counts a little more than a small one


def test_targets_of_several_boxes():
    """The smaller one in the middle of the larger one has its cell; a box to be ignored is neither found nor missed;
    one at the edge stays inside."""
    heat, boxes, _ = detector.target_of(
        item([[36, 28, 52, 44], [4, 0, 84, 72], [100, 60, 128, 96], [120, 88, 136, 104]], [0, 1, 0, 0],
             [False, False, True, False]), 2, 12, 16)
    assert heat[0, 4, 5] == heat[1, 4, 5] == 1 and boxes[:, 4, 5].tolist() == [36, 28, 52, 44]
    assert (heat[:, 8:11, 13:15] == -1).all()
    assert heat[0, 11, 15] == 1
    nothing = detector.target_of(item([]), 2, 12, 16)
    assert all(not each.any() for each in nothing)


def test_small_boxes_are_told_with_a_scale_that_makes_them_larger(capsys):
    """Of 10x6, 30x6, 6x40 and an ignored 2x2 box the median of the shorter sides is 6. At --scale 2.5 it is 15, at 3
    it is 18, 16 or more."""
    area = np.array([0, 0, 128, 96])
    small = item([[0, 0, 10, 6], [0, 0, 30, 6], [0, 0, 6, 40], [0, 0, 2, 2]], ignore=[False, False, False, True])
    sides = detector.shorter_sides([small, item([[0, 0, 50, 40]], [1])], ["dog", "cat", "cow"])
    assert [sides[name].tolist() for name in sides] == [[6, 6, 6], [40], []]
    assert detector.warn_of_small(sides, area, 1.0) == 3
    told = capsys.readouterr()
    assert "3 dog 6 px, 1 cat 40 px, 0 cow" in told.out
    assert "warning: half of the boxes of dog are narrower than 6 pixels" in told.err
    assert "--scale 3 makes them 18" in told.err
    assert detector.warn_of_small({"dog": np.array([16.0])}, area, 1.0) is None and not capsys.readouterr().err
    assert detector.warn_of_small({"dog": np.array([1.0])}, area, 1.0) == 4  # at most
    assert "--scale 4 makes them 4, which is little" in capsys.readouterr().err
    assert detector.warn_of_small({"dog": np.array([1.0])}, area, 4.0) is None
    assert "need larger volumes" in capsys.readouterr().err


def test_a_poor_result_is_told_with_what_helps():
    def summary(score, untrained=0.0):
        return {"metric": "AP50 dog", "AP50 dog": score, "untrained": untrained, "history": [{"step": 200}]}

    told = detector.advice(summary(0.0006), items=50, larger=3.0)
    assert told.startswith("AP50 dog 0.0006 on the validation samples is next to nothing")
    assert "--steps 3000 in place of 200" in told and "--scale 3 " in told and "more labelled images than 50" in told
    assert "--scale" not in detector.advice(summary(0.3, untrained=0.4), items=500, larger=None)
    assert detector.advice(summary(0.3), items=50, larger=None) is None
    assert "no box of that class" in detector.advice(summary(None), items=50, larger=None)


def test_what_is_learnt_is_what_is_found():
    given = item([[4, 16, 84, 56], [70, 2, 90, 90], [100, 60, 128, 96]])
    logits, edges, heat, boxes, weight = perfect(given)

    found, labels, scores = next(detector.detect(Learnt(logits, edges), given["volume"][None]))
    order = found[:, 0].argsort()
    torch.testing.assert_close(found[order], given["boxes"], atol=1e-4, rtol=0)
    assert (labels == 0).all() and (scores > 0.99).all()
    assert detector.detection_loss(logits, edges, heat, boxes, weight) == pytest.approx(0, abs=1e-4)
    assert detector.detection_loss(logits, 1.5 * edges, heat, boxes, weight) > 1
    assert detector.detection_loss(-logits, edges, heat, boxes, weight) > 10
    absent = detector.target_of(item([]), 1, 12, 16)
    assert torch.isfinite(detector.detection_loss(logits, edges, *(each[None] for each in absent)))


def test_giou():
    """Of boxes 0..4 and 2..6 of height 2: overlap 4, union 12, hull 12; of 0..2 and 4..6: none, union 8, hull 12."""
    def boxes(*given):
        return torch.tensor(given, dtype=torch.float32).T

    first, second = boxes([0, 0, 4, 2], [0, 0, 2, 2], [1, 1, 2, 2]), boxes([2, 0, 6, 2], [4, 0, 6, 2], [1, 1, 2, 2])
    torch.testing.assert_close(detector.giou(first, second), torch.tensor([4 / 12, -4 / 12, 1]))


def test_overlapping_boxes_are_one():
    """Both cells have the same box; the likelier one is left. A box without an area is none."""
    logits, edges = torch.full((1, 1, 2, 3), -20.0), torch.ones(1, 4, 2, 3)
    logits[0, 0, 0, 0], logits[0, 0, 1, 2] = 1.0, 2.0
    edges[0, :, 0, 0], edges[0, :, 1, 2] = torch.tensor([4.0, 4, 20, 12]), torch.tensor([20.0, 12, 4, 4])

    [(found, _, scores)] = detector.detect(Learnt(logits, edges), torch.zeros(1, 1, 16, 24))
    assert found.tolist() == [[0, 0, 24, 16]] and scores.tolist() == pytest.approx([1 / (1 + np.exp(-2))])


@pytest.mark.parametrize("channels", ["signed", "volume"])
def test_a_few_steps(channels, data, tmp_path):
    line = [EXAMPLES / "train_detector.py", "--data", data, "--out", tmp_path / "out", "--dataset", "kitti_object",
            "--threads", "1", "--channels", channels, "--batch", "4", "--images", "2", "--every", "2"]
    for epochs in ("2", "4"):  # and on
        said, code = run_script(*line, "--epochs", epochs)
        assert code == 0, said
    assert "resuming after epoch 2" in said
    history = json.loads((tmp_path / "out" / "metrics.json").read_text())["history"]
    assert [row["epoch"] for row in history] == [0, 2, 4] and history[-1]["loss"] < history[1]["loss"]
    assert len([*pathlib.Path(tmp_path, "out", "images").iterdir()]) == 2
    entries = json.loads((tmp_path / "out" / "predictions.json").read_text())
    said, code = run_script(*line[:-2], "--every", "9", "--epochs", "1", "--out", tmp_path / "more", "--pretrained",
                            tmp_path / "out" / "weights.pt")
    assert code == 0 and "of the model's" in said, said
    assert all(entry["category_id"] == "Car" and len(entry["bbox"]) == 4 for entry in entries)
    assert_taken_away(tmp_path / "out", [*line, "--epochs", "4"], tmp_path)
    said, code = run_script(*line, "--classes", "Cat", "--epochs", "1", "--out", tmp_path / "cats")
    assert code == 1 and "got Cat" in said and "Traceback" not in said


def camera(count, size=(132, 176), seed=3):
    """So many events of a second, of a square that crosses a sensor of that size; microseconds."""
    draw = np.random.default_rng(seed)
    events = np.zeros(count, [("t", "<i8"), ("x", "<i2"), ("y", "<i2"), ("p", "i1")])
    events["t"] = 5_000_000 + np.sort(draw.integers(0, 1_000_000, count))
    events["x"] = (events["t"] - 5_000_000) * (size[1] - 60) // 1_000_000 + draw.integers(0, 60, count)
    events["y"], events["p"] = draw.integers(30, 90, count), draw.integers(0, 2, count)
    return events


@pytest.mark.parametrize("normalize, signed", [("none", False), ("eta98", False), ("none", True), ("eta98", True)])
def test_what_is_taken_away_sees_what_shards_have(normalize, signed):
    made = takeaway.EventsToBoxes(torch.nn.Identity(), (96, 128), 9, normalize == "eta98", signed)
    for events in (camera(20_000), camera(1), camera(2)):
        volume = eventgan.represent(events, "volume:9", size=(132, 176))
        if normalize == "eta98":
            there = np.sort(volume[volume > 0])
            volume = np.minimum(volume / there[max(int(0.98 * len(there)), 1) - 1], 1)
        expected = eventgan.signed_channel(volume) if signed else volume
        seen = made.seen(*map(torch.from_numpy, detect.columns(events)), 132, 176)
        np.testing.assert_allclose(seen.numpy(), expected, atol=2e-5)
    events = np.array([(0, 5, 5, 1), (9, 5, 5, 0)], camera(0).dtype)  # as many of both: no signed event
    assert np.isfinite(made.seen(*map(torch.from_numpy, detect.columns(events)), 132, 176).numpy()).all()
    with pytest.raises(Exception, match="expected events within 50x40, got one at"):
        made(*map(torch.from_numpy, detect.columns(camera(100))), 40, 50)


def test_recordings_are_read_by_their_names(tmp_path):
    h5py, events = pytest.importorskip("h5py"), camera(50)
    expected = np.stack(detect.columns(events))
    np.save(tmp_path / "a.npy", events[::-1])
    np.savez(tmp_path / "a.npz", t_us=events["t"], x=events["x"], y=events["y"], polarity=2 * events["p"] - 1)
    with h5py.File(tmp_path / "dsec.h5", "w") as file:
        for name in "xytp":
            file[f"events/{name}"] = events[name]
    with h5py.File(tmp_path / "mvsec.hdf5", "w") as file:
        file["davis/left/events"] = np.stack([events["x"], events["y"], events["t"] * 1e-6, 2.0 * events["p"] - 1], 1)
        file["davis/left/image_raw"] = np.zeros((1, 132, 176), np.uint8)
    np.savez(tmp_path / "b.npz", t=events["t"], x=events["x"], y=events["y"], p=(2 * events["p"] - 1).astype("u1"))
    for name, size in (("a.npy", None), ("a.npz", None), ("b.npz", None),
                       ("dsec.h5", None), ("mvsec.hdf5", (132, 176))):
        found, seen = detect.read(tmp_path / name)
        assert seen == size
        np.testing.assert_array_equal(found[0], expected[0], name)
        assert sorted(found.T.tolist()) == sorted(expected.T.tolist())  # those of one time in any order


def test_what_detect_cannot_use_is_told_in_a_line(tmp_path):
    h5py, events = pytest.importorskip("h5py"), camera(500)
    takeaway.write(tmp_path, detector.Detector(1, 1).eval(), detector.likeliest, 1, (96, 128), {
        "classes": ["Car"], "bins": 9, "normalize": "none", "channels": "signed", "score": 0.3, "window_ms": 50})
    np.save(tmp_path / "good.npy", events)
    np.save(tmp_path / "bare.npy", np.zeros((5, 4)))
    events["p"] += 1
    np.save(tmp_path / "polarities.npy", events)
    events["x"][7] = -1
    events["p"] -= 1
    np.save(tmp_path / "negative.npy", events)
    (tmp_path / "camera.raw").write_bytes(b"% evt 3.0\n")
    with h5py.File(tmp_path / "eventgan.hdf5", "w") as file:
        file["davis/events/data"] = np.zeros((5, 4))
    for name in ("alone", "damaged"):
        (tmp_path / name).mkdir()
        shutil.copy(tmp_path / "detect.py", tmp_path / name)
    whole, damaged = (tmp_path / "detector.pt").read_bytes(), tmp_path / "damaged" / "detector.pt"
    damaged.write_bytes(whole[:len(whole) // 2])
    for script, name, options, error in (
            ("detect.py", "none.npz", [], f"expected a file, got none, in {tmp_path / 'none.npz'}"),
            ("alone/detect.py", "good.npy", [], f"expected a file, got none, in {tmp_path / 'alone' / 'detector.pt'}"),
            ("damaged/detect.py", "good.npy", [], f"), in {damaged}"),
            ("detect.py", "camera.raw", [], "(Unable to "),
            ("detect.py", "eventgan.hdf5", [], "object 'events' doesn't exist"),
            ("detect.py", "bare.npy", [], "(expected columns t, x, y and p, got none with a name), in "),
            ("detect.py", "polarities.npy", [], "(expected polarities -1 and 1 or 0 and 1, got 2), in "),
            ("detect.py", "negative.npy", [], f"got one at -1, {events['y'][7]}, in {tmp_path / 'negative.npy'}"),
            ("detect.py", "good.npy", ["--sensor", "32x30"], "expected events within 32x30, got one at "),
            ("detect.py", "good.npy", ["--sensor", "64"], "expected --sensor as 346x260, got 64"),
            ("detect.py", "good.npy", ["--window-ms", "0"], "expected --window-ms from 0.001 to 1e+09, got 0"),
            ("detect.py", "good.npy", ["--window-ms", "-5"], "expected --window-ms from 0.001 to 1e+09, got -5"),
            ("detect.py", "good.npy", ["--score", "nan"], "expected --score from 0 to 1, got nan")):
        said, code = run_script(tmp_path / script, tmp_path / name, *options)
        assert code == 1 and error in said and said.count("\n") == 1, said
        assert options or f"in {tmp_path}" in said
    said, code = run_script(tmp_path / "detect.py", tmp_path / "good.npy", "--window-ms", "400", "--score", "0")
    assert code == 0, said
    assert {int(row["t_us"]) - int(events["t"][0]) for row in csv.DictReader(io.StringIO(said))} == {
        400_000, 800_000, 1_200_000}


def test_detect_cuts_boxes_to_the_sensor_and_ends_with_its_reader(tmp_path):
    """96x96 pixels in the middle of 96x128: what lies in the borders is nothing that the camera sees."""
    found = torch.tensor([[[-3.0, 10, 12, 40], [16, -5, 40, 200], [100, 20, 140, 60], [114, 20, 126, 60]]])
    takeaway.write(tmp_path, torch.nn.Identity(), lambda events: (
        found + 0 * events.sum(), torch.zeros(1, 4, dtype=torch.long), torch.tensor([[0.9, 0.8, 0.7, 0.6]])), 1,
        (96, 128), {"classes": ["Car"], "bins": 9, "normalize": "none", "channels": "signed", "score": 0.3,
                    "window_ms": 0.001})
    events = camera(500)
    events["x"] %= 96
    events["y"] %= 96
    boxes, _, scores = detect.Detector(tmp_path / "detector.pt")(events, (96, 96))
    assert boxes.tolist() == [[0, 0, 24, 96], [84, 20, 12, 40]] and scores == pytest.approx([0.8, 0.7])
    np.save(tmp_path / "events.npy", events)
    line = f"{sys.executable} {tmp_path / 'detect.py'} {tmp_path / 'events.npy'} | head -n 2"
    done = subprocess.run(line, shell=True, capture_output=True, text=True)
    assert done.stderr == "" and done.stdout.startswith("t_us,x,y,w,h,class,score\n")


def convert_camera(folder, name, window_us):
    """FOLDER/NAME.npy with a box in each of its first three windows, which FOLDER/shards has; their ends."""
    folder.mkdir()
    events = camera(30_000)
    np.save(folder / f"{name}.npy", events)
    ends = events["t"][0] + window_us * np.arange(1, 4)
    (folder / f"{name}.csv").write_text("time_s,left,top,right,bottom,class\n"
                                        + "".join(f"{end * 1e-6:.6f},10,30,70,90,Car\n" for end in ends))
    eventgan.convert({"format": "eventgan-manifest", "version": 1, "name": "test", "image": {},
                      "sources": [{"dataset": "recording", "root": str(folder / f"{name}.npy"),
                                   "window_s": window_us * 1e-6, "sensor": {"width": 176, "height": 132}}],
                      "generator": {"kind": "events"}, "output": {"directory": "shards", "dtype": "float32"}},
                     folder / "shards", progress=False)
    return ends


def assert_taken_away(out, line, tmp_path):
    """detect.py finds in a recording, with nothing but its folder, what the trainer finds in the converted one."""
    recordings, alone = tmp_path / "recordings", tmp_path / "alone"
    alone.mkdir()
    for name in ("detect.py", "detector.pt"):
        shutil.copy(out / name, alone)
    window_us = round(1000 * detect.Detector(alone / "detector.pt").told["window_ms"])
    assert 100_000 < window_us < 300_000  # the median of some of the demo's gaps
    ends, events = convert_camera(recordings, "seen", window_us), np.load(recordings / "seen.npy")
    said, code = run_script(*line, "--test", recordings / "shards")
    assert code == 0 and "detect.py RECORDING" in said, said
    expected = json.loads((out / "predictions.json").read_text())
    assert len({each["image_id"] for each in expected}) == 3
    bare = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    boxes, classes, scores = detect.Detector(alone / "detector.pt")(events[:0], (132, 176))
    assert (boxes.shape, classes, scores.shape) == ((0, 4), [], (0,))
    done = subprocess.run([sys.executable, "-I", alone / "detect.py", recordings / "seen.npy", "--sensor", "176x132",
                           "--score", "0", "--images", alone / "images"], capture_output=True, text=True, env=bare)
    assert done.returncode == 0, done.stderr
    rows = [*csv.DictReader(io.StringIO(done.stdout))]
    last = {row["t_us"] for row in rows} - {str(end) for end in ends}  # a rest of a window, which the labels leave out
    rows = [row for row in rows if row["t_us"] not in last]
    for each in expected:  # of the volume's borders, too
        left, top, width, height = each["bbox"]
        right, bottom = np.clip([left + width, top + height], 0, [176, 132])
        left, top = np.clip([left, top], 0, [176, 132])
        each["bbox"] = [left, top, right - left, bottom - top]
    expected = [each for each in expected if min(each["bbox"][2:]) > 0]
    assert len(last) <= 1
    assert len(rows) == len(expected)
    for row, each in zip(rows, expected):
        assert row["class"] == each["category_id"] and f"{int(row['t_us']) * 1e-6:.6f}" in each["image_id"]
        np.testing.assert_allclose([float(row[name]) for name in "xywh"], each["bbox"], atol=0.05)
        assert float(row["score"]) == pytest.approx(each["score"], abs=1e-3)
    assert len([*(alone / "images").iterdir()]) == 3 + len(last)


def test_tuned_on_the_camera_s_own_windows(data, tmp_path, monkeypatch):
    """After the training, begun with its weights and left beside them; its own windows as often as generated ones."""
    monkeypatch.setattr(detector.training, "TUNING_STEPS", 4)
    for name in ("own", "other"):
        convert_camera(tmp_path / name, name, 100_000)
    own, out = tmp_path / "own" / "shards", tmp_path / "out"
    line = [EXAMPLES / "train_detector.py", "--data", data, "--out", out, "--dataset", "kitti_object", "--threads", "1",
            "--batch", "4", "--images", "1", "--every", "9", "--epochs", "2"]
    said, code = run_script(*line)
    assert code == 0 and "is next to nothing" in said, said
    before = (out / "weights.pt").read_bytes(), (out / "predictions.json").read_bytes()
    for more in ("step     4", "resuming after epoch"):
        said, code = run_script(*line, "--tune", own, "--test", tmp_path / "other" / "shards")
        assert code == 0 and more in said and "share" not in said, said
        assert "is next to nothing" not in said, said  # of the detector before
    assert ((out / "weights.pt").read_bytes(), (out / "predictions.json").read_bytes()) == before
    first, then = (json.loads((folder / "metrics.json").read_text()) for folder in (out, out / "tuned"))
    assert then["lr"] == first["lr"] / 4 and then["history"][-1]["step"] == 4
    assert then["untrained"] == pytest.approx(first["AP50 Car"])  # what it begins with
    entries = json.loads((out / "tuned" / "predictions.json").read_text())
    assert {each["image_id"].split("/")[0] for each in entries} <= {"other"}
    assert detect.Detector(out / "tuned" / "detector.pt").told["window_ms"] == 100  # as the camera's windows
    said, code = run_script(*line, "--tune", own, "--test", own)
    assert code == 0, said
    assert (f"warning: --tune and --test share {tmp_path / 'own' / 'own.npy'}: the score says nothing of other "
            "recordings\n") in said
    said, code = run_script(*line, "--tune", tmp_path / "other" / "shards")
    assert code == 1 and "expected --tune 3 samples of plan " in said and "as when this run started" in said, said
    said, code = run_script(*line, "--epochs", "3", "--tune", own)  # other weights to begin with
    assert code == 0 and "tuned: anew" in said and "step     4" in said, said
    line[line.index("--out") + 1] = tmp_path / "from weights"
    said, code = run_script(*line[:-2], "--steps", "0", "--tune", own)
    assert code == 1 and "expected --pretrained weights, since --steps is 0, got none" in said, said
    for more in ("step     4", "resuming after epoch"):
        said, code = run_script(*line[:-2], "--steps", "0", "--pretrained", out / "weights.pt", "--tune", own)
        assert code == 0 and more in said, said
    first, then = (torch.load(folder / "weights.pt") for folder in (out, tmp_path / "from weights"))
    assert all(torch.equal(first[name], then[name]) for name in first)
    said, code = run_script(*line[:-2], "--steps", "0", "--pretrained", out / "tuned" / "weights.pt", "--tune", own)
    assert code == 0 and "from weights/tuned: anew" in said and "step     4" in said, said
    line[line.index("--out") + 1] = tmp_path / "last layer"
    said, code = run_script(*line[:-2], "--steps", "0", "--pretrained", out / "weights.pt", "--tune", own,
                            "--last-layer")
    assert code == 0, said
    then = torch.load(tmp_path / "last layer" / "tuned" / "weights.pt")
    assert {name.split(".")[0] for name in first if not torch.equal(first[name], then[name])} == {"logits", "edges"}
    said, code = run_script(*line, "--last-layer")
    assert code == 1 and "expected --pretrained weights, since only the last layer is trained" in said, said
    line[line.index("--out") + 1] = out
    said, code = run_script(*line[:-2], "--steps", "0", "--pretrained", out / "weights.pt", "--tune", own)
    assert code == 1 and "expected no --pretrained, as when this run started, got" in said, said


def test_a_few_windows_are_drawn_as_often_as_many_images():
    class Many(torch.utils.data.Dataset):
        def __init__(self, value, count):
            self.value, self.count = value, count

        def __len__(self):
            return self.count

        def __getitem__(self, _):
            return self.value

    torch.manual_seed(0)
    args = detector.argparse.Namespace(batch=10, workers=0)
    drawn = torch.cat([*detector.training.batches(args, Many(0, 1990), shuffle=True, tuned=Many(1, 10))])
    assert len(drawn) == 2000 and abs(drawn.float().mean() - 0.5) < 0.05  # 4.5 standard deviations
    assert sum(map(len, detector.training.batches(args, Many(0, 30), shuffle=True, tuned=Many(1, 0)))) == 30


class TestShards:
    """As much of Shards as training.detection_test asks for: images of 1280x720 with cars alone."""
    _described_as = "test"

    def image_area(self):
        return np.array([0.0, 0.0, 1280.0, 720.0])

    def known_classes(self):
        return ["Car"]


def test_a_test_set_of_its_own_has_its_own_view_and_need_not_have_all_classes():
    """The training's view would show a part of its images: a box at their lower right corner must be seen whole."""
    import argparse
    training = detector.training
    view = detector.fitted([0, 0, 346, 260], (256, 352))
    dataset, own = training.detection_test(argparse.Namespace(test="elsewhere"), TestShards(), ["Van", "Car"],
                                           (256, 352), view)
    assert dataset.classes == {"Car": 1}
    left, top, right, bottom = training.move_boxes(np.array([[1180.0, 620.0, 1280.0, 720.0]]), own)[0]
    assert 0 <= left < right <= 352 and 0 <= top < bottom <= 256
    assert (right - left) / 100 == pytest.approx(352 / 1280)
    same, its = training.detection_test(argparse.Namespace(test=None), TestShards(), ["Car"], (256, 352), view)
    assert its is view and same.classes == {"Car": 0}
    with pytest.raises(ValueError, match="expected classes of Car, got Van"):
        training.detection_test(argparse.Namespace(test=None), TestShards(), ["Van"], (256, 352), view)

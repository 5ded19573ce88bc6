"""labelled_events.py, labelled_recordings.py and real_cameras.py, the task persons: boxes and events
against what they are made of, and `experiment.py real --quick` where there is data."""

import argparse
import csv
import dataclasses
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
from conftest import DATA, EXPERIMENTS, nightly, part_of_data

torch = pytest.importorskip("torch")
cv2 = pytest.importorskip("cv2")
pytest.importorskip("eventgan._engine")
import labelled_events
import labelled_recordings
import real_cameras
import train_detector

from eventgan import Generator, signed_channel



def texture(height, width, seed):
    noise = np.random.default_rng(seed).normal(size=(height, width))
    smooth = cv2.GaussianBlur(noise, (0, 0), 3)
    return np.uint8(127 + 100 * smooth / np.abs(smooth).max())


def write_frames(folder, images, sequence=""):
    """A folder of images, each with a box of a person, as real_cameras reads it."""
    (folder / "images").mkdir(parents=True)
    with open(folder / "frames.csv", "w", newline="") as frames, open(folder / "boxes.csv", "w", newline="") as boxes:
        csv.writer(frames).writerow(["image", "width", "height", "sequence", "index"])
        csv.writer(boxes).writerow(["image", "class", "x1", "y1", "x2", "y2", "track", "note"])
        for i, image in enumerate(images):
            cv2.imwrite(str(folder / "images" / f"{i:04}.png"), image)
            csv.writer(frames).writerow([f"{i:04}.png", image.shape[1], image.shape[0], sequence, i])
            csv.writer(boxes).writerow([f"{i:04}.png", "person", 20, 30, 60, 90, "", ""])


def write_window(folder, name, left, top, right, bottom):
    """A window of 40 ms whose events, five a pixel, all positive, fill a box; with its label."""
    folder.mkdir(parents=True, exist_ok=True)
    y, x = (np.tile(each.ravel(), 5) for each in np.mgrid[top:bottom, left:right])
    t = np.linspace(1.6e15, 1.6e15 + 40_000, len(x)).astype(np.int64)
    np.savez(folder / f"{name}.npz", t_us=t, x=x.astype(np.int16), y=y.astype(np.int16), p=np.ones(len(x), np.int8))
    (folder / f"{name}.txt").write_text(f"0 {(left + right) / 2 / 346:.12f} {(top + bottom) / 2 / 260:.12f} "
                                        f"{(right - left) / 346:.12f} {(bottom - top) / 260:.12f}\n")


@pytest.fixture
def args(tmp_path):
    """Two folders of stills and one clip of seven frames; a recording of two windows and one of a drawing."""
    frames, real = tmp_path / "frames", tmp_path / "real"
    write_frames(frames / "wide", [texture(100, 260, i) for i in range(3)])
    write_frames(frames / "high", [texture(200, 150, 5 + i) for i in range(3)])
    large = texture(200, 300, 9)
    write_frames(frames / "clip", [large[10:170, 4 * i:4 * i + 240] for i in range(7)], "clip")
    write_window(real / "windows", "a", 100, 40, 140, 160)
    write_window(real / "windows", "b", 0, 0, 346, 260)
    for name in ("images", "labels"):
        (real / "drawn" / name).mkdir(parents=True)
    drawing = np.full((360, 640), 90, np.uint8)
    drawing[100:300, 200:240] = 255
    drawing[100:300, 240:280] = 0
    drawing[10:90:2, 400:600], drawing[11:91:2, 400:600] = 140, 40  # as many of both in every two pixels
    cv2.imwrite(str(real / "drawn" / "images" / "c.png"), drawing)
    (real / "drawn" / "labels" / "c.txt").write_text(f"0 {240 / 640} {200 / 360} {80 / 640} {200 / 360}\n")
    for name in ("walking", "driving"):
        (real / "pictures" / name / "images").mkdir(parents=True)
        cv2.imwrite(str(real / "pictures" / name / "images" / "d.png"), drawing)
    (real / "pictures" / "boxes.csv").write_text("image,class,x1,y1,x2,y2,track,note\n"
                                                 "walking/images/d.png,person,200,100,280,300,,\n"
                                                 "walking/images/d.png,car,0,0,50,50,,\n"
                                                 "driving/images/d.png,car,0,0,50,50,,\n")
    (real / "notes").mkdir()
    task = dataclasses.replace(real_cameras.TASKS["persons"], stills=("wide", "high"), clips={"clip": 3},
                               development={"windows": 1})
    return argparse.Namespace(frames=frames, real=real, test=real, out=tmp_path / "out", peers=None, steps=2, task=task)


def test_pairs_are_those_of_the_program(args):
    """Log differences of the frames that are put together here have events where those of the program have them. The
    program resamples a still once, here it is done twice; another motion has no more than chance in common."""
    args.out.mkdir()
    shards = labelled_events.shards_of(args, "difference")
    assert len(shards) == 3 + 3 + 2  # every third frame of a clip, of which the first has none before it
    model = Generator(kind="difference")

    def agreement(sample):
        made, expected = model(*labelled_events.pair_of(sample)), sample["volume"]
        inside = np.s_[:, 64:-64, 4:-4] if sample["pair"]["source_size"][0] == 100 else np.s_[:, 4:-4, 100:-100]
        made, expected = (each.reshape(2, 9, *each.shape[1:]).sum(1)[inside] for each in (made, expected))
        return np.corrcoef(made.ravel(), expected.ravel())[0, 1]

    for sample in shards:
        own = agreement(sample)
        if "motion" not in sample["pair"]:
            assert own > 0.8
            continue
        x, y, angle, scale = sample["pair"]["motion"]
        sample["pair"]["motion"] = -x, -y, -angle, 1 / scale
        assert own > 0.6 and agreement(sample) < own - 0.4, sample["pair"]["sample_id"]


def test_controls_are_of_the_frame(args):
    args.out.mkdir()
    sample = labelled_events.shards_of(args, "EventGAN 16")[0]
    grey, slope = labelled_events.grey(args, sample), labelled_events.gradient(args, sample)
    assert grey.shape == slope.shape == (1, *labelled_recordings.SIZE)
    assert np.abs(slope).max() == np.abs(grey).max() == 1
    shown = np.abs(slope[0]).sum(1) > 0  # 100x260 in 192x320: 123 lines, the others are the letterbox's
    assert 120 <= shown.sum() <= 123 and not slope[0, :34].any() and not slope[0, -34:].any()
    np.testing.assert_array_equal(slope, labelled_events.gradient(args, sample))  # its direction is the sample's


def test_windows_and_drawings_have_their_boxes_around_their_events(args):
    # in the other pictures nobody is seen
    drawn, windows, walking = labelled_recordings.recordings_in(args, args.real)
    assert (drawn.name, windows.name, walking.name) == ("drawn", "windows", "walking")
    assert labelled_recordings.recordings_in(args, windows) == [windows]
    assert labelled_recordings.recordings_in(args, walking.parent) == [walking]
    a, b = labelled_recordings.test_items(args, windows, (192, 320))
    scale = 192 / 260  # 346x260 in 320x192: 256 wide, 32 left of it
    expected = [100 * scale + 32, 40 * scale, 140 * scale + 32, 160 * scale]
    np.testing.assert_allclose(a["boxes"][0], expected, atol=0.5)
    left, top, right, bottom = (round(edge) for edge in expected)
    channel = a["volume"][0].float()
    assert ((channel[top + 1:bottom - 1, left + 1:right - 1] > 0).all() and not channel[:, :left - 1].any()
            and not channel[bottom + 1:].any())
    np.testing.assert_allclose(b["boxes"][0], [32, 0, 288, 192], atol=0.5)
    assert (b["volume"][0, :, 32:288] > 0.99).all()  # as many events everywhere make no pattern of lines
    [c] = labelled_recordings.test_items(args, drawn, (192, 320))
    [d] = labelled_recordings.test_items(args, walking, (192, 320))  # the same picture, its boxes in a table
    torch.testing.assert_close(d["boxes"], c["boxes"], atol=1e-4, rtol=0)
    assert torch.equal(d["volume"], c["volume"])
    # 640x360: half of it, 6 lines below the top
    np.testing.assert_allclose(c["boxes"][0], [100, 56, 140, 156], atol=1e-4)
    channel = c["volume"][0].float()
    assert ((channel[57:155, 101:119] == 1).all() and (channel[57:155, 121:139] < -0.5).all()
            and not channel[:, :99].any())
    # all pixels count in a smaller one, not some
    assert channel[:55, :190].abs().max() == channel[12:50, 202:298].abs().max() == 0
    assert labelled_recordings.test_items(args, drawn, (192, 320), signed=False) == []
    volume = labelled_recordings.test_items(args, windows, (192, 320), signed=False)[0]["volume"]
    # no negative events
    assert volume.shape == (18, 192, 320) and volume.max() == 1 and volume.min() == 0 and not volume[9:].any()
    with pytest.raises(SystemExit, match="expected folders with windows .* got none"):
        labelled_recordings.recordings_in(args, args.frames)


def test_events_of_a_finer_sensor_are_averaged(args):
    """Each pixel that the detector sees is the mean of four of the sensor's; boxes keep their place."""
    args.out.mkdir()
    name = "difference, drawn sensor"
    items, shards, coarse = (labelled_events.items_of(args, name), labelled_events.shards_of(args, name),
                             labelled_events.items_of(args, "difference"))
    assert len(items) == len(shards) == len(coarse) and shards[0]["volume"].shape == (18, 384, 640)
    for item, sample, other in zip(items, shards, coarse):
        averaged = sample["volume"].astype(np.float32).reshape(18, 192, 2, 320, 2).mean((2, 4))
        np.testing.assert_allclose(item["volume"], signed_channel(averaged), atol=1e-3)
        np.testing.assert_allclose(item["boxes"], other["boxes"], atol=0.5)
    volume = labelled_events.items_of(args, name, signed=False)[0]["volume"]
    assert volume.shape == (18, 192, 320) and volume.max() == 1


def test_trained_once_and_never_on_what_it_is_tested_on(args, monkeypatch):
    args.out.mkdir()
    row = real_cameras.Row("windows", ("real windows",))
    scores = real_cameras.train_and_test(args, row, 0)
    assert [*scores] == ["drawn", "walking"]
    network = real_cameras.train_and_test(args, real_cameras.Row("difference", ("difference",), images=5), 0)
    assert [*network] == ["drawn", "windows", "windows, development", "walking"]  # none has grey frames
    assert all(0 <= value <= 1 for score in network.values() for value in score.values())
    args.test = labelled_recordings.recordings_in(args, args.real)[1]  # "windows": a part of what was learnt from
    assert [*real_cameras.parts_of(args, real_cameras.Row("difference", ("difference",)))] == [
        "windows", "windows, development"]
    assert real_cameras.parts_of(args, row) == {}
    args.test = args.real.rename(args.real.with_name("others"))
    args.real.symlink_to(args.test)
    monkeypatch.setattr(train_detector, "train", None)  # it would fail
    assert [*real_cameras.train_and_test(args, row, 0)] == ["drawn", "windows", "walking"]


def test_recordings_to_learn_from_may_lie_deeper(args):
    args.out.mkdir()
    [item] = labelled_events.items_of(args, "real walking")
    assert item["id"] == labelled_recordings.test_items(
        args, labelled_recordings.recordings_in(args, args.real)[2], labelled_recordings.SIZE)[0]["id"]


def test_a_trainer_that_ends_does_not_end_its_process_alone(monkeypatch):
    def refused(*_):
        raise SystemExit("expected a finite loss, got nan")

    monkeypatch.setattr(real_cameras, "train_and_test", refused)
    with pytest.raises(RuntimeError, match="expected a finite loss"):
        real_cameras._run((None, real_cameras.Row("a", ()), 0))


def test_what_is_made_of_a_folder_is_made_anew_once_its_files_change(tmp_path):
    (tmp_path / "a.txt").write_text("0 0.5 0.5 0.1 0.1")
    before = labelled_recordings.key_of(tmp_path)
    labelled_recordings.key_of.cache_clear()
    assert labelled_recordings.key_of(tmp_path) == before
    (tmp_path / "b.txt").write_text("")
    labelled_recordings.key_of.cache_clear()
    assert labelled_recordings.key_of(tmp_path) != before


def test_tables_compare_seed_by_seed():
    columns = real_cameras.TASKS["persons"].columns

    def score(value):
        return {"camera": dict.fromkeys(columns, value), "camera, development": {}}

    first, second = real_cameras.table_of({"EventGAN 16": [score(0.5), score(0.7)], "other": [score(0.4), score(0.9)]},
                                          ["EventGAN 16", "other", "none"], columns, "EventGAN 16")
    same = {"recording": "camera", "seeds": 2, "against": "EventGAN 16"}
    assert first.items() >= {"trained on": "EventGAN 16", "AP@0.5": "0.60", "AP@0.5 sd": "0.10", **same,
                             "against": ""}.items()
    assert second.items() >= {"trained on": "other", "best box": "0.65", "best box sd": "0.25", **same,
                              "AP@0.5 difference": "0.05", "AP@0.5 difference least": "-0.10",
                              "AP@0.5 difference most": "0.20"}.items()


def test_rows_are_those_of_one_thing_each():
    rows = [*real_cameras.rows(["one", "other"]), *real_cameras.drawn_sensors(), *real_cameras.ablations()]
    rows += [row for row in real_cameras.in_layers() if row not in rows]
    assert len({row.name for row in rows}) == len(rows)
    known = {*labelled_events.SOURCES, "real one", "real other"}
    assert all(set(row.sources) <= known for row in rows)
    of_persons = {name for row in rows for name in row.sources}
    of_tasks = {name for task in real_cameras.TASKS.values() for name in task.methods}
    assert of_persons | of_tasks == known and of_persons.isdisjoint(labelled_events.OF_TASKS)


@nightly
def test_a_detector_that_learnt_from_photographs_finds_persons_in_real_events(tmp_path):
    if not (DATA / "labelled_frames").is_dir() or not (DATA / "real_labels").is_dir():
        pytest.skip("no ../shared/data")
    part_of_data(tmp_path / "frames", 40)
    line = [sys.executable, EXPERIMENTS / "experiment.py", "real", "--program", os.environ["EVENTGAN_PROGRAM"],
            "--frames", tmp_path / "frames", "--real", DATA / "real_labels", "--out", tmp_path, "--quick"]
    done = subprocess.run(line, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    shutil.copytree(DATA / "real_labels" / "pedro", tmp_path / "other" / "pedro")
    again = subprocess.run([*line, "--test", tmp_path / "other"], capture_output=True, text=True)
    assert (again.returncode == 0 and "epoch" not in again.stdout
            and "pedro, development" not in again.stdout), again.stdout + again.stderr

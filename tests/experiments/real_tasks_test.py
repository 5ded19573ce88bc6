"""labelled_recordings.py, real_boxes.py, real_joints.py and real_cameras.py: cars and joints. Scores,
sides, signed channels of pictures and constant answers against numbers worked out here; `experiment.py real --task`
with few steps on a part of the data, where there is data."""

import argparse
import csv
import dataclasses
import json
import math
import os
import pathlib
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
import real_boxes
import real_cameras
import real_joints
from labelled_recordings import JOINTS

RIGHT, LEFT = ([i for i, name in enumerate(JOINTS) if name.startswith(side)] for side in ("right", "left"))
CDEHP = ["head", *(f"{side}_{name}" for name in ("shoulder", "elbow", "hand", "hip", "knee", "foot")
                   for side in ("red", "green"))]


def arguments(tmp_path, name):
    (tmp_path / "out").mkdir()
    return argparse.Namespace(task=real_cameras.TASKS[name], real=tmp_path / "real", test=tmp_path / "real",
                              out=tmp_path / "out", steps=None)


def standing(x=100.0, y=20.0):
    """Joints [13, 2] of somebody upright, 120 px high; the right side is at the lower x."""
    offsets = {"head": (0, 0), "shoulder": (20, 20), "elbow": (25, 40), "wrist": (25, 60), "hip": (10, 60),
               "knee": (10, 90), "ankle": (10, 120)}
    return np.array([[x + (-1 if name.startswith("right") else 1) * offsets[name.split("_")[-1]][0],
                      y + offsets[name.split("_")[-1]][1]] for name in JOINTS])


def person(joints):
    return {"volume": torch.zeros(1, 192, 320).half(), "joints": torch.from_numpy(joints), "id": "a"}


def boxed(*boxes, ignored=()):
    boxes = torch.tensor([*boxes, *ignored], dtype=torch.float32).reshape(-1, 4)
    return {"volume": torch.zeros(1, 192, 320), "boxes": boxes, "labels": torch.zeros(len(boxes), dtype=torch.int64),
            "ignore": torch.arange(len(boxes)) >= len(boxes) - len(ignored), "id": "a"}


def answer(*boxes_and_scores):
    rows = torch.tensor(boxes_and_scores, dtype=torch.float32).reshape(-1, 5)
    return rows[:, :4], torch.zeros(len(rows), dtype=torch.int64), rows[:, 4]


def test_scores_of_boxes():
    """The first and the third are right, of four to find: precision 1, 1/2, 2/3, recall 1/4, 1/4, 1/2."""
    items = [boxed((0, 0, 40, 40), (100, 0, 140, 40)), boxed((0, 0, 40, 40), (200, 0, 240, 40),
                                                             ignored=[(100, 100, 140, 140)])]
    found = [answer((0, 0, 40, 38, 0.9), (50, 50, 90, 90, 0.8)),
             answer((0, 0, 40, 40, 0.7), (100, 100, 140, 140, 0.95))]
    scores = real_boxes.scores_of(items, found)
    assert scores["ap50"] == pytest.approx(1 / 4 + 1 / 4 * 2 / 3)
    assert (scores["precision"], scores["recall"]) == (pytest.approx(2 / 3), 0.5)
    assert scores["f1"] == pytest.approx(2 * 2 / 3 / 2 / (2 / 3 + 1 / 2))
    nothing = real_boxes.scores_of(items, [answer()] * 2)
    assert [nothing[name] for name in ("ap50", "precision", "recall", "f1", "best")] == [0] * 5


def test_constant_box_is_that_of_most_items():
    often = [boxed((10 + i, 10, 60 + i, 60)) for i in range(3)]
    items = [*often, boxed((200, 100, 300, 150), (202, 100, 302, 150), (204, 100, 304, 150), (201, 100, 301, 150)),
             boxed()]
    constant = real_boxes.constant(items)
    assert len(constant) == 5 and all(torch.equal(boxes, constant[0][0]) for boxes, _, _ in constant)
    assert constant[0][0].tolist()[0] in [item["boxes"][0].tolist() for item in often]
    scores = real_boxes.scores_of(items, constant)
    assert scores["recall"] == pytest.approx(3 / 7) and scores["best"] == pytest.approx(3 / 5)


def test_small_boxes_are_neither_right_nor_wrong():
    item = labelled_events.without_small(boxed((0, 0, 8, 30), (0, 0, 30, 7.9), (0, 0, 30, 30)), 8)
    assert item["ignore"].tolist() == [False, True, False]


def test_pictures_become_signed_channels(tmp_path):
    """304x240 to 192x320: 243x192, 38 columns right of the left edge."""
    args = arguments(tmp_path, "cars")
    signed = argparse.Namespace(**{**vars(args), "out": tmp_path / "signed",
                                   "task": dataclasses.replace(args.task, polarity=True)})
    polar = np.full((240, 304), 128, np.uint8)
    polar[80:160, 100:150], polar[80:160, 150:200] = 255, 0
    alone = np.full((240, 304), 128, np.uint8)
    alone[80:160, 100:200] = 255
    for folder, image in (("polar", polar), ("alone", alone), ("walking", polar)):
        for shown in ("images", "frames"):
            (tmp_path / "real" / "set" / folder / shown).mkdir(parents=True)
            cv2.imwrite(str(tmp_path / "real" / "set" / folder / shown / "a.png"), image)
    (tmp_path / "real" / "set" / "boxes.csv").write_text(
        "image,class,x1,y1,x2,y2,track,note\n"
        + "".join(f"{name}/images/a.png,{kind},100,80,200,160,,\n"
                  for name, kind in (("polar", "car"), ("alone", "car"), ("walking", "person"))))
    (tmp_path / "real" / "windows").mkdir()
    for name in ("a.npz", "a.txt"):
        (tmp_path / "real" / "windows" / name).touch()  # of persons
    folders = labelled_recordings.recordings_in(args, args.real)
    assert [each.name for each in folders] == ["alone", "polar"]
    [alone], [polar] = (labelled_recordings.test_items(signed, each, (192, 320)) for each in folders)
    without = [labelled_recordings.test_items(args, each, (192, 320))[0] for each in folders]
    for item in without:  # none has a polarity where one has none
        channel = item["volume"][0].float().numpy()
        assert (channel[66:126, 121:195] > 0.4).mean() > 0.95 and channel.min() == 0
    for item in (alone, polar, *without):
        np.testing.assert_allclose(item["boxes"][0], [100 * 0.8 + 38, 64, 200 * 0.8 + 38, 128], atol=0.5)
    channel = polar["volume"][0].float().numpy()
    assert (channel[66:126, 121:155] > 0.9).all() and (channel[66:126, 161:195] < -0.9).all()
    channel = alone["volume"][0].float().numpy()
    inside, outside = channel[66:126, 121:195], np.delete(channel, np.s_[62:130], 0)
    # as many of both signs, and no area of either
    assert not outside.any() and 0.4 < (inside > 0).mean() < 0.6 and abs(inside.mean()) < 0.1
    [frame] = labelled_recordings.test_items(args, folders[1], (192, 320), shown="frames")
    assert torch.equal(frame["boxes"], polar["boxes"])
    channel = frame["volume"][0].float().numpy()  # as bright as it is
    assert ((channel[66:126, 121:155] == 1).all() and (channel[66:126, 161:195] == 0).all()
            and np.allclose(channel[10:50, 50:270], 128 / 255, atol=1e-3))


def test_pictures_of_joints_have_no_polarity(tmp_path):
    args = arguments(tmp_path, "joints")
    joints = 4 * standing() + [0, 40]  # in 1280x800
    image = np.zeros((800, 1280), np.uint8)
    for x, y in joints.astype(int):
        image[y - 8:y + 8, x - 8:x + 8] = 255
    (tmp_path / "real" / "clips" / "images").mkdir(parents=True)
    cv2.imwrite(str(tmp_path / "real" / "clips" / "images" / "a.png"), image)
    with open(tmp_path / "real" / "clips" / "joints.csv", "w", newline="") as file:
        csv.writer(file).writerow(["image", *(f"{name}_{axis}" for name in CDEHP for axis in "xy"), "uncertain"])
        csv.writer(file).writerow(["a.png", *joints.ravel(), "green_elbow red_knee"])
    (tmp_path / "real" / "surfaces" / "images").mkdir(parents=True)
    cv2.imwrite(str(tmp_path / "real" / "surfaces" / "images" / "a.png"), image // 2)
    names = [name.replace("red", "a").replace("green", "b") for name in CDEHP]
    with open(tmp_path / "real" / "surfaces" / "joints.csv", "w", newline="") as file:
        csv.writer(file).writerow(["image", *(f"{name}_{axis}" for name in names for axis in "xy")])
        csv.writer(file).writerow(["a.png", *joints.ravel()])
    [folder] = labelled_recordings.recordings_in(args, args.real)
    [item] = labelled_recordings.test_items(args, folder, (192, 320))
    assert item["volume"].min() == 0 and item["volume"].max() == 1
    expected = (joints + 0.5) * 0.24 + [6.4, 0] - 0.5  # 307 of 320 columns, rounded
    expected[[JOINTS.index("left_elbow"), JOINTS.index("right_knee")]] = np.nan
    np.testing.assert_allclose(item["joints"].numpy(), expected, atol=0.6)
    for x, y in expected[np.isfinite(expected[:, 0])].round().astype(int):
        assert item["volume"][0, y, x] > 0.5
    assert labelled_recordings.test_items(args, folder, (192, 320), shown="frames") == []
    args.task = dataclasses.replace(args.task, surfaces=True)
    [folder] = labelled_recordings.recordings_in(args, args.real)
    [surface] = labelled_recordings.test_items(args, folder, (192, 320))
    assert folder.name == "surfaces" and torch.isfinite(surface["joints"]).all()
    known = torch.isfinite(item["joints"])
    torch.testing.assert_close(surface["joints"][known], item["joints"][known])


def test_a_clip_leaves_the_surface_of_its_last_events():
    """A line moves by 8 px a pair: around its last place nothing is older, where it was it has faded."""
    class Clip:
        def column(self, name):
            return np.array({"sequence": ["a"] * 3, "label_index": [2, 0, 1]}[name])  # not in order

        def __getitem__(self, i):
            volume = np.zeros((2, 60, 80), np.float32)
            volume[:, 10:50, 20 + 8 * int(self.column("label_index")[i])] = 1
            joints = np.full((1, 14, 2), 10.0 * i, np.float32)
            return {"volume": volume, "pair": {"sample_id": f"a/{i}"},
                    "persons": {"joints": joints, "joints_source": joints}}

        def joint_names(self, _):
            return ["neck", "head_top", *JOINTS[1:]]

    [item] = labelled_events.surfaces_of(Clip(), "rounded")
    line = [float(item["volume"][0, 20:40, x].float().mean()) for x in (36, 28, 20, 70)]
    assert line[0] > 0.5 and line[0] > 2 * line[3] and line[1] > line[3]
    assert item["id"] == "a/0" and (item["joints"] == 0).all()  # of the frame with the highest number


def test_joints_of_photographs(tmp_path):
    names = ["neck", "head_top", *JOINTS[1:]]
    joints = np.concatenate([[[50, 40], [54, 20]], standing()[1:]]).astype(np.float32)
    source = np.where(np.arange(14)[:, None] == 5, -1, joints)
    item = labelled_events.with_joints({"volume": np.zeros((1, 4, 4), np.float32), "pair": {"sample_id": "a"},
                                        "persons": {"joints": joints[None], "joints_source": source[None]}}, names)
    np.testing.assert_allclose(item["joints"][0], [52, 30])
    assert torch.isnan(item["joints"][4]).all() and names[5] == JOINTS[4] and torch.isfinite(item["joints"]).sum() == 24
    np.testing.assert_allclose(item["joints"][5:], joints[6:])


def test_who_stands_with_hands_below_the_shoulders_is_upright(tmp_path):
    """`standing` is 120 px high with hands 40 px below the shoulders; turned, each line of its body is as far from
    upright as the turn."""
    def turned(angle):
        cos, sin = math.cos(math.radians(angle)), math.sin(math.radians(angle))
        return standing() @ np.array([[cos, sin], [-sin, cos]])

    raised, sitting, unknown = standing(), standing(), standing()
    raised[JOINTS.index("left_wrist"), 1] -= 45
    sitting[[JOINTS.index("right_knee"), JOINTS.index("left_knee")]] += [60, -30]
    unknown[JOINTS.index("right_ankle")] = math.nan
    persons = {"standing": standing(), "leaning": turned(28), "lying": turned(32), "head down": turned(180),
               "raised": raised, "sitting": sitting, "unknown": unknown}
    annotations = [{"id": i, "image_id": i, "category_id": 3, "keypoints":
                    np.column_stack([np.nan_to_num(joints), 2.0 * np.isfinite(joints[:, 0])]).ravel().tolist()}
                   for i, joints in enumerate(persons.values(), 1)]
    (tmp_path / "all.json").write_text(json.dumps({
        "images": [{"id": i, "file_name": name} for i, name in enumerate([*persons, "nobody"], 1)],
        "annotations": annotations, "categories": [{"id": 3, "name": "person", "keypoints": JOINTS}]}))
    found = json.loads(labelled_events.write_upright(tmp_path / "all.json", tmp_path / "upright.json").read_text())
    assert [each["file_name"] for each in found["images"]] == ["standing", "leaning"]
    assert found["annotations"] == annotations[:2]


def test_crops_hold_the_person():
    """The box around the joints is 50 wide and 120 high: 128 px are 1.4 x 120."""
    _, joints = real_joints.crop_of(person(standing()))
    np.testing.assert_allclose((joints.min(0) + joints.max(0)) / 2, [63.5, 63.5])
    np.testing.assert_allclose(np.ptp(joints, 0), [50 * 128 / 168, 120 * 128 / 168])
    turned = real_joints.view_of(standing(), 90)
    np.testing.assert_allclose(np.ptp(standing() @ turned[:, :2].T, 0), [120 * 128 / 168, 50 * 128 / 168])
    mirror = real_joints.EventAugmentation(flip=1)
    _, mirrored = real_joints.crop_of(person(standing()), 0, mirror)  # right is at the lower x again
    np.testing.assert_allclose(mirrored, joints, atol=1e-9)


def test_the_better_of_both_sides_is_scored():
    _, true = real_joints.crop_of(person(standing()))
    exchanged = true.copy()
    exchanged[RIGHT + LEFT] = true[LEFT + RIGHT]
    np.testing.assert_array_equal(real_joints.either_way(exchanged, true), true)
    np.testing.assert_array_equal(real_joints.either_way(true, true), true)
    one_arm = true.copy()
    wrists = [JOINTS.index("right_wrist"), JOINTS.index("left_wrist")]
    one_arm[wrists] = true[wrists[::-1]]
    np.testing.assert_array_equal(real_joints.either_way(one_arm, true), one_arm)  # wrong either way


def test_sides_in_training_are_those_of_somebody_who_faces_the_camera():
    front = standing()
    back = front.copy()
    back[RIGHT + LEFT] = front[LEFT + RIGHT]
    crossed = front.copy()
    wrists = [JOINTS.index("right_wrist"), JOINTS.index("left_wrist")]
    crossed[wrists] = front[wrists[::-1]]
    crossed[JOINTS.index("left_hip")] = math.nan
    for given, expected in ((front, front), (back, front), (crossed, crossed)):
        np.testing.assert_array_equal(real_joints.facing(given), expected)


def test_scores_of_joints():
    """In crops: the torso is the distance of a shoulder from the other side's hip, (30, 40) px times 128 / 168; the
    head is 20 px times that from the middle of the shoulders."""
    scale = 128 / 168
    items = [person(standing()), person(np.where(np.arange(13)[:, None] == 0, math.nan, standing()))]
    true = [real_joints.crop_of(item)[1] for item in items]
    torso, head = 0.2 * 50 * scale, 0.3 * 20 * scale
    found = [each.copy() for each in true]
    found[0][0, 1] -= head * 0.99
    found[0][JOINTS.index("right_wrist"), 0] -= head * 1.01
    found[0][JOINTS.index("left_ankle"), 1] += torso * 1.01
    found[1][JOINTS.index("left_ankle"), 1] += torso * 0.99
    scores = real_joints.scores_of(items, found)
    assert scores["pckh"] == pytest.approx(11 / 13)  # the second has no head
    assert scores["pck"] == pytest.approx(24 / 25)
    assert scores["mpjpe"] == pytest.approx((2 * head + 2 * torso) / 25)
    perfect = real_joints.scores_of(items, true)
    assert (perfect["pckh"], perfect["pck"], perfect["mpjpe"]) == (1, 1, 0)


def test_the_constant_pose_is_the_mean():
    wide = standing()
    wide[RIGHT, 0] -= 10
    wide[LEFT, 0] += 10
    items = [person(standing()), person(wide)]
    first, second = real_joints.constant(items)
    np.testing.assert_array_equal(first, second)
    scale = 128 / 168
    _, true = real_joints.crop_of(items[0])
    np.testing.assert_allclose(first[0], true[0])
    np.testing.assert_allclose(first[RIGHT, 0], true[RIGHT, 0] - 5 * scale)


def test_maps_give_back_the_joints(monkeypatch):
    """Where the logits are what the loss wants, the joints are found to half a cell."""
    _, true = real_joints.crop_of(person(standing()))
    crops = real_joints.Crops([person(standing())], real_joints.EventAugmentation(flip=0))
    monkeypatch.setattr(crops, "_augmentation", None)
    monkeypatch.setattr(real_joints, "ROTATION", 0)
    _, maps, weight = crops[0]
    assert weight.min() == 1
    logits = torch.from_numpy(maps[None]).clamp(min=1e-6).log()
    [found] = real_joints.find(lambda _: logits, [person(standing())])
    assert np.abs(found - true).max() <= 2.5
    right = real_joints.loss_of_maps(logits, torch.from_numpy(maps[None]), torch.from_numpy(weight[None]))
    wrong = real_joints.loss_of_maps(logits.flip(-1), torch.from_numpy(maps[None]), torch.from_numpy(weight[None]))
    assert right < wrong


def test_only_the_last_layer_is_tuned_and_parts_are_what_they_say(tmp_path, monkeypatch):
    args = arguments(tmp_path, "joints")
    args.steps, args.seeds = 2, 1
    args.task = dataclasses.replace(args.task, development={"clips": 1}, learnt={"clips": 2},
                                    methods=("gradient, layers",))
    items = [{**person(standing(100 + i)), "id": str(i)} for i in range(4)]
    monkeypatch.setattr(real_cameras, "recordings_in", lambda *_: [pathlib.Path("clips")])
    monkeypatch.setattr(real_cameras, "test_items",
                        lambda *_, shown="images", **__: items if shown == "images" else [])
    asked = []
    monkeypatch.setattr(real_cameras, "items_of", lambda _, name, *__: asked.append(name) or items)
    base, _, tuned = real_cameras.task_rows(args.task)
    assert tuned.base == base
    assert {name: [item["id"] for item in part] for name, part in real_cameras.parts_of(args, base).items()} == {
        "clips": ["1", "2", "3"], "clips, development": ["0"], "clips, others": ["2", "3"]}
    assert [*real_cameras.train_and_test(args, tuned, 0)] == ["clips, others"]
    assert asked == ["gradient, layers", "real clips"]
    before, after = (torch.load(real_cameras._run_folder(args, row, 0) / "weights.pt") for row in (base, tuned))
    changed = {name for name in before if not torch.equal(before[name], after[name])}
    assert changed == {"maps.weight", "maps.bias"}

    on_windows = dataclasses.replace(tuned, name="on windows", windows=2, last_layer=False)
    real_cameras.train(args, on_windows, 0)
    after = torch.load(real_cameras._run_folder(args, on_windows, 0) / "weights.pt")
    assert all(not torch.equal(before[name], after[name]) for name in before if name.endswith("weight"))


def test_windows_of_the_first_clips_are_learnt_and_the_others_tested(tmp_path, monkeypatch):
    """The tuned network has the base's weights to begin with, and sees as many windows as photographs; a network of
    windows alone sees whole batches of them."""
    args = arguments(tmp_path, "tuning")
    args.task = dataclasses.replace(args.task, development={}, learnt={"clips": 3}, windows=(2, 3))
    items = {"ESIM, layers": [{**boxed([9, 9, 40, 60]), "id": f"photograph {i}"} for i in range(20)],
             "real clips": [{**boxed([9, 9, 40, 60]), "id": f"window {i}"} for i in range(5)]}
    monkeypatch.setattr(real_cameras, "recordings_in", lambda *_: [pathlib.Path("clips")])
    monkeypatch.setattr(real_cameras, "test_items",
                        lambda *_, shown="images", **__: items["real clips"] if shown == "images" else [])
    monkeypatch.setattr(real_cameras, "items_of", lambda _, name, *__: items[name])
    seen = []

    def train(run, learnt, *_):
        seen.append((run.last_layer, run.steps, run.lr / real_cameras.RATE, run.pretrained is not None,
                     [sum(item["id"].startswith(kind) for item in learnt) for kind in ("photograph", "window")],
                     len({item["id"] for item in learnt} & {f"window {i}" for i in range(3)})))
        model = real_boxes.make(1, torch.nn.BatchNorm2d)
        for name in ("weights.pt", "checkpoint.pt"):
            torch.save(model.state_dict(), pathlib.Path(run.out, name))

    args.task = dataclasses.replace(args.task, network=dataclasses.replace(args.task.network, train=train))
    compared = real_cameras.task_rows(dataclasses.replace(args.task, methods=("ESIM, layers", "gradient, layers")))
    assert [(row.windows, row.base.sources[0]) for row in compared if row.base] == [
        *2 * [(count, "ESIM, layers") for count in (0, 2, 3)], (3, "gradient, layers")]
    base, *tuned, two_alone, three_alone = real_cameras.task_rows(args.task)
    assert [(row.windows, row.last_layer) for row in tuned] == [
        (count, last) for last in (False, True) for count in (0, 2, 3)]
    assert all(row.base == base for row in tuned)
    for row in (base, *tuned, two_alone, three_alone):
        real_cameras.train(args, row, 0)
    steps, rate = real_cameras.training.TUNING_STEPS, real_cameras.training.TUNING_RATE
    on_windows = ([20, 0], 0), ([20, 20], 2), ([20, 21], 3)
    assert seen == [(False, 600, 1, False, [20, 0], 0), *((False, steps, rate, True, *drawn) for drawn in on_windows),
                    *((True, steps, 1, True, *drawn) for drawn in on_windows),
                    *((False, real_cameras.STEPS, 1, False, *alone) for alone in (([0, 16], 2), ([0, 18], 3)))]
    assert {name: [item["id"] for item in part] for name, part in real_cameras.parts_of(args, tuned[1]).items()} == {
        "clips, others": ["window 3", "window 4"]}


@nightly
@pytest.mark.parametrize("task", ["cars", "joints", "dhp19", "tuning", "joints_tuning"])
def test_what_learnt_from_photographs_finds_something_in_real_events(tmp_path, task):
    if not (DATA / "labelled_frames").is_dir() or not (DATA / "real_labels").is_dir():
        pytest.skip("no ../shared/data")
    part_of_data(tmp_path / "frames", 40)
    line = [sys.executable, EXPERIMENTS / "experiment.py", "real", "--task", task, "--program",
            os.environ["EVENTGAN_PROGRAM"], "--frames", tmp_path / "frames", "--real", DATA / "real_labels", "--out",
            tmp_path / "out", "--quick"]
    done = subprocess.run(line, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    out = tmp_path / "out" / "quick" / task
    assert real_cameras.CONSTANT in (out / f"{task}.csv").read_text()
    assert f"--task {task} " in json.loads((out / "conditions.json").read_text())["command"]

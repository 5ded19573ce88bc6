"""eventgan.evaluate: scores of folders; those of poses and flows worked out by hand, and against a trainer's own."""

import json
import math
import os
import subprocess
import sys

import h5py
import numpy as np
import pytest
from conftest import NAME, PACKAGE, SECOND

from eventgan import Shards
from eventgan.detection_scores import KITTI_LEVELS
from eventgan.evaluate import Samples, detection_tables, evaluate_detections, evaluate_flows, evaluate_poses
from eventgan.flow_scores import flow_errors, flow_scores
from eventgan.pose_scores import Persons, head_lengths, pose_scores

MPII = ["r_ankle", "r_knee", "r_hip", "l_hip", "l_knee", "l_ankle", "pelvis", "thorax", "upper_neck", "head_top",
        "r_wrist", "r_elbow", "r_shoulder", "l_shoulder", "l_elbow", "l_wrist"]


def persons_at_random(rng, count):
    joints = rng.uniform(0, 200, (count, 16, 2))
    annotated = rng.random((count, 16)) < 0.9
    box = np.sort(rng.uniform(0, 120, (count, 2, 2)), axis=1)
    persons = Persons(MPII, np.stack([np.arange(count), np.zeros(count, int)], 1), joints, joints, annotated,
                      annotated & (rng.random((count, 16)) < 0.2), head_lengths(MPII, joints, annotated),
                      np.linalg.norm(box[:, 1] - box[:, 0], axis=-1), np.tile(np.eye(2, 3), (count, 1, 1)))
    return persons, box, joints + rng.normal(0, 12, joints.shape)


@pytest.mark.parametrize("hidden", [True, False])
def test_pckh_is_pose_resnet_s(trainer, tmp_path, hidden):
    trainer("pose_resnet/lib", "torch", "easydict", "json_tricks", "scipy", "yaml", "cv2")
    from core.config import config
    from dataset.mpii import MPIIDataset
    from scipy.io import savemat

    persons, box, found = persons_at_random(np.random.default_rng(3), 50)
    short = ["rank", "rkne", "rhip", "lhip", "lkne", "lank", "pelv", "thor", "neck", "head", "rwri", "relb", "rsho",
             "lsho", "lelb", "lwri"]
    (tmp_path / "annot").mkdir()
    savemat(tmp_path / "annot" / "gt_valid.mat",
            {"dataset_joints": np.array([short], object), "jnt_missing": (~persons.scored(hidden)).T.astype(float),
             "pos_gt_src": persons.joints.transpose(1, 2, 0) + 1, "headboxes_src": box.transpose(1, 2, 0) + 1})
    config.DATASET.ROOT, config.DATASET.TEST_SET = str(tmp_path), "valid"
    theirs, mean = MPIIDataset.evaluate(None, config, found, "")
    ours = {name: row["pckh_mpii"] for name, row in pose_scores(found, persons, hidden).items()}
    for name, joint in (("Shoulder", "shoulder"), ("Elbow", "elbow"), ("Wrist", "wrist"), ("Hip", "hip"),
                        ("Knee", "knee"), ("Ankle", "ankle")):
        assert 100 * (ours["l_" + joint] + ours["r_" + joint]) / 2 == pytest.approx(theirs[name], abs=1e-6)
    assert 100 * ours["head_top"] == pytest.approx(theirs["Head"], abs=1e-6)
    assert 100 * ours["all"] == pytest.approx(mean, abs=1e-6)
    assert 20 < mean < 95


def test_poses_worked_out_by_hand():
    names = ["head", "left shoulder", "right shoulder", "hand"]
    joints = np.array([[[0, 0], [-5, 20], [5, 20], [9, 9]], [[0, 0], [-5, 20], [5, 20], [9, 9]],
                       [[-1, -1], [-5, 20], [5, 20], [9, 9]]], float)
    annotated = ~(joints == -1).all(-1)
    hidden = np.zeros((3, 4), bool)
    hidden[1, 3] = True
    head = head_lengths(names, joints, annotated)
    np.testing.assert_array_equal(head, [20, 20, np.nan])  # within 6 px is near
    for shoulder in (1, 2):  # without one of them their middle is not known
        assert np.isnan(head_lengths(names, joints, annotated & (np.arange(4) != shoulder))).all()
    persons = Persons(names, np.array([[0, 0], [0, 1], [1, 0]]), joints / 2, joints, annotated, hidden, head,
                      np.array([np.nan, np.nan, 100.0]), np.tile(np.eye(2, 3) / 2, (3, 1, 1)))
    found = joints.copy()
    found[0, 3] += [6, 0]  # 6: near
    found[0, 0] += [3, 6]
    found[2, 3] += [0, 30]  # 30 = 0.5 x 0.6 x 100: near by the box
    found[1] = np.nan  # not found
    scores = pose_scores(found / 2, persons)
    hand, every = scores["hand"], scores["all"]
    assert (hand["scored"], hand["left_out"], hand["pckh"], hand["pckh_mpii"]) == (2, 1, 1, 1)
    assert (hand["mpjpe_source"], hand["mpjpe_volume"]) == (18, 9)
    # of the third person it is not annotated
    assert scores["head"]["pckh"] == 0 and math.isnan(scores["head"]["pckh_mpii"])
    assert (every["scored"], every["left_out"]) == (10, 2)
    assert every["pckh"] == 3 / 7 and every["pckh_mpii"] == 1  # the first person's 4, the second's 3; the third's 3
    assert every["mpjpe_source"] == pytest.approx((6 + math.sqrt(45) + 30) / 7)
    assert pose_scores(found / 2, persons, hidden=True)["hand"]["scored"] == 3


def test_pckh_of_all_joints_leaves_out_pelvis_and_thorax_as_mpii_does():
    names = ["pelvis", "thorax", "r_knee"]
    joints, annotated = np.full((1, 3, 2), 50.0), np.ones((1, 3), bool)
    persons = Persons(names, np.array([[0, 0]]), joints, joints, annotated, ~annotated, np.array([100.0]),
                      np.array([100.0]), np.eye(2, 3)[None])
    scores = pose_scores(joints + [[[31, 0], [0, 31], [30, 0]]], persons)  # near is 0.5 x 0.6 x 100 px
    assert [scores[name]["pckh_mpii"] for name in names] == [0, 0, 1]
    assert scores["all"]["pckh_mpii"] == 1 and scores["all"]["pckh"] == 1 / 3


def test_poses_without_a_head_or_a_person():
    nobody = Persons(["nose"], np.empty((0, 2), int), *np.empty((2, 0, 1, 2)), *np.empty((2, 0, 1), bool),
                     *np.empty((2, 0)), np.empty((0, 2, 3)))
    row = pose_scores(np.empty((0, 1, 2)), nobody)["all"]
    assert row["scored"] == 0 and all(math.isnan(row[key])
                                      for key in ("mpjpe_volume", "mpjpe_source", "pckh", "pckh_mpii"))
    assert np.isnan(head_lengths(["nose"], np.zeros((2, 1, 2)), np.ones((2, 1), bool))).all()


# The example shard has samples 000000, 000001, 000003, 000004 and in quarantine 000002. The first has a car at 1, 1,
# 4.25, 4.5 and a DontCare, and two persons; the last one.


def write(path, entries):
    path.write_text(json.dumps(entries))
    return path


def box(image_id, category, bbox, score=0.9):
    return {"image_id": image_id, "category_id": category, "bbox": bbox, "score": score}


def test_detections_of_a_folder(folder, tmp_path):
    found = write(tmp_path / "found.json",
                  [box("000000", "Car", [1, 1, 3.25, 3.5]), box("000001", "Car", [0, 0, 3, 3], 0.5),
                   box("000003", "Car", [0, 0, 3, 3], 0.1)])
    result, _, truth = evaluate_detections(found, Samples(folder, None, None, None))
    car = result["classes"]["Car"]
    assert result["counts"] == {"samples": 4, "samples_without_prediction": 1, "ignored": int(truth.ignore.sum()),
                                "predictions": 3, "not_of_these_samples": 0, "not_of_these_classes": 0,
                                "after_suppression": 2}
    assert (car["truths"], car["found"], car["right"]) == (2, 2, 1)
    numbered = write(tmp_path / "numbered.json",
                     [box(1, 1, [1, 1, 3.25, 3.5]), box(2, 1, [0, 0, 3, 3], 0.5), box(3, 1, [0, 0, 3, 3], 0.1)])
    assert json.dumps(evaluate_detections(numbered, Samples(folder, "train", None, None))[0]) == json.dumps(result)
    (tmp_path / "ids.txt").write_text("000000\n000003\n")
    part, _, _ = evaluate_detections(found, Samples(folder, None, None, tmp_path / "ids.txt"))
    assert part["counts"]["not_of_these_samples"] == 1 and part["classes"]["Car"]["precision"] == 1


def test_predictions_that_are_not_scored_are_told_apart(folder, tmp_path):
    with h5py.File(folder / NAME, "r+") as file:
        attributes = file["labels/boxes/class_id"].attrs
        attributes["class_names"] = [*attributes["class_names"], "Van"]
    found = write(tmp_path / "found.json",
                  [box("000000", "Car", [1, 1, 3.25, 3.5]), box("000000", "Car", [5, 1, 2, 2], 0.1),
                   box("000000", "Van", [1, 1, 3, 3]), box("000001", "Van", [1, 1, 3, 3]),
                   box("000003", "Van", [1, 1, 3, 3])])
    (tmp_path / "ids.txt").write_text("000000\n000001\n")
    result, _, _ = evaluate_detections(found, Samples(folder / NAME, None, None, tmp_path / "ids.txt"), ["Car"])
    counts = result["counts"]
    assert [counts[key] for key in ("predictions", "not_of_these_samples", "not_of_these_classes",
                                    "after_suppression")] == [5, 1, 2, result["classes"]["all"]["found"]]
    said = detection_tables(result)
    assert "average precisions use all 2 predictions; precision, recall and F1 use 1, after" in said
    assert "; left out: 1 of other samples, 2 of other classes\n" in said


@pytest.mark.parametrize(("name", "value"), [("confidence", math.nan), ("confidence", -0.1), ("nms", math.nan),
                                             ("nms", 1.5), ("iou", math.nan), ("iou", 0), ("iou", 5)])
def test_thresholds_that_are_no_shares_are_refused(folder, tmp_path, name, value):
    found = write(tmp_path / "found.json", [])
    with pytest.raises(ValueError, match=f"iou above 0 and up to 1, got .*{name} {value:g}"):
        evaluate_detections(found, Samples(folder, None, None, None), **{name: value})


def test_numbers_are_refused_where_an_export_keeps_those_of_coco_s_labels(folder, tmp_path, monkeypatch):
    module = sys.modules[Samples.__module__]
    entry = {"image": {"id": 3, "file_name": "a.png"}, "annotations": [{"id": 8, "category_id": 4}]}
    assert module._is_coco_s(json.dumps(entry).encode())
    for other in (b"Car 0 0 1.5 1 2 3 4", b"", b"[]", b"3", b'{"image": "a.png", "annotations": []}',
                  b'{"image": {"id": 1}}', b"\xff"):
        assert not module._is_coco_s(other)
    monkeypatch.setattr(module, "_is_coco_s", lambda original: True)
    samples, edges = Samples(folder, "train", None, None), [1, 1, 3, 3]
    evaluate_detections(write(tmp_path / "names.json", [box("000000", "Car", edges)]), samples)
    for wrong, key in ((box(1, "Car", edges), "image_id"), (box("000000", 1, edges), "category_id")):
        with pytest.raises(ValueError,
                           match=f"keeps the numbers of labels that are COCO's own, got 1 as {key}, in .*entry 0"):
            evaluate_detections(write(tmp_path / "numbers.json", [wrong]), samples)


def test_a_number_is_the_place_in_the_split_whatever_is_scored_of_it(two_shards, tmp_path):
    """The second shard is of another source, whose samples have the same ids: its places are 5 to 8."""
    with h5py.File(two_shards / SECOND, "r+") as file:
        file["pairs/dataset"][...] = "frames"
    dataset = Shards(two_shards / NAME).column("dataset")[0]
    right = [1, 1, 3.25, 3.5]
    for source, own, other in ((dataset, 1, 5), ("frames", 5, 1)):
        samples = Samples(two_shards, "train", source, None)
        result, _, _ = evaluate_detections(write(tmp_path / "found.json", [box(other, 1, right)]), samples)
        assert result["counts"]["not_of_these_samples"] == 1 and result["classes"]["Car"]["recall"] == 0
        result, found, _ = evaluate_detections(write(tmp_path / "found.json", [box(own, 1, right)]), samples)
        assert (result["counts"]["not_of_these_samples"] == 0 and result["classes"]["Car"]["recall"] == 1 / 2
                and found.image.tolist() == [0])
        joints = samples.shards.labels(0)["persons"]["joints"][
            1, samples.shards.joint_places(0, samples.shards.default_joints())].tolist()
        for number, there in ((own, 1), (other, 0)):
            entry = {"image_id": number, "person": 1, "joints": joints}
            assert (np.isfinite(evaluate_poses(write(tmp_path / "poses.json", [entry]), samples)[1]).all((1, 2)).sum()
                    == there)
    (tmp_path / "ids.txt").write_text("000003\n")
    samples = Samples(two_shards, "train", "frames", tmp_path / "ids.txt")
    assert samples.of([box(n, 1, right) for n in range(1, 9)], "").tolist() == [-1] * 6 + [0, -1]


def test_predictions_for_samples_of_a_source_without_boxes_do_not_count(two_shards, tmp_path):
    with h5py.File(two_shards / SECOND, "r+") as file:
        del file["labels/boxes/class_id"].attrs["class_names"]
        file["labels/boxes/offsets"][...] = 0
    record, size_bytes = (two_shards / SECOND).with_suffix(".json"), (two_shards / SECOND).stat().st_size
    record.write_text(json.dumps({**json.loads(record.read_text()), "size_bytes": size_bytes}))
    found = write(tmp_path / "found.json", [box(number, "Car", [1, 1, 3.25, 3.5]) for number in (1, 5)])
    result, _, _ = evaluate_detections(found, Samples(two_shards, "train", None, None))
    assert result["counts"]["samples"] == 4 and result["counts"]["not_of_these_samples"] == 1
    assert result["classes"]["Car"]["precision"] == 1


def test_average_precision_has_no_least_score_and_no_suppression(folder, tmp_path):
    found = write(tmp_path / "found.json",
                  [box("000003", "Car", [0, 0, 3, 3], 0.06), box("000000", "Car", [1, 1, 3.25, 3.5], 0.05),
                   box("000000", "Car", [1, 1, 3.25, 3.4], 0.04)])
    result, boxes, _ = evaluate_detections(found, Samples(folder, None, None, None))
    car = result["classes"]["Car"]
    assert (len(boxes.score), result["counts"]["after_suppression"],
            car["found"], car["recall"]) == (3, 0, 0, 0) and math.isnan(car["precision"])
    assert car["ap_voc"] == 1 / 2 / 2 and car["ap_coco"] > 0  # one of two cars, after a wrong one
    everything, _, _ = evaluate_detections(found, Samples(folder, None, None, None), confidence=0, nms=1)
    assert {key: everything["classes"]["Car"][key] for key in car
            if key.startswith("ap_")} == {key: car[key] for key in car if key.startswith("ap_")}
    assert everything["counts"]["after_suppression"] == 3


def test_difficulty_gives_the_recalls_and_kitti_s_levels(folder, tmp_path):
    with h5py.File(folder / NAME, "r+") as file:
        rows = len(file["labels/boxes/class_id"])
        if "labels/boxes/difficulty" in file:
            del file["labels/boxes/difficulty"]
        file["labels/boxes/difficulty"] = np.zeros(rows, np.int8)
    record = (folder / NAME).with_suffix(".json")
    record.write_text(json.dumps({**json.loads(record.read_text()), "size_bytes": (folder / NAME).stat().st_size}))
    found = write(tmp_path / "found.json", [box("000000", "Car", [1, 1, 3.25, 3.5])])
    result, _, _ = evaluate_detections(found, Samples(folder, None, None, None))
    assert result["classes"]["Car"]["easy"] == 2 and result["classes"]["Car"]["recall_easy"] == 0.5
    assert result["kitti"]["Car"].keys() == KITTI_LEVELS.keys()
    samples = Samples(folder, None, None, None)
    _, _, truth = evaluate_detections(found, samples)
    cars = np.flatnonzero((truth.label == samples.classes.index("Car")) & ~truth.ignore)
    ids, corners = samples.shards.column("sample_id")[truth.image[cars]], truth.xyxy[cars].reshape(-1, 2, 2)
    sides = corners[:, 1] - corners[:, 0]
    assert len(cars) == 2 and (2 <= sides[:, 1]).all() and (sides[:, 1] < 40).all()
    found = write(tmp_path / "found.json", [box(name, "Car", [*corner, *side]) for name, corner, side
                                            in zip(ids.tolist(), corners[:, 0].tolist(), sides.tolist())])
    del samples  # and with them the open file
    # The level is of boxes of 40 pixels of the source, and so of these where a row of the volume shows 20.
    for scale_x, scale_y, counts in ((1, 1 / 20, True), (1 / 20, 1, False)):
        with h5py.File(folder / NAME, "r+") as file:
            file["pairs/source_to_volume"][...] = [[scale_x, 0, 0], [0, scale_y, 0]]
        record.write_text(json.dumps({**json.loads(record.read_text()), "size_bytes": (folder / NAME).stat().st_size}))
        result, _, _ = evaluate_detections(found, Samples(folder, None, None, None))
        assert (result["kitti"]["Car"]["easy"] > 0) == counts


@pytest.mark.parametrize(("entry", "error"), [
    (box("000002", "Car", [0, 0, 1, 1]),
     r'expected the image_id of a sample of 4, got "000002", in .*json \(entry 1\)'),
    (box(5, "Car", [0, 0, 1, 1]), "expected the image_id of a sample of 4, got 5"),
    (box(0, "Car", [0, 0, 1, 1]), "expected the image_id of a sample of 4, got 0"),
    (box(True, "Car", [0, 0, 1, 1]), "expected the image_id of a sample of 4, got true"),
    (box(1.0, "Car", [0, 0, 1, 1]), "expected the image_id of a sample of 4, got 1.0"),
    (box("000001", True, [0, 0, 1, 1]), "expected a category_id of Car, or its number from 1 on, got true"),
    (box("000001", "Car", [0, 0, 1, 1], True), "expected a finite number as score, got true"),
    (box("000001", "Car", [0, 0, 1, 1], "0.9"), 'expected a finite number as score, got "0.9"'),
    (box("000001", "Car", [0, 0, 1, 1], 10**400), "expected a finite number as score, got 1000"),
    (box("000001", "Car", [0, 0, 1, True]), r"expected 4 finite numbers as bbox, got \[0, 0, 1, true\]"),
    (box("000001", "Car", ["0", 0, 1, 1]), r"expected 4 finite numbers as bbox, got \[\"0\", 0, 1, 1\]"),
    (box("000001", "Bus", [0, 0, 1, 1]), 'expected a category_id of Car, or its number from 1 on, got "Bus"'),
    (box("000001", 2, [0, 0, 1, 1]), "expected a category_id of Car, or its number from 1 on, got 2"),
    (box("000001", "DontCare", [0, 0, 1, 1]), 'got "DontCare"'),
    (box("000001", "Car", [0, 0, math.nan, 1]),
     r"expected 4 finite numbers as bbox, got .*NaN.* \(entry 1, sample 000001\)"),
    (box("000001", "Car", [0, 0, 1]), "expected 4 finite numbers as bbox"),
    (box("000001", "Car", [0, 0, -1, 1]), "expected a bbox of left, top, width, height, got"),
    (box("000001", "Car", [0, 0, 1, 1], math.nan), "expected a finite number as score, got NaN"),
    ({"image_id": "000001", "bbox": [0, 0, 1, 1], "score": 1}, "expected image_id, category_id, bbox, score, got"),
    ([1], "expected image_id, category_id, bbox, score, got"),
])
def test_wrong_predictions_are_refused(folder, tmp_path, entry, error):
    found = write(tmp_path / "found.json", [box("000000", "Car", [1, 1, 3, 3]), entry])
    with pytest.raises(ValueError, match=error):
        evaluate_detections(found, Samples(folder, None, None, None))


def test_what_is_no_list_and_ids_that_two_have_are_refused(two_shards, tmp_path):
    for text, error in (("{}", "expected a list, got dict"), ("[", "expected JSON, got"),
                        (100_000 * "[", "expected JSON, got .*recursion")):
        (tmp_path / "found.json").write_text(text)
        with pytest.raises(ValueError, match=error):
            evaluate_detections(tmp_path / "found.json", Samples(two_shards, None, None, None))
    found = write(tmp_path / "found.json", [box("000000", "Car", [1, 1, 3, 3])])
    with pytest.raises(ValueError,
                       match='expected the image_id of one sample of 8, got "000000", which two samples have'):
        evaluate_detections(found, Samples(two_shards, None, None, None))
    with pytest.raises(ValueError, match="expected classes of Car, DontCare, got Bus"):
        evaluate_detections(found, Samples(two_shards, None, None, None), ["Bus"])


def test_poses_of_a_folder(folder, tmp_path):
    samples = Samples(folder, None, None, None)
    places = samples.shards.joint_places(0, samples.shards.default_joints())
    first, alone = (samples.shards.labels(i)["persons"]["joints"][:, places] for i in (0, 3))  # two persons, one
    joints = first + [3.0, 4.0]
    entries = [{"image_id": "000000", "person": 1, "joints": joints[1].tolist()},
               {"image_id": "000004", "joints": alone[0].tolist()}]
    result, found, persons = evaluate_poses(write(tmp_path / "found.json", entries), samples, hidden=True)
    assert result["counts"]["persons"] == 3 and result["counts"]["not_found"] == 1 and np.isnan(found[0]).all()
    of_it = persons.scored(True)[1:]
    assert of_it.any(1).all()
    assert result["joints"]["all"]["mpjpe_volume"] == pytest.approx(5 * of_it[0].sum() / of_it.sum())
    linear = samples.shards.labels(0)["pair"]["source_to_volume"]
    moved = math.hypot(3 / linear[0, 0], 4 / linear[1, 1])
    assert result["joints"]["all"]["mpjpe_source"] == pytest.approx(moved * of_it[0].sum() / of_it.sum())
    for wrong, error in (({}, "expected a person of the 2 there are, got null"),
                         ({"person": 2}, "expected a person of the 2 there are, got 2"),
                         ({"person": True}, "expected a person of the 2 there are, got true"),
                         ({"person": 0, "joints": [[0, 0], [0, True]]},
                          "expected 2 x 2 finite numbers as joints, got .*true"),
                         ({"person": 1}, "got 1 twice"),
                         ({"person": 0, "joints": [[0, 0]]}, "expected 2 x 2 finite numbers as joints")):
        with pytest.raises(ValueError, match=error):
            evaluate_poses(write(tmp_path / "wrong.json",
                                 [*entries, {"image_id": "000000", "joints": joints[0].tolist(), **wrong}]), samples)


def evaluate(*arguments, expect=0):
    done = subprocess.run([sys.executable, "-m", "eventgan.evaluate", *map(str, arguments)], capture_output=True,
                          text=True, env={**os.environ, "PYTHONPATH": str(PACKAGE)})
    assert done.returncode == expect, done.stdout + done.stderr
    return done.stdout + done.stderr


def test_flow_scores_worked_out_by_hand():
    true = np.zeros((2, 1, 5), np.float16)
    found = np.array([[[0, 1, 3, 4, np.nan]], [[0, 0, 4, 0, 0]]], np.float32)
    scored = np.array([[True, True, True, True, False]])
    scores = flow_scores([(found, true, scored)])
    # distances 0, 1, 5 and 4, angles of (x, y, 1) to (0, 0, 1): the arc tangent of these
    assert scores["pixels"] == 4 and scores["aee"] == 10 / 4 and scores["npe_1"] == scores["npe_3"] == 2 / 4
    assert scores["angular"] == pytest.approx(np.degrees(np.arctan([0, 1, 5, 4])).mean())
    both = flow_scores([(found, true, scored), (found, true, np.array([[True, False, False, False, False]]))])
    assert both["pixels"] == 5 and both["aee"] == 10 / 5
    nothing = flow_scores([(found, true, np.zeros((1, 5), bool))])
    assert nothing["pixels"] == 0 and all(math.isnan(nothing[key]) for key in ("aee", "npe_1", "npe_3", "angular"))
    # opposite flows of a pixel: twice 45 degrees; a small angle keeps its digits
    distance, angle = flow_errors(np.array([[1, 1e-9], [0, 0]]), np.array([[-1, 0], [0, 0]]))
    assert distance.tolist() == [2, 1e-9] and angle == pytest.approx([90, np.degrees(1e-9)])


def test_flows_of_a_folder(folder, tmp_path):
    # the last sample's flow is (0.5, -0.25) at 7 x 5 pixels
    still = np.tile(np.array([0.5, -0.25])[:, None, None], (1, 6, 8))
    there = (Shards(folder)[-1]["volume"] != 0).any(0) & (Shards(folder)[-1]["flow_valid"] != 0)

    def evaluated(**flows):
        np.savez(tmp_path / "found.npz", **flows)
        return evaluate_flows(tmp_path / "found.npz", Samples(folder, None, None, None))[0]

    result = evaluated(**{"000004": still + [[[0.3]], [[0.4]]], "000000": still})
    assert result["counts"] == {"samples": 1, "not_of_these_samples": 1}
    dense, at_events = result["flow"]["dense"], result["flow"]["at events"]
    assert dense["pixels"] == 35 and at_events["pixels"] == there.sum()
    assert dense["aee"] == pytest.approx(0.5) and dense["npe_1"] == 0
    for flows, message in [({"000000": still}, "expected a flow of each of 1 samples, got none of 1"),
                           ({"000004": still[:1]}, r"expected flow of shape \(2, 6, 8\), got \(1, 6, 8\)"),
                           ({"000004": still * np.nan}, "expected finite flow, got 70 NaN or infinite numbers")]:
        with pytest.raises(ValueError, match=message + r".*found\.npz \(sample 000004\)"):
            evaluated(**flows)
    write(tmp_path / "found.npz", [])
    with pytest.raises(ValueError, match="expected an .npz of arrays, got another file, in .*found.npz"):
        evaluate_flows(tmp_path / "found.npz", Samples(folder, None, None, None))


def test_flows_of_ids_that_two_have_are_refused(two_shards, tmp_path):
    np.savez(tmp_path / "found.npz", **{"000004": np.zeros((2, 6, 8))})
    with pytest.raises(ValueError, match='ids of their own, got "000004", which two samples have'):
        evaluate_flows(tmp_path / "found.npz", Samples(two_shards, None, None, None))


def test_the_command_prints_tables_json_and_images(folder, tmp_path):
    found = write(tmp_path / "found.json",
                  [box("000000", "Car", [1, 1, 3.25, 3.5]), box("000000", "Car", [-1e30, 0, 2e30, 1], 0.1)])
    said = evaluate("detections", found, "--truth", folder)
    assert "4 samples (3 without a prediction), 2 ground-truth boxes" in said
    assert ("average precisions use all 2 predictions; precision, recall and F1 use 1, after confidence 0.2 and "
            "non-maximum" in said)
    heading, car = said.split("\n\n")[1].splitlines()[:2]
    assert car.split()[1:] == ["2", "0", "1", "1.000", "-", "1.000", "0.500",
                               "0.500", "0.667"] and heading.split()[-1] == "F1"
    assert json.loads(evaluate("detections", found, "--truth",
                               folder, "--json"))["classes"]["Car"]["recall_easy"] is None
    poses = write(tmp_path / "poses.json", [])
    # of the others all joints are hidden
    assert "3 persons, 1 of them not found" in evaluate("poses", poses, "--truth", folder)
    (tmp_path / "alone.txt").write_text("000004\n")
    assert "1 person, " in evaluate("poses", poses, "--truth", folder, "--ids", tmp_path / "alone.txt")
    assert "nowhere" in evaluate("detections", poses, "--truth", tmp_path / "nowhere", expect=1)
    for more, error in ((("--split", "val"), "expected a split of train, got 'val'"),
                        (("--dataset", "mpii"), "('kitti_object'), got 1 that it does not"),
                        (("--classes", "Bus"), "expected classes of Car, DontCare, got Bus"),
                        (("--iou", "5"), "got confidence 0.2, nms 0.2 and iou 5")):
        assert error in evaluate("detections", poses, "--truth", folder, *more, expect=1)
    for depth in (900, 100_000):  # as Python's reader of JSON gives it back, and as it does not
        (tmp_path / "deep.json").write_text('[{"image_id": ' + depth * "[" + depth * "]"
                                            + ', "category_id": 1, "bbox": [0, 0, 1, 1], "score": 1}]')
        said = evaluate("detections", tmp_path / "deep.json", "--truth", folder, expect=1)
        assert said.startswith("error: expected ") and "Traceback" not in said
    pytest.importorskip("cv2")
    evaluate("detections", found, "--truth", folder, "--images", tmp_path / "boxes", "--confidence", "0")
    write(poses, [{"image_id": "000000", "person": 1, "joints": [[1e30, 2], [3, -1e30]]}])
    evaluate("poses", poses, "--truth", folder, "--images", tmp_path / "joints")
    assert {path.name for path in (tmp_path / "boxes").iterdir()} >= {"precision_recall.png", "000000.png"}
    assert len(list((tmp_path / "joints").glob("*.png"))) == 2
    np.savez(tmp_path / "found.npz", **{"000004": np.zeros((2, 6, 8), np.float32)})
    said = evaluate("flows", tmp_path / "found.npz", "--truth", folder, "--images", tmp_path / "flows")
    # the flow is (0.5, -0.25): 0.559 px off
    assert said.splitlines()[3].split() == ["dense", "35", "0.559", "0.000", "0.000", "29.206"]
    assert [path.name for path in (tmp_path / "flows").iterdir()] == ["000004.png"]

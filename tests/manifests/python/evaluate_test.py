"""eventgan.evaluate: scores worked out by hand, against plain loops of the published rules,
and against the trainers' own."""

import inspect
import json
import math
import os
import pathlib
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest
from conftest import NAME, PACKAGE, SECOND, SOURCE

from eventgan import Shards
from eventgan.detection_scores import (COCO_IOUS, KITTI_CLASSES, KITTI_LEVELS, Detections, GroundTruth,
                                       average_precisions, detection_scores, kitti_average_precision, match_as_coco,
                                       match_as_voc, non_maximum_suppression)
from eventgan.evaluate import Samples, detection_tables, evaluate_detections, evaluate_flows, evaluate_poses
from eventgan.flow_scores import flow_errors, flow_scores
from eventgan.pose_scores import Persons, head_lengths, pose_scores

TRAINERS = pathlib.Path(os.environ.get("EVENTGAN_TEST_TRAINERS", SOURCE.parent / "shared" / "trainers"))
CAR, VAN, DONT_CARE = 0, 1, -1
CLASSES = {"Car": CAR, "Van": VAN}


def truth_of(*rows):
    """Rows of image, label, left, top, right, bottom, ignore, difficulty."""
    rows = np.array(rows, float).reshape(-1, 8)
    return GroundTruth(rows[:, 0].astype(int), rows[:, 1].astype(int), rows[:, 2:6], rows[:, 6] != 0,
                       rows[:, 7].astype(int))


def found_of(*rows):
    """Rows of image, label, left, top, right, bottom, score."""
    rows = np.array(rows, float).reshape(-1, 7)
    return Detections.of(rows[:, 0], rows[:, 1], rows[:, 2:6], rows[:, 6])


def test_scores_worked_out_by_hand():
    truth = truth_of([0, CAR, 0, 0, 10, 10, 0, 0], [0, CAR, 20, 0, 30, 10, 0, 1], [1, CAR, 0, 0, 10, 10, 0, 2],
                     [1, VAN, 50, 0, 60, 10, 0, -1], [1, DONT_CARE, 80, 0, 100, 20, 1, -1])
    found = found_of([0, CAR, 0, 0, 10, 10, 0.9],  # right
                     [0, CAR, 0, 0, 10, 9, 0.8],  # the same car again: wrong
                     [0, CAR, 20, 0, 30, 5, 0.7],  # IoU 0.5: right
                     [1, CAR, 50, 0, 60, 10, 0.6],  # a van: wrong
                     [1, CAR, 90, 0, 110, 10, 0.5],  # half in what is to be ignored: no matter
                     [1, VAN, 82, 2, 90, 9, 0.5],  # of another class, all the same
                     [1, CAR, 0, 0, 10, 4.9, 0.4])  # IoU 0.49: wrong
    scores = detection_scores(found, truth, CLASSES)
    car = scores["Car"]
    # right at 1 of 1 and 2 of 3 predictions, of 3 cars: precision 1 up to recall 1/3, 2/3 up to 2/3
    assert [car[key] for key in ("truths", "easy", "hard", "found", "right")] == [3, 1, 2, 5, 2]
    assert car["precision"] == 2 / 5 and car["recall"] == 2 / 3 and car["f1"] == 2 * 2 / (3 + 5)
    assert car["recall_easy"] == 1 and car["recall_hard"] == 1 / 2
    assert car["ap_voc"] == pytest.approx(1 / 3 + 2 / 3 / 3)
    assert car["ap_voc_11"] == pytest.approx((4 * 1 + 3 * 2 / 3) / 11)  # 0 to 0.3, 0.4 to 0.6
    assert car["ap_coco_101"] == pytest.approx((34 * 1 + 33 * 2 / 3) / 101)  # 0 to 0.33, 0.34 to 0.66
    # with COCO's matching: the second prediction is wrong at each IoU, the third right at 0.5 alone
    assert car["ap_coco"] == pytest.approx(((34 + 33 * 2 / 3) + 9 * 34) / 10 / 101)
    van = scores["Van"]
    assert van["recall"] == van["ap_voc"] == van["ap_coco"] == 0
    assert math.isnan(van["precision"]) and math.isnan(van["recall_easy"])
    both = scores["all"]
    assert both["precision"] == 2 / 5 and both["recall"] == 2 / 4 and both["ap_voc"] == car["ap_voc"] / 2


def test_recalls_that_a_point_meets_belong_to_it():
    right = np.array([True] * 3 + [False])  # recall 0.3 of 10: 0, 0.1, 0.2, 0.3
    assert average_precisions(right, 10)["ap_voc_11"] == pytest.approx(4 / 11)
    assert average_precisions(right, 10)["ap_voc"] == pytest.approx(0.3)


def test_a_second_one_is_wrong_for_voc_and_takes_another_box_for_coco():
    truth = truth_of([0, CAR, 0, 0, 10, 10, 0, 0], [0, CAR, 4, 0, 14, 10, 0, 0])
    # IoU 9/11 with the first, 7/13 with the second
    found = found_of([0, CAR, 0, 0, 10, 10, 0.9], [0, CAR, 1, 0, 11, 10, 0.8])
    assert match_as_voc(found, truth)[0].tolist() == [0, -1]
    assert match_as_coco(found, truth)[0][:, 0].tolist() == [True, True]


def test_equal_scores_stay_in_the_order_of_the_list():
    truth = truth_of([0, CAR, 0, 0, 10, 10, 0, 0])
    right, wrong = [0, CAR, 0, 0, 10, 10, 0.5], [0, CAR, 20, 0, 30, 10, 0.5]
    assert detection_scores(found_of(right, wrong), truth, CLASSES)["Car"]["ap_voc"] == 1
    assert detection_scores(found_of(wrong, right), truth, CLASSES)["Car"]["ap_voc"] == 0.5
    assert non_maximum_suppression(found_of([0, CAR, 0, 0, 10, 10, 0.5], [0, CAR, 0, 0, 10, 9, 0.5]),
                                   0.2).tolist() == [True, False]


@pytest.mark.parametrize(("truth", "found", "precision", "recall", "ap", "f1"), [
    ([], [], math.nan, math.nan, math.nan, math.nan),
    ([], [[0, CAR, 0, 0, 10, 10, 0.5]], 0, math.nan, math.nan, 0),
    ([[0, CAR, 0, 0, 10, 10, 0, 0]], [], math.nan, 0, 0, 0),
    # all to be ignored
    ([[0, CAR, 0, 0, 10, 10, 1, 0]], [[0, CAR, 0, 0, 10, 10, 0.5]], math.nan, math.nan, math.nan, math.nan),
    ([[0, CAR, 5, 5, 5, 5, 0, 0]], [[0, CAR, 5, 5, 5, 5, 0.5]], 0, 0, 0, 0),  # without an area nothing overlaps
])
def test_edges(truth, found, precision, recall, ap, f1):
    scores = detection_scores(found_of(*found), truth_of(*truth), CLASSES)
    for row in (scores["Car"], scores["all"]):
        values = [row[key] for key in ("precision", "recall", "ap_voc", "ap_voc_11", "ap_coco_101", "ap_coco", "f1")]
        np.testing.assert_array_equal(values, [precision, recall, ap, ap, ap, ap, f1])


def boxes_at_random(rng, images, each):
    """image [n], label [n], xyxy [n, 4] of about `each` boxes an image, in so little room that many overlap."""
    image = np.sort(rng.integers(0, images, images * each))
    corner, size = rng.uniform(0, 120, (len(image), 2)), rng.uniform(8, 60, (len(image), 2))
    return image, rng.integers(0, 2, len(image)), np.hstack([corner, corner + size])


def scene(seed, images=30, each=8):
    """Found and true boxes: true ones moved a little, some twice, some of the other class, and some from nowhere."""
    rng = np.random.default_rng(seed)
    image, label, xyxy = boxes_at_random(rng, images, each)
    ignore = rng.random(len(image)) < 0.15
    label = np.where(ignore & (rng.random(len(image)) < 0.5), DONT_CARE, label)
    truth = GroundTruth(image, label, xyxy, ignore, rng.integers(-1, 3, len(image)))
    rows = rng.integers(0, len(image), 2 * len(image))
    moved = xyxy[rows] + rng.normal(0, 0.08, (len(rows), 4)) * np.tile(xyxy[rows, 2:] - xyxy[rows, :2], 2)
    extra = boxes_at_random(rng, images, each // 2)
    other = np.where(rng.random(len(rows)) < 0.1, 1 - label[rows] % 2, label[rows] % 2)
    found = [np.concatenate(pair) for pair in zip((image[rows], other, moved), extra)]
    return Detections.of(*found, rng.permutation(len(found[0])) / len(found[0])), truth


def iou_of(a, b, share=False):
    wide, high = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    if wide <= 0 or high <= 0:
        return 0.0
    area = (a[2] - a[0]) * (a[3] - a[1])
    return wide * high / (area if share else area + (b[2] - b[0]) * (b[3] - b[1]) - wide * high)


def rows_of(boxes, image):
    return np.flatnonzero(boxes.image == image).tolist()


def ignored_by_loops(found, truth, n, least):
    return any(truth.ignore[m] and truth.label[m] in (found.label[n], DONT_CARE)
               and iou_of(found.xyxy[n], truth.xyxy[m], share=True) >= least
               for m in rows_of(truth, found.image[n]))


@pytest.mark.parametrize("seed", range(5))
def test_voc_s_matching_is_that_of_its_loop(seed):
    found, truth = scene(seed)
    taken, expected, counts = set(), [], []
    for n in range(len(found.score)):
        same = [m for m in rows_of(truth, found.image[n]) if truth.label[m] == found.label[n] and not truth.ignore[m]]
        best = max(same, key=lambda m: iou_of(found.xyxy[n], truth.xyxy[m]), default=None)
        right = best is not None and iou_of(found.xyxy[n], truth.xyxy[best]) >= 0.5 and best not in taken
        taken |= {best} if right else set()
        expected.append(best if right else -1)
        counts.append(right or not ignored_by_loops(found, truth, n, 0.5))
    matched_truth, counted = match_as_voc(found, truth)
    assert matched_truth.tolist() == expected and counted.tolist() == counts
    assert 0.2 < np.mean(matched_truth >= 0) < 0.8 and not counted.all()


@pytest.mark.parametrize("seed", range(3))
def test_coco_s_matching_is_that_of_its_loop(seed):
    found, truth = scene(seed)
    right, counted = match_as_coco(found, truth)
    for t, least in enumerate(COCO_IOUS):
        taken = set()
        for n in range(len(found.score)):
            free = [m for m in rows_of(truth, found.image[n]) if truth.label[m] == found.label[n]
                    and not truth.ignore[m] and m not in taken]
            best = max(free, key=lambda m: iou_of(found.xyxy[n], truth.xyxy[m]), default=None)
            hit = best is not None and iou_of(found.xyxy[n], truth.xyxy[best]) >= least
            taken |= {best} if hit else set()
            assert right[n, t] == hit and counted[n, t] == (hit or not ignored_by_loops(found, truth, n, least))


def pycocotools(found, annotations, label, images):
    """COCOeval's AP@[.5:.95] of a class, all areas, 100 detections, as its evaluateImg and accumulate have it, in plain
    loops; annotations are dictionaries of image_id, category_id, bbox and iscrowd."""
    precision = []
    for least in np.linspace(0.5, 0.95, 10):
        scores, right, ignored, truths = [], [], [], 0
        for image in range(images):
            there = sorted((each for each in annotations if each["image_id"] == image and each["category_id"] == label),
                           key=lambda each: each["iscrowd"])
            truths += sum(not each["iscrowd"] for each in there)
            rows = [n for n in rows_of(found, image) if found.label[n] == label]
            matched = {}
            for n in sorted(rows, key=lambda n: -found.score[n])[:100]:
                best, at = min(least, 1 - 1e-10), None
                for g, each in enumerate(there):
                    if g in matched and not each["iscrowd"]:
                        continue
                    if at is not None and not there[at]["iscrowd"] and each["iscrowd"]:
                        break
                    left, top, width, height = each["bbox"]
                    box, true = found.xyxy[n], [left, top, left + width, top + height]
                    overlap = iou_of(box, true, share=each["iscrowd"])
                    if overlap >= best:
                        best, at = overlap, g
                if at is not None:
                    matched[at] = n
                scores.append(found.score[n])
                right.append(at is not None and not there[at]["iscrowd"])
                ignored.append(at is not None and bool(there[at]["iscrowd"]))
        if not truths:
            return math.nan
        hits, misses, recall, precisions = 0, 0, [], []
        for n in sorted(range(len(scores)), key=lambda n: -scores[n]):
            hits, misses = hits + right[n], misses + (not right[n] and not ignored[n])
            recall.append(hits / truths)
            precisions.append(hits / max(hits + misses, 1))
        for n in range(len(precisions) - 1, 0, -1):
            precisions[n - 1] = max(precisions[n - 1], precisions[n])
        for point in np.linspace(0, 1, 101):
            n = next((n for n in range(len(recall)) if recall[n] >= point), None)
            precision.append(0 if n is None else precisions[n])
    return np.mean(precision)


@pytest.mark.parametrize("seed", range(4))
def test_coco_s_average_precision_is_pycocotools_of_our_own_export(seed):
    found, truth = scene(seed, images=12, each=12)
    annotations = []
    for image, label, (left, top, right, bottom), ignore in zip(truth.image, truth.label, truth.xyxy.tolist(),
                                                                truth.ignore.tolist()):
        for category in CLASSES.values() if label == DONT_CARE else [label]:  # exports.md: one of every class
            annotations.append({"image_id": image, "category_id": category,
                                "bbox": [left, top, right - left, bottom - top], "iscrowd": int(ignore)})
    scores = detection_scores(found, truth, CLASSES)
    for name, label in CLASSES.items():
        assert scores[name]["ap_coco"] == pytest.approx(pycocotools(found, annotations, label, 12), abs=1e-12)
        assert 0.1 < scores[name]["ap_coco"] < 0.6
    none = detection_scores(found, truth._replace(ignore=np.zeros_like(truth.ignore)), CLASSES)
    assert none["Car"]["ap_coco"] != scores["Car"]["ap_coco"]  # it matters


def test_boxes_to_be_ignored_ignore_their_class_and_dont_care_all():
    truth = truth_of([0, CAR, 0, 0, 10, 10, 0, 0], [0, VAN, 20, 0, 40, 20, 1, -1], [0, DONT_CARE, 60, 0, 80, 20, 1, -1])
    for left, label, counts in ((20, VAN, 0), (20, CAR, 1), (60, VAN, 0), (60, CAR, 0)):
        found = found_of([0, label, left, 0, left + 10, 10, 0.9])
        assert match_as_voc(found, truth)[1].tolist() == [counts]
        assert match_as_coco(found, truth)[1].tolist() == [[counts] * 10]
        assert detection_scores(found, truth, CLASSES)["all"]["found"] == counts


def test_average_precisions_are_of_all_predictions_and_the_others_of_those_that_are_sure():
    truth = truth_of([0, CAR, 0, 0, 10, 10, 0, 0], [0, CAR, 20, 0, 30, 10, 0, 0])
    found = found_of([0, CAR, 0, 0, 10, 10, 0.9], [0, CAR, 40, 0, 50, 10, 0.5], [0, CAR, 20, 0, 30, 10, 0.1])
    car = detection_scores(found, truth, CLASSES, sure=found.score >= 0.2)["Car"]
    assert (car["found"], car["right"], car["precision"], car["recall"], car["f1"]) == (2, 1, 1 / 2, 1 / 2, 2 / 4)
    assert car["ap_voc"] == pytest.approx(1 / 2 + 2 / 3 / 2)
    assert car["ap_coco"] == pytest.approx((51 + 50 * 2 / 3) / 101)
    sure = detection_scores(found.rows(found.score >= 0.2), truth, CLASSES)["Car"]
    assert {key for key in sure
            if sure[key] != pytest.approx(car[key], nan_ok=True)} == {"ap_voc", "ap_voc_11", "ap_coco_101", "ap_coco"}


def test_coco_counts_a_hundred_of_a_class_and_sample():
    truth = truth_of([0, CAR, 0, 0, 10, 10, 0, 0])
    found = found_of(*([0, CAR, 20 * i, 20, 20 * i + 9, 30, 0.9] for i in range(100)), [0, CAR, 0, 0, 10, 10, 0.1],
                     [0, VAN, 0, 0, 10, 10, 0.1])
    right, counted = match_as_coco(found, truth)
    assert not right.any() and counted.sum(0).tolist() == [101] * 10


@pytest.mark.parametrize("iou", [0, 0.2, 0.6, 1])
def test_suppression_is_torchvision_s(iou):
    torch, ops = pytest.importorskip("torch"), pytest.importorskip("torchvision.ops")
    found, _ = scene(1)
    kept = ops.batched_nms(torch.from_numpy(found.xyxy), torch.from_numpy(found.score),
                           torch.from_numpy(2 * found.image + found.label), iou)
    # both from the highest score on
    assert np.flatnonzero(non_maximum_suppression(found, iou)).tolist() == kept.tolist()
    assert 0 < len(kept) < len(found.score) or iou == 1


def kitti_by_loops(found, truth, classes, name, level, height):
    """The development kit's evaluate_object.cpp, sample by sample, threshold by threshold."""
    least, neighbour = KITTI_CLASSES[name]
    rank = list(KITTI_LEVELS).index(level)
    kind = {}  # of true boxes: 0 counts, 1 is ignored
    for m in range(len(truth.image)):
        if truth.label[m] == classes[name]:
            kind[m] = 0 if 0 <= truth.difficulty[m] <= rank and not truth.ignore[m] else 1
        elif truth.label[m] == classes.get(neighbour):
            kind[m] = 1
    small = {n: height[n] < KITTI_LEVELS[level] for n in range(len(found.score)) if height[n] < KITTI_LEVELS[level]
             or found.label[n] == classes[name]}
    images = range(max([*truth.image, *found.image], default=-1) + 1)

    def best_score(m, free):
        return max((n for n in free if iou_of(found.xyxy[n], truth.xyxy[m]) > least), key=lambda n: found.score[n],
                   default=None)

    def best_fit(m, free):
        fits = [n for n in free if iou_of(found.xyxy[n], truth.xyxy[m]) > least]
        return max((n for n in fits if not small[n]), key=lambda n: iou_of(found.xyxy[n], truth.xyxy[m]),
                   default=fits[0] if fits else None)

    def right_and_wrong(choose, threshold):
        scores, wrong = [], 0
        for image in images:
            free = [n for n in rows_of(found, image) if n in small and found.score[n] >= threshold]
            for m in rows_of(truth, image):
                n = choose(m, free) if m in kind else None
                if n is not None:
                    free.remove(n)
                    scores += [found.score[n]] if kind[m] == 0 and not small[n] else []
            stuff = [m for m in rows_of(truth, image) if truth.label[m] == DONT_CARE]
            wrong += sum(not small[n] and all(iou_of(found.xyxy[n], truth.xyxy[m], share=True) <= least for m in stuff)
                         for n in free)
        return scores, wrong

    truths = sum(each == 0 for each in kind.values())
    scores = sorted(right_and_wrong(best_score, -1)[0], reverse=True)
    thresholds, recall = [], 0.0
    for i, score in enumerate(scores):
        last = i == len(scores) - 1
        if not last and (i + 2) / truths - recall < recall - (i + 1) / truths:
            continue
        thresholds.append(score)
        recall += 1 / 40
    precision = [0.0] * 41
    for i, threshold in enumerate(thresholds):
        right, wrong = right_and_wrong(best_fit, threshold)
        precision[i] = len(right) / max(len(right) + wrong, 1)
    return sum(max(precision[i:]) for i in range(1, 41)) / 40


@pytest.mark.parametrize("level", KITTI_LEVELS)
@pytest.mark.parametrize("seed", range(3))
def test_kitti_s_average_precision_is_that_of_its_development_kit(seed, level):
    found, truth = scene(seed, images=60)
    height = (found.xyxy[:, 3] - found.xyxy[:, 1]) * 1.3
    classes = {**CLASSES, "DontCare": DONT_CARE}
    expected = kitti_by_loops(found, truth, classes, "Car", level, height)
    assert kitti_average_precision(found, truth, classes, "Car", level, height) == pytest.approx(expected, abs=1e-12)
    assert 0.05 < expected < 0.95


def test_kitti_without_a_box_of_the_level():
    truth = truth_of([0, CAR, 0, 0, 10, 10, 0, 2])
    found = found_of([0, CAR, 0, 0, 10, 10, 0.5])
    assert math.isnan(kitti_average_precision(found, truth, CLASSES, "Car", "easy", np.array([50.0])))
    # one box: recall 0 alone has a threshold
    assert kitti_average_precision(found, truth, CLASSES, "Car", "hard", np.array([50.0])) == 0
    assert kitti_average_precision(found_of(), truth, CLASSES, "Car", "hard", np.empty(0)) == 0


@pytest.fixture
def trainer(monkeypatch):
    """Puts the folder of a trainer's modules first on the path. Both trainers have a `utils`:
    what others have loaded of them is forgotten."""

    def use(path, *modules):
        if not (TRAINERS / path).is_dir():
            pytest.skip(f"no ../shared/trainers/{path}")
        for module in modules:
            pytest.importorskip(module)
        for name, module in list(sys.modules.items()):
            if str(TRAINERS) in str(getattr(module, "__file__", None)):
                monkeypatch.delitem(sys.modules, name)
        monkeypatch.syspath_prepend(str(TRAINERS / path))

    return use


@pytest.mark.parametrize("seed", range(3))
def test_average_precision_is_yolov3_s(trainer, monkeypatch, seed):
    trainer("yolov3", "torch", "torchvision", "matplotlib", "tqdm")
    from utils import utils

    source = inspect.getsource(utils.compute_ap)
    assert "method = 'interp'" in source  # its other method is the area itself
    exec(source.replace("method = 'interp'", "method = 'continuous'"), utils.__dict__)
    found, truth = scene(seed)
    scores = detection_scores(found, truth, CLASSES)
    matched_truth, counts = match_as_voc(found, truth)
    precision, recall, ap, f1, classes = utils.ap_per_class(matched_truth[counts, None] >= 0, found.score[counts] + 0.2,
                                                            found.label[counts],
                                                            # it looks at precision and recall at score 0.1
                                                            truth.label[~truth.ignore])
    assert classes.tolist() == [CAR, VAN]
    for key, values in (("ap_voc", ap[:, 0]), ("precision", precision[:, 0]), ("recall", recall[:, 0]),
                        ("f1", f1[:, 0])):
        np.testing.assert_allclose([scores[name][key] for name in CLASSES], values, rtol=0, atol=1e-6)


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


def test_poses_without_a_head_or_a_person():
    nobody = Persons(["nose"], np.empty((0, 2), int), *np.empty((2, 0, 1, 2)), *np.empty((2, 0, 1), bool),
                     *np.empty((2, 0)), np.empty((0, 2, 3)))
    row = pose_scores(np.empty((0, 1, 2)), nobody)["all"]
    assert row["scored"] == 0 and all(math.isnan(row[key])
                                      for key in ("mpjpe_volume", "mpjpe_source", "pckh", "pckh_mpii"))
    assert np.isnan(head_lengths(["nose"], np.zeros((2, 1, 2)), np.ones((2, 1), bool))).all()


def test_a_hundred_thousand_predictions_take_seconds():
    rng = np.random.default_rng(0)
    image, label, xyxy = boxes_at_random(rng, 10_000, 10)
    truth = GroundTruth(*(column[::2] for column in (image, label, xyxy)), np.zeros(50_000, bool),
                        rng.integers(-1, 3, 50_000))
    start = time.process_time()
    found = Detections.of(image, label, xyxy + rng.normal(0, 2, xyxy.shape), rng.random(100_000))
    found = found.rows(non_maximum_suppression(found, 0.5))
    detection_scores(found, truth, CLASSES)
    for level in KITTI_LEVELS:
        kitti_average_precision(found, truth, CLASSES, "Car", level, found.xyxy[:, 3] - found.xyxy[:, 1])
    assert time.process_time() - start < 30


def test_a_hundred_thousand_boxes_in_twelve_images():
    """8,333 boxes an image: 100 places, at each of which the best of 83 or 84 is right."""
    rng = np.random.default_rng(0)
    image, at = np.arange(100_000) % 12, np.arange(100_000) // 12 % 100
    corner = np.stack([at % 10, at // 10], 1) * 50.0
    found = Detections.of(image, np.zeros(len(image)), np.hstack([corner, corner + 40])
                          + rng.uniform(-1, 1, (len(image), 4)), rng.random(len(image)))
    place = np.arange(100)
    corner = np.stack([place % 10, place // 10], 1) * 50.0
    truth = GroundTruth(np.repeat(np.arange(12), 100), np.zeros(1200, int),
                        np.tile(np.hstack([corner, corner + 40]), (12, 1)), np.zeros(1200, bool), np.zeros(1200, int))
    sure = non_maximum_suppression(found, 0.2)
    assert sure.sum() == 1200
    car = detection_scores(found, truth, CLASSES, sure=sure)["Car"]
    assert (car["right"], car["precision"], car["recall"]) == (1200, 1, 1)
    assert 0.5 < car["ap_voc"] < 0.9  # of all 100,000
    assert detection_scores(found.rows(sure), truth, CLASSES)["Car"]["ap_voc"] == pytest.approx(1)
    assert kitti_average_precision(found.rows(sure), truth, CLASSES, "Car", "easy",
                                   np.full(1200, 40.0)) == pytest.approx(1)


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
                           ({"000004": still[:1]}, r"shape \(2, 6, 8\), got float64 of shape \(1, 6, 8\)"),
                           ({"000004": still * np.nan}, "expected finite numbers")]:
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

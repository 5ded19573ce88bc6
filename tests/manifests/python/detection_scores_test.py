"""eventgan.detection_scores: scores worked out by hand, against plain loops of the published rules, and against a
trainer's own."""

import inspect
import math
import time

import numpy as np
import pytest

from eventgan.detection_scores import (COCO_IOUS, KITTI_CLASSES, KITTI_LEVELS, Detections, GroundTruth,
                                       average_precisions, detection_scores, kitti_average_precision, match_as_coco,
                                       match_as_voc, non_maximum_suppression)

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


def test_of_boxes_that_fit_alike_coco_takes_the_last():
    truth = truth_of([0, CAR, 0, 0, 10, 10, 0, 0], [0, CAR, 4, 0, 14, 10, 0, 0])
    # the first has IoU 8/12 with both; the second is the first box, and has 6/14 with the other
    found = found_of([0, CAR, 2, 0, 12, 10, 0.9], [0, CAR, 0, 0, 10, 10, 0.8])
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

"""Scores of detected boxes, on arrays: the matching and average precision of PASCAL VOC, of COCO and of KITTI.

What is not defined (a recall with nothing to find, a precision with nothing found) is NaN. An average precision is 0 if
every box is missed, NaN if there is none to find.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from .shards import Shards

DONT_CARE = "DontCare"
BLOCK = 1_000_000  # pairs of boxes compared at once
COCO_IOUS = np.linspace(0.5, 0.95, 10)
COCO_MOST = 100  # predictions of a class in a sample that COCO counts
# least IoU, class that is ignored
KITTI_CLASSES = {"Car": (0.7, "Van"), "Pedestrian": (0.5, "Person_sitting"), "Cyclist": (0.5, "")}
KITTI_LEVELS = {"easy": 40, "moderate": 25, "hard": 25}  # least height in source pixels
KITTI_POINTS = 41


class Detections(NamedTuple):
    """Boxes that were found: n rows, the highest score first, equal scores in the order given. Made by `of`."""

    image: np.ndarray  # int [n]: its number
    label: np.ndarray  # int [n]: the number of the class
    xyxy: np.ndarray   # float [n, 4]: left, top, right, bottom in pixels, by edges
    score: np.ndarray  # float [n]

    @staticmethod
    def of(image: Iterable[int], label: Iterable[int], xyxy: Iterable[Iterable[float]],
           score: Iterable[float]) -> Detections:
        """Detections of rows in any order: image [n], label [n], xyxy [n, 4], score [n]."""
        score = np.asarray(score, float)
        order = np.argsort(-score, kind="stable")
        return Detections(np.asarray(image, int)[order], np.asarray(label, int)[order],
                          np.asarray(xyxy, float).reshape(-1, 4)[order], score[order])

    def rows(self, chosen: np.ndarray) -> Detections:
        """The `chosen` ones: bool [n], or rows in ascending order."""
        return Detections(*(column[chosen] for column in self))


class GroundTruth(NamedTuple):
    """Labelled boxes: m rows."""

    image: np.ndarray       # int [m]
    label: np.ndarray       # int [m]; -1: DontCare, which stands for every class
    xyxy: np.ndarray        # float [m, 4]: left, top, right, bottom in pixels, by edges
    ignore: np.ndarray      # bool [m]: detections of this class (-1: any) in it are neither right nor wrong
    difficulty: np.ndarray  # int [m]: 0 easy, 1 and 2 hard (KITTI's moderate and hard), -1 unknown or none of them


class Overlaps(NamedTuple):
    """Pairs of overlapping boxes of one image."""

    first: np.ndarray   # int [k]: row of the first list
    second: np.ndarray  # int [k]: row of the second list
    iou: np.ndarray     # float [k]
    share: np.ndarray   # float [k]: the intersection as a share of the first box


def overlapping(image: np.ndarray, xyxy: np.ndarray, other_image: np.ndarray, other_xyxy: np.ndarray,
                iou: float = 0.0) -> Overlaps:
    """All pairs of a box [n, 4] and another one [m, 4] of the same image whose IoU is at least `iou`, by the first,
    then the second.

    Only boxes that are close in x are compared.
    """
    lefts, widths = np.sort(other_xyxy[:, 0]), xyxy[:, 2] - xyxy[:, 0]
    widest = (other_xyxy[:, 2] - other_xyxy[:, 0]).max(initial=0)
    reach = np.minimum(widths / iou, widest) if iou else widest  # a wider box cannot have that IoU

    def place(images: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Orders by image, then by where x comes among the left edges."""
        return images * (len(lefts) + 1) + np.searchsorted(lefts, x)

    places = place(other_image, other_xyxy[:, 0])
    order = np.argsort(places, kind="stable")
    begin, end = (np.searchsorted(places[order], place(image, x)) for x in (xyxy[:, 0] - reach, xyxy[:, 2]))
    counts = np.maximum(end - begin, 0)
    areas, other_areas = (np.prod(boxes[:, 2:] - boxes[:, :2], axis=1) for boxes in (xyxy, other_xyxy))
    parts = []
    for rows in np.split(np.arange(len(image)),
                         np.searchsorted(np.cumsum(counts), np.arange(BLOCK, counts.sum(), BLOCK))):
        of_row = counts[rows]
        i = np.repeat(rows, of_row)
        j = order[np.arange(len(i)) + np.repeat(begin[rows] - (np.cumsum(of_row) - of_row), of_row)]
        sides = np.minimum(xyxy[i, 2:], other_xyxy[j, 2:]) - np.maximum(xyxy[i, :2], other_xyxy[j, :2])
        touch = (sides > 0).all(1)
        i, j, both = i[touch], j[touch], sides[touch].prod(1)
        pairs = Overlaps(i, j, both / (areas[i] + other_areas[j] - both), both / areas[i])
        kept = np.flatnonzero(pairs.iou >= iou)
        kept = kept[np.lexsort((j[kept], i[kept]))]
        parts.append(Overlaps(*(column[kept] for column in pairs)))
    return Overlaps(*map(np.concatenate, zip(*parts)))


def turns(group: np.ndarray) -> np.ndarray:
    """int [n]: how many rows before each have the same group, [n]."""
    order = np.argsort(group, kind="stable")
    turn = np.empty(len(group), int)
    turn[order] = np.arange(len(group)) - np.searchsorted(group[order], group[order])
    return turn


def rounds(turn: np.ndarray) -> list[np.ndarray]:
    """The rows of each turn, lowest turn first; within a turn in order."""
    order = np.argsort(turn, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(turn[order])) + 1)


def non_maximum_suppression(found: Detections, iou: float) -> np.ndarray:
    """bool [n]: what non-maximum suppression leaves.

    From the highest score on, a box that is left removes those of its class whose IoU with it is above `iou`.
    """
    left = np.ones(len(found.score), bool)
    for rows in rounds(_group(found)):
        low, high = found.xyxy[rows, :2], found.xyxy[rows, 2:]
        sides, areas, is_left = high - low, np.prod(high - low, axis=1), np.ones(len(rows), bool)
        order = np.argsort(low[:, 0])
        widest = sides[:, 0].max(initial=0)
        reach = np.minimum(sides[:, 0] / iou, widest) if iou else widest  # a wider box cannot have that IoU
        begin, end = (np.searchsorted(low[order, 0], x) for x in (low[:, 0] - reach, high[:, 0]))
        for i in range(len(rows)):
            if is_left[i]:
                near = order[begin[i]:end[i]]
                near = near[is_left[near] & (near > i)]
                both = np.prod(np.maximum(np.minimum(high[i], high[near]) - np.maximum(low[i], low[near]), 0), axis=1)
                is_left[near[both > iou * (areas[i] + areas[near] - both)]] = False
        left[rows] = is_left
    return left


def assigned(first: np.ndarray, second: np.ndarray, allowed: np.ndarray, turn: np.ndarray, others: int) -> np.ndarray:
    """int [n, T]: which of the `others` each of n rows gets in T trials, -1 for none.

    Rows choose in the order of `turn` [n], those of one image one after the other; each takes the first of the pairs
    (`first`, `second`) [k] that is `allowed` [k, T] and whose second is still free. A pair is always of one image.
    """
    trials = allowed.shape[1]
    choice, free = np.full((len(turn), trials), -1), np.ones((others, trials), bool)
    order = np.argsort(first, kind="stable")
    for part in rounds(turn[first[order]]) if len(first) else ():
        rows = order[part]
        begin = np.flatnonzero(np.diff(first[rows], prepend=-1))
        place = np.where(allowed[rows] & free[second[rows]], np.arange(len(rows))[:, None], len(rows))
        best = np.minimum.reduceat(place, begin)
        who, trial = np.nonzero(best < len(rows))
        taken = second[rows[best[who, trial]]]
        choice[first[rows[begin[who]]], trial] = taken
        free[taken, trial] = False
    return choice


def match_as_voc(found: Detections, truth: GroundTruth, iou: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    """Matches as the development kit of PASCAL VOC does.

    A detection matches the true box of its class with the greatest IoU, if that is at least `iou` and no detection with
    a higher score has matched it; a second one on the same box is wrong. A detection without a match does not count if
    at least `iou` of its area lies in an ignored box of its class or of DontCare.

    Parameters
    ----------
    found : Detections
    truth : GroundTruth
    iou : float, default 0.5

    Returns
    -------
    matched : numpy.ndarray
        int [n], the row of the true box that each detection matches, -1 for none.
    counts : numpy.ndarray
        bool [n], whether it counts.
    """
    pairs = overlapping(found.image, found.xyxy, truth.image, truth.xyxy, iou)
    same = np.flatnonzero(_same_class(found, truth, pairs))
    same = same[np.lexsort((-pairs.iou[same], pairs.first[same]))]
    best = same[np.flatnonzero(np.diff(pairs.first[same], prepend=-1))]
    matched_truth = np.full(len(found.score), -1)
    rows, earliest = np.unique(pairs.second[best], return_index=True)
    matched_truth[pairs.first[best[earliest]]] = rows
    return matched_truth, (matched_truth >= 0) | (_ignored_share(found, truth) < iou)


def match_as_coco(found: Detections, truth: GroundTruth) -> tuple[np.ndarray, np.ndarray]:
    """Matches at each of COCO's IoUs, as evaluateImg of pycocotools does.

    From the highest score on, each detection takes the true box of its class with the greatest IoU among those that are
    free. Ignored boxes are crowds of their class; DontCare is a crowd of all classes. Of a class only the 100 best
    detections in a sample count.

    Parameters
    ----------
    found : Detections
    truth : GroundTruth

    Returns
    -------
    right : numpy.ndarray
        bool [n, 10], whether each found box is right.
    counts : numpy.ndarray
        bool [n, 10], whether it counts.
    """
    turn = turns(_group(found))
    rows = np.flatnonzero(turn < COCO_MOST)
    pairs = overlapping(found.image[rows], found.xyxy[rows], truth.image, truth.xyxy, COCO_IOUS[0])
    pairs = pairs._replace(first=rows[pairs.first])
    same = np.flatnonzero(_same_class(found, truth, pairs))
    same = same[np.lexsort((-pairs.second[same], -pairs.iou[same]))]
    least = np.minimum(COCO_IOUS, 1 - 1e-10)
    right = assigned(pairs.first[same], pairs.second[same], pairs.iou[same, None] >= least, turn, len(truth.image)) >= 0
    return right, (right | (_ignored_share(found, truth)[:, None] < least)) & (turn < COCO_MOST)[:, None]


def _group(found: Detections) -> np.ndarray:
    return found.image * (found.label.max(initial=0) + 1) + found.label


def _same_class(found: Detections, truth: GroundTruth, pairs: Overlaps) -> np.ndarray:
    return (found.label[pairs.first] == truth.label[pairs.second]) & ~truth.ignore[pairs.second]


def _ignored_share(found: Detections, truth: GroundTruth) -> np.ndarray:
    """[n]: the largest share of each found box that lies in a single ignored box, of its class or of DontCare."""
    share = np.zeros(len(found.score))
    ignored = np.flatnonzero(truth.ignore)
    pairs = overlapping(found.image, found.xyxy, truth.image[ignored], truth.xyxy[ignored])
    label = truth.label[ignored[pairs.second]]
    rows = (label == found.label[pairs.first]) | (label == -1)
    np.maximum.at(share, pairs.first[rows], pairs.share[rows])
    return share


def curve(right: np.ndarray, truths: float) -> tuple[np.ndarray, np.ndarray]:
    """Recall and precision [n] after each found box; `right` [n] is in the order of the scores,
    `truths` counts the boxes to find."""
    hits = np.cumsum(right)
    return hits / max(truths, 1), hits / np.arange(1, len(hits) + 1)


def average_precisions(right: np.ndarray, truths: float) -> dict[str, float]:
    """The area under the precision-recall curve in three ways, each with the highest precision at that recall or above.

    ap_voc is the whole area (PASCAL VOC from 2010 on), ap_voc_11 the mean at the recalls 0, 0.1, ... 1 (PASCAL VOC
    2007), ap_coco_101 that at 0, 0.01, ... 1 (COCO).
    """
    if not truths:
        return dict.fromkeys(("ap_voc", "ap_voc_11", "ap_coco_101"), math.nan)
    recall, precision = curve(right, truths)
    envelope = np.append(np.maximum.accumulate(precision[::-1])[::-1], 0)

    def at(points: np.ndarray) -> float:
        return float(envelope[np.searchsorted(recall, points)].mean())

    return {"ap_voc": float(np.sum(np.diff(recall, prepend=0) * envelope[:-1])), "ap_voc_11": at(np.arange(11) / 10),
            "ap_coco_101": at(np.linspace(0, 1, 101))}


def detection_scores(found: Detections, truth: GroundTruth, classes: Mapping[str, int], iou: float = 0.5,
                     sure: np.ndarray | None = None) -> dict[str, dict[str, float]]:
    """Scores of each class, and of "all".

    "all" counts the boxes of all classes together and averages the average precisions of those classes that have a box
    to find. Found boxes of other classes are left out, and so are true ones unless they are ignored.

    Parameters
    ----------
    found : Detections
    truth : GroundTruth
    classes : mapping of str to int
        Names with labels.
    iou : float, default 0.5
        Of VOC's matching.
    sure : numpy.ndarray, bool [n], optional
        The predictions that precision, recall and F1 are computed from. None: all.

    Returns
    -------
    dict of dict
        truths, easy, hard : how many boxes count, how many of these have difficulty 0, and how many have 1 or 2
        found, right : how many of the predictions that are `sure` count, and how many of these are right
            (`match_as_voc`)
        precision, recall, f1 : of these predictions; recall_easy, recall_hard: the recall of those true boxes
        ap_voc, ap_voc_11, ap_coco_101 : of all predictions, sure or not: see `average_precisions`, all with VOC's
            matching at `iou`
        ap_coco : also of all: COCO's AP@[.5:.95], from 101 points and its own matching, the mean of ten IoUs
    """
    ours = np.isin(found.label, list(classes.values()))
    chosen, found = found.rows(ours if sure is None else ours & sure), found.rows(ours)
    right_one, counts = match_as_voc(chosen, truth, iou)
    met = np.zeros(len(truth.image), bool)
    met[right_one[right_one >= 0]] = True
    voc_right, voc_counts = match_as_voc(found, truth, iou)
    coco_right, coco_counts = match_as_coco(found, truth)

    def sums(labels: list[int]) -> dict[str, float]:
        mine = counts & np.isin(chosen.label, labels)
        there = ~truth.ignore & np.isin(truth.label, labels)
        easy, hard = there & (truth.difficulty == 0), there & (truth.difficulty > 0)
        right = np.count_nonzero(right_one[mine] >= 0)
        truths, all_found = np.count_nonzero(there), np.count_nonzero(mine)
        return {"truths": truths, "easy": np.count_nonzero(easy), "hard": np.count_nonzero(hard), "found": all_found,
                "right": right, "precision": ratio(right, all_found), "recall_easy": ratio(met[easy].sum(), easy.sum()),
                "recall_hard": ratio(met[hard].sum(), hard.sum()), "recall": ratio(right, truths),
                "f1": ratio(2 * right, truths + all_found)}

    scores = {}
    for name, label in classes.items():
        own = sums([label])
        mine = found.label == label
        coco = [average_precisions(coco_right[kept, i], own["truths"])["ap_coco_101"]
                for i, kept in enumerate((coco_counts & mine[:, None]).T)]
        scores[name] = {**own, **average_precisions(voc_right[mine & voc_counts] >= 0, own["truths"]),
                        "ap_coco": float(np.mean(coco))}
    means = {key: mean([each[key] for each in scores.values()])
             for key in ("ap_voc", "ap_voc_11", "ap_coco_101", "ap_coco")}
    return {**scores, "all": {**sums(list(classes.values())), **means}}


def kitti_average_precision(found: Detections, truth: GroundTruth, classes: Mapping[str, int], name: str, level: str,
                            height: np.ndarray) -> float:
    """KITTI's average precision (40 recalls) of a class at a level, counted as in its development kit
    (evaluate_object.cpp).

    The least IoU is 0.7 for cars, 0.5 for pedestrians and cyclists. Boxes beyond the level, vans and sitting persons
    are ignored. Found boxes lower than the level's least height never count, although one of any class may take a true
    box; neither do those inside DontCare.

    Parameters
    ----------
    found : Detections
    truth : GroundTruth
    classes : mapping of str to int
        Names with labels.
    name : str
        The class, of KITTI_CLASSES.
    level : str
        Of KITTI_LEVELS.
    height : numpy.ndarray, float [n]
        Of the found boxes, in source pixels.

    Returns
    -------
    float
        NaN if the level has no box.
    """
    least, neighbour = KITTI_CLASSES[name]
    rank = list(KITTI_LEVELS).index(level)
    of_class, small = truth.label == classes[name], height < KITTI_LEVELS[level]
    counted = of_class & ~truth.ignore & (truth.difficulty >= 0) & (truth.difficulty <= rank)
    takes = of_class | np.isin(truth.label, [classes[neighbour]] if neighbour in classes else [])
    candidate = small | (found.label == classes[name])
    if not counted.any():
        return math.nan
    pairs = overlapping(truth.image, truth.xyxy, found.image, found.xyxy, least)
    pairs = Overlaps(*(column[takes[pairs.first] & candidate[pairs.second] & (pairs.iou > least)] for column in pairs))
    turn = turns(truth.image)

    # Each true box takes the highest score: these scores, at 41 recalls, are the thresholds.
    every = np.ones((len(pairs.first), 1), bool)
    choice = assigned(pairs.first, pairs.second, every, turn, len(found.score))[counted, 0]
    choice = choice[choice >= 0]
    thresholds = _kitti_thresholds(found.score[choice[~small[choice]]], np.count_nonzero(counted))

    # At each threshold each true box takes the one that fits best; small ones come last.
    order = np.lexsort((np.where(small[pairs.second], 0, -pairs.iou), small[pairs.second]))
    first, second = pairs.first[order], pairs.second[order]
    choice = assigned(first, second, found.score[second, None] >= thresholds, turn, len(found.score))
    row, trial = np.nonzero(choice >= 0)
    right = np.bincount(trial[counted[row] & ~small[choice[row, trial]]], minlength=len(thresholds))
    free = ~small[:, None] & candidate[:, None] & (found.score[:, None] >= thresholds)
    free[choice[row, trial], trial] = False
    stuff = np.flatnonzero(truth.ignore & (truth.label == -1))
    within = overlapping(found.image, found.xyxy, truth.image[stuff], truth.xyxy[stuff])
    free[within.first[within.share > least]] = False
    precision = np.zeros(KITTI_POINTS)
    precision[:len(thresholds)] = right / np.maximum(right + free.sum(0), 1)
    return float(np.maximum.accumulate(precision[::-1])[::-1][1:].mean())


def _kitti_thresholds(scores: np.ndarray, truths: int) -> np.ndarray:
    """The scores at which the recall is nearest to 0, 1/40, ... 1."""
    thresholds, recall = [], 0.0
    scores = np.sort(scores)[::-1]
    for i, score in enumerate(scores):
        here, next_one = (i + 1) / truths, (i + 2) / truths
        if i < len(scores) - 1 and next_one - recall < recall - here:
            continue
        thresholds.append(score)
        recall += 1 / (KITTI_POINTS - 1)
    return np.array(thresholds[:KITTI_POINTS])


def read_boxes(shards: Shards, numbers: Mapping[str, int]) -> GroundTruth:
    """The boxes of all samples: `image` is the sample's index, `label` the number of its class in `numbers`."""
    numbers = {**numbers, DONT_CARE: -1}
    nothing = np.empty(0, int)
    parts = [(nothing, nothing, np.empty((0, 4)), nothing.astype(bool), nothing)]
    for i in range(len(shards)):
        boxes = shards.sample(i, {"boxes"})["boxes"]
        labels = np.array([numbers[name] for name in shards.class_names(i)], int)[boxes["class_id"]]
        unknown = np.full(len(labels), -1)
        parts.append((np.full(len(labels), i), labels, boxes["xyxy"], boxes["ignore"] != 0,
                      boxes.get("difficulty", unknown)))
    return GroundTruth(*map(np.concatenate, zip(*parts)))


def ratio(part: float, whole: float) -> float:
    """part / whole; NaN if the whole is 0."""
    return float(part / whole) if whole else math.nan


def mean(values: Sequence[float]) -> float:
    """The mean of those values that are not NaN; NaN if there are none."""
    known = np.asarray(values, float)
    known = known[~np.isnan(known)]
    return float(known.mean()) if len(known) else math.nan

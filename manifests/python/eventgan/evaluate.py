"""Scores a network's predictions on shards: boxes as PASCAL VOC, COCO and KITTI do, joints as the EventGAN paper and
MPII do, optical flow as MVSEC, KITTI and DSEC do.

    python3 -m eventgan.evaluate detections found.json --truth out --split val
    python3 -m eventgan.evaluate poses found.json --truth out --split val --dataset mpii --images images
    python3 -m eventgan.evaluate flows found.npz --truth out --split val

The predictions are a JSON list of

    detections   {"image_id": "000001", "category_id": "Car", "bbox": [left, top, width, height], "score": 0.9}
    poses        {"image_id": "000001", "person": 0, "joints": [[x, y], ...]}

the first as in COCO's results. image_id is a sample's id, or its place in the split from 1 on; category_id is a class's
name, or its place among the sources' classes without DontCare from 1 on: the numbers of `eventgan export --to coco`.
Boxes and joints are in volume pixels, boxes by edges, joints by pixel centres (shard_format.md, Geometry). `person` is
the row in the sample and may be left out where there is only one; joints come in the order of Shards.default_joints().
Flows are an .npz of numpy.savez with an array [2, H, W] (x, then y, volume pixels) for each sample's id.

detection_scores.py, pose_scores.py and flow_scores.py define the numbers. One that is not defined is null in JSON and
"-" in a table.
"""

from __future__ import annotations

import argparse
import collections
import functools
import json
import math
import pathlib
import sys
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from .detection_scores import (DONT_CARE, KITTI_CLASSES, KITTI_LEVELS, Detections, GroundTruth, curve, detection_scores,
                               kitti_average_precision, match_as_voc, non_maximum_suppression, read_boxes)
from .flow_scores import flow_scores
from .pose_scores import Persons, pose_scores, read_persons
from .open_shards import PathLike, open_shard
from .shards import Shards
from .words import counted, did_you_mean, listed

IMAGES = 12  # samples to draw
PAPER_COLUMNS = {"precision": "precision", "recall_easy": "easy recall", "recall_hard": "hard recall",
                 "recall": "combined recall", "ap_voc": "AP", "f1": "F1"}  # of the EventGAN paper's Table 1


def read_predictions(path: PathLike, keys: Sequence[str]) -> list[dict[str, Any]]:
    """A JSON file's list of predictions, each an object with these keys; anything else is a ValueError."""
    try:
        entries = json.loads(pathlib.Path(path).read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"expected JSON, got {error}, in {path}") from error
    if not isinstance(entries, list):
        raise ValueError(f"expected a list, got {type(entries).__name__}, in {path}")
    for number, entry in enumerate(entries):
        if not isinstance(entry, dict) or not entry.keys() >= set(keys):
            raise ValueError(f"expected {', '.join(keys)}, got {_brief(entry)}, in {path} (entry {number})")
    return entries


def _brief(value: Any) -> str:
    """The beginning of the value in JSON."""
    try:
        return json.dumps(value)[:80]
    except RecursionError:
        return f"a {type(value).__name__} of too many levels"


def _name(entry: Mapping[str, Any]) -> str:
    return _brief(entry["image_id"]).strip('"')


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _are_numbers(value: Any, shape: tuple[int, ...]) -> bool:
    if shape:
        return (isinstance(value, list) and len(value) == shape[0]
                and all(_are_numbers(each, shape[1:]) for each in value))
    return _is_whole(value) or isinstance(value, float)


def numbers_of(entries: Sequence[Mapping[str, Any]], key: str, shape: tuple[int, ...], path: PathLike) -> np.ndarray:
    """float [n, *shape]: the finite numbers that each entry has under a key;
    anything else is a ValueError that names `path`."""
    values = np.empty((len(entries), *shape))
    for number, entry in enumerate(entries):
        try:
            values[number] = entry[key] if _are_numbers(entry[key], shape) else np.nan
        except OverflowError:
            values[number] = np.inf
        if not np.isfinite(values[number]).all():
            wanted = " x ".join(map(str, shape)) + " finite numbers" if shape else "a finite number"
            raise ValueError(f"expected {wanted} as {key}, got {_brief(entry[key])}, in {path} (entry {number}, sample "
                             f"{_name(entry)})")
    return values


def _places(shards: Shards) -> list[tuple[str, int]]:
    """The shard and slot of each sample, which are unique."""
    return [(sample["shard"], sample["slot"]) for sample in (shards.sample(i, ()) for i in range(len(shards)))]


def _is_coco_s(original: bytes) -> bool:
    """Whether a sample's annotation is an entry of COCO's labels, whose images and annotations have numbers."""
    try:
        entry = json.loads(original)
        return "annotations" in entry and "id" in entry["image"]
    except (ValueError, TypeError, KeyError):
        return False


class Samples:
    """The samples that are scored, and what predictions call them.

    `truth` is a folder of shards, or one shard; `split`, `dataset` (the kind of source) and `ids` (see `Shards`) select
    samples.
    """

    def __init__(self, truth: PathLike, split: str | None, dataset: str | None,
                 ids: PathLike | Iterable[str] | None) -> None:
        where = {"dataset": dataset} if dataset else None
        self.shards = Shards(truth, split=split, where=where, ids=ids)
        self._of_split, self.classes = Shards(truth, split=split), Shards(truth).known_classes()
        scored = {place: i for i, place in enumerate(_places(self.shards))}
        exported = (any((self._of_split.class_names(i), self._of_split.joint_names(i)))
                    for i in range(len(self._of_split)))
        self._of_number = [scored.get(place, -1) for place, is_exported in zip(_places(self._of_split), exported)
                           if is_exported]
        names = self.shards.column("sample_id").tolist()
        self._of_name = {**dict.fromkeys(self._of_split.column("sample_id").tolist(), -1),
                         **{name: i for i, name in enumerate(names)}}
        self._twice = {name for name, count in collections.Counter(names).items() if count > 1}

    def of(self, entries: Sequence[Mapping[str, Any]], path: PathLike) -> np.ndarray:
        """int [n]: the index in `shards` of each entry's `image_id`, -1 for a sample of the split that is not scored.

        A number is a place in the split, whichever of its samples are scored. An id that does not exist, or that two
        scored samples have, is a ValueError that names `path`.
        """
        found = np.empty(len(entries), int)
        for number, entry in enumerate(entries):
            name = entry["image_id"]
            if _is_whole(name) and 1 <= name <= len(self._of_number):
                if len(self._splits) > 1:
                    raise ValueError("expected --split with samples that are numbered, got shards of "
                                     f"{', '.join(self._splits)}")
                self._refuse_coco_s_own("image_id", name, path, number)
                found[number] = self._of_number[name - 1]
                continue
            is_known = isinstance(name, str) and name in self._of_name
            if not is_known or name in self._twice:
                raise ValueError(f"expected the image_id of {'one' if is_known else 'a'} sample of "
                                 f"{len(self._of_number)}, got {_brief(name)}"
                                 f"{', which two samples have' if is_known else ''}, in {path} (entry {number})")
            found[number] = self._of_name[name]
        return found

    def _refuse_coco_s_own(self, key: str, value: Any, path: PathLike, number: int) -> None:
        if self._has_coco_labels:
            raise ValueError("expected names, since `export --to coco` keeps the numbers of labels that are COCO's "
                             f"own, got {value} as {key}, in {path} (entry {number})")

    @functools.cached_property
    def _has_coco_labels(self) -> bool:
        # all samples of a shard are from one source
        first = {shard: i for i, (shard, _) in reversed(list(enumerate(_places(self._of_split))))}
        return any(_is_coco_s(self._of_split.sample(i, {"original"})["original"]) for i in first.values())

    @functools.cached_property
    def _splits(self) -> list[str]:
        return sorted({open_shard(path).attrs["split"] for path in self._of_split.paths})

    def labels(self, entries: Sequence[Mapping[str, Any]], path: PathLike) -> np.ndarray:
        """int [n]: the place in `classes` of each entry's `category_id`;
        one that does not exist is a ValueError that names `path`."""
        numbered = [name for name in self.classes if name != DONT_CARE]
        labels: dict[Any, int] = {i + 1: self.classes.index(name) for i, name in enumerate(numbered)}
        labels |= {name: self.classes.index(name) for name in numbered}
        given = [entry["category_id"] for entry in entries]
        unknown = [i for i, name in enumerate(given) if not (_is_whole(name) or isinstance(name, str))
                   or name not in labels]
        if unknown:
            raise ValueError(f"expected a category_id of {', '.join(numbered)}, or its number from 1 on, got "
                             f"{_brief(given[unknown[0]])}, in {path} (entry {unknown[0]})")
        whole = [i for i, name in enumerate(given) if not isinstance(name, str)]
        if whole:
            self._refuse_coco_s_own("category_id", given[whole[0]], path, whole[0])
        return np.array([labels[name] for name in given], int)


def evaluate_detections(predictions: PathLike, samples: Samples, classes: Sequence[str] | None = None,
                        confidence: float = 0.2, nms: float = 0.2,
                        iou: float = 0.5) -> tuple[dict[str, Any], Detections, GroundTruth]:
    """What `detections` prints, with the boxes it was computed from. Samples of sources without boxes are left out.

    Parameters
    ----------
    predictions : str or path
        A JSON file (see above).
    samples : Samples
    classes : sequence of str, optional
        Those to score. None: all that have a box to find or a prediction.
    confidence, nms : float, default 0.2
        As in the paper, precision, recall and F1 are of predictions with at least this score that non-maximum
        suppression at this IoU leaves (1: no suppression); the average precisions are of all predictions.
    iou : float, default 0.5
        The least at which a detection matches a box.

    Returns
    -------
    result : dict
    found : Detections
    truth : GroundTruth

    Raises
    ------
    ValueError
        No sample has boxes, or an entry of the predictions or one of the numbers above is not valid.
    """
    if not (0 <= confidence <= 1 and 0 <= nms <= 1 and 0 < iou <= 1):
        raise ValueError("expected confidence and nms from 0 to 1, and iou above 0 and up to 1, got confidence "
                         f"{confidence:g}, nms {nms:g} and iou {iou:g}")
    shards, numbers = samples.shards, {name: i for i, name in enumerate(samples.classes)}
    unknown = [name for name in listed(classes or (), "classes") if name not in numbers]
    if unknown:
        raise ValueError(f"expected classes of {', '.join(numbers)}, got {', '.join(unknown)}"
                         f"{did_you_mean(unknown, numbers)}")
    entries = read_predictions(predictions, ("image_id", "category_id", "bbox", "score"))
    boxes, scores = numbers_of(entries, "bbox", (4,), predictions), numbers_of(entries, "score", (), predictions)
    wrong = np.flatnonzero((boxes[:, 2:] < 0).any(1))
    if len(wrong):
        raise ValueError(f"expected a bbox of left, top, width, height, got {boxes[wrong[0]].tolist()}, in "
                         f"{predictions} (entry {wrong[0]})")
    labelled = np.array([bool(shards.class_names(i)) for i in range(len(shards))], bool)
    if not labelled.any():
        raise ValueError("expected samples of sources with boxes, got none")
    image = samples.of(entries, predictions)
    boxes[:, 2:] += boxes[:, :2]
    found = Detections.of(image, samples.labels(entries, predictions), boxes, scores)
    found = found.rows((found.image >= 0) & np.append(labelled, False)[found.image])
    truth, sure = read_boxes(shards, numbers), _sure(found, confidence, nms)
    if classes is None:
        there = np.concatenate([found.label, truth.label[~truth.ignore]])
        classes = [name for name, label in numbers.items() if name != DONT_CARE and (there == label).any()]
    ours = np.isin(found.label, [numbers[name] for name in classes])
    counts = {"samples": int(labelled.sum()),
              "samples_without_prediction": int(labelled.sum() - len(np.unique(found.image))),
              "ignored": int(truth.ignore.sum()), "predictions": len(entries),
              "not_of_these_samples": len(entries) - len(found.score), "not_of_these_classes": int((~ours).sum()),
              "after_suppression": int((sure & ours).sum())}
    result = {"settings": {"confidence": confidence, "nms": nms, "iou": iou}, "counts": counts,
              "classes": detection_scores(found, truth, {name: numbers[name] for name in classes}, iou, sure)}
    kitti = _of_kitti(shards, found, truth, numbers, classes)
    return ({**result, "kitti": kitti} if kitti else result), found, truth


def _sure(found: Detections, confidence: float, nms: float) -> np.ndarray:
    """bool [n]: the detections with at least this confidence that non-maximum suppression leaves."""
    sure = found.score >= confidence
    sure[sure] = non_maximum_suppression(found.rows(sure), nms)
    return sure


def _of_kitti(shards: Shards, found: Detections, truth: GroundTruth, numbers: Mapping[str, int],
              classes: Sequence[str]) -> dict[str, dict[str, float]]:
    """KITTI's average precisions by class and level, of the samples of kitti_object."""
    ours = shards.column("dataset") == "kitti_object"
    found, truth = found.rows(ours[found.image]), GroundTruth(*(column[ours[truth.image]] for column in truth))
    height = (found.xyxy[:, 3] - found.xyxy[:, 1]) / shards.column("source_to_volume")[found.image, 1, 1]
    return {name: {level: kitti_average_precision(found, truth, numbers, name, level, height) for level in KITTI_LEVELS}
            for name in classes if name in KITTI_CLASSES
            and (truth.difficulty[truth.label == numbers[name]] >= 0).any()}


def evaluate_poses(predictions: PathLike, samples: Samples,
                   hidden: bool = False) -> tuple[dict[str, Any], np.ndarray, Persons]:
    """What `poses` prints, with the joints it was computed from.

    Parameters
    ----------
    predictions : str or path
        A JSON file (see above).
    samples : Samples
    hidden : bool, default False
        Whether hidden joints count.

    Returns
    -------
    result : dict
    found : numpy.ndarray
        float [P, J, 2] in volume pixels; NaN: not found.
    persons : Persons
        The labelled ones.

    Raises
    ------
    ValueError
        No sample has joints, or an entry of the predictions is not valid.
    """
    shards = samples.shards
    persons = read_persons(shards)
    if not persons.names:
        raise ValueError("expected samples of sources with joints, got none")
    entries = read_predictions(predictions, ("image_id", "joints"))
    image, joints = samples.of(entries, predictions), numbers_of(entries, "joints", (len(persons.names), 2),
                                                                 predictions)
    rows = {(index, row): i for i, (index, row) in enumerate(persons.place.tolist())}
    alone = np.bincount(persons.place[:, 0], minlength=len(shards)) == 1
    found = np.full(persons.joints.shape, np.nan)
    for number, (entry, index) in enumerate(zip(entries, image.tolist())):
        if index < 0:
            continue
        person = entry.get("person", 0 if alone[index] else None)
        at = rows.get((index, person)) if _is_whole(person) else None
        if at is None or np.isfinite(found[at]).all():
            what = f"got {_brief(person)}" if at is None else f"got {person} twice"
            raise ValueError(f"expected a person of the {np.count_nonzero(persons.place[:, 0] == index)} there are, "
                             f"{what}, in {predictions} (entry {number}, sample {_name(entry)})")
        found[at] = joints[number]
    not_found = np.isnan(found).all((1, 2)) & persons.scored(hidden).any(1)
    counts = {"persons": len(persons.place), "not_found": int(not_found.sum()), "predictions": len(entries),
              "not_of_these_samples": int((image < 0).sum()), "hidden": int(persons.hidden.sum()),
              "not_annotated": int((~persons.annotated).sum()), "without_head": int(np.isnan(persons.head).sum()),
              "without_head_box": int(np.isnan(persons.head_box).sum())}
    return {"settings": {"hidden": hidden}, "counts": counts,
            "joints": pose_scores(found, persons, hidden)}, found, persons


def evaluate_flows(predictions: PathLike, samples: Samples) -> tuple[dict[str, Any], Mapping[str, np.ndarray]]:
    """What `flows` prints, with the flows it was computed from.

    Parameters
    ----------
    predictions : str or path
        An .npz file (see above).
    samples : Samples
        Those without flow are left out.

    Returns
    -------
    result : dict
        `flow`: scores of "dense", the pixels where flow is valid, and of "at events", those of them with an event.
    found : mapping
        float [2, H, W] by sample id; an array is read when it is asked for.

    Raises
    ------
    ValueError
        No sample has flow, two of those that have it share an id, or a sample has no prediction, or one that is not
        [2, H, W] and finite where it is scored.
    """
    shards = samples.shards
    try:
        found = np.load(predictions)
        names = set(found.files)
    except (AttributeError, ValueError, zipfile.BadZipFile) as error:
        raise ValueError(f"expected an .npz of arrays, got another file, in {predictions}") from error
    labelled: dict[str, int] = {}
    for i, name in enumerate(shards.column("sample_id").tolist()):
        sample = shards.sample(i, {"flow"})
        if "flow" not in sample or not sample["flow_valid"].any():
            continue
        if name in labelled:
            raise ValueError(f"expected samples with ids of their own, got {_brief(name)}, which two samples have")
        labelled[name] = i
    if not labelled:
        raise ValueError('expected samples with flow ("flow": true in their source), got none')
    missing = sorted(labelled.keys() - names)
    if missing:
        raise ValueError(f"expected a flow of each of {len(labelled)} samples, got none of {len(missing)}, in "
                         f"{predictions} (sample {missing[0]})")

    def flows(at_events: bool) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        for name, i in labelled.items():
            sample = shards.sample(i, {"volume", "flow"})
            scored, flow = sample["flow_valid"] != 0, found[name]
            if flow.shape != sample["flow"].shape:
                raise ValueError(f"expected flow of shape {sample['flow'].shape}, got {flow.shape}, in {predictions} "
                                 f"(sample {name})")
            if not np.isfinite(flow[:, scored]).all():
                raise ValueError(f"expected finite flow, got {np.count_nonzero(~np.isfinite(flow[:, scored]))} NaN or "
                                 f"infinite numbers, in {predictions} (sample {name})")
            yield flow, sample["flow"], scored & (sample["volume"] != 0).any(0) if at_events else scored

    counts = {"samples": len(labelled), "not_of_these_samples": len(names - labelled.keys())}
    scores = {"dense": flow_scores(flows(False)), "at events": flow_scores(flows(True))}
    return {"counts": counts, "flow": scores}, found


def table(title: str, rows: Mapping[str, Mapping[str, float | str]], columns: Mapping[str, str],
          digits: int = 3) -> str:
    """A line of headings (`title`, then those of `columns`), then one for each row; NaN is "-"."""
    cells = [[title, *columns.values()]]
    for name, row in rows.items():
        cells.append([name, *(_text(row[key], digits) for key in columns)])
    widths = [max(map(len, column)) for column in zip(*cells)]
    return "\n".join("  ".join([line[0].ljust(widths[0]),
                                *(text.rjust(width) for text, width in zip(line[1:], widths[1:]))]) for line in cells)


def _text(value: float | str, digits: int) -> str:
    return str(value) if isinstance(value, (int, str)) else "-" if math.isnan(value) else f"{value:.{digits}f}"


def detection_tables(result: Mapping[str, Any]) -> str:
    """The result of `evaluate_detections` as text."""
    counts, settings, classes = result["counts"], result["settings"], result["classes"]
    others = {what: counts[f"not_of_these_{what}"] for what in ("samples", "classes")}
    first = (f"{counts['samples']} samples ({counts['samples_without_prediction']} without a prediction), "
             f"{classes['all']['truths']} ground-truth boxes, {counts['ignored']} ignored; average precisions use all "
             f"{counts['predictions'] - sum(others.values())} predictions; precision, recall and F1 use "
             f"{counts['after_suppression']}, after confidence {settings['confidence']:g} and non-maximum suppression "
             f"at IoU {settings['nms']:g}")
    if any(others.values()):
        first += f"; left out: {', '.join(f'{n} of other {what}' for what, n in others.items() if n)}"
    tables = [first, table("", classes, {"truths": "boxes", "easy": "easy", "hard": "hard", **PAPER_COLUMNS}),
              table("average precision", classes,
                    {"ap_voc": "VOC, area", "ap_voc_11": "VOC, 11 points", "ap_coco_101": "COCO, 101 points",
                     "ap_coco": "COCO, AP@[.5:.95]"})]
    if "kitti" in result:
        tables.append(table("KITTI, 40 recalls", result["kitti"], {level: level for level in KITTI_LEVELS}))
    return "\n\n".join(tables)


def pose_tables(result: Mapping[str, Any]) -> str:
    """The result of `evaluate_poses` as text."""
    counts = result["counts"]
    hidden = (f"{counts['hidden']} hidden ones also scored" if result["settings"]["hidden"]
              else f"{counts['hidden']} hidden")
    first = (f"{counted(counts['persons'], 'person')}, {counts['not_found']} of them not found; joints left out: "
             f"{counts['not_annotated']} not annotated, {hidden}; PCKh leaves out "
             f"{counted(counts['without_head'], 'person')} without annotated head or shoulders, MPII's "
             f"{counts['without_head_box']} without a head box")
    return first + "\n\n" + table("", result["joints"],
                                  {"scored": "scored", "left_out": "left out", "mpjpe_volume": "MPJPE, volume px",
                                   "mpjpe_source": "MPJPE, source px", "pckh": "PCKh@0.5",
                                   "pckh_mpii": "PCKh@0.5, MPII's"})


def flow_tables(result: Mapping[str, Any]) -> str:
    """The result of `evaluate_flows` as text."""
    counts = result["counts"]
    first = f"{counts['samples']} samples"
    if counts["not_of_these_samples"]:
        first += f"; {counts['not_of_these_samples']} predictions are of other samples"
    return first + "\n\n" + table("", result["flow"], {"pixels": "pixels", "aee": "AEE, px", "npe_1": "above 1 px",
                                                       "npe_3": "above 3 px", "angular": "angle, degrees"})


def draw_detections(folder: str, samples: Samples, result: Mapping[str, Any], found: Detections,
                    truth: GroundTruth) -> None:
    """Writes images of the result of `evaluate_detections`: precision over recall of all detections, and some of the
    samples, evenly spread, with the sure detections in blue, true boxes in green, ignored ones in red. Needs OpenCV.
    """
    from . import drawing  # OpenCV, which nothing else here needs

    names = {samples.classes.index(name): name for name in result["classes"] if name != "all"}
    found = found.rows(np.isin(found.label, list(names)))
    settings = result["settings"]
    matched_truth, counts = match_as_voc(found, truth, settings["iou"])
    curves = {name: curve(matched_truth[counts & (found.label == label)] >= 0, result["classes"][name]["truths"])
              for label, name in names.items()}
    drawing.write(folder, "precision_recall", drawing.of_precision(curves))
    found = found.rows(_sure(found, settings["confidence"], settings["nms"]))
    true = ~truth.ignore & np.isin(truth.label, list(names))
    for i in _some(np.union1d(found.image, truth.image)):
        there, ours = truth.image == i, np.flatnonzero(found.image == i)
        canvas = drawing.of_events(samples.shards.sample(i, {"volume"})["volume"])
        drawing.draw_boxes(canvas, truth.xyxy[there & truth.ignore], drawing.IGNORED)
        drawing.draw_boxes(canvas, truth.xyxy[there & true], drawing.TRUE)
        drawing.draw_boxes(canvas, found.xyxy[ours], drawing.FOUND,
                           [f"{names[found.label[n]]} {found.score[n]:.2f}" for n in ours])
        drawing.write(folder, samples.shards.column("sample_id")[i], canvas)


def draw_poses(folder: str, samples: Samples, result: Mapping[str, Any], found: np.ndarray, persons: Persons) -> None:
    """Writes images of some of the samples, evenly spread, from the result of `evaluate_poses`: joints found in blue,
    true ones in green, annotated but not scored ones in red. Needs OpenCV.
    """
    from . import drawing

    scored = persons.scored(result["settings"]["hidden"])
    for i in _some(np.unique(persons.place[:, 0])):
        canvas = drawing.of_events(samples.shards.sample(i, {"volume"})["volume"])
        for row in np.flatnonzero(persons.place[:, 0] == i):
            true = persons.joints[row]
            drawing.draw_joints(canvas, true[persons.annotated[row] & ~scored[row]], drawing.IGNORED)
            drawing.draw_joints(canvas, true[scored[row]], drawing.TRUE)
            drawing.draw_joints(canvas, found[row][scored[row]], drawing.FOUND, true[scored[row]])
        drawing.write(folder, samples.shards.column("sample_id")[i], canvas)


def draw_flows(folder: str, samples: Samples, found: Mapping[str, np.ndarray]) -> None:
    """Writes images of some of the samples, evenly spread: found flow as blue arrows, the true one where it is valid
    in green. Needs OpenCV.
    """
    from . import drawing

    for i in _some(np.arange(len(samples.shards))):
        name, sample = samples.shards.column("sample_id")[i], samples.shards.sample(i, {"volume", "flow"})
        if "flow" in sample and sample["flow_valid"].any():
            canvas = drawing.of_events(sample["volume"])
            drawing.draw_flow(canvas, np.where(sample["flow_valid"], sample["flow"], np.nan), drawing.TRUE)
            drawing.draw_flow(canvas, found[name], drawing.FOUND)
            drawing.write(folder, name, canvas)


def _some(values: np.ndarray) -> list[int]:
    return values[np.unique(np.linspace(0, len(values) - 1, min(IMAGES, len(values))).round().astype(int))].tolist()


def _without_nan(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_nan(each) for key, each in value.items()}
    return None if isinstance(value, float) and math.isnan(value) else value


def main(arguments: Sequence[str] | None = None) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python3 -m eventgan.evaluate",
                                     description="Scores the predictions of a network against the labels of shards.")
    parser.add_argument("what", choices=["detections", "poses", "flows"])
    parser.add_argument("predictions", help="JSON list of objects with image_id, category_id, bbox, score; or with "
                        "image_id, person, joints; .npz of flows by sample id")
    parser.add_argument("--truth", required=True, metavar="OUT", help="folder of shards, or one shard")
    parser.add_argument("--split", help="score only samples of this split")
    parser.add_argument("--dataset", help="score only samples of this kind of source, such as kitti_object")
    parser.add_argument("--ids", metavar="FILE", help="score only the samples listed in this file, one id per line")
    parser.add_argument("--classes", type=lambda text: text.split(","),
                        help="detections: class names, separated by commas (default: all that have a box or a "
                        "prediction)")
    parser.add_argument("--confidence", type=float, default=0.2, help="detections: lowest score that counts for "
                        "precision, recall and F1; average precisions use all predictions (default: %(default)s)")
    parser.add_argument("--nms", type=float, default=0.2, help="detections: IoU of the non-maximum suppression for "
                        "precision, recall and F1; 1 switches it off (default: %(default)s)")
    parser.add_argument("--iou", type=float, default=0.5,
                        help="detections: lowest IoU at which a detection matches a box (default: %(default)s)")
    parser.add_argument("--hidden", action="store_true",
                        help="poses: also score hidden joints that are annotated, as MPII's own evaluation does")
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")
    parser.add_argument("--images", metavar="DIR", help="folder for plots of precision and recall and for images of "
                        "some samples with their predictions; needs OpenCV")
    args = parser.parse_args(arguments)
    try:
        samples = Samples(args.truth, args.split, args.dataset, args.ids)
        if args.what == "detections":
            result, *boxes = evaluate_detections(args.predictions, samples, args.classes, args.confidence, args.nms,
                                                 args.iou)
            text, draw = detection_tables(result), functools.partial(draw_detections, args.images, samples, result,
                                                                     *boxes)
        elif args.what == "flows":
            result, flows = evaluate_flows(args.predictions, samples)
            text, draw = flow_tables(result), functools.partial(draw_flows, args.images, samples, flows)
        else:
            result, *joints = evaluate_poses(args.predictions, samples, args.hidden)
            text, draw = pose_tables(result), functools.partial(draw_poses, args.images, samples, result, *joints)
        if args.images:
            draw()
    except (ImportError, OSError, ValueError) as error:
        sys.exit(f"error: {error}")
    print(json.dumps(_without_nan(result), indent=1) if args.json else text)


if __name__ == "__main__":
    main()

"""Scores of detected joints, on arrays: the mean distance, and PCKh as in the EventGAN paper and of MPII.
Undefined is NaN."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .detection_scores import mean, ratio
from .shards import Shards


class Persons(NamedTuple):
    """Labelled persons: P rows of J joints."""

    names: list[str]           # of the joints
    place: np.ndarray          # int [P, 2]: the sample's index, the row in it
    joints: np.ndarray         # float [P, J, 2]: x, y in volume pixels
    joints_source: np.ndarray  # float [P, J, 2]: x, y in source pixels
    annotated: np.ndarray      # bool [P, J]
    hidden: np.ndarray         # bool [P, J]: annotated but not visible
    head: np.ndarray           # float [P]: as of `head_lengths`, in source pixels
    head_box: np.ndarray       # float [P]: diagonal of the head's box in source pixels; NaN: none
    to_volume: np.ndarray      # float [P, 2, 3]: source_to_volume of their samples

    def rows(self, chosen: np.ndarray) -> Persons:
        """The `chosen` ones: bool [P], or rows."""
        return Persons(self.names, *(column[chosen] for column in self[1:]))

    def to_source(self, joints: np.ndarray) -> np.ndarray:
        """Joints [P, J, 2] in volume pixels as source pixels."""
        return (joints - self.to_volume[:, None, :, 2]) / self.to_volume[:, [0, 1], [0, 1]][:, None]

    def scored(self, hidden: bool) -> np.ndarray:
        """bool [P, J]: the joints that count; hidden ones only if `hidden`."""
        return self.annotated if hidden else self.annotated & ~self.hidden


def read_persons(shards: Shards) -> Persons:
    """All persons of the samples, with the joints of shards.default_joints(), which every source must have."""
    names, persons = shards.default_joints(), shards.persons
    columns: dict[str, list[np.ndarray]] = {key: [np.empty((0, len(names), 2))] for key in ("joints", "joints_source")}
    columns |= {"visible": [np.empty((0, len(names)), int)], "head_box_source": [np.empty((0, 4))]}
    for i in np.unique(persons[:, 0]).tolist():
        sample, places = shards.sample(i, {"persons"})["persons"], shards.joint_places(i, names)
        for key, parts in columns.items():
            parts.append(sample[key] if key == "head_box_source" else sample[key][:, places])
    joints, source, visible, box = map(np.concatenate, columns.values())
    annotated = ~(source == -1).all(-1)
    corners = np.where((box == -1).all(-1)[:, None], np.nan, box).reshape(-1, 2, 2)
    return Persons(names, persons, joints, source, annotated, annotated & (visible == 0),
                   head_lengths(names, source, annotated), np.linalg.norm(corners[:, 1] - corners[:, 0], axis=-1),
                   shards.column("source_to_volume")[persons[:, 0]])


def head_lengths(names: Sequence[str], joints: np.ndarray, annotated: np.ndarray) -> np.ndarray:
    """[P]: from the head (of MPII its top) to the middle of the shoulders, in the unit of the joints;
    NaN if one is not annotated."""
    lower = [name.lower() for name in names]
    head = [lower.index(name) for name in ("head_top", "head") if name in lower][:1]
    shoulders = [i for i, name in enumerate(lower) if "shoulder" in name]
    if not head or len(shoulders) != 2:
        return np.full(len(joints), np.nan)
    length = np.linalg.norm(joints[:, head[0]] - joints[:, shoulders].mean(1), axis=-1)
    return np.where(annotated[:, head + shoulders].all(-1), length, np.nan)


def near_head(error: np.ndarray, scored: np.ndarray, head: np.ndarray,
              at: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    """PCKh's counts for each joint, of persons whose head is known: how many are near, and how many there are, int [J]
    each.

    Near is an `error` [P, J] (NaN: not found) of at most `at` x 0.6 x `head` [P] (NaN: not known), where `scored` [P,
    J].
    """
    scored = scored & np.isfinite(head)[:, None]
    return (scored & (error <= at * 0.6 * head[:, None])).sum(0), scored.sum(0)


def pose_scores(joints: np.ndarray, persons: Persons, hidden: bool = False) -> dict[str, dict[str, float]]:
    """Scores of found joints, of each joint and of "all".

    Both kinds of PCKh are measured in source pixels, which do not depend on how the image was stretched; a joint that
    was not found is missed. "all" is of all joints that count, in pckh_mpii without pelvis and thorax, as MPII does.

    Parameters
    ----------
    joints : numpy.ndarray, [P, J, 2]
        Found, in volume pixels; NaN for a person that was not found.
    persons : Persons
    hidden : bool, default False
        Whether hidden joints count, as in MPII's own evaluation.

    Returns
    -------
    dict of dict
        scored, left_out : joints that count, and those that do not: not annotated, or hidden
        mpjpe_volume, mpjpe_source : mean distance in pixels of the joints that count and were found
        pckh : PCKh@0.5 as in the EventGAN paper: the share of the joints that count that lie within half of 0.6 x the
            distance from the head to the middle of the shoulders, of persons in whom these are annotated
        pckh_mpii : MPII's own: within half of 0.6 x the diagonal of the head's box, of persons who have one
    """
    scored = persons.scored(hidden)
    error = np.linalg.norm(joints - persons.joints, axis=-1)
    error_source = np.linalg.norm(persons.to_source(joints) - persons.joints_source, axis=-1)
    near, of_near = near_head(error_source, scored, persons.head)
    mpii, of_mpii = near_head(error_source, scored, persons.head_box)

    def row(chosen: list[int], of_mean: list[int]) -> dict[str, float]:
        kept, found = scored[:, chosen], scored[:, chosen] & np.isfinite(error[:, chosen])
        return {"scored": np.count_nonzero(kept), "left_out": np.count_nonzero(~kept),
                **{key: mean(each[:, chosen][found])
                   for key, each in (("mpjpe_volume", error), ("mpjpe_source", error_source))},
                "pckh": ratio(near[chosen].sum(), of_near[chosen].sum()),
                "pckh_mpii": ratio(mpii[of_mean].sum(), of_mpii[of_mean].sum())}

    every = range(len(persons.names))
    limbs = [i for i in every if persons.names[i] not in ("pelvis", "thorax")]
    return {**{persons.names[i]: row([i], [i]) for i in every}, "all": row(list(every), limbs)}

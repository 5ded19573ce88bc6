"""Scores of joints that were found, on arrays: the mean distance, and PCKh as the EventGAN paper and as MPII have it. What is not defined is NaN."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .detection_scores import mean, ratio
from .shards import Shards


class Persons(NamedTuple):
    """Persons that are there: P rows of J joints.

    Attributes
    ----------
    names : list of str
        Of the joints.
    place : numpy.ndarray, int [P, 2]
        The sample's index, the row in it.
    joints, joints_source : numpy.ndarray, float [P, J, 2]
        x, y in volume pixels, and in source pixels.
    annotated, hidden : numpy.ndarray, bool [P, J]
        hidden: annotated and not visible.
    head : numpy.ndarray, float [P]
        Source pixels from the head to the middle of the shoulders; NaN where one of them is not annotated.
    head_box : numpy.ndarray, float [P]
        Diagonal of the head's box in source pixels; NaN where there is none.
    to_volume : numpy.ndarray, float [P, 2, 3]
        source_to_volume of their samples.
    """

    names: list[str]
    place: np.ndarray
    joints: np.ndarray
    joints_source: np.ndarray
    annotated: np.ndarray
    hidden: np.ndarray
    head: np.ndarray
    head_box: np.ndarray
    to_volume: np.ndarray

    def rows(self, chosen: np.ndarray) -> Persons:
        """Those `chosen`, bool [P] or rows.

        Parameters
        ----------
        chosen : numpy.ndarray

        Returns
        -------
        Persons
        """
        return Persons(self.names, *(column[chosen] for column in self[1:]))

    def to_source(self, joints: np.ndarray) -> np.ndarray:
        """Joints in source pixels.

        Parameters
        ----------
        joints : numpy.ndarray, [P, J, 2]
            In volume pixels.

        Returns
        -------
        numpy.ndarray
            [P, J, 2].
        """
        return (joints - self.to_volume[:, None, :, 2]) / self.to_volume[:, [0, 1], [0, 1]][:, None]

    def scored(self, hidden: bool) -> np.ndarray:
        """The joints that count.

        Parameters
        ----------
        hidden : bool
            Whether hidden ones do, too.

        Returns
        -------
        numpy.ndarray
            bool [P, J].
        """
        return self.annotated if hidden else self.annotated & ~self.hidden


def read_persons(shards: Shards) -> Persons:
    """All persons of samples, with the joints of shards.default_joints(), which every source must have.

    Parameters
    ----------
    shards : Shards

    Returns
    -------
    Persons
    """
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
    return Persons(names, persons, joints, source, annotated, annotated & (visible == 0), head_lengths(names, source, annotated),
                   np.linalg.norm(corners[:, 1] - corners[:, 0], axis=-1), shards.column("source_to_volume")[persons[:, 0]])


def head_lengths(names: Sequence[str], joints: np.ndarray, annotated: np.ndarray) -> np.ndarray:
    """From the head (of MPII its top) to the middle of the shoulders.

    Parameters
    ----------
    names : sequence of str
        Of the joints.
    joints : numpy.ndarray, [P, J, 2]
    annotated : numpy.ndarray, bool [P, J]

    Returns
    -------
    numpy.ndarray
        [P], in the joints' unit; NaN where one of them is not annotated.
    """
    lower = [name.lower() for name in names]
    head = [lower.index(name) for name in ("head_top", "head") if name in lower][:1]
    shoulders = [i for i, name in enumerate(lower) if "shoulder" in name]
    if not head or len(shoulders) != 2:
        return np.full(len(joints), np.nan)
    length = np.linalg.norm(joints[:, head[0]] - joints[:, shoulders].mean(1), axis=-1)
    return np.where(annotated[:, head + shoulders].all(-1), length, np.nan)


def near_head(error: np.ndarray, scored: np.ndarray, head: np.ndarray, at: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    """PCKh's counts of each joint, of persons whose head is known.

    Parameters
    ----------
    error : numpy.ndarray, [P, J]
        Distances; NaN is a joint that was not found.
    scored : numpy.ndarray, bool [P, J]
        Joints that count.
    head : numpy.ndarray, [P]
        In the unit of `error`; NaN: not known.
    at : float, default 0.5
        Near is at most `at` x 0.6 x `head`.

    Returns
    -------
    near, there : numpy.ndarray
        int [J], how many of the joints are near, and how many there are.
    """
    scored = scored & np.isfinite(head)[:, None]
    return (scored & (error <= at * 0.6 * head[:, None])).sum(0), scored.sum(0)


def pose_scores(joints: np.ndarray, persons: Persons, hidden: bool = False) -> dict[str, dict[str, float]]:
    """Scores of found joints, of each joint and of "all".

    Both shares are of source pixels, which no stretching changes; joints that were not found are missed. "all" is of all joints that count
    together, and for pckh_mpii without pelvis and thorax, as MPII has it.

    Parameters
    ----------
    joints : numpy.ndarray, [P, J, 2]
        Found, in volume pixels; NaN for a person that was not found.
    persons : Persons
    hidden : bool, default False
        Whether hidden joints count, as MPII's own evaluation has it.

    Returns
    -------
    dict of dict
        scored, left_out : joints that count, and those that do not: not annotated, or hidden
        mpjpe_volume, mpjpe_source : mean distance in pixels of those that count and were found
        pckh : PCKh@0.5, as in the EventGAN paper: the share of those that count that are within half of 0.6 x the distance of
            head and middle of the shoulders, of persons in whom these are annotated
        pckh_mpii : MPII's own: half of 0.6 x the diagonal of the head's box, of persons who have one
    """
    scored = persons.scored(hidden)
    error = np.linalg.norm(joints - persons.joints, axis=-1)
    error_source = np.linalg.norm(persons.to_source(joints) - persons.joints_source, axis=-1)
    near, of_near = near_head(error_source, scored, persons.head)
    mpii, of_mpii = near_head(error_source, scored, persons.head_box)

    def row(chosen: list[int], of_mean: list[int]) -> dict[str, float]:
        kept, found = scored[:, chosen], scored[:, chosen] & np.isfinite(error[:, chosen])
        return {"scored": np.count_nonzero(kept), "left_out": np.count_nonzero(~kept),
                **{key: mean(each[:, chosen][found]) for key, each in (("mpjpe_volume", error), ("mpjpe_source", error_source))},
                "pckh": ratio(near[chosen].sum(), of_near[chosen].sum()), "pckh_mpii": ratio(mpii[of_mean].sum(), of_mpii[of_mean].sum())}

    every = range(len(persons.names))
    limbs = [i for i in every if persons.names[i] not in ("pelvis", "thorax")]
    return {**{persons.names[i]: row([i], [i]) for i in every}, "all": row(list(every), limbs)}

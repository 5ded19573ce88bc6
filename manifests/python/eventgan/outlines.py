"""What objects cover: the outlines of /labels/boxes/outline as corners and as masks."""

from __future__ import annotations

import json

import numpy as np


def rings(outline: bytes) -> list[np.ndarray]:
    """The closed rings of an outline.

    Parameters
    ----------
    outline : bytes
        A box's, of `Shards`: sample["boxes"]["outline"][k]; empty if it has none.

    Returns
    -------
    list of numpy.ndarray
        float64 [corners, 2]: x, y in volume pixels as edges are counted, so that the centre of pixel 3 is 3.5. Parts
        run clockwise, as one sees them, holes the other way. Corners may lie outside the volume.

    Raises
    ------
    ValueError
        It is no outline.
    """
    try:
        # as 32 bits, which have been written in as few digits as tell them apart
        read = [np.array(ring) for ring in json.loads(outline or b"[]")]
        found = [ring.astype(np.float32).reshape(-1, 2).astype(np.float64) for ring in read if ring.dtype.kind in "if"]
        is_sound = len(found) == len(read)
    except (TypeError, ValueError, OverflowError, RecursionError):
        is_sound = False
    if not is_sound or not all(len(ring) >= 3 and np.isfinite(ring).all() for ring in found):
        raise ValueError(f"expected rings [[x, y, x, y, ...], ...] of 3 corners or more, got {outline[:80]!r}")
    return found


def mask(outline: bytes, size: tuple[int, int]) -> np.ndarray:
    """The pixels whose centres an outline covers, as `eventgan` itself counts them.

    Parameters
    ----------
    outline : bytes
        As of `rings`.
    size : (int, int)
        Height and width of the volume.

    Returns
    -------
    numpy.ndarray
        bool [H, W]

    Raises
    ------
    ValueError
        It is no outline.
    """
    found, covered = rings(outline), np.zeros(size, bool)
    if not found:
        return covered
    # What no ring reaches is not looked at.
    corners = np.concatenate(found)
    left, top = np.clip(np.floor(corners.min(0)), 0, size[::-1]).astype(np.int64)
    right, bottom = np.clip(np.ceil(corners.max(0)), 0, size[::-1]).astype(np.int64)
    width = right - left + 1
    start, ahead = corners, np.concatenate([np.roll(ring, -1, axis=0) for ring in found])
    upwards = start[:, 1] > ahead[:, 1]  # clockwise, that is where a part begins
    high, low = np.where(upwards[:, None], ahead, start), np.where(upwards[:, None], start, ahead)
    first, end = (np.clip(np.ceil(y - 0.5), top, bottom).astype(np.int64) for y in (high[:, 1], low[:, 1]))
    count = np.maximum(end - first, 0)  # of the rows whose centres an edge crosses
    edge = np.repeat(np.arange(len(start)), count)
    row = first[edge] + np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
    (x, y), (run, rise) = high[edge].T, (low - high)[edge].T
    column = np.clip(np.ceil(x + (row + 0.5 - y) / rise * run - 0.5), left, right).astype(np.int64)
    # how much more often rings wind around a pixel than around its left one
    turns = np.bincount((row - top) * width + column - left, np.where(upwards, 1, -1)[edge], (bottom - top) * width)
    covered[top:bottom, left:right] = turns.reshape(-1, width).cumsum(1)[:, :-1] != 0
    return covered

"""Scores of optical flow as MVSEC's, KITTI's and DSEC's benchmarks define them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from .detection_scores import ratio


def flow_errors(found: np.ndarray, true: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """End-point errors in pixels and angular errors in degrees, [n] each, of flows [2, n] (x, then y, pixels).

    The angle is that between (x, y, 1) of both (Barron, Fleet, Beauchemin: Performance of optical flow techniques,
    1994), so that it is defined for a flow of zero.
    """
    found, true = np.asarray(found, float), np.asarray(true, float)
    cross = np.stack([found[1] - true[1], true[0] - found[0], found[0] * true[1] - found[1] * true[0]])
    # the arc tangent, since the arc cosine of a small angle loses its digits
    return np.hypot(*(found - true)), np.degrees(np.arctan2(np.linalg.norm(cross, axis=0), (found * true).sum(0) + 1))


def flow_scores(flows: Iterable[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> dict[str, float]:
    """Scores over the pixels of all samples; NaN without any.

    Parameters
    ----------
    flows : iterable of (found, true, scored)
        Flow in pixels, [2, H, W], x, then y, found and true; bool [H, W]: the pixels to score.

    Returns
    -------
    dict
        pixels : scored ones
        aee : average end-point error, pixels
        npe_1, npe_3 : share of the pixels whose end-point error is above 1 and 3 pixels
        angular : average angular error, degrees
    """
    pixels, sums = 0, np.zeros(4)
    for found, true, scored in flows:
        distance, angle = flow_errors(found[:, scored], true[:, scored])
        pixels += distance.size
        sums += distance.sum(), np.count_nonzero(distance > 1), np.count_nonzero(distance > 3), angle.sum()
    return {"pixels": pixels, **{key: ratio(total, pixels)
                                 for key, total in zip(("aee", "npe_1", "npe_3", "angular"), sums.tolist())}}

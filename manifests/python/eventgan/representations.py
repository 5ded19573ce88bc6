"""Event representations: what a network may take instead of a whole volume."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def signed_channel(events: npt.ArrayLike) -> np.ndarray:
    """One channel, whatever the events come from: at each pixel the positive events minus the negative ones, divided by the 99th percentile of their
    magnitude over all pixels (by its maximum where that is 0), clipped to -1..1.

    Neither the camera's threshold nor the window's length nor the number of bins matters to it, so it suits to train on one source and to test on
    another; when within the window an event happened is lost. For `Shards.changed`: ``shards.changed(lambda sample: signed_channel(sample["volume"]))``.

    Parameters
    ----------
    events : array_like
        [2B, H, W], a volume: channels 0..B-1 are the positive polarity. Or [H, W], an image in which somebody has drawn positive minus
        negative events in grey: its most frequent value is taken for no events.

    Returns
    -------
    numpy.ndarray
        float32 [1, H, W]; zeros where there are no events at all.

    Raises
    ------
    ValueError
        It is neither.
    """
    events = np.asarray(events)
    if events.ndim == 3 and len(events) % 2 == 0 and len(events):
        positive, negative = np.split(events.astype(np.float32, copy=False), 2)
        signed = positive.sum(0) - negative.sum(0)
    elif events.ndim == 2:
        values, counts = np.unique(events, return_counts=True)
        signed = events.astype(np.float32) - (np.float32(values[counts.argmax()]) if len(values) else 0)
    else:
        raise ValueError(f"expected a volume [2B, H, W] or an image [H, W], got an array of {events.shape}")
    magnitude = np.abs(signed)
    scale = (np.percentile(magnitude, 99) or magnitude.max()) if signed.size else 0
    return np.clip(signed / (scale or 1), -1, 1)[None]

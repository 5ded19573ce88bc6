"""Event representations: what a network may take instead of a whole volume."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def signed_channel(events: npt.ArrayLike) -> np.ndarray:
    """One channel, wherever the events come from: the positive minus the negative events of each pixel, divided by the
    99th percentile of their magnitude over all pixels (by its maximum if that is 0), clipped to -1..1.

    It does not depend on the camera's threshold, the window's length or the number of bins, so it suits training on one
    source and testing on another; when an event happened within the window is lost. For `Shards.changed`:
    ``shards.changed(lambda sample: signed_channel(sample["volume"]))``.

    Parameters
    ----------
    events : array_like
        [2B, H, W], a volume: channels 0..B-1 are the positive polarity. Or [H, W], a grey image that shows positive
        minus negative events: its most frequent value is taken for no events.

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

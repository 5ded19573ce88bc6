"""Volumes and their labels drawn with matplotlib, in the colours of `eventgan preview`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .outlines import rings

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# red, green, blue, as in stages/events/images/time_panel.cc and preview_image.cc
EARLY_TO_LATE = np.array([[40, 60, 255], [0, 220, 230], [40, 220, 60], [255, 220, 0], [255, 30, 30]], np.float32)
CLASSES = [(255, 60, 255), (255, 255, 255)]  # no colours of times
IGNORED, JOINT = (235, 235, 235), (120, 230, 80)
SCREEN = 10.0  # inches: the longer side of a figure that is made for a volume


def time_image(volume: npt.ArrayLike) -> np.ndarray:
    """The image of a volume's mean event times, coloured as by `eventgan preview`.

    The colour is the mean time of both polarities, from early (blue) to late (red); the brightness is 1 - exp(-m) of
    full brightness for a pixel whose values sum to m. No event is black, a value that is not finite white.

    Parameters
    ----------
    volume : array_like, float [2B, H, W], >= 0

    Returns
    -------
    numpy.ndarray
        uint8 [H, W, 3], red, green, blue.

    Raises
    ------
    ValueError
        The volume has another number of dimensions, or an odd number of channels.
    """
    volume = np.asarray(volume, np.float32)
    if volume.ndim != 3 or not volume.shape[0] or volume.shape[0] % 2:
        raise ValueError(f"expected a volume [2B, H, W], got an array {list(volume.shape)}")
    polarities = volume.reshape(2, -1, *volume.shape[1:])
    bins = polarities.shape[1]
    times = 0.1 + 0.9 * np.arange(bins, dtype=np.float32) / max(bins - 1, 1)
    with np.errstate(invalid="ignore", over="ignore"):
        mass = polarities.sum(1)
        total = mass.sum(0)
        means = np.einsum("b,pbyx->pyx", times, polarities) / (mass + np.float32(1e-5))
        time = (means * mass).sum(0) / np.where(total > 0, total, 1)
        at = np.clip((np.nan_to_num(time) - 0.1) / 0.9, 0, 1) * (len(EARLY_TO_LATE) - 1)
        below = np.minimum(at.astype(int), len(EARLY_TO_LATE) - 2)
        share = (at - below)[..., None]
        colour = np.rint(EARLY_TO_LATE[below] * (1 - share) + EARLY_TO_LATE[below + 1] * share)
        image = np.rint(colour * (1 - np.exp(-np.maximum(total, 0)))[..., None])
    image[~np.isfinite(total)] = 255
    return image.astype(np.uint8)


def show(volume: npt.ArrayLike | Mapping[str, Any], boxes: npt.ArrayLike | None = None,
         joints: npt.ArrayLike | None = None, ax: Axes | None = None) -> Axes:
    """Draws a volume with its labels, in the colours of `eventgan preview` (see `time_image`). Needs matplotlib.

    Parameters
    ----------
    volume : array_like, float [2B, H, W], or dict
        A volume; or a sample of `Shards` or of `Generator.sample`, which is drawn with its labels: boxes
        magenta or white by class, ignored ones dashed, outlines thin, hidden joints hollow.
    boxes : array_like, [n, 4], optional
        Instead of a sample's: left, top, right, bottom in volume pixels, by edges; the whole volume is 0, 0, W, H.
    joints : array_like, [J, 2] or [P, J, 2], optional
        Instead of a sample's: x, y in volume pixels, whose centres are whole numbers; NaN: not annotated.
    ax : matplotlib.axes.Axes, optional
        Where to draw. None: a new figure of page size.

    Returns
    -------
    matplotlib.axes.Axes
        Its x and y are volume pixels, whose centres are whole numbers.

    Raises
    ------
    ValueError
        The volume, the boxes or the joints have another shape.
    """
    import matplotlib.patches
    import matplotlib.patheffects
    import matplotlib.pyplot

    sample: Mapping[str, Any] = volume if isinstance(volume, Mapping) else {"volume": volume}
    if "volume" not in sample:
        raise ValueError(f"expected a sample with its volume, got one with {', '.join(sample)}")
    image = time_image(np.multiply(sample["volume"], sample["scale"]) if "scale" in sample else sample["volume"])
    height, width = image.shape[:2]
    if ax is None:
        size = SCREEN / max(height, width)
        ax = matplotlib.pyplot.subplots(figsize=(max(size * width, 2), max(size * height, 2)), layout="constrained")[1]
    ax.imshow(image, interpolation="nearest")
    ax.set_axis_off()
    edge = matplotlib.patheffects.withStroke(linewidth=4, foreground="black")
    for (left, top, right, bottom), colour, ignore, outline in _boxes_of(sample, boxes):
        for ring in rings(outline):
            ax.add_patch(matplotlib.patches.Polygon(ring - 0.5, fill=False, edgecolor=np.divide(colour, 255)))
        # Pixel centres are whole numbers: the left edge of pixel x is half a pixel left of it.
        place = {"xy": (left - 0.5, top - 0.5), "width": right - left, "height": bottom - top, "fill": False}
        if ignore:
            ax.add_patch(matplotlib.patches.Rectangle(**place, edgecolor="black", linewidth=1))
        ax.add_patch(matplotlib.patches.Rectangle(**place, edgecolor=np.divide(colour, 255),
                                                  linewidth=1 if ignore else 2, linestyle="--" if ignore else "-",
                                                  path_effects=None if ignore else [edge]))
    points, hidden = _joints_of(sample, joints)
    ax.scatter(*points[~hidden].T, s=40, zorder=3, linewidths=1, facecolors=[np.divide(JOINT, 255)], edgecolors="black")
    ax.scatter(*points[hidden].T, s=40, zorder=3, linewidths=1, facecolors="none", edgecolors=[np.divide(JOINT, 255)])
    ax.set_xlim(-0.5, width - 0.5)
    ax.set_ylim(height - 0.5, -0.5)
    return ax


def _boxes_of(sample: Mapping[str, Any],
              boxes: npt.ArrayLike | None) -> Iterator[tuple[np.ndarray, tuple[int, int, int], bool, bytes]]:
    """Box [4], colour, whether it is ignored, and outline; ignored ones first, so that they never cover an object."""
    rows = sample.get("boxes", {}) if boxes is None else {}
    xyxy = np.asarray(rows.get("xyxy", []) if boxes is None else boxes, float)
    if xyxy.size and (xyxy.ndim != 2 or xyxy.shape[1] != 4):
        raise ValueError(f"expected boxes [n, 4], got an array {list(xyxy.shape)}")
    xyxy = xyxy.reshape(-1, 4)
    ignore = np.asarray(rows.get("ignore", np.zeros(len(xyxy)))) != 0
    numbers = np.maximum(rows.get("class_id", np.zeros(len(xyxy), int)), 0)
    for i in np.argsort(~ignore, kind="stable"):
        colour = IGNORED if ignore[i] else CLASSES[numbers[i] % len(CLASSES)]
        yield xyxy[i], colour, bool(ignore[i]), rows["outline"][i] if "outline" in rows else b""


def _joints_of(sample: Mapping[str, Any], joints: npt.ArrayLike | None) -> tuple[np.ndarray, np.ndarray]:
    """The annotated joints [k, 2], and [k] whether they are hidden."""
    persons = sample.get("persons", {}) if joints is None else {}
    points = np.asarray(persons.get("joints", sample.get("joints", [])) if joints is None else joints, float)
    if points.size and (points.ndim not in (2, 3) or points.shape[-1] != 2):
        raise ValueError(f"expected joints [J, 2] or [P, J, 2], got an array {list(points.shape)}")
    points = points.reshape(-1, 2)
    annotated = np.isfinite(points).all(1)
    if "joints_source" in persons:
        annotated &= (np.reshape(persons["joints_source"], (-1, 2)) != -1).any(1)
    hidden = np.reshape(persons["visible"], -1) == 0 if "visible" in persons else np.zeros(len(points), bool)
    return points[annotated], hidden[annotated]

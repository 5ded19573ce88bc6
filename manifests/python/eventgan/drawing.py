"""Drawings of volumes with true and found labels, as in the EventGAN paper, and of precision over recall.
Needs OpenCV."""

from __future__ import annotations

import pathlib
from collections.abc import Iterable, Mapping, Sequence

import cv2
import numpy as np

FOUND, TRUE, IGNORED, BLACK = (230, 90, 20), (60, 170, 40), (40, 40, 220), (0, 0, 0)  # blue, green, red (BGR)
ZOOM = 2
FAR = 1e6  # pixels: what lies farther out is drawn there


def of_events(volume: np.ndarray) -> np.ndarray:
    """uint8 [ZOOM H, ZOOM W, 3] BGR: a volume [2B, H, W] as grey on white."""
    events = volume.sum(0)
    top = np.percentile(events[events > 0], 98) if (events > 0).any() else 1
    canvas = (255 - 175 * np.clip(events / top, 0, 1)).astype(np.uint8)
    return cv2.cvtColor(cv2.resize(canvas, None, fx=ZOOM, fy=ZOOM, interpolation=cv2.INTER_NEAREST), cv2.COLOR_GRAY2BGR)


def draw_boxes(canvas: np.ndarray, boxes: Iterable[Sequence[float]] | np.ndarray, colour: tuple[int, int, int],
               texts: Iterable[str] = ()) -> None:
    """Draws boxes [n, 4] (left, top, right, bottom in volume pixels, by edges) onto `of_events`,
    each with its text above."""
    texts = iter(texts)
    for box in boxes:
        left, top, right, bottom = (round(ZOOM * float(edge)) for edge in np.clip(box, -FAR, FAR))
        cv2.rectangle(canvas, (left, top), (right - 1, bottom - 1), colour, 1)
        cv2.putText(canvas, next(texts, ""), (left, max(top - 3, 9)), cv2.FONT_HERSHEY_SIMPLEX, 0.35, colour, 1,
                    cv2.LINE_AA)


def draw_joints(canvas: np.ndarray, joints: np.ndarray, colour: tuple[int, int, int],
                true: np.ndarray | None = None) -> None:
    """Draws joints [J, 2] in volume pixels onto `of_events`, with lines to the `true` ones [J, 2]; NaN is left out."""
    for i, joint in enumerate(joints):
        ends = [joint] if true is None else [joint, true[i]]
        ends = [tuple(int(x) for x in np.round(ZOOM * (np.clip(end, -FAR, FAR) + 0.5) - 0.5)) for end in ends
                if np.isfinite(end).all()]
        if len(ends) == 2:
            cv2.line(canvas, *ends, colour, 1, cv2.LINE_AA)
        if np.isfinite(joint).all():
            cv2.circle(canvas, ends[0], 2, colour, -1, cv2.LINE_AA)


def draw_flow(canvas: np.ndarray, flow: np.ndarray, colour: tuple[int, int, int], step: int = 16) -> None:
    """Draws flow [2, H, W] in volume pixels onto `of_events`, an arrow each `step` pixels; NaN is left out."""
    for y, x in np.ndindex(flow.shape[1] // step, flow.shape[2] // step):
        start = np.array([x, y]) * step + step // 2
        end = start + np.clip(flow[:, start[1], start[0]].astype(float), -FAR, FAR)
        if np.isfinite(end).all():
            cv2.arrowedLine(canvas, *(tuple(int(v) for v in np.round(ZOOM * (point + 0.5) - 0.5))
                                      for point in (start, end)), colour, 1, cv2.LINE_AA)


def of_precision(curves: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """uint8 [440, 440, 3] BGR: precision over recall (each [n], by name) as lines in a square from 0 to 1."""
    canvas = np.full((440, 440, 3), 255, np.uint8)
    colours = [FOUND, TRUE, IGNORED, (200, 160, 0), (180, 0, 160), (0, 150, 230), BLACK]

    def place(recall: float, precision: float) -> tuple[int, int]:
        return round(45 + 380 * recall), round(395 - 380 * precision)

    for tick in np.arange(6) / 5:
        for ends in (((tick, 0), (tick, 1)), ((0, tick), (1, tick))):
            cv2.line(canvas, place(*ends[0]), place(*ends[1]), (210, 210, 210), 1)
        for x, y in ((place(tick, 0)[0] - 8, 412), (18, place(0, tick)[1] + 4)):
            cv2.putText(canvas, f"{tick:.1f}", (x, y), cv2.FONT_HERSHEY_SIMPLEX, 0.35, BLACK, 1, cv2.LINE_AA)
    cv2.putText(canvas, "recall", (215, 430), cv2.FONT_HERSHEY_SIMPLEX, 0.4, BLACK, 1, cv2.LINE_AA)
    cv2.putText(canvas, "precision", (48, 11), cv2.FONT_HERSHEY_SIMPLEX, 0.4, BLACK, 1, cv2.LINE_AA)
    for number, (name, (recall, precision)) in enumerate(curves.items()):
        colour = colours[number % len(colours)]
        line = np.array([place(*point) for point in zip(recall, precision)], np.int32).reshape(-1, 1, 2)
        cv2.polylines(canvas, [line], False, colour, 2 if len(curves) == 1 else 1, cv2.LINE_AA)
        cv2.putText(canvas, name, (55, 385 - 14 * number), cv2.FONT_HERSHEY_SIMPLEX, 0.4, colour, 1, cv2.LINE_AA)
    return canvas


def write(folder: str | pathlib.Path, name: str, canvas: np.ndarray) -> None:
    """Writes a BGR image as FOLDER/NAME.png. Raises OSError if it cannot be written."""
    path = pathlib.Path(folder, name.replace("/", "_") + ".png")
    path.parent.mkdir(parents=True, exist_ok=True)
    if not cv2.imwrite(str(path), canvas):
        raise OSError(f"cannot write {path}")

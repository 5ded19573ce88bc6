"""A recording of frames and events as event volumes: the camera's own, and those that each method makes of the frames.

    frames, times_s = recordings.frames_of("slider_depth.hdf5")
    real = recordings.real_volumes("eventgan", "slider_depth.hdf5", "volumes/slider_depth")       # [F - 1, 18, H, W]
    method = recordings.METHODS["difference, fitted"](frames, real.sum((1, 2, 3)), peers)
    volume = method(frames[0], frames[1])                                                         # [18, H, W]

Volumes of the camera, of the models, of v2e and of the network that knows its sensor are counts of events; those of the
other networks are about [0, 1] and no counts.
"""

from __future__ import annotations

import atexit
import json
import logging
import math
import os
import pathlib
import subprocess
import sys
from collections.abc import Callable
from typing import Union

import h5py
import numpy as np
import torch

_PYTHON = pathlib.Path(__file__).resolve().parents[2] / "manifests" / "python"
sys.path += [str(_PYTHON), str(_PYTHON / "examples")]  # the package, if it is not installed, and the trainers

from eventgan import Generator, Shards

PathLike = Union[str, os.PathLike]
Method = Callable[[np.ndarray, np.ndarray], np.ndarray]  # previous, following: uint8 [H, W] -> float32 [2B, H, W]

BINS = 9  # per polarity
THRESHOLD = 0.2  # of the models and of v2e where it is not fitted: the default of all three
THRESHOLDS, TOLERANCE, MOST_STEPS, MOST_PAIRS = (0.01, 5.0), 0.005, 16, 16  # of the fit, as `eventgan realism` has them
LEARNT_THRESHOLDS = (0.07, 0.93)  # by shipped:sensor
SPREAD_SHARE = 0.15  # of a threshold over the pixels, and the next two: realism's, too
LOG_EPSILON = 0.02
ESIM_DISPLACEMENT_PX = 5
BLENDED = 8  # steps in which v2e is given a pair


def frames_of(path: PathLike) -> tuple[np.ndarray, np.ndarray]:
    """Frames of a recording in MVSEC's layout.

    Parameters
    ----------
    path : str or path
        HDF5 with davis/left/image_raw and image_raw_ts.

    Returns
    -------
    frames : numpy.ndarray
        uint8 [F, H, W], grey.
    times_s : numpy.ndarray
        float64 [F], rising.

    Raises
    ------
    ValueError
        The file has no such frames.
    """
    with h5py.File(path) as file:
        camera = file.get("davis/left", {})
        missing = [name for name in ("image_raw", "image_raw_ts") if name not in camera]
        if missing:
            raise ValueError(f"expected davis/left/{missing[0]}, got none, in {path}")
        frames, times_s = camera["image_raw"][:], camera["image_raw_ts"][:].astype(np.float64)
    if frames.ndim != 3 or frames.dtype != np.uint8 or times_s.shape != frames.shape[:1]:
        got = f"{frames.dtype} {list(frames.shape)} and {list(times_s.shape)}"
        raise ValueError(f"expected frames uint8 [F, H, W] and times [F], got {got}, in {path}")
    return frames, times_s


def real_volumes(program: PathLike, path: PathLike, folder: PathLike) -> np.ndarray:
    """Volumes of the camera's events, of each interval between two frames, by `eventgan convert`.

    They are counts ("normalize": "none"): a count is what a sensor model makes, too, and its sum is how many events
    there were. Whoever needs shares of the 98th percentile divides by it.

    Parameters
    ----------
    program : str or path
        The eventgan program.
    path : str or path
        A recording with frames that it can read.
    folder : str or path
        For the finalized shards, which are kept: a second call only reads them, and one after an interruption goes on.

    Returns
    -------
    numpy.ndarray
        float32 [F - 1, 2B, H, W], >= 0: bins of positive polarity in time order, then of negative.

    Raises
    ------
    ValueError
        The volumes of some intervals could not be made.
    subprocess.CalledProcessError
        The program failed; it has said why.
    """
    path, folder = pathlib.Path(path).resolve(), pathlib.Path(folder).resolve()
    if not (folder / "dataset.json").exists():
        folder.parent.mkdir(parents=True, exist_ok=True)
        manifest = {"format": "eventgan-manifest", "version": 1, "name": path.stem, "image": {},
                    "generator": {"kind": "events"},
                    "sources": [{"dataset": "recording", "root": str(path), "split": "test"}],
                    "volume": {"bins": BINS, "normalize": "none"},
                    "output": {"directory": folder.name, "dtype": "float32"}}
        file = folder.with_name(f"{folder.name}.json")
        file.write_text(json.dumps(manifest, indent=1), encoding="utf-8")
        subprocess.run([program, "convert", file, "--progress", "none"], check=True, stdout=subprocess.DEVNULL)
    with Shards(folder) as shards:
        volumes = np.stack([shards.sample(i, {"volume"})["volume"] for i in range(len(shards))])
    expected = len(frames_of(path)[0]) - 1
    if len(volumes) != expected:
        raise ValueError(f"expected volumes of {expected} intervals, got {len(volumes)}, in {folder} (its dataset.json "
                         "has the reasons)")
    return volumes


class V2e:
    """The emulator of v2e (Hu et al. 2021) without its noise, as a function of two frames.

    Thresholds differ from pixel to pixel by 15 %, the same at each call, as in one camera. In place of frames
    interpolated by SuperSloMo it is given the pair in eight steps, blended from both: else the events would have only
    as many times as the pixel with most events has events.

    Parameters
    ----------
    peers : str or path
        A folder with `v2e`, a checkout of SensorsINI/v2e. Its folder `stubs`, if there is one, stands in for packages
        that are not installed.
    threshold : float
        Contrast threshold of both polarities.
    bins : int
        B, per polarity.
    steps : int
        In how many steps a pair is given. How many events it makes does not depend on them.

    Raises
    ------
    FileNotFoundError
        There is no v2e.
    """

    def __init__(self, peers: PathLike, threshold: float = THRESHOLD, bins: int = BINS, steps: int = BLENDED) -> None:
        checkout = pathlib.Path(peers) / "v2e"
        if not (checkout / "v2ecore").is_dir():
            raise FileNotFoundError(f"expected a checkout of SensorsINI/v2e with v2ecore, got none, in {checkout}")
        for folder in map(str, (checkout, checkout / "stubs")):
            if folder not in sys.path:
                sys.path.append(folder)  # at the end: installed packages come first
        logging.getLogger("v2ecore").setLevel(logging.ERROR)  # it warns of each pair without events
        self.threshold, self._bins, self._steps = threshold, bins, steps

    def __call__(self, previous: np.ndarray, following: np.ndarray) -> np.ndarray:
        """uint8 [H, W] grey, twice -> float32 [2B, H, W], counts, shared between bins as `eventgan` does."""
        from v2ecore.emulator import EventEmulator

        height, width = previous.shape
        with torch.random.fork_rng(devices=[]):  # a training's random numbers stay its own
            torch.manual_seed(0)
            emulator = EventEmulator(pos_thres=self.threshold, neg_thres=self.threshold,
                                     sigma_thres=SPREAD_SHARE * self.threshold, leak_rate_hz=0,
                                     device="cpu", output_height=height, output_width=width)
            atexit.unregister(emulator.cleanup)  # it would keep every emulator in memory
            parts = [np.zeros((0, 4), np.float32)]
            for share in np.linspace(0, 1, self._steps + 1, dtype=np.float32):
                # without noise the time's unit is all one
                made = emulator.generate_events((1 - share) * previous + share * following, float(share))
                parts += [] if made is None else [made]
        return volume_of(np.concatenate(parts), (height, width), self._bins)


def volume_of(events: np.ndarray, size: tuple[int, int], bins: int = BINS) -> np.ndarray:
    """The volume of events, each shared between the two bins nearest to it in time, of which the first event has 0 and
    the last one `bins` - 1.

    Parameters
    ----------
    events : numpy.ndarray
        [N, 4] t, x, y, polarity (-1 or 1), in order of time.
    size : (int, int)
        H, W.
    bins : int
        B, per polarity.

    Returns
    -------
    numpy.ndarray
        float32 [2B, H, W], counts.
    """
    t, x, y, polarity = events.T.astype(np.float64)
    lasts = np.ptp(t) if len(t) else 0
    star = (bins - 1) * (t - t[0]) / lasts if lasts else np.zeros_like(t)
    lower = np.minimum(star.astype(np.int64), bins - 2)
    cell = (((polarity < 0) * bins + lower) * size[0] + y.astype(np.int64)) * size[1] + x.astype(np.int64)
    cells, weights = np.concatenate([cell, cell + size[0] * size[1]]), np.concatenate([lower + 1 - star, star - lower])
    return np.bincount(cells, weights, 2 * bins * size[0] * size[1]).astype(np.float32).reshape(2 * bins, *size)


def fitted(model: Callable[[float], Method], frames: np.ndarray, event_counts: np.ndarray,
           within: tuple[float, float] = THRESHOLDS) -> float:
    """The threshold with which a model makes as many events as the camera, as a simulator's user would set it and
    `eventgan realism` does.

    Parameters
    ----------
    model : callable
        threshold -> method of counts.
    frames : numpy.ndarray
        uint8 [F, H, W].
    event_counts : numpy.ndarray
        [F - 1] of the camera. At most 16 pairs, spread evenly, count.
    within : (float, float)
        Least and largest threshold.

    Returns
    -------
    float
        So that the numbers agree within 0.5 %, or as near as 16 bisections come.
    """
    pairs = np.unique(np.linspace(0, len(event_counts) - 1, min(MOST_PAIRS, len(event_counts))).round().astype(int))
    wanted = event_counts[pairs].sum(dtype=np.float64)
    low, high = within
    for _ in range(MOST_STEPS):
        middle = math.sqrt(low * high)
        method = model(middle)
        made = sum(method(frames[i], frames[i + 1]).sum(dtype=np.float64) for i in pairs)
        if abs(made - wanted) <= TOLERANCE * wanted:
            break
        low, high = (middle, high) if made > wanted else (low, middle)
    return middle


def told(threshold: float) -> Method:
    """The network that knows its sensor."""
    return Generator("shipped:sensor", precision="float32", sensor={"threshold": threshold}, bins=BINS)


def difference(threshold: float) -> Method:
    """Log intensity on a line from frame to frame, by a sensor without noise."""
    return Generator(kind="difference", sensor=_sensor(threshold), bins=BINS)


def esim(threshold: float) -> Method:
    """The previous frame under a random affine motion, by a sensor without noise."""
    return Generator(kind="esim", sensor=_sensor(threshold), max_displacement_px=ESIM_DISPLACEMENT_PX, bins=BINS)


def _sensor(threshold: float) -> dict[str, float]:
    return {"positive_threshold": threshold, "negative_threshold": threshold,
            "threshold_spread": SPREAD_SHARE * threshold, "log_epsilon": LOG_EPSILON}


def _fitted_v2e(frames: np.ndarray, event_counts: np.ndarray, peers: PathLike) -> V2e:
    return V2e(peers, fitted(lambda threshold: V2e(peers, threshold, steps=1), frames, event_counts))


# By name a function of the recording's frames, of how many events its camera had in each interval, [F - 1], and of the
# folder with v2e. It returns the method; only those that are fitted look at the recording.
METHODS: dict[str, Callable[[np.ndarray, np.ndarray, PathLike], Method]] = {
    "EventGAN 16": lambda frames, event_counts, peers: Generator("shipped:16", precision="float32", bins=BINS),
    "EventGAN 8": lambda frames, event_counts, peers: Generator("shipped:8", precision="float32", bins=BINS),
    "EventGAN sensor, fitted": lambda frames, event_counts, peers: told(fitted(told, frames, event_counts,
                                                                               LEARNT_THRESHOLDS)),
    "difference": lambda frames, event_counts, peers: difference(THRESHOLD),
    "difference, fitted": lambda frames, event_counts, peers: difference(fitted(difference, frames, event_counts)),
    "esim": lambda frames, event_counts, peers: esim(fitted(esim, frames, event_counts)),
    "v2e": lambda frames, event_counts, peers: V2e(peers),
    "v2e, fitted": _fitted_v2e,
}

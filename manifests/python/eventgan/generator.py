"""Volumes of two images, by the engine of the program `eventgan`: bit for bit those in its shards."""

from __future__ import annotations

import contextlib
import ctypes
import errno
import json
import operator
import os
import re
import threading
import warnings
from collections.abc import Mapping
from typing import Any, Union

import numpy as np
import numpy.typing as npt

try:
    from . import _engine
except ImportError as error:
    raise ImportError(f"expected the library libeventgan, got none ({error}): install the Debian packages "
                      "libeventgan1 and python3-eventgan, or run `pip install -v ./manifests/python` in a checkout, "
                      "which builds it or says what is missing") from error

from .words import did_you_mean, sides

PathLike = Union[str, os.PathLike]
_PLACES = {  # of settings in a manifest
    "image": ("fit", "preset", "grey", "blur"),
    "generator": ("kind", "weights", "precision", "scope", "motion_threshold", "motion_margin_px", "label_margin_px",
                  "tile_px", "sensor", "sample", "duration_s", "max_displacement_px"),
    "volume": ("bins", "normalize"),
}


class Generator:
    """Makes the event volume of two images, as `eventgan convert` does with the same settings: bit for bit what is in
    its shards of float32.

    Images are uint8, or floating-point numbers from 0 to 1, which are rounded to the 256 levels of an image file; [H,
    W] grey or [H, W, 3] red, green, blue (for OpenCV's order, blue, green, red, pass `image[..., ::-1]`). NumPy arrays,
    and what NumPy converts to one: a PyTorch tensor on the CPU, a PIL image.

    Several threads may use one object at once, and it can go to forked or spawned workers. It has no threads of its
    own: a call computes on the calling thread, without Python's lock.

    Parameters
    ----------
    weights : str or path, default "shipped"
        A .safetensors file, "shipped", "shipped:WIDTH" or "shipped:sensor" (weights that come with the package), or
        "untrained:WIDTH".
    kind : {"network", "esim", "difference"}
        The EventGAN network, or a sensor model to compare it with, which needs no weights.
    precision : {"auto", "float32", "bfloat16", "int8"}
        The numbers that the network computes with. "auto": bfloat16 on processors with instructions for it, else
        float32, which is the default of `eventgan convert`; `description` says which. int8 needs calibrated weights
        (`eventgan calibrate`).
    size : (int, int), optional
        Height and width of the volumes. None: those of the images.
    fit : {"stretch", "letterbox", "crop"}
        How an image of another shape is fitted to that size.
    preset : {"demo", "kitti", "mpii"}
        Preprocessing as in the EventGAN authors' scripts: "demo" converts to grey after resizing, "mpii" before it,
        "kitti" also before it, and blurs (3x3). Or give both of the next two.
    grey : {"before_resize", "after_resize"}, optional
    blur : int, optional
        Side of the Gaussian kernel in pixels, odd; 0: none.
    scope : {"whole", "motion", "labels", "labels_only"}
        Which part of a volume is computed; the rest is zeros. "labels" and "labels_only" need labels, which only
        `sample` takes.
    normalize : {"none", "eta98"}
        Whether a volume is divided by its 98th percentile and clipped.
    seed : int, default 0
        Of the sensor models' random numbers, of what sensor={"threshold": [0.1, 0.6], "noise": {...}} draws for each
        pair, and of untrained weights.
    **settings
        Other keys of `generator` and `volume` in a manifest: motion_threshold, motion_margin_px, label_margin_px,
        tile_px, sensor (a dictionary, or a camera: the path of its document or the name of one that ships), sample,
        duration_s, max_displacement_px, bins. manifest.schema.json has their meanings and ranges.

    Raises
    ------
    ValueError
        A setting is not valid, or the processor or the weights do not support it; the message names every fault.
    FileNotFoundError
        There is no such file of weights.

    Examples
    --------
    >>> generator = eventgan.Generator("shipped:8", size=(256, 320), fit="letterbox")
    >>> volume = generator(previous, following)
    >>> volume.shape
    (18, 256, 320)
    """

    def __init__(self, weights: PathLike | None = None, *, kind: str | None = None, precision: str | None = None,
                 size: tuple[int, int] | None = None, fit: str | None = None, preset: str | None = None,
                 grey: str | None = None, blur: int | None = None, scope: str | None = None,
                 normalize: str | None = None, seed: int = 0, **settings: Any) -> None:
        if precision is None and kind in (None, "network"):
            precision = "auto"
        given = dict(kind=kind, weights=_weights(weights), precision=precision, fit=fit, preset=preset, grey=grey,
                     blur=blur, scope=scope, normalize=normalize, **settings)
        known = [key for keys in _PLACES.values() for key in keys]
        unknown = [key for key in given if key not in known]
        if unknown:
            raise ValueError(f"expected settings of {', '.join(known)}, got {', '.join(unknown)}"
                             f"{did_you_mean(unknown, known)}")
        manifest: dict[str, Any] = {
            place: {key: given[key] for key in keys if given.get(key) is not None} for place, keys in _PLACES.items()}
        if size is not None:
            manifest["image"].update(zip(("height", "width"), sides(size)))
        manifest["seed"] = seed
        self._set_up(_json(manifest))
        for text in self._told["warnings"]:
            warnings.warn(text, stacklevel=2)

    def _set_up(self, settings: str) -> None:
        self._settings = settings
        self._handle = ctypes.c_void_p()
        code = _engine.lib.eventgan_load(settings.encode(), ctypes.byref(self._handle))
        weights = json.loads(settings).get("generator", {}).get("weights", "")
        if code == _engine.INPUT_MISSING and weights.startswith("/") and not os.path.exists(weights):
            raise FileNotFoundError(errno.ENOENT, "expected a file of weights, got none", weights)
        _engine.check(code)
        self._told: dict[str, Any] = json.loads(_engine.lib.eventgan_describe(self._handle))

    def __del__(self, _free: Any = _engine.lib.eventgan_free) -> None:
        if handle := self.__dict__.get("_handle"):
            _free(handle)

    def __getstate__(self) -> str:
        return self._settings

    def __setstate__(self, settings: str) -> None:
        self._set_up(settings)

    def __repr__(self) -> str:
        return f"<eventgan.Generator {self._settings}: {self.description}>"

    @property
    def bins(self) -> int:
        """Bins per polarity: a volume has twice as many channels."""
        return self._told["bins"]

    @property
    def description(self) -> str:
        """Engine, precision and the libraries that affect the bytes, as in a plan's fingerprint."""
        return self._told["description"]

    @property
    def weights_hash(self) -> str:
        """SHA-256 of the weights file, hexadecimal; of a model, of its description."""
        return self._told["weights_hash"]

    @property
    def training_gaps(self) -> tuple[int, int] | None:
        """The smallest and the largest gap, in frames, that the network was trained on; None: unknown."""
        gaps = self._told["training_gaps"]
        return gaps and (gaps[0], gaps[1])

    @property
    def draws(self) -> bool:
        """Whether thresholds, noise, events or a simulator's motion are drawn for each pair."""
        return self._told["draws"]

    def __call__(self, previous: npt.ArrayLike, following: npt.ArrayLike, *, draw: int = 0) -> np.ndarray:
        """The volume of two images of one size.

        Parameters
        ----------
        previous, following : array_like, [H, W] or [H, W, 3]
            uint8, or floating-point numbers from 0 to 1.
        draw : int, default 0
            Which of the draws for these images, where anything is drawn (`draws`): another number gives another
            volume. 0 is that of shards.

        Returns
        -------
        numpy.ndarray
            float32 [2B, H, W], >= 0: B bins of positive polarity in time order, then B of negative polarity.
            Dimensionless.

        Raises
        ------
        ValueError
            An image is not one, or the two differ in size.
        """
        before, after = _engine.pair(_array(previous, "previous"), _array(following, "following"))
        volume = np.empty(self._shape(before)[0], np.float32)
        _engine.check(_engine.lib.eventgan_generate(
            self._handle, before.pointer, after.pointer, _whole(draw, "draw", 0, 2**64 - 1), _engine.address(volume),
            volume.size, None, 0))
        return volume

    def _shape(self, images: _engine.Images, threads: int = 1) -> tuple[tuple[int, ...], np.ndarray]:
        """Shape of the volume of such an image, and the map [2, 3] of its points to it."""
        shape, to_volume = (ctypes.c_int32 * 3)(), (ctypes.c_double * 6)()
        _engine.check(_engine.lib.eventgan_shape(self._handle, images.height, images.width, images.count, threads,
                                                 shape, to_volume))
        return tuple(shape), np.array(to_volume).reshape(2, 3)

    def many(self, previous: npt.ArrayLike, following: npt.ArrayLike, threads: int = 1) -> np.ndarray:
        """Volumes of N pairs: images [N, H, W] or [N, H, W, 3] -> float32 [N, 2B, H, W], by this many threads,
        which end with the call; by no more than there are cores."""
        threads = min(_whole(threads, "threads"), len(os.sched_getaffinity(0)))
        before, after = _engine.pair(_array(previous, "previous"), _array(following, "following"), True)
        volumes = np.empty((before.count, *self._shape(before, threads)[0]), np.float32)
        next_pair = ctypes.c_int64(0)  # which the threads count up
        faults: list[Exception] = []

        def make(most: int) -> None:
            try:
                _engine.check(_engine.lib.eventgan_generate(
                    self._handle, before.pointer, after.pointer, 0, _engine.address(volumes), volumes.size,
                    ctypes.byref(next_pair), most))
            except Exception as error:
                faults.append(error)

        others = [threading.Thread(target=make, args=(before.count,), daemon=True)
                  for _ in range(min(threads, before.count) - 1)]
        try:
            with contextlib.suppress(RuntimeError):  # no room for another thread: those that are there do it
                for other in others:
                    other.start()
            while next_pair.value < before.count:
                make(1)  # one at a time: Ctrl-C is heard between them
        finally:
            next_pair.value = before.count
            for other in others:
                if other.ident:
                    other.join()
        if faults:
            raise faults[0]
        return volumes

    def sample(self, previous: npt.ArrayLike, following: npt.ArrayLike, *, boxes: npt.ArrayLike | None = None,
               joints: npt.ArrayLike | None = None, gap: int = 1, draw: int = 0) -> dict[str, Any]:
        """The volume with what a shard has beside it.

        Parameters
        ----------
        previous, following : array_like, [H, W] or [H, W, 3]
            As of a call.
        boxes : array_like, [n, 4], optional
            Left, top, right, bottom in pixels of the image, by edges: a whole image is 0, 0, W, H.
        joints : array_like, [P, J, 2], optional
            x, y in pixels of the image, whose centres are whole numbers; NaN: not annotated.
        gap : int, default 1
            The gap between the images in frames; only for the flag that the network was not trained on such a gap.
        draw : int, default 0
            As of a call.

        Returns
        -------
        dict
            volume : float32 [2B, H, W]
            statistics : dict, as in `Shards`: nonzero_fraction, max, sum_positive, sum_negative, flags, eta98; if the
                scope is a part, generated_fraction and tiles
            threshold : float, drawn for the pair, if sensor={"threshold": ...} was given
            source_to_volume : float64 [2, 3], the map of points (pixel centres are whole numbers)
            boxes : dict with xyxy, clipped to what the volume shows of the image, and xyxy_unclipped, if boxes were
                given; row for row
            joints : float64 [P, J, 2] in volume pixels, if joints were given
        """
        before, after = _engine.pair(_array(previous, "previous"), _array(following, "following"))
        volume_shape, to_volume = self._shape(before)
        volume, notes = np.empty(volume_shape, np.float32), ctypes.c_char_p()
        sample: dict[str, Any] = {"volume": volume, "statistics": None, "source_to_volume": to_volume}
        labels = _engine.Labels(box_count=-1, person_count=-1)
        if boxes is not None:
            boxes = _numbers(boxes, "boxes")
            if boxes.shape == (0,):  # an empty list
                boxes = boxes.reshape(0, 4)
            if boxes.ndim != 2 or boxes.shape[1] != 4:
                raise ValueError(f"expected boxes [n, 4], got shape {_engine.shape_text(boxes)}")
            clipped, unclipped = np.empty(boxes.shape), np.empty(boxes.shape)
            labels.boxes, labels.box_count = _engine.address(boxes), len(boxes)
            labels.clipped, labels.unclipped = _engine.address(clipped), _engine.address(unclipped)
            sample["boxes"] = {"xyxy": clipped, "xyxy_unclipped": unclipped}
        if joints is not None:
            joints = _numbers(joints, "joints")
            if joints.shape == (0,):
                joints = joints.reshape(0, 0, 2)
            if joints.ndim != 3 or joints.shape[2] != 2:
                raise ValueError(f"expected joints [P, J, 2], got shape {_engine.shape_text(joints)}")
            sample["joints"] = np.empty(joints.shape)
            labels.joints, labels.placed = _engine.address(joints), _engine.address(sample["joints"])
            labels.person_count, labels.joint_count = joints.shape[:2]
        _engine.check(_engine.lib.eventgan_sample(
            self._handle, before.pointer, after.pointer, ctypes.byref(labels), _whole(gap, "gap"),
            _whole(draw, "draw", 0, 2**64 - 1), _engine.address(volume), volume.size, ctypes.byref(notes)))
        sample.update(json.loads(notes.value or b""))
        if "tiles" in sample["statistics"]:
            sample["statistics"]["tiles"] = np.array(sample["statistics"]["tiles"], np.uint8)
        return sample

    def prepare(self, image: npt.ArrayLike) -> np.ndarray:
        """uint8 [H, W]: an image as the network sees it: grey, resized, blurred, at its place in the volume."""
        images = _engine.Images(_array(image, "image"), "image")
        grey = np.empty(self._shape(images)[0][1:], np.uint8)
        _engine.check(_engine.lib.eventgan_prepare(self._handle, images.pointer, _engine.address(grey), grey.size))
        return grey

    def source_to_volume(self, height: int, width: int) -> np.ndarray:
        """float64 [2, 3]: the map of points of an image of that size to those of the volume."""
        to_volume = (ctypes.c_double * 6)()
        _engine.check(_engine.lib.eventgan_shape(self._handle, _whole(height, "height"), _whole(width, "width"), 0, 1,
                                                 None, to_volume))
        return np.array(to_volume).reshape(2, 3)


def sample_events(volume: npt.ArrayLike, *, duration_s: float = 1.0, seed: int = 0,
                  counts: str = "poisson") -> np.ndarray:
    """Events that could have made the volume, as `eventgan export --to events` draws them.

    Parameters
    ----------
    volume : array_like, float32 [2B, H, W], finite, >= 0
    duration_s : float
        Time between the two images, seconds.
    seed : int
    counts : {"poisson", "rounded"}
        How many events a value becomes: a draw with that mean, or the nearest whole number.

    Returns
    -------
    numpy.ndarray
        Structured, in time order: t (float64, seconds from 0 to duration_s), x and y (int32, pixels), p (int8, 1
        positive, 0 negative).
    """
    if counts not in ("poisson", "rounded"):
        raise ValueError(f"expected counts to be of poisson, rounded, got {counts!r}")
    volume = _numbers(volume, "volume", np.float32)
    if volume.ndim != 3 or volume.shape[0] < 2 or volume.shape[0] % 2 != 0:
        raise ValueError(f"expected a volume [2B, H, W], got shape {_engine.shape_text(volume)}")
    channels, height, width = volume.shape
    events, count = ctypes.c_void_p(), ctypes.c_uint64()
    _engine.check(_engine.lib.eventgan_sample_events(
        _engine.address(volume), channels // 2, height, width, float(duration_s),
        _whole(seed, "seed", 0, 2**63 - 1), counts == "rounded", ctypes.byref(events), ctypes.byref(count)))
    try:
        rows = np.empty(count.value, _engine.EVENT)
        ctypes.memmove(_engine.address(rows), events, rows.nbytes)
        return rows
    finally:
        _engine.lib.eventgan_free_events(events)


def represent(events: Any, representation: str, *, size: tuple[int, int],
              window_s: tuple[float, float] | None = None) -> np.ndarray:
    """Events, a camera's or drawn ones, as the array that a network takes.

    Parameters
    ----------
    events : structured array, or dictionary of arrays, in time order
        x and y in whole pixels; p (also pol, polarity), 1 or True: positive, and of the others either all 0 or all -1
        (also 255, 65535, 4294967295: -1 of an unsigned type); t (also ts, timestamp), seconds if floating-point,
        microseconds if whole.
    representation : str
        "histogram:10". Of these, where B, T, K are whole numbers and TAU is in seconds:

{table}
    size : (int, int)
        Height and width of the array, pixels. Events outside are an error.
    window_s : (float, float), optional
        t1 and tN in seconds on the events' clock; only events from t1 to tN count. None: the first and the last
        event's times.

    Returns
    -------
    numpy.ndarray
        Zeros where there are no events.

    Raises
    ------
    ValueError
        Not events in time order at whole pixels of the image, other polarities, or another representation.
    """
    height, width = (_whole(side, "a side of size") for side in sides(size))
    columns = [_event_column(events, names) for names in
               (("t", "ts", "timestamp"), ("x",), ("y",), ("p", "pol", "polarity"))]
    times = columns[0]
    if not (times[1:] >= times[:-1]).all():
        raise ValueError("expected events in time order, got another order, or times that are NaN")
    unit = 1.0 if times.dtype.kind == "f" else 1e-6
    if window_s is not None:
        ends_s = _numbers(window_s, "window_s")
        if ends_s.shape != (2,):
            raise ValueError(f"expected a window of two times, got {window_s!r} for window_s")
        begin, end = ends_s.tolist()
        # Whole microseconds are not exact in seconds: what rounding lost must not cost the events at t1 and at tN.
        lost = 0 if unit == 1 else 2 * np.spacing(np.abs(ends_s))
        first, last = (ends_s + np.array([-1, 1]) * lost) / unit
        within = slice(np.searchsorted(times, first), np.searchsorted(times, last, side="right"))
        columns = [column[within] for column in columns]
    rows = np.zeros(len(columns[0]), _engine.EVENT)
    # A clock of the day in microseconds has more digits than seconds in float64, so times count from the first one.
    first = columns[0][0] if len(rows) else 0
    times = columns[0] if unit == 1 else columns[0].astype(np.uint64)  # whole ones of any type differ exactly in this
    rows["t"] = (times - times[:1]) * unit
    ends = None
    if window_s is not None:
        low, high = float(begin - first * unit), float(end - first * unit)
        ends, rows["t"] = (ctypes.c_double * 2)(low, high), rows["t"].clip(low, high)  # what rounding put outside
    for name, column in zip("xy", columns[1:]):
        with np.errstate(invalid="ignore"):
            rows[name] = column
        wrong = column[rows[name] != column]
        if len(wrong):
            raise ValueError(f"expected whole pixels inside {width}x{height}, got {wrong[0]} for {name}")
    rows["p"] = columns[3] == 1
    off = columns[3][columns[3] != 1].astype(float)
    off[np.isin(off, [2**8 - 1, 2**16 - 1, 2**32 - 1])] = -1  # as convert reads it
    wrong = ~np.isin(off, [-1, 0]) | (off != off[:1])
    if wrong.any():
        at = wrong.argmax()
        raise ValueError(f"expected polarities -1 and 1 or 0 and 1, got {off[at]:.12g}"
                         + (f" after {off[0]:.12g}" if at else ""))
    channels, number = ctypes.c_int32(), ctypes.c_int32()

    def call(values: int | None, nbytes: int) -> None:
        _engine.check(_engine.lib.eventgan_represent(
            _engine.address(rows), len(rows), str(representation).encode(), height, width, ends,
            ctypes.byref(channels), ctypes.byref(number), values, nbytes))

    call(None, 0)
    shape = (channels.value, height, width) if channels.value else (height, width)
    array = np.empty(shape, np.float32 if number.value else np.uint8)
    call(_engine.address(array), array.nbytes)
    return array


represent.__doc__ = (represent.__doc__ or "").replace("{table}", "\n".join(
    f"        {word}{number and ':' + number} : {dtype} {shape}\n            {equation}; for {readers}"
    for word, number, shape, dtype, equation, readers in (
        row.split("\t") for row in _engine.lib.eventgan_representations().decode().splitlines())))


def _event_column(events: Any, names: tuple[str, ...]) -> np.ndarray:
    """[N], the numbers of the first of these names that there is."""
    known = getattr(getattr(events, "dtype", None), "names", None) or getattr(events, "keys", tuple)()
    name = next((name for name in names if name in known), None)
    if name is None:
        raise ValueError(f"expected events with {' or '.join(names)}, got {', '.join(known) or type(events).__name__}")
    column = np.asarray(events[name])
    if column.ndim != 1 or column.dtype.kind not in "biuf":
        raise ValueError(f"expected numbers [N], got {column.dtype} {_engine.shape_text(column)} for {name}")
    return column


def _weights(given: PathLike | None) -> str | None:
    """A name unchanged; a file by its absolute path, so that a worker spawned in another folder finds it."""
    if given is None or isinstance(given, str) and re.fullmatch("(shipped|untrained)(:.*)?", given):
        return given
    if not isinstance(given, (str, os.PathLike)):
        raise ValueError(f"expected weights by their name or file, got {given!r}")
    return os.path.abspath(os.fspath(given))


def _json(manifest: Mapping[str, Any]) -> str:
    try:
        return json.dumps(manifest, default=lambda value: value.item() if isinstance(value, np.generic) else str(value))
    except (TypeError, ValueError) as error:
        raise ValueError(f"expected settings that JSON can hold, got {error}") from error


def _whole(value: Any, name: str, least: int = 1, most: int = 2**31 - 1) -> int:
    try:
        number = operator.index(value)
    except TypeError:
        number = None
    if number is None or not least <= number <= most:
        raise ValueError(f"expected {name} to be a whole number from {least} to {most}, got {value!r}")
    return number


def _array(image: npt.ArrayLike, name: str) -> np.ndarray:
    if isinstance(image, (str, bytes, os.PathLike)):
        raise ValueError(f"expected an image array, got a path for {name}: read it first, as "
                         f"np.asarray(PIL.Image.open({os.fspath(image)!r})) does")
    try:
        return np.asarray(image)
    except (TypeError, ValueError, RuntimeError) as error:
        raise ValueError(f"expected an image as an array, got {type(image).__name__} for {name}: {error}") from error


def _numbers(values: npt.ArrayLike, name: str, dtype: npt.DTypeLike = np.float64) -> np.ndarray:
    try:
        return np.require(values, dtype, ("C_CONTIGUOUS", "ALIGNED"))
    except (TypeError, ValueError, RuntimeError) as error:
        raise ValueError(f"expected numbers, got {type(values).__name__} for {name}: {error}") from error

"""Event volumes made on the fly from pairs of images: `eventgan.torch.FramePairs`."""

from __future__ import annotations

import collections
import contextlib
import dataclasses
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import torch
from torch.utils.data import Dataset

from .augmentation import EventAugmentation, Item, detection_item, moved, numbered
from .detection_scores import DONT_CARE

if TYPE_CHECKING:
    from .generator import Generator


@dataclasses.dataclass(frozen=True)
class FrameAugmentation:
    """Random changes of a pair of images before there are events, which no change of a volume can imitate.

    Parameters
    ----------
    reverse : float
        Probability that time runs backwards: the images are exchanged.
    gain, gamma : (float, float)
        Ranges, drawn uniformly in the logarithm: a value v of an image, from 0 to 1, becomes gain x v^gamma, clipped to
        0..1, as under another exposure. Both images of a pair get the same; a difference would make events everywhere.
    """

    reverse: float = 0.0
    gain: tuple[float, float] = (1.0, 1.0)
    gamma: tuple[float, float] = (1.0, 1.0)

    def __post_init__(self) -> None:
        if not 0 <= self.reverse <= 1:
            raise ValueError(f"expected reverse to be a probability, got {self.reverse}")
        for name in ("gain", "gamma"):
            first, last = getattr(self, name)
            if not 0 < first <= last < math.inf:
                raise ValueError(f"expected {name} to be a range of numbers above 0, got {first}, {last}")


class Drawn(NamedTuple):
    """What was drawn for an item."""

    gap: int                  # frames between the images of a clip; 1 where the source has pairs
    reversed: bool
    gain: float
    gamma: float
    generator: int            # its place among the generators
    draw: int                 # of its thresholds, noise and events (`Generator.draws`); 0 where it draws nothing
    augmentation_seed: int    # of EventAugmentation's numbers


class CacheInfo(NamedTuple):
    """How often a volume was found in the cache and how often not, and the bytes it holds."""

    hits: int
    misses: int
    bytes: int


class FramePairs(Dataset):
    """Volumes made from pairs of images when they are asked for: no shards on disk, and other volumes in each epoch.

    What is drawn for an item, thresholds, noise and events of the generator's sensor too, depends on (seed, epoch,
    index) alone, not on the worker, the order or the batch. Call `set_epoch` before each epoch.

    If the target has boxes, an item is one of `DetectionDataset`, so `collate_yolo` and `collate_torchvision` take it;
    its `label_position` is 1 if the target belongs to the image at the end of time, 0 for the one at the start. With
    any other target it is (volume, target), float32 [2B, H, W]: batches need volumes of one size, which a generator's
    `size` gives.

    A target with boxes is a dictionary:

    boxes     [n, 4], left, top, right, bottom in pixels of the image, by edges: a whole image is 0, 0, W, H
    labels    [n], whole numbers from 0, below 0 for ignored boxes; with `classes` names, DontCare for ignored boxes
    ignore    [n] bool, optional
    id        str, optional; by default the item's index

    Parameters
    ----------
    generator : Generator, or a sequence of them
        Of several, one is drawn for each item: of sensors with other thresholds or of other weights, all with one
        number of bins.
    source : sequence or callable
        source[i], or source(i), is (previous, following, target), or with `gap` a clip: (frames, ..., target), as in
        torchvision's datasets of videos, whose sound is ignored. An image is a file's path, or an array or tensor,
        uint8 or floating-point numbers from 0 to 1: [H, W], [H, W, 3], [H, W, 1], [3, H, W] or [1, H, W]. `frames` is a
        sequence of images, such as [T, H, W, 3] or [T, 3, H, W].
    gap : int or (int, int), optional
        The source has clips, from which two frames that far apart are taken; from a range (first, last) it is drawn.
        None: the source has pairs.
    label_frame : int, default -1
        The frame of a clip that the target belongs to; negative numbers count from its end. It is the end of the pair,
        so at least the largest gap must lie between it and the clip's first frame.
    classes : sequence of str, or mapping of str to int, optional
        As of DetectionDataset; labels are names then, and boxes of other classes are left out.
    frame_augmentation : FrameAugmentation, optional
        A clip's reversed pair is the target's frame and one after it, so that the target stays at the end of time. A
        pair, or a clip without such a frame, has its images exchanged: then the target belongs to the start of time.
        Targets of a whole clip, such as its class, stay true unless they are a direction ("opening a door"); boxes are
        where things were at that end.
    augmentation : EventAugmentation, optional
        Changes volume and boxes alike.
    seed : int, default 0
    cache_bytes : int, default 0
        How many bytes of the volumes last used are kept, before `augmentation`. Another gap, gain, gamma, direction or
        generator is another volume: one drawn from a continuous range never comes again, nor does one of a generator
        that draws (`Generator.draws`). Each worker has its own cache, which ends with it: it is of use between epochs
        with persistent_workers=True, if an item comes to the same worker again.
    length : int, optional
        The number of items, if `source` is a callable.

    Raises
    ------
    ValueError
        An image, a clip or a target is not valid; the message names the index.
    FileNotFoundError
        There is no such image.

    Examples
    --------
    >>> generator = eventgan.Generator("shipped:8", size=(256, 320), fit="letterbox")
    >>> pairs = FramePairs(generator, [("0.png", "1.png", {"boxes": [[0, 0, 20, 40]], "labels": ["car"]})],
    ...                    classes=["car"])
    >>> clips = FramePairs(generator, torchvision.datasets.UCF101("videos", "lists", frames_per_clip=7), gap=(1, 6))
    """

    def __init__(self, generator: Generator | Sequence[Generator], source: Sequence[Any] | Callable[[int], Any], *,
                 gap: int | tuple[int, int] | None = None, label_frame: int = -1,
                 classes: Sequence[str] | Mapping[str, int] | None = None,
                 frame_augmentation: FrameAugmentation | None = None, augmentation: EventAugmentation | None = None,
                 seed: int = 0, cache_bytes: int = 0, length: int | None = None) -> None:
        self._generators = list(generator) if isinstance(generator, Sequence) else [generator]
        if len({each.bins for each in self._generators}) != 1:
            raise ValueError("expected generators with one number of bins, got "
                             f"{[each.bins for each in self._generators]}")
        self._source: Any = source
        if length is None and not hasattr(source, "__len__"):
            raise ValueError(f"expected a source with a length, or `length`, got {type(source).__name__} alone")
        self._length = len(self._source) if length is None else length
        self._gaps = None if gap is None else (gap, gap) if isinstance(gap, int) else tuple(gap)
        if self._gaps and not 1 <= self._gaps[0] <= self._gaps[1]:
            raise ValueError(f"expected gaps of at least 1 frame, the smaller one first, got {gap}")
        if not 0 <= seed < 2**64:
            raise ValueError(f"expected a seed from 0 to 2^64 - 1, got {seed}")
        self._label_frame, self._seed = label_frame, seed
        self.classes = None if classes is None else numbered(classes)
        self._frame_augmentation, self._augmentation = frame_augmentation or FrameAugmentation(), augmentation
        self._cache = _Cache(cache_bytes)
        self._epoch = torch.zeros((), dtype=torch.int64)
        self._share_epoch()

    def _share_epoch(self) -> None:
        self._epoch.share_memory_()  # so that `set_epoch` reaches persistent workers

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._share_epoch()

    def __len__(self) -> int:
        return self._length

    def set_epoch(self, epoch: int) -> None:
        """Draws for epoch `epoch` (>= 0) from now on, in running workers, too."""
        if epoch < 0:
            raise ValueError(f"expected an epoch of at least 0, got {epoch}")
        self._epoch.fill_(epoch)

    def drawn(self, index: int) -> Drawn:
        """What item `index` is made with in this epoch."""
        philox = np.random.Philox(counter=[0, 0, self._number(index), int(self._epoch)], key=self._seed)
        raw = philox.random_raw(7)
        gap, reverse, gain, gamma, generator = ((raw[:5] >> np.uint64(11)) * 2.0**-53).tolist()
        first, last = self._gaps or (1, 1)
        may = self._frame_augmentation
        place = int(generator * len(self._generators))
        return Drawn(first + int(gap * (last - first + 1)), reverse < may.reverse, _between(may.gain, gain),
                     _between(may.gamma, gamma), place, int(raw[6]) if self._generators[place].draws else 0,
                     int(raw[5] >> np.uint64(1)))

    def cache_info(self) -> CacheInfo:
        """Of this process's cache, since it was made."""
        return self._cache.info()

    def __getitem__(self, index: int) -> Item | tuple[torch.Tensor, Any]:
        index = self._number(index)
        drawn = self.drawn(index)
        made = self._cache.get((index, drawn[:-1]), lambda: self._made(index, drawn))
        volume = torch.from_numpy(made.volume)
        with _drawing_from(drawn.augmentation_seed):
            if made.boxes is None:
                return moved(volume, made.label_position, self._augmentation)[0], made.target
            item = detection_item(volume, *made.boxes, made.label_position, self._augmentation)
        return {**item, "id": str(made.target.get("id", index)), "index": index, "label_position": made.label_position}

    def _number(self, index: int) -> int:
        if not -len(self) <= index < len(self):
            raise IndexError(f"expected an item of {len(self)}, got number {index}")
        return int(index) % len(self)

    def _made(self, index: int, drawn: Drawn) -> _Made:
        item = self._source[index] if hasattr(self._source, "__getitem__") else self._source(index)
        try:
            previous, following, target, label_position = self._pair(item, drawn)
            images = [_exposed(_image(image), drawn.gain, drawn.gamma) for image in (previous, following)]
            generator = self._generators[drawn.generator]
            if not isinstance(target, Mapping) or "boxes" not in target:
                return _Made(generator(*images, draw=drawn.draw), target, None, label_position)
            boxes, labels, ignore = self._boxes(target)
            sample = generator.sample(*images, boxes=boxes, gap=drawn.gap, draw=drawn.draw)
            return _Made(sample["volume"], target,
                         (sample["boxes"]["xyxy"], sample["boxes"]["xyxy_unclipped"], labels, ignore), label_position)
        except FileNotFoundError as error:
            raise FileNotFoundError(f"{error}, in item {index}") from error
        except ValueError as error:
            raise ValueError(f"{error}, in item {index}") from error

    def _pair(self, item: Any, drawn: Drawn) -> tuple[Any, Any, Any, float]:
        """Previous image, following image, target, label position."""
        if self._gaps is None:
            if not isinstance(item, (tuple, list)) or len(item) != 3:
                raise ValueError(f"expected (previous, following, target), got {_what(item)} (`gap` is for clips)")
            previous, following, target = item
            return (following, previous, target, 0.0) if drawn.reversed else (previous, following, target, 1.0)
        is_clip = isinstance(item, (tuple, list)) and len(item) >= 2
        if not is_clip or not hasattr(item[0], "__len__") or isinstance(item[0], str):
            raise ValueError(f"expected (frames, ..., target), got {_what(item)}")
        frames, target = item[0], item[-1]
        at = self._label_frame + (len(frames) if self._label_frame < 0 else 0)
        if not self._gaps[1] <= at < len(frames):
            raise ValueError(f"expected a clip whose frame {self._label_frame} is at least {self._gaps[1]} behind the "
                             f"first, got {len(frames)} frames")
        before, after = at - drawn.gap, at + drawn.gap
        if not drawn.reversed:
            return frames[before], frames[at], target, 1.0
        if after < len(frames):
            return frames[after], frames[at], target, 1.0
        return frames[at], frames[before], target, 0.0

    def _boxes(self, target: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Boxes [n, 4], labels [n] and ignore [n] of the wanted classes."""
        boxes, labels = np.asarray(target["boxes"], float), np.asarray(target.get("labels", ()))
        if not boxes.size:
            boxes = boxes.reshape(0, 4)
        ignore = np.asarray(target.get("ignore", np.zeros(len(boxes), bool)), bool)
        shapes = boxes.shape, labels.shape, ignore.shape
        if labels.ndim != 1 or shapes != ((len(labels), 4),
                                          (len(labels),), (len(labels),)) or not np.isfinite(boxes).all():
            raise ValueError("expected boxes [n, 4] of finite numbers, labels [n] and ignore [n], "
                             f"got {', '.join(map(str, shapes))}")
        if self.classes is not None:
            names = labels.tolist()
            if not all(isinstance(name, str) for name in names):
                raise ValueError(f"expected names of classes as labels, got {names}")
            ignored = np.array([name == DONT_CARE for name in names], bool)
            labels = np.array([self.classes.get(name, -1) for name in names], np.int64)
            kept = (labels >= 0) | ignored
            return boxes[kept], labels[kept], (ignore | ignored)[kept]
        if len(labels) and labels.dtype.kind not in "iu":
            raise ValueError(f"expected whole numbers as labels, got {labels.dtype} (names need `classes`)")
        labels = labels.astype(np.int64)
        return boxes, labels, ignore | (labels < 0)


class _Made(NamedTuple):
    volume: np.ndarray        # [2B, H, W]
    target: Any
    # [n, 4] in volume pixels, the same before clipping, labels, ignore
    boxes: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None
    label_position: float


class _Cache:
    """The volumes last used, up to a number of bytes."""

    def __init__(self, most_bytes: int) -> None:
        self._most = most_bytes
        self._forget()

    def _forget(self) -> None:
        self._kept: collections.OrderedDict[Any, _Made] = collections.OrderedDict()
        self._bytes = self._hits = self._misses = 0

    def __getstate__(self) -> dict[str, Any]:
        return {"_most": self._most}  # a spawned worker makes its own

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._most = state["_most"]
        self._forget()

    def info(self) -> CacheInfo:
        return CacheInfo(self._hits, self._misses, self._bytes)

    def get(self, key: Any, make: Callable[[], _Made]) -> _Made:
        """What is kept for the key, else the result of `make`; its volume is a copy."""
        made = self._kept.get(key)
        if made is None:
            self._misses += 1
            made = make()
            if made.volume.nbytes > self._most:
                return made
            self._kept[key] = made
            self._bytes += made.volume.nbytes
            while self._bytes > self._most:
                self._bytes -= self._kept.popitem(last=False)[1].volume.nbytes
        else:
            self._hits += 1
            self._kept.move_to_end(key)
        return made._replace(volume=made.volume.copy())


def _between(limits: tuple[float, float], share: float) -> float:
    return limits[0] * (limits[1] / limits[0]) ** share


@contextlib.contextmanager
def _drawing_from(seed: int) -> Iterator[None]:
    """Seeds PyTorch's random numbers, which afterwards go on as if nothing had been drawn."""
    with torch.random.fork_rng(devices=[]):
        torch.default_generator.manual_seed(seed)
        yield


def _image(image: Any) -> np.ndarray:
    """[H, W] or [H, W, 3] red, green, blue."""
    if isinstance(image, (str, os.PathLike)):
        return _read(os.fspath(image))
    try:
        image = np.asarray(image)
    except (TypeError, RuntimeError) as error:  # such as a tensor of a GPU
        raise ValueError(f"expected an image, got what NumPy does not take: {error}") from error
    has_channels = image.ndim == 3 and {image.shape[0], image.shape[2]} & {1, 3}
    if image.dtype == object or image.ndim != 2 and not has_channels:
        raise ValueError(f"expected an image [H, W], [H, W, 3] or [3, H, W], or a file, got {_what(image)}")
    if image.ndim == 3 and image.shape[2] not in (1, 3):
        image = np.moveaxis(image, 0, 2)
    return image[..., 0] if image.ndim == 3 and image.shape[2] == 1 else image


def _read(path: str) -> np.ndarray:
    """The image of a file, upright, as `_image` has it."""
    if not os.path.isfile(path):
        raise FileNotFoundError(f"expected an image, got no such file, in {path}")
    try:
        import cv2
    except ImportError:
        return _read_by_pillow(path)
    image = cv2.imread(path, cv2.IMREAD_ANYCOLOR)
    if image is None:
        raise ValueError(f"expected an image, got none, in {path}")
    return cv2.cvtColor(image, cv2.COLOR_BGR2RGB) if image.ndim == 3 else image


def _read_by_pillow(path: str) -> np.ndarray:
    import PIL.Image
    import PIL.ImageOps

    try:
        with PIL.Image.open(path) as file:
            image = PIL.ImageOps.exif_transpose(file)
            if image.mode[0] in "IF":
                raise ValueError(f"expected 8 bits a value, got {image.mode}, in {path}")
            return np.asarray(image.convert("L" if image.mode in ("1", "L", "LA") else "RGB"))
    except (OSError, SyntaxError) as error:  # a broken PNG raises SyntaxError
        raise ValueError(f"expected an image, got none ({error}), in {path}") from error


def _exposed(image: np.ndarray, gain: float, gamma: float) -> np.ndarray:
    """The image with each value v, from 0 to 1, replaced by gain x v^gamma."""
    if gain == gamma == 1:
        return image
    if image.dtype == np.uint8:
        table = np.round(255 * np.minimum(gain * (np.arange(256) / 255) ** gamma, 1)).astype(np.uint8).tobytes()
        # 3x faster than table[image]
        return np.frombuffer(image.tobytes().translate(table), np.uint8).reshape(image.shape)
    if image.dtype.kind != "f" or not ((image >= 0) & (image <= 1)).all():
        raise ValueError(f"expected an image of uint8 or of numbers from 0 to 1, got {_what(image)}")
    return np.minimum(gain * image**gamma, 1)


def _what(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {list(value.shape)}"
    return f"a {type(value).__name__} of {len(value)}" if isinstance(value, (tuple, list)) else type(value).__name__

"""Event-camera training data from frames: volumes of two images, and shards of volumes with their labels.

    import eventgan

    generator = eventgan.Generator("shipped:8")
    volume = generator(previous, following)               # float32 [2B, H, W], >= 0, of images [H, W] or [H, W, 3]
    events = eventgan.sample_events(volume, seed=0)       # structured array t, x, y, p

    for sample in eventgan.Shards("out", split="train"):  # a folder of `eventgan convert`, a shard, or a list of shards
        sample["volume"], sample["boxes"]["xyxy"], sample["persons"]["joints"]

`eventgan.torch` has PyTorch's datasets, `eventgan.evaluate` scores what a network finds. Each name is loaded when it is
first used: `Shards` needs h5py, `Generator` libeventgan, `show` matplotlib. manifests/guides/python.md shows
all of it at work.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from . import evaluate, shards, torch
    from .generator import Generator, represent, sample_events
    from .open_shards import Sample, open_shard
    from .outlines import mask, rings
    from .plotting import show
    from .program import ProgramError, convert, init, open
    from .representations import signed_channel
    from .shard_folder import read_description
    from .shards import FIELDS, InvalidSample, Shards

__version__ = "1.0.0"

_MODULE_OF = {
    "Generator": "generator", "represent": "generator", "sample_events": "generator", "FIELDS": "shards",
    "InvalidSample": "shards", "Sample": "open_shards", "Shards": "shards", "open_shard": "open_shards",
    "read_description": "shard_folder", "ProgramError": "program", "convert": "program", "init": "program",
    "open": "program", "mask": "outlines", "rings": "outlines", "show": "plotting",
    "signed_channel": "representations",
}
_MODULES = ("evaluate", "shards", "torch")

__all__ = [*_MODULE_OF, *_MODULES]


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return importlib.import_module("." + name, __name__)
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module("." + _MODULE_OF[name], __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

"""The shards open in a process: their columns, kept once read, and their volumes, decoded."""

from __future__ import annotations

import collections
import errno
import functools
import json
import os
import re
import warnings
from collections.abc import Iterable, Mapping
from typing import Any, Union

import h5py
import numpy as np

from .remote import Place, RemotePath, close_at_exit, place

FORMAT, FORMAT_VERSION = "eventgan-shard", "1.0"
FEATURES = frozenset(("tiles", "times", "origin", "motion", "threshold", "projection", "flow", "difficulty",
                      "outlines", "object_motion", "person_boxes", "joints3d", "camera", "joint_aliases"))

PathLike = Union[str, os.PathLike]
Sample = dict[str, Any]


class _Kept:
    """What was read from a shard and stays when its file is closed."""

    def __init__(self) -> None:
        self.columns: dict[str, np.ndarray] = {}
        self.groups: dict[str, list[tuple[str, np.ndarray]]] = {}
        self.names: dict[tuple[str, str], list[str]] = {}
        self.paths: set[str] = set()  # of all objects in the file


_SHUFFLE, _DEFLATE, _CHECKSUM = h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_FLETCHER32


@functools.lru_cache(maxsize=None)
def _engine_if_any() -> Any:
    try:
        from . import _engine
    except ImportError:
        return None
    return _engine


class OpenShard:
    """A shard's open file, and the columns read from it."""

    def __init__(self, path: Place, kept: _Kept) -> None:
        self.file = open_shard(path)
        self._kept = kept
        self._volume = self.file["events/volume"]
        self.size = self._volume.shape[2:]  # H, W
        created = self._volume.id.get_create_plist()
        self._filters = [created.get_filter(i)[0] for i in range(created.get_nfilters())]
        self.volumes = f"{' x '.join(map(str, self._volume.shape[1:]))}, {self._volume.dtype}"

    def fit(self) -> str:
        """How images came to the size of the volumes, as in the manifest."""
        return json.loads(self.file.attrs["preprocessing"])["fit"]

    def volume(self, slot: int, decode: bool) -> Sample:
        """`volume`, float32 [2B, H, W]; not decoded as it is stored, with its `scale`."""
        scale = self.column("events/scale")[slot]
        if not decode:
            return {"volume": self._volume[slot], "scale": scale}
        values = self._decoded(slot, scale)
        if values is None:
            values = np.multiply(self._volume[slot], scale, dtype=np.float32)
        return {"volume": values}

    def _decoded(self, slot: int, scale: float) -> np.ndarray | None:
        """The values by libeventgan, in a fraction of the time of h5py's zlib. None without the library, for other
        filters, and for what HDF5 should judge: a chunk that was never written, or is damaged."""
        engine = _engine_if_any()
        if engine is None or self._filters not in ([_SHUFFLE, _CHECKSUM], [_SHUFFLE, _DEFLATE, _CHECKSUM]):
            return None
        try:
            skipped, chunk = self._volume.id.read_direct_chunk((slot, 0, 0, 0))
        except (OSError, RuntimeError, ValueError):
            return None
        values = np.empty(self._volume.shape[1:], np.float32)
        failed = skipped or engine.lib.eventgan_decode(chunk, len(chunk), self._volume.dtype.itemsize,
                                                       _DEFLATE in self._filters, scale, engine.address(values),
                                                       values.size)
        return None if failed else values

    def column(self, name: str) -> np.ndarray:
        """[N, ...] the whole column, kept; text as str."""
        columns = self._kept.columns
        if name not in columns:
            if name not in self.file:
                raise ValueError(f"expected a column {name}, got none, in {self.file.filename}")
            dataset = self.file[name]
            text = h5py.check_string_dtype(dataset.dtype)
            column = (dataset.asstr() if text else dataset)[:]
            columns[name] = column.astype(np.int64) if column.dtype == np.uint32 else column
        return columns[name]

    def has(self, name: str) -> bool:
        """Whether there is an object of this path."""
        if not self._kept.paths:
            self.file.visit(self._kept.paths.add)
        return name in self._kept.paths

    def row(self, group: str, slot: int) -> Sample:
        """A sample's value in each column of a group."""
        return {name: column[slot] for name, column in self._group(group)}

    def rows(self, group: str, slot: int) -> Sample:
        """A sample's rows in each column of a group of labels."""
        first, last = self.column(group + "/offsets")[slot : slot + 2]
        rows = {name: column[first:last] for name, column in self._group(group) if name != "offsets"}
        if "outline" in rows:
            rows["outline"] = np.array([each.tobytes() for each in rows["outline"]], object)
        return rows

    def names(self, item: str, attribute: str) -> list[str]:
        """The names in an attribute; none where it is not."""
        names = self._kept.names
        if (item, attribute) not in names:
            names[item, attribute] = list(self.file[item].attrs.get(attribute, ()))
        return names[item, attribute]

    def joint_places(self, names: Iterable[str]) -> list[int]:
        """The places of joints among the shard's, by name or alias."""
        known, aliases = self.names("labels/poses", "joint_names"), self.names("labels/poses", "joint_aliases")
        places = {**{alias: i for i, alias in enumerate(aliases) if alias}, **{name: i for i, name in enumerate(known)}}
        unknown = [name for name in names if name not in places]
        if unknown:
            also = [alias for alias in aliases if alias and alias not in known]
            raise ValueError(f"expected joints of {', '.join(known)}{' or ' if also else ''}{', '.join(also)}, got "
                             f"{', '.join(unknown)}, in {self.file.filename} (where={{'dataset': ...}}, or --dataset, "
                             "leaves out sources with other joints)")
        return [places[name] for name in names]

    def _group(self, group: str) -> list[tuple[str, np.ndarray]]:
        groups = self._kept.groups
        if group not in groups:
            groups[group] = [(name, self.column(f"{group}/{name}")) for name in self.file[group]]
        return groups[group]


class OpenShards:
    """The shards open in this process, of which the least recently used is closed first,
    and the columns read from all of them."""

    _open: collections.OrderedDict[Place, OpenShard]
    _process: int

    def __init__(self, most: int) -> None:
        self._most = most
        self._forget()

    def __getitem__(self, path: Place) -> OpenShard:
        if self._process != os.getpid():  # HDF5's handles do not survive a fork; columns do
            self._open, self._process = collections.OrderedDict(), os.getpid()
        if path not in self._open:
            while len(self._open) >= self._most:
                self._open.popitem(last=False)[1].file.close()
            self._open[path] = OpenShard(path, self._kept[path])
        self._open.move_to_end(path)
        return self._open[path]

    def close(self) -> None:
        """Closes the files; they are opened again when they are needed."""
        if self._process == os.getpid():
            for shard in self._open.values():
                shard.file.close()
        self._open = collections.OrderedDict()

    def __getstate__(self) -> dict[str, Any]:
        return {"_most": self._most}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._most = state["_most"]
        self._forget()

    def _forget(self) -> None:
        self._open = collections.OrderedDict()
        self._kept: dict[Place, _Kept] = collections.defaultdict(_Kept)
        self._process = os.getpid()


def open_shard(path: PathLike | RemotePath) -> h5py.File:
    """Opens a shard.

    Parameters
    ----------
    path : str or path
        A file, or a URL that fsspec knows.

    Returns
    -------
    h5py.File

    Raises
    ------
    FileNotFoundError
        There is no such file.
    OSError
        It is none.
    ValueError
        It is of another kind or major version.
    """
    path = place(path)
    source: Any = path
    if isinstance(path, RemotePath):
        source = path.open()
    elif not os.path.exists(path):
        raise FileNotFoundError(errno.ENOENT, "expected a folder of shards, or a shard, got no such file",
                                os.fspath(path))
    try:
        file = h5py.File(source, "r", rdcc_nbytes=0)  # each volume is one chunk: a cache is of no use
    except OSError as error:
        raise OSError(f"expected a shard, got what HDF5 does not open ({error}), in {path}") from error
    if source is not path:
        close_at_exit(file)
    try:
        check_version(file.attrs, "format_version", FORMAT, FORMAT_VERSION, path)
    except ValueError:
        file.close()
        raise
    return file


def check_version(found: Mapping[str, Any], key: str, name: str, version: str, path: Place) -> None:
    """Takes every minor version of this major one, and warns once of each feature that is not known."""
    major = version.partition(".")[0]
    got = found.get("format"), found.get(key)
    if got[0] != name or not re.fullmatch(major + r"\.[0-9]+", str(got[1])):
        raise ValueError(f"expected {name} {major}.x, got {got[0]} {got[1]}, in {path}")
    for feature in sorted(set(found.get("features", ())) - FEATURES - _told):
        _told.add(feature)
        warnings.warn(f"{path} has {feature!r}, which this version of eventgan does not know and leaves out",
                      stacklevel=3)


_told: set[str] = set()

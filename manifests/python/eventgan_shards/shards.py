"""The reader: samples of shards as dictionaries of numpy arrays."""

from __future__ import annotations

import collections
import copy
import json
import os
import pathlib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple, Union

import h5py
import numpy as np

FORMAT, FORMAT_VERSION = "eventgan-shard", 1
DESCRIPTION, DESCRIPTION_FORMAT, DESCRIPTION_VERSION = "dataset.json", "eventgan-dataset", 1
VIEW = "dataset.h5"
FIELDS = ("volume", "pair", "statistics", "boxes", "persons", "original")

PathLike = Union[str, os.PathLike]
Sample = dict[str, Any]


class InvalidSample(ValueError):
    """A sample that eventgan put into quarantine was asked for."""


class Shards(Sequence):
    """The samples of one or more shards, in the order of the shards and their slots.

    shards[i] is a sample (see `sample`), shards[i:j] or shards[[i, j, ...]] a Shards of those alone.

    paths: a folder, its dataset.h5, one shard, or a list of shards. Of a folder that `eventgan finalize` has completed, the
        shards that its dataset.json lists, in the order of the plan: a shard that is gone or another one by now is a
        ValueError. Of any other folder all shards that are done, so those with a marker, by name.
    split: only the shards of this split ("train"...).
    ids: only samples with these ids: a list, or a text file with one a line. Their order stays that of the shards.
    where: only samples whose value is one of those given, by column: {"gap": 1, "class": ["Car", "Van"]}. `class` means
        a box of that class that is not to be ignored, `gap` is gap_frames; any other key is a column of /pairs:
        sequence, subject, action, camera, dataset...
    A split, an id or a value that no sample has is a ValueError: nothing is silently missing.
    invalid: what to do about quarantined samples. "skip": they are not part of the sequence. "raise": they are, and
        reading one raises InvalidSample. "keep": they come with a volume of zeros and `valid` False.
    fields: what a sample holds; of FIELDS. What is not asked for is not read.
    decode: False leaves a volume as it is stored (uint8, float16 or float32) with its `scale` beside it, to be
        decoded elsewhere: value = stored number x scale.
    open_files: how many shards stay open at a time (about half a megabyte each).

    The labels of a shard are read once, when they are first needed, and kept. Files are opened anew in every process:
    an object can go to workers that are forked or spawned. One object must not be used by several threads at a time.
    """

    def __init__(self, paths: PathLike | Iterable[PathLike], *, split: str | None = None,
                 ids: PathLike | Iterable[str] | None = None, where: Mapping[str, Any] | None = None,
                 invalid: str = "skip", fields: Iterable[str] = FIELDS, decode: bool = True, open_files: int = 128):
        _one_of("invalid", [invalid], ("skip", "raise", "keep"))
        _one_of("fields", fields, FIELDS)
        if open_files < 1:
            raise ValueError(f"expected open_files of at least 1, got {open_files}")
        self._invalid, self._fields, self._decode = invalid, frozenset(fields), decode
        self._files = _Files(open_files)
        self._where_from = str(paths)
        shards = _find_shards(paths)
        if split is not None:
            shards = [shard for shard in shards if self._split(shard) == split]
            if not shards:
                raise ValueError(f"expected shards of split {split!r}, got none, in {self._where_from}")
        self.paths = [shard.path for shard in shards]
        slots = [self._slots_of(shard) for shard in shards]
        self._shard = np.repeat(np.arange(len(slots), dtype=np.int32), [len(each) for each in slots])
        self._slot = np.concatenate([*slots, np.empty(0, np.int32)]).astype(np.int32)
        if ids is not None:
            self._keep(self._with_ids(ids))
        for key, values in (where or {}).items():
            self._keep(self._with_values(key, values))

    def __len__(self) -> int:
        return len(self._slot)

    def __getitem__(self, index):
        if isinstance(index, (slice, Sequence, np.ndarray)):
            chosen = copy.copy(self)
            chosen._keep(index)
            return chosen
        return self.sample(index, self._fields)

    def __enter__(self) -> Shards:
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def close(self) -> None:
        """Closes the files; reading goes on by opening them again."""
        self._files.close()

    def labels(self, index: int) -> Sample:
        """Sample `index` without its volume, which is not touched."""
        return self.sample(index, self._fields - {"volume"})

    def sample(self, index: int, fields: Iterable[str] = FIELDS) -> Sample:
        """One sample, a dictionary of the fields asked for; keys are shard_format.md's names:

        volume        float32 [2B, H, W], >= 0 (decode=False: as stored, and `scale`, float32)
        pair          everything of /pairs: texts, numbers, `source_to_volume` [2, 3]; KITTI's `projection` [3, 4], if it is there
        statistics    everything of /events/statistics, eta98, and `tiles` [R, C] where only some were generated; flags as int64,
                      since PyTorch has no uint32
        boxes         arrays with a row for each box: xyxy [n, 4] in volume pixels, class_id, ignore...
        persons       arrays with a row for each person: joints [n, J, 2] in volume pixels, visible, center...
        original      bytes, the annotation as the dataset holds it
        and always    valid, bool; shard, slot: where it comes from
        """
        path, slot = self._place(index)
        file = self._files[path]
        valid = bool(file.column("valid")[slot])
        if self._invalid == "raise" and not valid:
            raise InvalidSample(_reason(path, slot))
        sample: Sample = {}
        if "volume" in fields:
            sample.update(file.volume(slot, self._decode))
        if "pair" in fields:
            sample["pair"] = file.row("pairs", slot)
            for name in file.optional("labels/projection", "labels/projection_source"):
                sample["pair"][name.removeprefix("labels/")] = file.column(name)[slot]
        if "statistics" in fields:
            sample["statistics"] = {**file.row("events/statistics", slot), "eta98": file.column("events/eta98")[slot]}
            for name in file.optional("events/tiles"):
                sample["statistics"]["tiles"] = file.column(name)[slot]
        if "boxes" in fields:
            sample["boxes"] = file.rows("labels/boxes", slot)
        if "persons" in fields:
            sample["persons"] = file.rows("labels/poses", slot)
        if "original" in fields:
            sample["original"] = file.column("labels/original")[slot].tobytes()
        return {**sample, "valid": valid, "shard": str(path), "slot": slot}

    def column(self, name: str) -> np.ndarray:
        """[len(self), ...]: a column of /pairs (or "gap") of every sample, read without volumes or boxes."""
        name = {"gap": "gap_frames"}.get(name, name)
        return self._gathered(lambda file: file.column("pairs/" + name))

    @property
    def persons(self) -> np.ndarray:
        """int64 [persons, 2]: of every person the sample's index here and its row there. Volumes are not touched."""
        counts = self._gathered(lambda file: np.diff(file.column("labels/poses/offsets")))
        first = np.cumsum(counts) - counts
        samples = np.repeat(np.arange(len(self)), counts)
        return np.stack([samples, np.arange(len(samples)) - first[samples]], axis=1) if len(samples) else np.empty((0, 2), int)

    def picture_area(self) -> np.ndarray:
        """float64 [4]: left, top, right, bottom in volume pixels (edges) around what the samples' pictures cover, all together. What
        is outside is the border that a letterbox adds and never holds events."""
        maps, sizes = self.column("source_to_volume").reshape(-1, 2, 3), self.column("source_size").reshape(-1, 2)
        if np.isnan(maps).all():
            raise ValueError(f"expected samples with pictures, got none, in {self._where_from}")
        scale = maps[:, [0, 1], [0, 1]]
        low = maps[:, :, 2] - scale / 2 + 0.5
        volumes = self._gathered(lambda file: np.tile(file.size[::-1], (len(file.column("valid")), 1)))
        high = np.minimum(low + scale * sizes[:, ::-1], volumes)
        return np.concatenate([np.nanmin(np.maximum(low, 0), axis=0), np.nanmax(high, axis=0)])

    def divide(self, fraction: float, by: str = "sequence", seed: int = 0) -> tuple[Shards, Shards]:
        """Two parts, the first of about `fraction` of the samples, that share no value of column `by`: no drive, no
        subject is in both. Which groups are in the first is a function of seed and their names."""
        if not 0 < fraction < 1:
            raise ValueError(f"expected a fraction between 0 and 1, got {fraction}")
        names, group, counts = np.unique(self.column(by), return_inverse=True, return_counts=True)
        if len(names) < 2:
            raise ValueError(f"expected two or more values of {by} to divide by, got {len(names)}, in {self._where_from}")
        order = np.random.default_rng(seed).permutation(len(names))
        ends = np.cumsum(counts[order])[:-1]
        cut = 1 + int(np.abs(ends - fraction * len(self)).argmin())
        first = np.isin(group, order[:cut])
        return self[np.flatnonzero(first)], self[np.flatnonzero(~first)]

    def class_counts(self) -> dict[str, int]:
        """How many boxes that are not to be ignored the samples have of each class, by name, in the order the shards name them."""
        counts: dict[str, int] = {}
        for number in np.unique(self._shard):
            file, slots = self._files[self.paths[number]], self._slot[self._shard == number]
            names = file.names("labels/boxes/class_id", "class_names")
            of_boxes = np.repeat(np.arange(len(file.column("valid"))), np.diff(file.column("labels/boxes/offsets")))
            kept = np.isin(of_boxes, slots) & (file.column("labels/boxes/ignore") == 0)
            found = np.bincount(file.column("labels/boxes/class_id")[kept], minlength=len(names))
            for name, count in zip(names, found.tolist()):
                counts[name] = counts.get(name, 0) + count
        return counts

    def joint_sets(self) -> list[tuple[str, ...]]:
        """The different lists of joint names that occur, in the order the shards have them."""
        files = (self._files[self.paths[number]] for number in np.unique(self._shard))
        return [names for names in dict.fromkeys(tuple(file.names("labels/poses", "joint_names")) for file in files) if names]

    def class_names(self, index: int) -> list[str]:
        """What the class ids of sample `index` mean, the same for a whole source."""
        return self._files[self._place(index)[0]].names("labels/boxes/class_id", "class_names")

    def joint_names(self, index: int) -> list[str]:
        """What the joints of sample `index` are, the same for a whole source."""
        return self._files[self._place(index)[0]].names("labels/poses", "joint_names")

    def joint_places(self, index: int, names: Iterable[str]) -> list[int]:
        """Where these joints stand among those of sample `index`, found by their names or by those of the 17 joints in common
        use (`joint_aliases`); a name that is neither is a ValueError."""
        file = self._files[self._place(index)[0]]
        known = file.names("labels/poses", "joint_names")
        places = {alias: i for i, alias in enumerate(file.names("labels/poses", "joint_aliases")) if alias}
        places.update({name: i for i, name in enumerate(known)})
        unknown = [name for name in names if name not in places]
        if unknown:
            raise ValueError(f"expected joints of {', '.join(known)}, got {', '.join(unknown)}, in {file.file.filename}")
        return [places[name] for name in names]

    def _place(self, index: int) -> tuple[pathlib.Path, int]:
        if not -len(self) <= index < len(self):
            raise IndexError(f"expected a sample of {len(self)}, got number {index}, in {self._where_from}")
        return self.paths[self._shard[index]], int(self._slot[index])

    def _keep(self, chosen) -> None:
        if not isinstance(chosen, slice):
            chosen = np.asarray(chosen)
            if chosen.dtype != bool:
                chosen = chosen.astype(np.int64)
        self._shard, self._slot = self._shard[chosen], self._slot[chosen]

    def _split(self, shard: _Shard) -> str:
        return shard.split or self._files[shard.path].file.attrs["split"]

    def _slots_of(self, shard: _Shard) -> np.ndarray:
        valid = self._files[shard.path].column("valid") if shard.valid is None else shard.valid
        return np.flatnonzero(valid) if self._invalid == "skip" else np.arange(len(valid))

    def _gathered(self, of_shard) -> np.ndarray:
        """[len(self), ...]: what `of_shard` gives of a shard, [its samples, ...], for the samples here."""
        if not len(self):
            return np.empty(0, int)
        parts, places = [], np.empty(len(self), np.int64)
        for number in np.unique(self._shard):
            here = np.flatnonzero(self._shard == number)
            places[here] = sum(map(len, parts)) + np.arange(len(here))
            parts.append(of_shard(self._files[self.paths[number]])[self._slot[here]])
        return np.concatenate(parts)[places]

    def _with_ids(self, ids) -> np.ndarray:
        source = "ids"
        if isinstance(ids, (str, os.PathLike)):
            source = str(ids)
            ids = [line.strip() for line in pathlib.Path(ids).read_text(encoding="utf-8").splitlines() if line.strip()]
        return self._among(self.column("sample_id"), list(ids), "sample ids", source)

    def _with_values(self, key: str, values) -> np.ndarray:
        values = [values] if isinstance(values, str) or not isinstance(values, Iterable) else list(values)
        if key != "class":
            return self._among(self.column(key), values, f"values of {key}", "where")
        names, kept = set(), []
        for number, path in enumerate(self.paths):
            file, slots = self._files[path], self._slot[self._shard == number]
            here = file.names("labels/boxes/class_id", "class_names")
            names.update(here)
            wanted = np.isin(np.array([*here, ""])[file.column("labels/boxes/class_id")], values)
            wanted &= file.column("labels/boxes/ignore") == 0
            before = np.concatenate([[0], np.cumsum(wanted)])
            kept.append(np.diff(before[file.column("labels/boxes/offsets")])[slots] > 0)
        self._require_known(values, names, "classes", "where")
        order = np.argsort(self._shard, kind="stable")
        chosen = np.empty(len(self), bool)
        chosen[order] = np.concatenate([*kept, np.empty(0, bool)])
        return chosen

    def _among(self, column: np.ndarray, values: list, what: str, source: str) -> np.ndarray:
        self._require_known(values, set(column.tolist()), what, source)
        return np.isin(column, values) if values else np.zeros(len(column), bool)

    def _require_known(self, values: list, known: set, what: str, source: str) -> None:
        unknown = [value for value in values if value not in known]
        if unknown:
            raise ValueError(f"expected {what} of {self._where_from}, got {len(unknown)} that it does not have "
                             f"({', '.join(map(repr, unknown[:5]))}{', ...' if unknown[5:] else ''}), in {source}")


class _OpenShard:
    """A shard's file and those of its columns that were read."""

    def __init__(self, path: pathlib.Path, columns: dict[str, Any]):
        self.file = open_shard(path)
        self._columns = columns
        self._volume = self.file["events/volume"]
        self.size = self._volume.shape[2:]  # H, W

    def volume(self, slot: int, decode: bool) -> Sample:
        stored, scale = self._volume[slot], self.column("events/scale")[slot]
        if not decode:
            return {"volume": stored, "scale": scale}
        return {"volume": np.multiply(stored, scale, dtype=np.float32)}

    def column(self, name: str) -> np.ndarray:
        """[N, ...] the whole column, kept; text as str."""
        if name not in self._columns:
            if name not in self.file:
                raise ValueError(f"expected a column {name}, got none, in {self.file.filename}")
            dataset = self.file[name]
            text = h5py.check_string_dtype(dataset.dtype)
            column = (dataset.asstr() if text else dataset)[:]
            self._columns[name] = column.astype(np.int64) if column.dtype == np.uint32 else column
        return self._columns[name]

    def optional(self, *names: str) -> list[str]:
        if "" not in self._columns:  # every name, asked for once
            self._columns[""] = set()
            self.file.visit(self._columns[""].add)
        return [name for name in names if name in self._columns[""]]

    def row(self, group: str, slot: int) -> Sample:
        return {name: column[slot] for name, column in self._group(group)}

    def rows(self, group: str, slot: int) -> Sample:
        first, last = self.column(group + "/offsets")[slot : slot + 2]
        return {name: column[first:last] for name, column in self._group(group) if name != "offsets"}

    def names(self, item: str, attribute: str) -> list[str]:
        return list(self.file[item].attrs.get(attribute, ()))

    def _group(self, group: str) -> list[tuple[str, np.ndarray]]:
        if group not in self._columns:
            self._columns[group] = [(name, self.column(f"{group}/{name}")) for name in self.file[group]]
        return self._columns[group]


class _Files:
    """The shards that are open in this process, the one used longest ago closed first, and the columns of all that were."""

    def __init__(self, most: int):
        self._most = most
        self._forget()

    def __getitem__(self, path: pathlib.Path) -> _OpenShard:
        if self._process != os.getpid():  # HDF5's handles do not survive a fork; columns do
            self._open, self._process = collections.OrderedDict(), os.getpid()
        if path not in self._open:
            while len(self._open) >= self._most:
                self._open.popitem(last=False)[1].file.close()
            self._open[path] = _OpenShard(path, self._columns[path])
        self._open.move_to_end(path)
        return self._open[path]

    def close(self) -> None:
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
        self._open: collections.OrderedDict[pathlib.Path, _OpenShard] = collections.OrderedDict()
        self._columns: dict[pathlib.Path, dict[str, Any]] = collections.defaultdict(dict)
        self._process = os.getpid()

def open_shard(path: PathLike) -> h5py.File:
    """The shard's file. Raises ValueError if it is none of a known version."""
    file = h5py.File(path, "r", rdcc_nbytes=0)  # a volume is a chunk of its own: nothing to keep
    found = file.attrs.get("format"), int(file.attrs.get("format_version", 0))
    if found != (FORMAT, FORMAT_VERSION):
        file.close()
        raise ValueError(f"expected {FORMAT} {FORMAT_VERSION}, got {found[0]} {found[1]}, in {path}")
    return file


def _one_of(what: str, words: Iterable[str], known: Sequence[str]) -> None:
    for word in words:
        if word not in known:
            raise ValueError(f"expected {what} to be of {', '.join(known)}, got {word!r}")


def _marker(path: PathLike) -> pathlib.Path:
    return pathlib.Path(path).with_suffix(".json")


def _reason(path: pathlib.Path, slot: int) -> str:
    reason = "quarantined"
    if _marker(path).exists():
        for sample in json.loads(_marker(path).read_text(encoding="utf-8"))["quarantined"]:
            if sample["slot"] == slot:
                reason = f"quarantined: {sample['reason']} ({sample['sample_id']})"
    return f"sample {slot} of {path} is {reason}"


class _Shard(NamedTuple):
    path: pathlib.Path
    split: str | None = None  # None: look into the file
    valid: np.ndarray | None = None  # bool, of each slot


def _find_shards(paths: PathLike | Iterable[PathLike]) -> list[_Shard]:
    if not isinstance(paths, (str, os.PathLike)):
        return [_Shard(pathlib.Path(path)) for path in paths]
    paths = pathlib.Path(paths)
    if paths.name == VIEW and paths.is_file():
        paths = paths.parent
        if not (paths / DESCRIPTION).exists():
            raise ValueError(f"expected {DESCRIPTION} beside {VIEW}, got none, in {paths}")
    if not paths.is_dir():
        return [_Shard(paths)]
    if (paths / DESCRIPTION).exists():
        return _described_shards(paths)
    return [_Shard(path) for path in sorted(paths.glob("*.h5")) if _is_done(path)]


def read_description(folder: PathLike) -> dict[str, Any]:
    """dataset.json of a finalized folder, as a dictionary. Raises ValueError if it is of no known version."""
    path = pathlib.Path(folder, DESCRIPTION)
    description = json.loads(path.read_text(encoding="utf-8"))
    found = description.get("format"), description.get("version")
    if found != (DESCRIPTION_FORMAT, DESCRIPTION_VERSION):
        raise ValueError(f"expected {DESCRIPTION_FORMAT} {DESCRIPTION_VERSION}, got {found[0]} {found[1]}, in {path}")
    return description


def _described_shards(folder: pathlib.Path) -> list[_Shard]:
    description = read_description(folder)
    shards = []
    for entry in description["shards"]:
        path = folder / entry["name"]
        if not _is_same(path, entry):
            raise ValueError(f"expected the shard that {DESCRIPTION} describes, got another or none, in {path} "
                             "(eventgan convert and eventgan finalize put it right)")
        shards.append(_Shard(path, entry["split"], np.ones(entry["samples"], bool)))
    valid = {shard.path.name: shard.valid for shard in shards}
    for sample in description["quarantined"]:
        valid[sample["shard"]][sample["slot"]] = False
    return shards


def _is_same(path: pathlib.Path, entry: Mapping[str, Any]) -> bool:
    """Whether the shard is the one that was described: by its size, and by its marker if that came along."""
    try:
        if path.stat().st_size != entry["size_bytes"]:
            return False
    except OSError:
        return False
    try:
        return json.loads(_marker(path).read_text(encoding="utf-8"))["sha256"] == entry["sha256"]
    except FileNotFoundError:
        return True
    except (OSError, ValueError, KeyError):
        return False


def _is_done(path: pathlib.Path) -> bool:
    """Whether the marker beside the file is a shard's and the file has its size (DESIGN section 6)."""
    try:
        marker = json.loads(_marker(path).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return marker.get("shard") == path.name and marker.get("size_bytes") == path.stat().st_size

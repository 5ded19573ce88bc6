"""Reads eventgan's shards with h5py and numpy, nothing else.

    from eventgan_shards import Shards

    shards = Shards("out", split="train")   # a folder (finalized or not), a shard, or a list of shards
    for sample in shards:
        sample["volume"]                    # float32 [2B, H, W], >= 0
        sample["boxes"]["xyxy"]             # float64 [boxes, 4], volume pixels
        sample["persons"]["joints"]         # float64 [persons, J, 2], volume pixels

manifests/guides/shard_format.md says what each field means; the keys here are its names.
"""

import bisect
import collections
import json
import os
import pathlib

import h5py
import numpy as np

FORMAT = "eventgan-shard"
FORMAT_VERSION = 1
DESCRIPTION = "dataset.json"
DESCRIPTION_FORMAT = "eventgan-dataset"
DESCRIPTION_VERSION = 1
_OPEN_FILES = 8


class InvalidSample(ValueError):
    """A sample that eventgan put into quarantine was asked for."""


class Shards:
    """A sequence of the samples of one or more shards, in the order of the shards and their slots.

    paths: a folder, one shard, or a list of shards. Of a folder that `eventgan finalize` has completed, the
        shards that its dataset.json lists, in the order of the plan: then no shard is opened before it is read,
        and a shard that is gone or another one by now is a ValueError. Of any other folder all shards that are
        done, so those with a marker, by name.
    split: only the shards of this split ("train"...); none is a ValueError. None: of all.
    invalid: what to do about quarantined samples. "skip": they are not part of the sequence. "raise": they
        are, and reading one raises InvalidSample. "keep": they come with a volume of zeros and `valid` False.

    Files are opened when they are needed, anew in every process, so that an object can be handed to the
    workers of a data loader (PyTorch's needs batch_size=None or a collate_fn of its own, since samples differ in their
    numbers of boxes and persons); at most eight stay open, however many shards there are. One object must not be
    used by several threads at a time.
    """

    def __init__(self, paths, invalid="skip", split=None):
        if invalid not in ("skip", "raise", "keep"):
            raise ValueError(f"expected invalid to be skip, raise or keep, got {invalid!r}")
        self._invalid = invalid
        self._files = collections.OrderedDict()
        self._process = os.getpid()
        shards = _find_shards(paths)
        if split is not None:
            shards = [shard for shard in shards if (shard.split or self._file(shard.path).attrs["split"]) == split]
            if not shards:
                raise ValueError(f"expected shards of split {split!r}, got none, in {paths}")
        self.paths = [shard.path for shard in shards]
        self._slots = [self._read_slots(shard) for shard in shards]
        self._ends = np.cumsum([len(slots) for slots in self._slots]).tolist()

    def __len__(self):
        return self._ends[-1] if self._ends else 0

    def __getitem__(self, index):
        """Sample `index` as a dictionary; see `read_sample`."""
        if not -len(self) <= index < len(self):
            raise IndexError(f"sample {index} of {len(self)}")
        index = index % len(self)
        number = bisect.bisect_right(self._ends, index)
        begin = self._ends[number - 1] if number else 0
        path = self.paths[number]
        slot = int(self._slots[number][index - begin])
        file = self._file(path)
        if self._invalid == "raise" and not file["valid"][slot]:
            raise InvalidSample(_reason(path, slot))
        return read_sample(file, slot)

    def __getstate__(self):
        return {**self.__dict__, "_files": collections.OrderedDict()}

    def class_names(self, index):
        """What the class ids of sample `index` mean: a list, the same for a whole source."""
        return list(self._file(self._path_of(index))["labels/boxes/class_id"].attrs["class_names"])

    def joint_names(self, index):
        """What the joints of sample `index` are: a list, the same for a whole source."""
        return list(self._file(self._path_of(index))["labels/poses"].attrs["joint_names"])

    def _path_of(self, index):
        return self.paths[bisect.bisect_right(self._ends, index % len(self))]

    def _read_slots(self, shard):
        valid = self._file(shard.path)["valid"][:] if shard.valid is None else shard.valid
        return np.flatnonzero(valid) if self._invalid == "skip" else np.arange(len(valid))

    def _file(self, path):
        if self._process != os.getpid():  # HDF5's handles do not survive a fork
            self._files, self._process = collections.OrderedDict(), os.getpid()
        if path not in self._files:
            self._files[path] = open_shard(path)
            if len(self._files) > _OPEN_FILES:
                self._files.popitem(last=False)[1].close()
        self._files.move_to_end(path)
        return self._files[path]


def open_shard(path):
    """The shard as an h5py.File. Raises ValueError if it is none of a known version."""
    file = h5py.File(path, "r")
    found = file.attrs.get("format"), int(file.attrs.get("format_version", 0))
    if found != (FORMAT, FORMAT_VERSION):
        file.close()
        raise ValueError(f"expected {FORMAT} {FORMAT_VERSION}, got {found[0]} {found[1]}, in {path}")
    return file


def read_sample(file, slot):
    """One sample of an open shard, as a dictionary:

    volume        float32 [2B, H, W], decoded
    valid         bool
    original      bytes, the annotation as the dataset holds it
    pair          dictionary of everything in /pairs: texts, numbers, `source_to_volume` [2, 3]
    statistics    dictionary of /events/statistics/* and eta98; flags as int64, since PyTorch has no uint32
    boxes         dictionary of arrays, a row for each box: xyxy, class_id, ignore…
    persons       dictionary of arrays, a row for each person: joints, visible, center…
    shard, slot   where it comes from
    """
    volume = file["events/volume"][slot].astype(np.float32)
    volume *= file["events/scale"][slot]
    statistics = {name: _value(values, slot) for name, values in file["events/statistics"].items()}
    statistics["eta98"] = file["events/eta98"][slot]
    return {
        "volume": volume,
        "valid": bool(file["valid"][slot]),
        "original": bytes(file["labels/original"][slot]),
        "pair": {name: _value(values, slot) for name, values in file["pairs"].items()},
        "statistics": statistics,
        "boxes": _rows(file["labels/boxes"], slot),
        "persons": _rows(file["labels/poses"], slot),
        "shard": file.filename,
        "slot": slot,
    }


def _value(dataset, slot):
    if h5py.check_string_dtype(dataset.dtype):
        return dataset.asstr()[slot]
    return np.int64(dataset[slot]) if dataset.dtype == np.uint32 else dataset[slot]


def _rows(group, slot):
    first, last = group["offsets"][slot : slot + 2]
    return {name: rows[first:last] for name, rows in group.items() if name != "offsets"}


def _marker(path):
    return pathlib.Path(path).with_suffix(".json")


def _reason(path, slot):
    reason = "quarantined"
    if _marker(path).exists():
        for sample in json.loads(_marker(path).read_text(encoding="utf-8"))["quarantined"]:
            if sample["slot"] == slot:
                reason = f"quarantined: {sample['reason']} ({sample['sample_id']})"
    return f"sample {slot} of {path} is {reason}"


_Shard = collections.namedtuple("_Shard", "path split valid", defaults=(None, None))  # None: look into the file


def _find_shards(paths):
    if not isinstance(paths, (str, os.PathLike)):
        return [_Shard(pathlib.Path(path)) for path in paths]
    paths = pathlib.Path(paths)
    if not paths.is_dir():
        return [_Shard(paths)]
    if (paths / DESCRIPTION).exists():
        return _described_shards(paths)
    return [_Shard(path) for path in sorted(paths.glob("*.h5")) if _is_done(path)]


def read_description(folder):
    """dataset.json of a finalized folder, as a dictionary. Raises ValueError if it is of no known version."""
    path = pathlib.Path(folder, DESCRIPTION)
    description = json.loads(path.read_text(encoding="utf-8"))
    found = description.get("format"), description.get("version")
    if found != (DESCRIPTION_FORMAT, DESCRIPTION_VERSION):
        raise ValueError(f"expected {DESCRIPTION_FORMAT} {DESCRIPTION_VERSION}, got {found[0]} {found[1]}, in {path}")
    return description


def _described_shards(folder):
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


def _is_same(path, entry):
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


def _is_done(path):
    """Whether the marker beside the file is a shard's and the file has its size (DESIGN section 6)."""
    try:
        marker = json.loads(_marker(path).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return marker.get("shard") == path.name and marker.get("size_bytes") == path.stat().st_size

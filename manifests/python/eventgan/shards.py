"""The reader: samples of shards as dictionaries of numpy arrays."""

from __future__ import annotations

import collections
import copy
import functools
import hashlib
import html
import os
import re
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from .open_shards import OpenShard, OpenShards, PathLike, Sample
from .outlines import mask
from .remote import Place, RemotePath, place
from .shard_folder import FoundShard, find_shards, quarantine_reason
from .words import did_you_mean, first_of, path_of

FIELDS = ("volume", "pair", "statistics", "boxes", "persons", "flow", "original")


class InvalidSample(ValueError):
    """A quarantined sample was read with invalid="raise"."""


class Shards(Sequence):
    """The samples of one or more shards, in the order of the shards and their slots.

    shards[i] is a sample (see `sample`); shards[i:j] or shards[[i, j, ...]] is a Shards of those alone.

    The labels of a shard are read when they are first needed, and kept. Files are opened again in every process, so an
    object can go to forked or spawned workers. Slices share the files of what they were cut from: only one thread at a
    time may use any of them.

    Parameters
    ----------
    paths : str, path or iterable of them
        A folder, its dataset.h5, one shard, or a list of shards, also as URLs that fsspec knows (a shard's ends in
        .h5). Of a folder that `eventgan finalize` has completed: the shards that its dataset.json lists, in the order
        of the plan. Of any other folder, of a URL only where the server lists it: all finished shards, those with a
        commit record, by name.
    split : str, optional
        Only the shards of this split ("train"...).
    ids : str, path or iterable of str, optional
        Only samples with these ids: a list, or a text file with one per line. They stay in the order of the shards. The
        id of a frame ("000001") stands for all its samples ("000001@before1"...).
    where : dict, optional
        Only samples whose value is one of those given, by column: {"gap": 1, "class": ["Car", "Van"]}. `class` means a
        box of that class that is not ignored, `gap` is gap_frames; any other key is a column of /pairs: sequence,
        subject, action, camera, dataset... (see `column`). Values that exist, but not together in a sample, give an
        empty sequence.
    invalid : {"skip", "raise", "keep"}
        What to do about quarantined samples. "skip": they are left out. "raise": they are in the sequence, and reading
        one raises InvalidSample. "keep": they have a volume of zeros and `valid` False. Skipping one that `ids` names
        gives a warning.
    fields : iterable of str
        What a sample holds; of FIELDS. Other fields are not read.
    decode : bool, default True
        False leaves a volume as it is stored (uint8, float16 or float32) with its `scale` beside it, to be decoded
        elsewhere: value = stored number x scale.
    open_files : int, default 128
        How many shards stay open at a time (about half a megabyte each, of a URL up to 1.5).
    partial : bool, default False
        True takes the finished shards of an incomplete folder.
    cache : str or path, optional
        Of URLs: a folder that keeps what was read, in blocks of 256 KiB, for all processes and for ever; it may be
        deleted.

    Raises
    ------
    ValueError
        There is no shard at all; one that dataset.json describes is missing, has been replaced, or does not have the
        name of a shard. Without `partial`: dataset.json or plan.json lists a shard that is missing, one has no commit
        record, or a commit record has no shard. A split, an id or a value that no sample (of the split) has, so that
        nothing is missing in silence; also a class that has a name but no box that counts.
    OSError
        Also while reading: what was read of a URL is not the whole of what was asked for, or of a file that has been
        replaced since.
    ImportError
        fsspec is not there, or what it needs for this kind of URL.
    """

    def __init__(self, paths: PathLike | RemotePath | Iterable[PathLike | RemotePath], *, split: str | None = None,
                 ids: PathLike | Iterable[str] | None = None, where: Mapping[str, Any] | None = None,
                 invalid: str = "skip", fields: Iterable[str] = FIELDS, decode: bool = True, open_files: int = 128,
                 partial: bool = False, cache: PathLike | None = None) -> None:
        _one_of("invalid", [invalid], ("skip", "raise", "keep"))
        if open_files < 1:
            raise ValueError(f"expected open_files of at least 1, got {open_files}")
        self._invalid, self._fields, self._decode = invalid, _known_fields(fields), decode
        self._changes: tuple[Callable[[Sample], np.ndarray], ...] = ()
        self._files = OpenShards(open_files)
        if not isinstance(paths, (str, os.PathLike, RemotePath)):
            paths = list(paths) if isinstance(paths, Iterable) else path_of(paths, "a folder of shards, or a shard")
        self._described_as = str(paths)
        shards = find_shards(paths, partial, cache)
        self._all_paths = [shard.path for shard in shards]
        if split is not None:
            splits = [self._split(shard) for shard in shards]
            if split not in splits:
                raise ValueError(f"expected a split of {', '.join(sorted(set(splits)))}, got {split!r}, in "
                                 f"{self._described_as}")
            shards = [shard for shard, of_it in zip(shards, splits) if of_it == split]
            self._described_as += f", split {split}"
        self.paths = [shard.path for shard in shards]
        valid = [self._files[shard.path].column("valid") if shard.valid is None else shard.valid for shard in shards]
        self._quarantined = sum(np.count_nonzero(np.equal(each, 0)) for each in valid)
        self._shard = np.repeat(np.arange(len(valid), dtype=np.int32), [len(each) for each in valid])
        self._slot = np.concatenate([np.arange(len(each), dtype=np.int32) for each in valid])
        sound = np.concatenate(valid).astype(bool) | (invalid != "skip")
        chosen = [self._with_values(key, values) for key, values in (where or {}).items()]
        if ids is not None:
            chosen.append(self._with_ids(ids, sound))
        self._keep(np.logical_and.reduce([sound, *chosen]))
        if chosen:  # classes and columns are those of the sources that were asked for
            used, self._shard = np.unique(self._shard, return_inverse=True)
            self.paths = [self.paths[number] for number in used] or self.paths
            self._all_paths = self.paths

    def __len__(self) -> int:
        return len(self._slot)

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, (slice, Sequence, np.ndarray)):
            chosen = copy.copy(self)
            chosen._keep(index)
            return chosen
        return self.sample(index)

    def __enter__(self) -> Shards:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Closes the files; reading goes on by opening them again."""
        self._files.close()

    def changed(self, volume_of: Callable[[Sample], np.ndarray]) -> Shards:
        """The same samples with other volumes, for example a camera's three times as bright:

            Shards("camera").changed(lambda sample: np.minimum(3 * sample["volume"], 1))

        Statistics remain those of the stored volumes, and quarantined samples are not changed.

        Parameters
        ----------
        volume_of : callable
            Makes a volume, float32 [2B, H, W], of a sample, which has the decoded `volume`, `pair` and what is always
            there. For spawned workers it must be a function of a module.

        Returns
        -------
        Shards
        """
        changed = copy.copy(self)
        changed._changes = (*self._changes, volume_of)
        return changed

    def represent(self, representation: str, *, counts: str = "poisson", seed: int = 0) -> Shards:
        """The same samples with another representation of their events as `volume`, float32; events are drawn from the
        volumes.

        Parameters
        ----------
        representation : str
            "histogram:10": of `eventgan.represent`. The interval is the pair's.
        counts : {"poisson", "rounded"}
            Of `eventgan.sample_events`.
        seed : int, default 0
            A sample's events depend on it and on its id alone.

        Returns
        -------
        Shards
        """
        return self.changed(functools.partial(_represented, representation=representation, counts=counts, seed=seed))

    def labels(self, index: int) -> Sample:
        """Sample `index` without its volume, which is not read."""
        return self.sample(index, self._fields - {"volume"})

    def sample(self, index: int, fields: Iterable[str] | None = None) -> Sample:
        """One sample; keys are shard_format.md's names.

        Parameters
        ----------
        index : int
        fields : iterable of str, optional
            Which fields, of FIELDS. None: the constructor's.

        Returns
        -------
        dict
            volume : float32 [2B, H, W], >= 0 (decode=False: as stored, and `scale`, float32)
            pair : everything of /pairs: texts, numbers, `source_to_volume` [2, 3]; KITTI's `projection` [3, 4]
            statistics : everything of /events/statistics, eta98, and `tiles` [R, C] if the scope is a part;
                flags as int64, since PyTorch has no uint32
            boxes : arrays with a row for each box: xyxy [n, 4] in volume pixels, class_id, ignore...; `outline`, bytes
                each, where a box of the shard has one (see `masks`)
            persons : arrays with a row for each person: joints [n, J, 2] in volume pixels, visible, center...
            flow, flow_valid : float16 [2, H, W], x, then y, from the previous image to the next, at the pixels of the
                labelled one; uint8 [H, W]. Only where the shard has them, of stills with "flow"
            original : bytes, the annotation as the dataset holds it
            valid, shard, slot : always there: bool; where it comes from

        Raises
        ------
        IndexError
            There is no such sample.
        InvalidSample
            It is quarantined, and `invalid` is "raise".
        """
        fields = self._fields if fields is None else _known_fields(fields)
        path, slot = self._place(index)
        file = self._files[path]
        valid = bool(file.column("valid")[slot])
        if self._invalid == "raise" and not valid:
            raise InvalidSample(quarantine_reason(path, slot))
        changes = self._changes if "volume" in fields and valid else ()
        if changes:
            fields |= {"pair"}
        sample: Sample = {}
        origin = {"valid": valid, "shard": str(path), "slot": slot}
        if "volume" in fields:
            sample.update(file.volume(slot, self._decode or bool(self._changes)))
        if "pair" in fields:
            sample["pair"] = file.row("pairs", slot)
            for name in ("projection", "projection_source"):
                if file.has("labels/" + name):
                    sample["pair"][name] = file.column("labels/" + name)[slot]
        if "statistics" in fields:
            sample["statistics"] = {**file.row("events/statistics", slot), "eta98": file.column("events/eta98")[slot]}
            if file.has("events/tiles"):
                sample["statistics"]["tiles"] = file.column("events/tiles")[slot]
        if "boxes" in fields:
            sample["boxes"] = file.rows("labels/boxes", slot)
        if "persons" in fields:
            sample["persons"] = file.rows("labels/poses", slot)
        if "flow" in fields and file.has("labels/flow"):
            sample.update((name, file.file["labels/" + name][slot]) for name in ("flow", "flow_valid"))
        if "original" in fields:
            sample["original"] = file.column("labels/original")[slot].tobytes()
        for change in changes:
            sample["volume"] = np.asarray(change({**sample, **origin}), np.float32)
        return {**sample, **origin}

    def masks(self, index: int) -> np.ndarray:
        """What the outlines of a sample's boxes cover of what the volume shows of the image.

        Parameters
        ----------
        index : int

        Returns
        -------
        numpy.ndarray
            bool [n, H, W], the masks of all boxes in their order; all False of a box without an outline. Masks may
            overlap.

        Raises
        ------
        IndexError
            There is no such sample.
        InvalidSample
            It is quarantined, and `invalid` is "raise".
        """
        boxes = self.sample(index, {"boxes"})["boxes"]
        path, slot = self._place(index)
        file = self._files[path]
        masks = np.zeros((len(boxes["xyxy"]), *file.size), bool)
        if not any(boxes.get("outline", ())):
            return masks
        one = self[[index]]
        one.paths, one._shard = [path], np.zeros(1, np.int32)  # looks into no other shard
        area = one.image_area() if np.isfinite(file.column("pairs/source_to_volume")[slot]).all() else None
        for k, outline in enumerate(boxes["outline"]):
            masks[k] = mask(outline, file.size)
        if area is not None:
            left, top, right, bottom = np.ceil(area - 0.5).astype(int)  # of the first pixels whose centres are beyond
            shown = np.zeros(file.size, bool)
            shown[top:bottom, left:right] = True
            masks &= shown
        return masks

    def column(self, name: str) -> np.ndarray:
        """A column of /pairs for every sample, read without volumes or boxes.

        Parameters
        ----------
        name : str
            The column, or "gap" for gap_frames.

        Returns
        -------
        numpy.ndarray
            [len(self), ...]. For samples of shards without that column: "", NaN or -1.

        Raises
        ------
        ValueError
            No shard has the column.
        """
        name = "pairs/" + {"gap": "gap_frames"}.get(name, name)
        having = next((file for file in map(self._files.__getitem__, self.paths) if file.has(name)), None)
        if having is None:
            known = sorted({column for path in self.paths for column in self._files[path].file["pairs"]})
            raise ValueError(f"expected a column of {', '.join(known)}, got {name[len('pairs/'):]!r}, in "
                             f"{self._described_as}")
        like = having.column(name)
        nothing = {"O": "", "f": np.nan}.get(like.dtype.kind, -1)

        def of_shard(file: OpenShard) -> np.ndarray:
            return file.column(name) if file.has(name) else np.full((len(file.column("valid")), *like.shape[1:]),
                                                                    nothing, like.dtype)

        return self._gathered(of_shard)

    @property
    def persons(self) -> np.ndarray:
        """int64 [persons, 2]: of every person the sample's index here and its row there. Reads no volumes."""
        counts = self._gathered(lambda file: np.diff(file.column("labels/poses/offsets")))
        first = np.cumsum(counts) - counts
        samples = np.repeat(np.arange(len(self)), counts)
        return (np.stack([samples, np.arange(len(samples)) - first[samples]], axis=1) if len(samples)
                else np.empty((0, 2), int))

    def annotated(self, joints: Iterable[str]) -> np.ndarray:
        """bool [persons]: for every row of `persons`, whether any of these joints (named as for `joint_places`)
        is annotated."""
        joints, persons = list(joints), self.persons
        if not len(persons):
            return np.empty(0, bool)
        rows = self._gathered(lambda file: file.column("labels/poses/offsets")[:-1])[persons[:, 0]] + persons[:, 1]

        def of_shard(file: OpenShard) -> np.ndarray:
            return (file.column("labels/poses/joints_source")[:, file.joint_places(joints)] != -1).any((1, 2))

        return self._gathered(of_shard, self._shard[persons[:, 0]], rows)

    def image_area(self) -> np.ndarray:
        """float64 [4]: left, top, right, bottom of the samples' images all together, in volume pixels, by edges.

        Outside lies the border that a letterbox adds, which never holds events. Samples without images are a
        ValueError.
        """
        maps, sizes = self.column("source_to_volume").reshape(-1, 2, 3), self.column("source_size").reshape(-1, 2)
        if np.isnan(maps).all():
            raise ValueError(f"expected samples with images, got none, in {self._described_as}")
        scale = maps[:, [0, 1], [0, 1]]
        low = maps[:, :, 2] - scale / 2 + 0.5
        volumes = self._gathered(lambda file: np.tile(file.size[::-1], (len(file.column("valid")), 1)))
        high = np.minimum(low + scale * sizes[:, ::-1], volumes)
        # stills have lost their borders, so the image in a letterbox is smaller than the source
        if self._have("motion"):
            boxed = self._gathered(lambda file: np.full(len(file.column("valid")), file.fit() == "letterbox"))
            boxed &= np.isfinite(self.column("motion")).all(1) & (sizes > 0).all(1)
            whole, into = sizes[boxed][:, ::-1], volumes[boxed]
            scaled = np.maximum(np.floor(whole * (into / whole).min(1, keepdims=True) + 0.5), 1)
            low[boxed] = (into - scaled) // 2
            high[boxed] = low[boxed] + scaled
        return np.concatenate([np.nanmin(np.maximum(low, 0), axis=0), np.nanmax(high, axis=0)])

    def groups(self, by: str = "sequence") -> np.ndarray:
        """str [len(self)]: the group of each sample, which a division into training and validation must not split.

        Parameters
        ----------
        by : str, default "sequence"
            "sequence": for Human3.6M subject and action, whatever the camera; else the drive, else the sequence, else
            the labelled frame, whichever of these the sample has. "sample_id": the labelled frame. Any other column:
            its value, or as "sequence" for samples without.
        """
        frames = np.array([_frame_of(name) for name in self.column("sample_id")], object)
        if by == "sample_id":
            return frames
        texts = {name: self.column(name) if self._have(name) else np.full(len(self), "", object)
                 for name in ("subject", "action", "drive", "sequence")}
        known = (self.column("dataset") == "human36m") & (texts["subject"] != "") & (texts["action"] != "")
        take = np.where(known, texts["subject"] + "/" + texts["action"], "")
        recordings = frames
        for better in (texts["sequence"], texts["drive"], take):
            recordings = np.where(better != "", better, recordings)
        values = recordings if by == "sequence" else self.column(by).astype(str).astype(object)
        return np.where(values != "", values, recordings)

    def divide(self, fraction: float, by: str = "sequence", seed: int = 0) -> tuple[Shards, Shards]:
        """Two parts that share none of `groups(by)`: no drive, no subject, no labelled frame is in both.

        Parameters
        ----------
        fraction : float
            About the share of the samples that the first part gets, between 0 and 1.
        by : str, default "sequence"
            As of `groups`.
        seed : int, default 0
            Which groups the first part gets depends on it and on their names.

        Returns
        -------
        (Shards, Shards)

        Raises
        ------
        ValueError
            There are fewer than two groups, or the fraction is not between 0 and 1.
        """
        if not 0 < fraction < 1:
            raise ValueError(f"expected a fraction between 0 and 1, got {fraction}")
        names, group, counts = np.unique(self.groups(by), return_inverse=True, return_counts=True)
        if len(names) < 2:
            there = f"{len(self)} of {names[0]} alone" if len(names) else "none"
            frames = "" if by == "sample_id" else '; by="sample_id" divides by labelled frame'
            raise ValueError(f"expected samples of two or more groups by {by}, one for each part, got {there}, in "
                             f"{self._described_as}{frames}")
        order = np.random.default_rng(seed).permutation(len(names))
        ends = np.cumsum(counts[order])[:-1]
        cut = 1 + int(np.abs(ends - fraction * len(self)).argmin())
        first = np.isin(group, order[:cut])
        return self[np.flatnonzero(first)], self[np.flatnonzero(~first)]

    def known_classes(self) -> list[str]:
        """The names of classes in the shards, in their order, whether or not a sample here has such a box. A split has
        those of all splits, since in each a class must have the same number; none if its sources have no boxes."""
        names = {path: self._files[path].names("labels/boxes/class_id", "class_names") for path in self._all_paths}
        if not any(names[path] for path in self.paths):
            return []
        return list(dict.fromkeys(name for of_shard in names.values() for name in of_shard))

    def class_counts(self) -> dict[str, int]:
        """The number of boxes of each class that are not ignored, by name, in the order of the shards."""
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

    def default_joints(self) -> list[str]:
        """The joints of the first source that has any: the 17 in common use if it names them (`joint_aliases`),
        else all."""
        files = (self._files[self.paths[number]] for number in np.unique(self._shard))
        sets = ([name for name in file.names("labels/poses", "joint_aliases") if name]
                or file.names("labels/poses", "joint_names") for file in files)
        return next(filter(None, sets), [])

    def class_names(self, index: int) -> list[str]:
        """The classes that a sample's class ids stand for, the same for a whole source."""
        return self._files[self._place(index)[0]].names("labels/boxes/class_id", "class_names")

    def joint_names(self, index: int) -> list[str]:
        """The joints of a sample, the same for a whole source."""
        return self._files[self._place(index)[0]].names("labels/poses", "joint_names")

    def joint_places(self, index: int, names: Iterable[str]) -> list[int]:
        """The places of these joints (the source's names, or those of `joint_aliases`) among a sample's;
        others are a ValueError."""
        return self._files[self._place(index)[0]].joint_places(names)

    def __repr__(self) -> str:
        return (f"<eventgan.Shards {self._described_as}: {len(self):,} samples of {len(np.unique(self._shard)):,} "
                "shards>")

    def __str__(self) -> str:
        rows = self._summary()
        wide = max(map(len, rows))
        return "\n".join([self._described_as, *(f"  {what:<{wide}}  {text}" for what, text in rows.items())])

    def _repr_html_(self) -> str:
        """A table for notebooks."""
        cells = "".join(f'<tr><th style="text-align:left">{what}</th><td '
                        f'style="text-align:left">{html.escape(text)}</td></tr>'
                        for what, text in self._summary().items())
        return f"<table><caption>{html.escape(self._described_as)}</caption>{cells}</table>"

    def _summary(self) -> dict[str, str]:
        """What there is, counted without reading a volume."""
        counts: dict[str, collections.Counter] = collections.defaultdict(collections.Counter)
        for number in np.unique(self._shard):
            here, file = self[np.flatnonzero(self._shard == number)], self._files[self.paths[number]]
            counts["splits"][file.file.attrs["split"]] += len(here)
            counts["sources"][file.file.attrs["dataset"]] += len(here)
            counts["gaps, frames"].update(file.column("pairs/gap_frames")[here._slot].tolist())
            counts["boxes"].update(here.class_counts())
            counts["volumes"][file.volumes] += len(here)
        rows = {"samples": f"{len(self):,}"}
        for what, found in counts.items():
            rows[what] = ", ".join(f"{value}: {count:,}" for value, count in sorted(found.items()) if count) or "none"
        rows["quarantined"] = f"{self._quarantined:,} in these shards"
        return rows

    def _place(self, index: int) -> tuple[Place, int]:
        if not -len(self) <= index < len(self):
            raise IndexError(f"expected a sample of {len(self)}, got number {index}, in {self._described_as}")
        return self.paths[self._shard[index]], int(self._slot[index])

    def _keep(self, chosen: slice | Sequence[int] | np.ndarray) -> None:
        if not isinstance(chosen, slice):
            chosen = np.asarray(chosen)
            if chosen.dtype != bool:
                chosen = chosen.astype(np.int64)
        self._shard, self._slot = self._shard[chosen], self._slot[chosen]

    def _split(self, shard: FoundShard) -> str:
        return shard.split or self._files[shard.path].file.attrs["split"]

    def _have(self, column: str) -> bool:
        return any(self._files[path].has("pairs/" + column) for path in self.paths)

    def _gathered(self, of_shard: Callable[[OpenShard], np.ndarray], shard: np.ndarray | None = None,
                  rows: np.ndarray | None = None) -> np.ndarray:
        """[n, ...]: from `of_shard`'s array of a shard, [its slots, ...], rows [n] of shards [n]; None:
        those of the samples here."""
        if shard is None or rows is None:
            shard, rows = self._shard, self._slot
        if not len(shard):
            return of_shard(self._files[self.paths[0]])[:0]
        parts, places, done = [], np.empty(len(shard), np.int64), 0
        for number in np.unique(shard):
            here = np.flatnonzero(shard == number)
            places[here] = done + np.arange(len(here))
            done += len(here)
            parts.append(of_shard(self._files[self.paths[number]])[rows[here]])
        return np.concatenate(parts)[places]

    def _with_ids(self, ids: PathLike | Iterable[str], sound: np.ndarray) -> np.ndarray:
        """bool [len(self)]: whether the sample's id, or its frame's, is one of these."""
        source = "ids"
        if isinstance(ids, (str, os.PathLike)):
            source = str(ids)
            ids = [line.strip() for line in place(ids).read_text(encoding="utf-8-sig").splitlines() if line.strip()]
        wanted = dict.fromkeys(ids)
        names = [(name, _frame_of(name)) for name in self.column("sample_id")]
        self._require_known(wanted, {name for pair in names for name in pair}, "sample ids", source)
        chosen = np.array([name in wanted or frame in wanted for name, frame in names], bool)
        skipped = [names[i][0] for i in np.flatnonzero(chosen & ~sound)]
        if skipped:
            warnings.warn(f"{len(skipped)} samples named by {source} are quarantined and skipped "
                          f"({first_of(skipped)}), in {self._described_as}", stacklevel=3)
        return chosen

    def _with_values(self, key: str, values: Any) -> np.ndarray:
        """bool [len(self)]: whether the sample's value is one of these."""
        wanted = dict.fromkeys([values] if isinstance(values, str) or not isinstance(values, Iterable) else values)
        if key != "class":
            column = self.column(key).tolist()
            self._require_known(wanted, set(column), f"values of {key}", "where")
            return np.array([value in wanted for value in column], bool)
        self._require_known(wanted, {name for name, count in self.class_counts().items() if count}, "classes", "where")

        def of_shard(file: OpenShard) -> np.ndarray:
            numbers = [i for i, name in enumerate(file.names("labels/boxes/class_id", "class_names")) if name in wanted]
            found = np.isin(file.column("labels/boxes/class_id"), numbers) & (file.column("labels/boxes/ignore") == 0)
            return np.diff(np.concatenate([[0], np.cumsum(found)])[file.column("labels/boxes/offsets")]) > 0

        return self._gathered(of_shard)

    def _require_known(self, values: Iterable[Any], known: set, what: str, source: str) -> None:
        unknown = [value for value in values if value not in known]
        if unknown:
            there = first_of(map(repr, sorted(known)), 20) or "none"
            raise ValueError(f"expected {what} of {self._described_as} ({there}), got {len(unknown)} that it does not "
                             f"have ({first_of(map(repr, unknown))}), in {source}{did_you_mean(unknown, known)}")


def _one_of(what: str, words: Iterable[str], known: Sequence[str]) -> None:
    for word in words:
        if word not in known:
            raise ValueError(f"expected {what} to be of {', '.join(known)}, got {word!r}")


def _known_fields(fields: Iterable[str]) -> frozenset[str]:
    if isinstance(fields, str):
        raise ValueError(f"expected a list of fields, got the text {fields!r}")
    fields = frozenset(fields)
    _one_of("fields", sorted(fields.difference(FIELDS)), FIELDS)
    return fields


def _frame_of(sample_id: str) -> str:
    """The id of the labelled frame: 000005 for "000005@before1"."""
    return re.sub(r"@(before|after|around)\d+$", "", sample_id)


def _represented(sample: Sample, representation: str, counts: str, seed: int) -> np.ndarray:
    from .generator import represent, sample_events

    pair, volume = sample["pair"], sample["volume"]
    digest = hashlib.sha256(f"{seed} {pair['dataset']} {pair['sample_id']}".encode()).digest()
    duration_s = pair["gap_s"] if pair["gap_s"] > 0 else 1.0
    events = sample_events(volume, duration_s=duration_s, seed=int.from_bytes(digest[:7], "big"), counts=counts)
    return represent(events, representation, size=volume.shape[1:], window_s=(0, duration_s))

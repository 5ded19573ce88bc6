"""Which finished shards lie in a folder: by its dataset.json, else by their commit records."""

from __future__ import annotations

import concurrent.futures
import contextlib
import json
import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from .open_shards import PathLike, check_version
from .remote import Place, RemotePath, place
from .words import first_of

PLAN = "plan.json"
DESCRIPTION, DESCRIPTION_FORMAT, DESCRIPTION_VERSION = "dataset.json", "eventgan-dataset", "1.0"
VIEW = "dataset.h5"
SHARD_NAME = re.compile(r"\w[\w.-]*-\w[\w.-]*-\d{5,}-of-\d{5,}\.h5", re.ASCII)  # no path to another folder


def _record(path: Place) -> Place:
    return path.with_suffix(".json")


def quarantine_reason(path: Place, slot: int) -> str:
    """Why a shard's sample is quarantined, if its commit record is there to say it."""
    reason = "quarantined"
    with contextlib.suppress(OSError):
        for sample in json.loads(_record(path).read_text(encoding="utf-8"))["quarantined"]:
            if sample["slot"] == slot:
                reason = f"quarantined: {sample['reason']} ({sample['sample_id']})"
    return f"sample {slot} of {path} is {reason}"


class FoundShard(NamedTuple):
    """A finished shard, and what dataset.json says of it."""

    path: Place
    split: str | None = None  # None: the file says it
    valid: np.ndarray | None = None  # bool, of each slot


def find_shards(paths: PathLike | RemotePath | list[PathLike | RemotePath], partial: bool,
                cache: PathLike | None) -> list[FoundShard]:
    """Those of a folder or of a list, as `Shards` takes them; a ValueError where there is none, or one is missing."""
    if isinstance(paths, list):
        shards = [FoundShard(place(path, cache)) for path in paths]
    else:
        shards = _listed_shards(place(paths, cache), partial)
    if not shards:
        raise ValueError(f"expected finished shards, got none, in {paths}")
    return shards


def _listed_shards(folder: Place, partial: bool) -> list[FoundShard]:
    is_view = folder.name == VIEW and folder.is_file()
    if is_view:
        folder = folder.parent
    if not folder.is_dir():
        return [FoundShard(folder)]
    try:
        description = read_description(folder)
    except FileNotFoundError:
        if is_view:
            raise ValueError(f"expected {DESCRIPTION} beside {VIEW}, got none, in {folder}") from None
    else:
        return _described_shards(folder, description, partial)
    try:
        done = sorted(path.name for path in folder.glob("*.h5") if _is_done(path))
    except OSError as error:
        raise ValueError(f"expected {DESCRIPTION}, which eventgan finalize writes, or a list of the files, got neither "
                         f"({error}), in {folder}") from error
    if not partial:
        _require_whole(done, sorted(_expected_shards(folder).difference(done)), folder)
    return [FoundShard(folder / name) for name in done]


def _expected_shards(folder: Place) -> set[str]:
    """The names of shards that are there, or planned, or have a commit record."""
    names = {path.name for path in folder.glob("*.h5")} - {VIEW}
    names.update(path.with_suffix(".h5").name for path in folder.glob("*.json")
                 if path.with_suffix(".h5").name not in names and _is_commit_record(path))
    with contextlib.suppress(FileNotFoundError):
        names.update(shard["name"] for shard in json.loads((folder / PLAN).read_text(encoding="utf-8"))["shards"])
    return names


def _is_commit_record(path: Place) -> bool:
    try:
        record = {} if path.name == PLAN else json.loads(path.read_text(encoding="utf-8"))
        return record.get("shard") == path.with_suffix(".h5").name
    except (OSError, ValueError, AttributeError):
        return False


def _require_whole(done: Sequence[str], missing: Sequence[str], folder: Place) -> None:
    if missing:
        raise ValueError(f"expected {len(done) + len(missing)} finished shards, got {len(missing)} unfinished "
                         f"({first_of(missing)}), in {folder} (partial=True uses the others)")


def read_description(folder: PathLike | RemotePath) -> dict[str, Any]:
    """dataset.json of a finalized folder.

    Parameters
    ----------
    folder : str or path
        Also a URL.

    Returns
    -------
    dict

    Raises
    ------
    ValueError
        It is of another major version, or no JSON.
    """
    path = place(folder) / DESCRIPTION
    try:
        description = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"expected JSON, got {error}, in {path}") from error
    check_version(description, "version", DESCRIPTION_FORMAT, DESCRIPTION_VERSION, path)
    return description


def _described_shards(folder: Place, description: Mapping[str, Any], partial: bool) -> list[FoundShard]:
    if not partial:
        _require_whole(description["shards"], description.get("missing", ()), folder)
    entries = description["shards"]
    for entry in entries:
        if not SHARD_NAME.fullmatch(str(entry["name"])):
            raise ValueError(f"expected the name of a shard beside it, got {entry['name']!r}, in "
                             f"{folder / DESCRIPTION}")
    paths = [folder / entry["name"] for entry in entries]
    with concurrent.futures.ThreadPoolExecutor(folder.at_once if isinstance(folder, RemotePath) else 1) as pool:
        for path, is_same in zip(paths, pool.map(_is_same, paths, entries)):
            if not is_same:
                raise ValueError(f"expected the shard that {DESCRIPTION} describes, got another or none, in {path} "
                                 "(run eventgan convert, then eventgan finalize)")
    valid = {entry["name"]: np.ones(entry["samples"], bool) for entry in entries}
    for sample in description["quarantined"]:
        valid[sample["shard"]][sample["slot"]] = False
    return [FoundShard(path, entry["split"], valid[entry["name"]]) for path, entry in zip(paths, entries)]


def _is_same(path: Place, entry: Mapping[str, Any]) -> bool:
    """Whether the shard is the one that was described: by its size, and by its commit record if there is one."""
    try:
        if path.stat().st_size != entry["size_bytes"]:
            return False
    except FileNotFoundError:
        return False
    try:
        return json.loads(_record(path).read_text(encoding="utf-8"))["sha256"] == entry["sha256"]
    except FileNotFoundError:
        return True
    except (ValueError, KeyError):
        return False


def _is_done(path: Place) -> bool:
    """Whether the shard is finished: the commit record beside it names it and has its size."""
    try:
        record = json.loads(_record(path).read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        return False
    return record.get("shard") == path.name and record.get("size_bytes") == path.stat().st_size

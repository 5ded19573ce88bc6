"""Output folders: what is in them, and whether two hold the same."""

import hashlib
import json
import pathlib

OF_ONE_RUN = ("stage_seconds", "wall_seconds", "peak_bytes")  # the only fields in which two runs' commit records differ


def temporaries(folder):
    """Names of the files that are being written, or that a killed writer left."""
    return sorted(path.name for path in pathlib.Path(folder).iterdir() if path.name.endswith(".tmp"))


def shards(folder):
    """The shards' names, in order."""
    return sorted(path.name for path in pathlib.Path(folder).glob("*-of-*.h5"))


def records(folder):
    """The commit records by their shard's name."""
    found = pathlib.Path(folder).glob("*-of-*.json")
    return {path.with_suffix(".h5").name: json.loads(path.read_text()) for path in sorted(found)}


def quarantined(folder):
    """The reason of each sample that is in quarantine, by its id."""
    return {entry["sample_id"]: entry["reason"] for record in records(folder).values()
            for entry in record["quarantined"]}


def content(folder):
    """Each file by name: a commit record as JSON without what differs from run to run,
    any other as SHA-256 of its bytes."""
    files = {}
    for path in sorted(pathlib.Path(folder).rglob("*")):
        if path.is_dir():
            continue
        name = str(path.relative_to(folder))
        if path.suffix == ".json" and "-of-" in path.name:
            record = json.loads(path.read_text())
            files[name] = {key: value for key, value in record.items() if key not in OF_ONE_RUN}
        else:
            files[name] = hashlib.sha256(path.read_bytes()).hexdigest()
    return files


def same_folder(got, expected):
    """Fails with the names that differ unless both folders hold the same files and no temporary."""
    same_content(content(got), content(expected), got)


def same_content(got, expected, where):
    faults = [f"{name} is missing" for name in expected.keys() - got.keys()]
    faults += [f"{name} is one too many" for name in got.keys() - expected.keys()]
    for name in expected.keys() & got.keys():
        if got[name] != expected[name]:
            faults.append(f"{name} differs" + field_difference(got[name], expected[name]))
    if faults:
        raise AssertionError(f"{where}: " + "; ".join(sorted(faults)))


def field_difference(got, expected):
    if not isinstance(got, dict) or not isinstance(expected, dict):
        return ""
    return "".join(f", {key}: expected {expected.get(key)}, got {got.get(key)}"
                   for key in sorted(got.keys() | expected.keys()) if got.get(key) != expected.get(key))

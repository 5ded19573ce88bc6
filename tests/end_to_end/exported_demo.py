"""The demo, with an image that is broken, converted and finalized; and what tests of its exports share."""

import json
import pathlib
import shutil
import tempfile
import unittest

import h5py
import numpy as np

import program
from program import run, text

BROKEN = "000003"  # of KITTI: quarantined
folder = finalized = samples = None  # a module's tests have them from set_up() to tear_down()
exports = {}


def set_up():
    global folder, finalized, samples
    folder = pathlib.Path(tempfile.mkdtemp(prefix="eventgan-export-"))
    demo = folder / "demo"
    run("make-demo", demo)
    image = demo / "kitti" / "training" / "image_2" / f"{BROKEN}.png"
    image.write_bytes(image.read_bytes()[:-50])
    kitti = {"dataset": "kitti_object", "root": "kitti/training", "pairs": program.pairs([1, 2, 3])}
    sources = [kitti, {**kitti, "split": "val"},
               {"dataset": "mpii", "root": "mpii", "pairs": program.pairs([2, 4], side="around")},
               {"dataset": "human36m", "root": "h36m", "layout": "fetch", "pairs": program.pairs([1, 2], side="after")}]
    manifest = program.manifest(
        sources, image={"width": 173, "height": 130, "fit": "letterbox", "preset": "mpii"},
        generator={"kind": "difference"}, volume={"bins": 9, "normalize": "none"},
        errors={"policy": "quarantine", "max_count": 9, "max_fraction": 1})
    (demo / "manifest.json").write_text(json.dumps(manifest))
    finalized = demo / "out"
    run("convert", demo / "manifest.json", "--progress", "none")
    samples = read_samples(finalized)


def tear_down():
    shutil.rmtree(folder)


def exported(to, *arguments):
    """The folder of an export that is made once, which no test may change; and what it said."""
    if (to, *arguments) not in exports:
        out = folder / "exports" / str(len(exports))
        said, _ = run("export", finalized, "--to", to, "--out", out, "--progress", "none", *arguments)
        exports[to, *arguments] = out, said
    return exports[to, *arguments]


def read_samples(out):
    """Each sample of the shards that is not quarantined: its columns, by (split, dataset, sample id)."""
    found = {}
    for name in [shard["name"] for shard in json.loads((out / "dataset.json").read_text())["shards"]]:
        with h5py.File(out / name) as shard:
            classes = [text(name) for name in shard["labels/boxes/class_id"].attrs["class_names"]]
            joints = [text(name) for name in shard["labels/poses"].attrs["joint_names"]]
            aliases = [text(name) for name in shard["labels/poses"].attrs.get("joint_aliases", joints)]
            for i in np.flatnonzero(shard["valid"][:]):
                sample = {"shard": name, "slot": i, "volume": shard["events/volume"][i], "classes": classes,
                          "joints": [j for j, alias in enumerate(aliases) if alias],
                          "joint_names": [a for a in aliases if a]}
                for kind in ("boxes", "poses"):
                    group = shard["labels"][kind]
                    rows = slice(*group["offsets"][i:i + 2])
                    sample[kind] = {key: group[key][rows] for key in group if key != "offsets"}
                for column in ("source_to_volume", "gap_s", "label_index"):
                    sample[column] = shard["pairs"][column][i]
                sample["pairs"] = {key: column[i] for key, column in shard["pairs"].items()}
                sample["pairs"].update((key, shard["labels"][key][i]) for key in ("projection", "projection_source")
                                       if key in shard["labels"])
                key = (text(shard.attrs["split"]), text(shard.attrs["dataset"]), text(shard["pairs/sample_id"][i]))
                found[key] = sample
    return found


def of(split=None, dataset=None):
    return {key: sample for key, sample in samples.items()
            if split in (None, key[0]) and dataset in (None, key[1])}


def name_of(key):
    """What a sample's files are called; train has several sources."""
    split, dataset, sample_id = key
    return (f"{dataset}+" if split == "train" else "") + sample_id.replace("/", "+")


class Export(unittest.TestCase):
    def setUp(self):
        self.out = pathlib.Path(tempfile.mkdtemp(dir=folder)) / "export"

    def export(self, to, *arguments, out=None, source=None, expect=0):
        return run("export", source or finalized, "--to", to, "--out", out or self.out, "--progress", "none",
                   *arguments, expect=expect)

    def described(self, out=None):
        return json.loads(((out or self.out) / "export.json").read_text())

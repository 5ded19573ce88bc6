"""Views over shards as stock h5py sees them: the values are the shards', one after the other."""

import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest

import h5py
import numpy as np

# In the order of the view: both shards of "train" before the one of "val".
SHARDS = ["demo-train-00000-of-00002.h5", "demo-train-00001-of-00002.h5",
          "demo-val-00000-of-00001.h5"]
OFFSETS = ("labels/boxes/offsets", "labels/poses/offsets")


def datasets(group):
    """Every dataset below the group by its path from there, but for the view's own tables."""
    found = {}
    group.visititems(lambda name, item: found.update({name: item})
                     if isinstance(item, h5py.Dataset) else None)
    return {name: item for name, item in found.items()
            if name.split("/")[0] not in ("shards", "splits")}


def values(dataset):
    """As lists, so that text, bytes and NaN compare."""
    if dataset.dtype.kind == "O":
        return [bytes(value) for value in dataset[:]]
    return dataset[:]


class View(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        subprocess.run([os.environ["WRITE_EXAMPLE_VIEWS"], self.folder], check=True)

    def open(self, path):
        file = h5py.File(self.folder / path, "r")
        self.addCleanup(file.close)
        return file

    def assert_concatenated(self, view, shards):
        columns = datasets(view)
        expected = set().union(*(datasets(shard) for shard in shards))
        self.assertEqual(set(columns), expected)
        for name, column in columns.items():
            parts = [values(shard[name]) for shard in shards if name in shard]
            if name == "labels/boxes/outline":  # of the first shard alone
                self.assertEqual(values(column), [*parts[0], *[b""] * (len(column) - len(parts[0]))])
                continue
            if name in OFFSETS:
                rows = np.concatenate([np.diff(part) for part in parts])
                np.testing.assert_array_equal(column, np.concatenate([[0], np.cumsum(rows)]))
            elif column.dtype.kind == "O":
                self.assertEqual(values(column), sum(parts, []), name)
            elif len(parts) == len(shards):
                np.testing.assert_array_equal(column, np.concatenate(parts), name)
            self.assertEqual(column.dtype, shards[0][name].dtype, name)

    def test_values_of_every_type_are_the_shards_one_after_the_other(self):
        for dtype in ("float32", "float16", "uint8"):
            shards = [self.open(f"{dtype}/{name}") for name in SHARDS]
            view = self.open(f"{dtype}/dataset.h5")
            self.assertEqual(view["events/volume"].shape, (9, 4, 6, 8))
            self.assertEqual(view["events/volume"].dtype, dtype)
            self.assert_concatenated(view, shards)

    def test_most_columns_are_virtual_and_the_rest_has_checksums(self):
        for name, column in datasets(self.open("float16/dataset.h5")).items():
            if name in OFFSETS or name == "valid":
                self.assertTrue(column.fletcher32, name)
            else:
                self.assertTrue(column.is_virtual, name)

    def test_a_split_is_one_range(self):
        view = self.open("float16/dataset.h5")
        self.assertEqual(list(view.attrs["views"]), ["/"])
        self.assertEqual(list(view["splits/name"].asstr()), ["train", "val"])
        np.testing.assert_array_equal(view["splits/first"], [0, 7])
        np.testing.assert_array_equal(view["splits/rows"], [7, 2])
        self.assertEqual(list(view["shards/name"].asstr()), SHARDS)
        np.testing.assert_array_equal(view["shards/first"], [0, 5, 7])
        np.testing.assert_array_equal(view["shards/rows"], [5, 2, 2])

    def test_labels_of_a_sample_by_offsets(self):
        view = self.open("float16/dataset.h5")
        sample = 7  # the first of "val": the fourth of the example, with one box
        first, last = view["labels/boxes/offsets"][sample:sample + 2]
        self.assertEqual(view["labels/boxes/xyxy"][first:last].tolist(), [[5, 0, 8, 3]])
        first, last = view["labels/poses/offsets"][sample + 1:sample + 3]
        self.assertEqual(view["labels/poses/joints"][first:last].shape, (1, 3, 2))
        np.testing.assert_array_equal(view["valid"], [1, 1, 0, 1, 1, 1, 1, 1, 1])

    def test_optional_columns_are_missing_for_shards_without(self):
        joints = self.open("float16/dataset.h5")["labels/poses/joints3d_mm"]
        self.assertEqual(joints.shape, (4, 3, 3))  # three persons of the first shard, one of "val"
        has_none = np.isnan(joints[:]).all(axis=(1, 2))
        np.testing.assert_array_equal(has_none, [True, False, True, True])

    def test_attributes_are_those_of_a_shard(self):
        shard = self.open(f"uint8/{SHARDS[0]}")
        view = self.open("uint8/dataset.h5")

        def look_at(name, item):
            for key, value in item.attrs.items():
                np.testing.assert_array_equal(view[name].attrs[key], value, f"{name} {key}")

        shard.visititems(look_at)
        for key in set(shard.attrs) - {"format", "name", "split", "features"}:
            self.assertEqual(view.attrs[key], shard.attrs[key], key)
        self.assertEqual(view.attrs["format"], "eventgan-view")
        found = [set(self.open(f"uint8/{name}").attrs["features"]) for name in SHARDS]
        self.assertEqual(set(view.attrs["features"]), set.union(*found))

    def test_a_moved_folder_read_from_another_one(self):
        moved = self.folder / "elsewhere" / "deep"
        moved.parent.mkdir()
        shutil.move(self.folder / "float16", moved)
        decoys = self.folder / "float32"  # has files of the same names
        before = os.getcwd()
        self.addCleanup(os.chdir, before)
        os.chdir(decoys)
        with h5py.File(moved / SHARDS[0], "r+") as shard:
            shard["events/eta98"][0] = 42
        for path in (moved / "dataset.h5", os.path.relpath(moved / "dataset.h5")):
            with h5py.File(path, "r") as view:
                self.assertEqual(view["events/eta98"][0], 42)

    def test_a_shard_that_is_gone_shows(self):
        for dtype in ("float16", "uint8"):
            (self.folder / dtype / SHARDS[1]).unlink()
            view = self.open(f"{dtype}/dataset.h5")
            volume = view["events/volume"][:].astype("float32")
            volume *= view["events/scale"][:].reshape(-1, 1, 1, 1)
            gone = np.isnan(volume).all(axis=(1, 2, 3))
            np.testing.assert_array_equal(gone, [False] * 5 + [True] * 2 + [False] * 2)
            self.assertTrue(np.isnan(view["labels/boxes/xyxy"][3]).all())  # its one box
            self.assertEqual(view["labels/boxes/class_id"][3], -1)
            self.assertEqual(view["labels/boxes/ignore"][3], 255)
            self.assertEqual(view["pairs/gap_frames"][5], -1)
            self.assertEqual(view["pairs/sample_id"].asstr()[5], "")
            np.testing.assert_array_equal(view["labels/boxes/offsets"],
                                          [0, 2, 2, 2, 3, 3, 3, 4, 5, 5])

    def test_two_kinds_stand_in_groups(self):
        file = self.open("two/dataset.h5")
        self.assertEqual(list(file.attrs["views"]), ["demo", "other"])
        self.assertEqual(set(file), {"demo", "other"})
        self.assert_concatenated(file["demo"], [self.open(f"two/{name}") for name in SHARDS])
        self.assert_concatenated(file["other"],
                                 [self.open("two/other-train-00000-of-00001.h5")])
        self.assertEqual(file["other/labels/poses/joints"].shape, (0, 0, 2))
        self.assertEqual(list(file["demo/labels/poses"].attrs["joint_names"]),
                         ["nose", "left hand", "right hand"])

    def test_no_object_has_a_time(self):
        for path in ("float16/dataset.h5", "two/dataset.h5"):
            file = self.open(path)
            items = [file]
            file.visititems(lambda _, item: items.append(item))
            for item in items:
                self.assertEqual(h5py.h5g.get_objinfo(item.id).mtime, 0, item.name)


if __name__ == "__main__":
    unittest.main()

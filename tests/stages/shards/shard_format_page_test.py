"""manifests/guides/shard_format.md against a shard: each says what the other has."""

import re
import unittest

import h5py

import eventgan.open_shards
from example_shards import SOURCE, ExampleShards

PAGE = SOURCE / "manifests" / "guides" / "shard_format.md"
# What a shard is; the parts after that are on the files beside it.
TEXT = PAGE.read_text(encoding="utf-8").split("## The commit record")[0]


def tables():
    """(path, dtype, shape, meaning) of each dataset, and (object, attribute, dtype) of each attribute of the page."""
    datasets = re.findall(r"(?m)^\| `(/\S+)` (\w+)\[(\S+)\] \| (.*) \|$", TEXT)
    attributes = [(path, *re.match(r"`(\w+)`(?: (int32)\b)?", text).groups("str"))
                  for path, texts in re.findall(r"(?ms)^- `(/\S*)`: (.*?)(?=\n-|\n\n)", TEXT)
                  for text in re.split(r";\s+", texts)]
    return datasets, attributes


def dtype_name(dtype):
    if h5py.check_string_dtype(dtype):
        return "str"
    element = h5py.check_vlen_dtype(dtype)
    return str(dtype) if element is None else {"uint8": "bytes"}[str(element)]


class ShardFormatPage(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.example = ExampleShards()
        cls.addClassCleanup(cls.example.close)
        cls.file = h5py.File(cls.example.path("float16-1"), "r")
        cls.addClassCleanup(cls.file.close)
        cls.datasets, cls.attributes = tables()

    def test_the_page_has_tables(self):
        self.assertGreater(len(self.datasets), 40)
        self.assertGreater(len(self.attributes), 20)

    def test_every_dataset_of_the_page_is_in_the_shard_as_described(self):
        # 5 samples, 2 bins, 6 x 8 pixels, 3 boxes, 3 persons, 3 joints, 2 x 2 tiles.
        sizes = {"N": 5, "N+1": 6, "2B": 4, "H": 6, "W": 8, "R": 3, "P": 3, "J": 3, "TR": 2, "TC": 2}
        for path, dtype, shape, _ in self.datasets:
            with self.subTest(path=path):
                dataset = self.file[path]
                words = shape.split(",")
                self.assertEqual(dataset.shape, tuple(sizes.get(w) or int(w) for w in words))
                self.assertEqual(dtype_name(dataset.dtype), dtype)

    def test_every_dataset_of_the_shard_is_on_the_page(self):
        found = set()
        self.file.visititems(lambda name, item: found.add("/" + name)
                             if isinstance(item, h5py.Dataset) else None)
        self.assertEqual(found, {row[0] for row in self.datasets})

    def test_attributes_of_the_page_and_of_the_shard_are_the_same(self):
        found = set()

        def look_at(item):
            for name in item.attrs:
                dtype = item.attrs.get_id(name).dtype
                found.add((item.name, name, dtype_name(dtype)))

        look_at(self.file)
        self.file.visititems(lambda _, item: look_at(item))
        self.assertEqual(found, set(self.attributes))

    def test_features_of_the_page_are_the_shards_and_the_readers(self):
        columns = [re.match(r"\*(\w+)\*\. ", what) for _, _, _, what in self.datasets]
        features = [*dict.fromkeys(column[1] for column in columns if column), "joint_aliases"]
        self.assertEqual(list(self.file.attrs["features"]), features)  # this shard has everything
        self.assertEqual(eventgan.open_shards.FEATURES, set(features))
        with h5py.File(self.example.path("unlabelled"), "r") as plain:
            self.assertEqual(list(plain.attrs["features"]), ["times", "origin"])

    def test_the_version_is_that_of_the_page(self):
        version = self.file.attrs["format_version"]
        self.assertTrue(PAGE.read_text(encoding="utf-8").startswith(f"# Shard format, version {version}\n"))
        self.assertEqual(version, eventgan.open_shards.FORMAT_VERSION)

    def test_the_lines_of_python_on_the_page_run(self):
        code = "\n".join(line[4:] for line in re.findall(
            r"(?m)^    (?:import h5py|with h5py|    ).*$", TEXT))
        code = code.replace("kitti-events-train-00000-of-00117.h5",
                            str(self.example.path("uint8-1")))
        names = {}
        exec(code, names)
        self.assertEqual(names["volume"].shape, (4, 6, 8))
        self.assertAlmostEqual(names["volume"].max(), max(self.example.volumes[0]), places=5)
        self.assertEqual(names["boxes"].tolist(), [[1, 1, 4.25, 4.5], [0, 0, 0.5, 0.5]])
        self.assertEqual(names["classes"].tolist(), [0, 1])


if __name__ == "__main__":
    unittest.main()

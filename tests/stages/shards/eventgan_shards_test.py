"""The Python reader that comes with the format."""

import multiprocessing
import pathlib
import pickle
import shutil
import sys
import tempfile
import unittest

import numpy as np

from example_shards import NAME, SOURCE, ExampleShards

sys.path.insert(0, str(SOURCE / "manifests" / "python"))
import eventgan_shards  # noqa: E402
from eventgan_shards import InvalidSample, Shards  # noqa: E402


def id_of(shards, index):
    return shards[index]["pair"]["sample_id"]


class ReadingShards(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.example = ExampleShards()
        cls.addClassCleanup(cls.example.close)

    def setUp(self):  # a folder with one shard, to be changed at will
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name, "out")
        shutil.copytree(self.example.path("uint8-1").parent, self.folder)

    def add_second_shard(self):
        second = "demo-train-00001-of-00002.h5"
        shutil.copy(self.folder / NAME, self.folder / second)
        marker = (self.folder / NAME).with_suffix(".json")
        text = marker.read_text().replace(NAME, second)
        (self.folder / second).with_suffix(".json").write_text(text)

    def test_a_folder_without_its_quarantined_samples(self):
        shards = Shards(self.folder)
        self.assertEqual(len(shards), 4)
        self.assertEqual([id_of(shards, i) for i in range(4)],
                         ["000000", "000001", "000003", "000004"])
        self.assertEqual(id_of(shards, -1), "000004")
        with self.assertRaises(IndexError):
            shards[4]

    def test_several_shards_follow_each_other(self):
        self.add_second_shard()
        shards = Shards(self.folder)
        self.assertEqual([sample["slot"] for sample in shards], [0, 1, 3, 4] * 2)
        self.assertTrue(shards[4]["shard"].endswith("00001-of-00002.h5"))

    def test_more_shards_than_files_stay_open(self):
        shards = Shards([self.folder / NAME] + [self.example.path(f"{dtype}-{level}")
                        for dtype in ("float32", "float16", "uint8") for level in (0, 1, 9)])
        self.assertEqual(len(list(shards)), 40)
        self.assertLessEqual(len(shards._files), eventgan_shards._OPEN_FILES)

    def test_volumes_are_decoded(self):
        expected = np.array(self.example.volumes[3], "float32").reshape(4, 6, 8)
        for kind, tolerance in (("float32-0", 0), ("float16-9", 1e-3), ("uint8-1", 3e-3)):
            volume = Shards(self.example.path(kind))[2]["volume"]
            self.assertEqual(volume.dtype, np.float32)
            np.testing.assert_allclose(volume, expected, rtol=0, atol=tolerance)

    def test_labels(self):
        shards = Shards(self.folder)
        first = shards[0]
        self.assertEqual(first["boxes"]["xyxy"].tolist(), [[1, 1, 4.25, 4.5], [0, 0, 0.5, 0.5]])
        self.assertEqual(first["boxes"]["ignore"].tolist(), [0, 1])
        self.assertEqual(first["persons"]["joints"].shape, (2, 3, 2))
        self.assertEqual(first["original"][:8], b"Car 0.10")
        self.assertEqual(first["pair"]["gap_frames"], 2)
        self.assertEqual(first["pair"]["source_to_volume"].shape, (2, 3))
        self.assertEqual(shards[1]["boxes"]["xyxy"].shape, (0, 4))
        self.assertEqual(shards.class_names(0), ["Car", "DontCare"])
        self.assertEqual(shards.joint_names(-1), ["nose", "left hand", "right hand"])

    def test_quarantined_samples_raise_with_the_reason(self):
        shards = Shards(self.folder, invalid="raise")
        self.assertEqual(len(shards), 5)
        with self.assertRaisesRegex(InvalidSample, "cannot decode kitti/image_2/000002.png"):
            shards[2]

    def test_quarantined_samples_can_be_kept(self):
        sample = Shards(self.folder, invalid="keep")[2]
        self.assertFalse(sample["valid"])
        self.assertFalse(sample["volume"].any())

    def test_shards_that_are_not_done_are_left_out(self):
        self.add_second_shard()
        (self.folder / "demo-train-00001-of-00002.json").unlink()
        self.assertEqual(len(Shards(self.folder)), 4)
        self.add_second_shard()
        with open(self.folder / NAME, "ab") as file:
            file.write(b"x")
        self.assertEqual(len(Shards(self.folder)), 4)
        self.assertEqual(len(Shards(self.folder.parent)), 0)

    def test_other_files_are_refused(self):
        with self.assertRaises(ValueError):
            Shards(self.folder, invalid="maybe")
        with eventgan_shards.h5py.File(self.folder / "other.h5", "w"):
            pass
        with self.assertRaisesRegex(ValueError, "expected eventgan-shard 1.*other.h5"):
            Shards(self.folder / "other.h5")

    def test_every_column_of_a_person(self):
        persons = Shards(self.folder)[0]["persons"]
        self.assertEqual(persons["camera_distortion"].shape, (2, 5))
        self.assertTrue(np.isnan(persons["joints3d_mm"][1, 0]).all())  # this joint is not known
        self.assertEqual(persons["joints3d_mm"][1, 1].tolist(), [4, 5, 3001])

    def test_pytorch_can_batch_samples(self):
        try:
            from torch.utils.data import DataLoader
        except ImportError:
            self.skipTest("skipped: no PyTorch")
        self.add_second_shard()
        # Two samples of as many boxes and persons: the same slot of both shards.
        shards = Shards(self.folder)
        for sample, batch in ((shards[i], next(iter(DataLoader([shards[i], shards[i + 4]], batch_size=2))))
                              for i in range(4)):
            self.assertEqual(batch["volume"].shape, (2, 4, 6, 8))
            self.assertEqual(batch["statistics"]["flags"].tolist(), [sample["statistics"]["flags"]] * 2)
            self.assertEqual(batch["pair"]["sample_id"], [sample["pair"]["sample_id"]] * 2)
        self.assertEqual(len(list(DataLoader(shards, batch_size=None, num_workers=2))), 8)

    def test_a_loader_s_workers_can_share_it(self):
        shards = Shards(self.folder)
        shards[0]
        self.assertEqual(id_of(pickle.loads(pickle.dumps(shards)), 1), "000001")
        with multiprocessing.get_context("fork").Pool(2) as pool:
            ids = pool.starmap(id_of, [(shards, i) for i in range(4)])
        self.assertEqual(ids, ["000000", "000001", "000003", "000004"])


if __name__ == "__main__":
    unittest.main()

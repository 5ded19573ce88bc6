"""Shards as stock h5py sees them: no plugin, and nothing of this project."""

import shutil
import unittest

import h5py
import numpy as np

from example_shards import ExampleShards

SHAPE = (4, 6, 8)  # 2 polarities x 2 bins, height, width
QUARANTINED = 2


class ShardInH5py(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.example = ExampleShards()
        cls.addClassCleanup(cls.example.close)

    def open(self, kind):
        file = h5py.File(self.example.path(kind), "r")
        self.addCleanup(file.close)
        return file

    def test_tiles_and_their_share(self):
        events = self.open("float16-1")["events"]
        share = events["tiles"][:].mean(axis=(1, 2))
        np.testing.assert_array_equal(share, [0.75, 0.75, 0, 0.75, 0.75])  # the third is quarantined
        np.testing.assert_array_equal(events["statistics/generated_fraction"][:], share)

    def test_volumes_of_every_type_and_level(self):
        # Half a unit in the last of float16's 11 bits; half a step of uint8.
        tolerances = {"float32": lambda v, s: 0 * v, "float16": lambda v, s: v * 2.0**-11,
                      "uint8": lambda v, s: 0 * v + 0.5001 * s}
        for dtype, tolerance in tolerances.items():
            for level in (0, 1, 9):
                file = self.open(f"{dtype}-{level}")
                volume = file["events/volume"]
                self.assertEqual(volume.dtype, dtype)
                self.assertEqual(volume.shape, (5, *SHAPE))
                self.assertEqual(volume.chunks, (1, *SHAPE))
                self.assertTrue(volume.shuffle)
                self.assertTrue(volume.fletcher32)
                self.assertEqual(volume.compression, "gzip" if level else None)
                self.assertEqual(volume.compression_opts, level or None)
                for slot, expected in enumerate(self.example.volumes):
                    scale = file["events/scale"][slot]
                    got = volume[slot].astype("float32") * scale
                    if slot == QUARANTINED:
                        self.assertFalse(got.any())
                        continue
                    expected = np.array(expected, "float32").reshape(SHAPE)
                    self.assertTrue((abs(got - expected) <= tolerance(expected, scale)).all())

    def test_every_numeric_dataset_is_checksummed(self):
        def check(name, item):
            if isinstance(item, h5py.Dataset) and item.dtype.kind != "O":
                self.assertTrue(item.fletcher32 and item.shuffle, name)

        self.open("float16-1").visititems(check)

    def test_originals_byte_for_byte(self):
        original = self.open("float16-1")["labels/original"]
        self.assertEqual(bytes(original[0]), b"Car 0.10 0 1.57 2.00 2.00 8.50 9.00\r\nDontCare\n")
        self.assertEqual(bytes(original[1]), b"")
        self.assertEqual(bytes(original[2]), b"any \0 byte")

    def test_texts_and_attributes(self):
        file = self.open("uint8-9")
        self.assertEqual(file["pairs/prev_path"].asstr()[3], "kitti/prev_2/000003_02.png")
        self.assertEqual(file.attrs["manifest"], '{ "name": "d\u00e9mo" }\n')
        self.assertEqual(list(file["labels/boxes/class_id"].attrs["class_names"]),
                         ["Car", "DontCare"])

    def test_ragged_rows(self):
        boxes = self.open("float16-1")["labels/boxes"]
        np.testing.assert_array_equal(boxes["offsets"], [0, 2, 2, 2, 3, 3])
        np.testing.assert_array_equal(boxes["xyxy"][2], [5, 0, 8, 3])
        np.testing.assert_array_equal(boxes["xyxy_unclipped"][2], [5, -1.5, 8.5, 3])

    def test_optional_numbers_are_missing_for_those_without(self):
        poses = self.open("float16-1")["labels/poses"]
        has_none = np.isnan(poses["joints3d_mm"]).all(axis=(1, 2))
        np.testing.assert_array_equal(has_none, [True, False, True])
        np.testing.assert_array_equal(poses["joints3d_mm"][1], [[np.nan] * 3, [4, 5, 3001], [7, 8, 3002]])
        lens = [-0.2071, 0.2478, -0.0031, -0.0014, -0.001]
        np.testing.assert_array_equal(poses["camera_distortion"], [[np.nan] * 5, lens, [np.nan] * 5])

    def test_optional_texts_and_levels(self):
        file = self.open("float16-1")
        self.assertEqual(file["pairs/action"].asstr()[:].tolist(),
                         ["", "Walking-1", "Walking-1", "Walking-1", "Walking-1"])
        self.assertEqual(file["labels/boxes/difficulty"][:].tolist(), [1, -1, -1])
        self.assertEqual([bytes(outline) for outline in file["labels/boxes/outline"]],
                         [b"[[1,1,4.25,1,4.25,4.5,1,4.5],[2,2,2,3,3,3,3,2]]", b"", b""])
        np.testing.assert_array_equal(file["pairs/motion"][:], [[np.nan] * 4] * 4 + [[-1.5, 0.25, 0.75, 1.0078125]])
        motion = file["labels/boxes/motion"]
        np.testing.assert_array_equal(motion[:], [[np.nan] * 4] * 2 + [[0.5, -2.25, 1.5, 0.984375]])
        self.assertEqual(motion.attrs["columns"].tolist(), ["x_px", "y_px", "angle_deg", "scale"])
        np.testing.assert_array_equal(file["pairs/threshold"][:], [np.nan] * 4 + [0.3125])
        self.assertEqual(file["pairs/motion"].attrs["columns"].tolist(), ["x_px", "y_px", "angle_deg", "scale"])
        np.testing.assert_array_equal(file["pairs/next_time_s"][:], [1.2, np.nan, 1.2, 1.2, 1.2])
        self.assertTrue(np.isnan(file["labels/projection"][1:]).all())

    def test_flow_is_an_array_of_a_chunk_for_each_sample(self):
        labels = self.open("float16-1")["labels"]
        flow, valid = labels["flow"], labels["flow_valid"]
        self.assertEqual((flow.dtype, flow.shape, flow.chunks), (np.float16, (5, 2, 6, 8), (1, 2, 6, 8)))
        self.assertEqual((valid.dtype, valid.shape, valid.chunks), (np.uint8, (5, 6, 8), (1, 6, 8)))
        self.assertTrue(np.isnan(flow[:4]).all() and not valid[:4].any())
        np.testing.assert_array_equal(flow[4], np.broadcast_to([[[0.5]], [[-0.25]]], (2, 6, 8)))
        # It leads half a column back, a quarter of a row on: from the first column and the last row out of the image.
        np.testing.assert_array_equal(valid[4], np.pad(np.ones((5, 7)), ((0, 1), (1, 0))))
        self.assertIn("label_position", flow.attrs["meaning"])

    def test_a_source_without_labels_has_empty_datasets(self):
        labels = self.open("unlabelled")["labels"]
        self.assertEqual(labels["boxes/xyxy"].shape, (0, 4))
        self.assertEqual(labels["boxes/xyxy"][:].shape, (0, 4))
        self.assertEqual(labels["poses/joints"].shape, (0, 0, 2))
        self.assertEqual(len(labels["boxes/class_id"].attrs["class_names"]), 0)
        self.assertNotIn("camera", labels["poses"])

    def test_no_object_has_a_time(self):
        file = self.open("float16-1")
        items = [file]
        file.visititems(lambda _, item: items.append(item))
        for item in items:
            info = h5py.h5g.get_objinfo(item.id)
            self.assertEqual(info.mtime, 0, item.name)

    def test_a_flipped_bit_in_a_volume_is_an_error(self):
        broken = self.example.folder / "broken.h5"
        shutil.copy(self.example.path("float16-1"), broken)
        with h5py.File(broken, "r") as file:
            chunk = file["events/volume"].id.get_chunk_info_by_coord((3, 0, 0, 0))
        with open(broken, "r+b") as file:
            file.seek(chunk.byte_offset + chunk.size // 2)
            byte = file.read(1)[0]
            file.seek(-1, 1)
            file.write(bytes([byte ^ 1]))
        with h5py.File(broken, "r") as file:
            file["events/volume"][0]  # its neighbours are not touched
            with self.assertRaises(OSError):
                file["events/volume"][3]


if __name__ == "__main__":
    unittest.main()

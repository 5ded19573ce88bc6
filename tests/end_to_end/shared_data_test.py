"""Real frames and labels, and the golden numbers, through the whole program."""

import json
import shutil

import h5py
import numpy as np
import PIL.Image

import program
from program import SHARED, manifest, pairs, run, text
from safetensors_rules import read_safetensors


def floats(value):
    return np.asarray(value, float)


class SharedData(program.InFolder):
    def convert(self, job, expect=0):
        path = self.write_manifest(job)
        out, _ = run("convert", path, "--progress", "none", expect=expect)
        if expect == 0:
            run("verify", self.folder / "out")
        return out, [h5py.File(shard) for shard in sorted((self.folder / "out").glob("*-of-*.h5"))]

    def test_volumes_equal_the_published_network_through_convert(self):
        imported = {}
        for checkpoint in ["zip", "legacy"]:
            weights = self.folder / f"{checkpoint}.safetensors"
            run("import-weights", SHARED / "golden" / f"checkpoint_{checkpoint}.pt", weights)
            imported[checkpoint] = read_safetensors(weights)
            with self.subTest(checkpoint):
                self.assert_golden_volumes(weights, checkpoint)
        tensors, metadata = imported["zip"]
        self.assertEqual(imported["legacy"][0], tensors)
        self.assertEqual(metadata["origin"], "PyTorch checkpoint")
        self.assertEqual(len(tensors), 2 * 14)  # a weight and a bias each
        self.assertEqual(tensors["head.weight"][0], [8, 2, 3, 3])

    def assert_golden_volumes(self, weights, prefix):
        cases = 0
        with h5py.File(SHARED / "golden" / "golden.h5") as golden:
            for name, case in golden["generator"].items():
                if name == "state":
                    continue
                clip = self.folder / f"{prefix}_clip_{name}"
                clip.mkdir()
                for index, frame in enumerate(case["frames_u8"][:]):
                    PIL.Image.fromarray(frame).save(clip / f"f_{index}.png")
                output = f"{prefix}_{name}"
                job = manifest([{"dataset": "frames", "root": str(clip), "pairs": pairs([1])}], name=name,
                               generator={"weights": str(weights), "precision": "float32"},
                               output={"directory": output, "dtype": "float32"})
                run("convert", self.write_manifest(job), "--progress", "none")
                with h5py.File(next((self.folder / output).glob("*-of-*.h5"))) as shard:
                    volume, expected = shard["events/volume"][0], case["volume"][:]
                self.assertLessEqual(np.abs(volume - expected).max(), 1e-4 * expected.max(), name)
                cases += 1
        self.assertEqual(cases, 3)

    def test_kitti_object_with_its_previous_frames(self):
        root = SHARED / "kitti_object" / "training"
        out, (shard,) = self.convert(manifest(
            [{"dataset": "kitti_object", "root": str(root), "pairs": pairs([1, 2, 3], choose="all")}],
            image={"width": 861, "height": 260, "fit": "stretch", "preset": "kitti"}))
        self.assertIn("without a paired frame", out)  # 000000, 000001, 000008 have no previous frames
        self.assertEqual([text(s) for s in shard["pairs/sample_id"]],
                         ["001497@before1", "001497@before2", "001497@before3"])
        np.testing.assert_array_equal(shard["pairs/gap_frames"], [1, 2, 3])
        np.testing.assert_array_equal(shard["pairs/label_position"], [1, 1, 1])
        np.testing.assert_array_equal(shard["pairs/source_size"], [[375, 1242]] * 3)
        label = (root / "label_2" / "001497.txt").read_bytes()
        self.assertEqual(bytes(shard["labels/original"][2]), label)
        # The first car: 556 185 714 334 of 1242x375 in 861x260.
        scale = np.array([861 / 1242, 260 / 375] * 2)
        np.testing.assert_allclose(shard["labels/boxes/xyxy"][0], floats([556, 185, 714, 334]) * scale, atol=1e-3)

    def test_kitti_object_through_raw_for_gaps_4_to_6(self):
        _, (shard,) = self.convert(manifest(
            [{"dataset": "kitti_object", "root": str(SHARED / "kitti_object" / "training"),
              "raw_root": str(SHARED / "kitti_raw"), "devkit": str(SHARED / "kitti_object" / "devkit"),
              "pairs": pairs([4, 5, 6], choose="all")}],
            image={"width": 346, "height": 260, "fit": "letterbox", "preset": "kitti"}))
        # By the mapping 001497 is frame 7 of drive 0052, which is there from frame 0.
        np.testing.assert_array_equal(shard["pairs/prev_index"], [3, 2, 1])
        np.testing.assert_array_equal(shard["pairs/next_index"], [7, 7, 7])
        for slot, frame in enumerate([3, 2, 1]):
            self.assertTrue(text(shard["pairs/prev_path"][slot]).endswith(f"{frame:010d}.png"))
        np.testing.assert_allclose(shard["pairs/gap_s"][:], [0.4, 0.5, 0.6], atol=1e-6)
        # Nobody knows what gaps these weights were trained on: not even 6 counts as extrapolated.
        self.assertFalse(shard["events/statistics/flags"][:].any())

    def test_kitti_raw(self):
        _, shards = self.convert(
            manifest([{"dataset": "kitti_raw", "root": str(SHARED / "kitti_raw"), "pairs": pairs([6])}],
                     image={"width": 96, "height": 32, "fit": "crop", "preset": "kitti"}))
        self.assertEqual(sum(shard["valid"][:].sum() for shard in shards), 15)  # frames 6..20

    def test_mpii(self):
        _, shards = self.convert(
            manifest([{"dataset": "mpii", "root": str(SHARED / "mpii"), "pairs": pairs([2, 4], "around", "all")}],
                     image={"width": 256, "height": 256, "fit": "letterbox", "preset": "mpii"}))
        shard = shards[0]
        self.assertEqual(text(shard["pairs/sample_id"][0]), "000000001@around2")
        np.testing.assert_array_equal(shard["pairs/label_position"][:2], [0.5, 0.5])
        np.testing.assert_array_equal(shard["pairs/prev_index"][:2], [6, 5])
        np.testing.assert_array_equal(shard["pairs/label_index"][:2], [7, 7])
        poses = shard["labels/poses"]
        self.assertEqual(poses["offsets"][1], 2)  # two people, one of them without joints
        # Joint 0 is at (711, 621) counted from 1.
        np.testing.assert_array_equal(poses["joints_source"][0, 0], [710, 620])
        np.testing.assert_array_equal(poses["visible"][0, :4], [1, 1, -1, 0])
        np.testing.assert_array_equal(poses["joints"][1], np.full((16, 2), -1.0))
        matrix = shard["pairs/source_to_volume"][0]
        np.testing.assert_allclose(poses["joints"][0, 0], matrix[:, :2] @ [710, 620] + matrix[:, 2], atol=1e-3)
        original = json.loads(bytes(shard["labels/original"][0]))
        self.assertIn("000000001.jpg", json.dumps(original))

    def test_human36m(self):
        # Its joints in 3-D and its cameras are random numbers, so no camera is claimed.
        source = {"dataset": "human36m", "root": str(SHARED / "human36m_fetch"), "layout": "fetch", "pairs": pairs([1])}
        self.assertIn("no camera for 18 of 18 rows", run("plan", self.write_manifest(manifest([source])))[0])

        root = self.folder / "h36m"
        shutil.copytree(SHARED / "human36m_fetch", root)
        with h5py.File(root / "S1" / "Directions-1" / "annot.h5", "r+") as annotations:
            for row, camera in enumerate(annotations["camera"][:]):  # the joints that these cameras see
                fx, cx, fy, cy = annotations[f"intrinsics/{camera}"][:]
                seen = (annotations["pose/2d"][row] - [cx, cy]) / [fx, fy]
                annotations["pose/3d-univ"][row] = np.append(5000 * seen, np.full((len(seen), 1), 5000), axis=1)
        _, shards = self.convert(manifest([{"dataset": "human36m", "root": str(root), "layout": "fetch",
                                            "pairs": pairs([1, 6], "after", "one")}],
                                          image={"width": 250, "height": 250, "fit": "stretch", "preset": "mpii"}))
        ids = [text(sample) for shard in shards for sample in shard["pairs/sample_id"]]
        self.assertEqual(len(ids), 16)  # 9 frames of each of two cameras, the last without a next one
        shard = shards[0]
        with h5py.File(root / "S1" / "Directions-1" / "annot.h5") as annotations:
            expected = annotations["pose/2d"][0]
            fx, cx, fy, cy = annotations["intrinsics/54138969"][:]
        np.testing.assert_array_equal(shard["labels/poses/joints_source"][0], expected)
        scale = np.array([250 / 1000, 250 / shard["pairs/source_size"][0][0]])
        np.testing.assert_allclose(shard["labels/poses/joints"][0], (expected + 0.5) * scale - 0.5, atol=1e-3)
        np.testing.assert_allclose(shard["labels/poses/camera"][0],
                                   [fx * scale[0], fy * scale[1], (cx + 0.5) * scale[0] - 0.5,
                                    (cy + 0.5) * scale[1] - 0.5], atol=1e-6)
        # One step is five frames of the 50 Hz original.
        np.testing.assert_allclose(shard["pairs/gap_s"][:], shard["pairs/gap_frames"][:] * 0.1, atol=1e-9)

    def test_human36m_as_it_is_downloaded(self):
        _, shards = self.convert(
            manifest([{"dataset": "human36m", "root": str(SHARED / "human36m_official"), "layout": "official",
                       "every": 5, "pairs": pairs([1, 6], "after", "all")}],
                     image={"width": 250, "height": 250, "fit": "stretch", "preset": "mpii"},
                     generator={"kind": "difference"}, output={"directory": "out", "samples_per_shard": 64}))
        shard, = shards
        ids = [text(sample) for sample in shard["pairs/sample_id"]]
        # Of 40 frames 1, 6, ..., 36 are taken: 7 have a next one, 2 one six steps on, in each of two videos.
        self.assertEqual(len(ids), 18)
        self.assertEqual(ids[0], "S1/Directions 1/54138969/000001@after1")
        np.testing.assert_array_equal(shard["pairs/prev_index"][:3], [1, 1, 6])
        np.testing.assert_array_equal(shard["pairs/next_index"][:3], [6, 31, 11])
        np.testing.assert_allclose(shard["pairs/gap_s"][:], shard["pairs/gap_frames"][:] * 0.1, atol=1e-9)
        expected = np.load(SHARED / "human36m_official" / "expected.npz")
        poses = shard["labels/poses"]
        for slot, sample in enumerate(ids):
            subject, action, camera, number = sample.split("@")[0].split("/")
            row = int(number) - 1
            original = json.loads(bytes(shard["labels/original"][slot]))
            for kind, stored in (("D2_Positions", "joints_source"), ("D3_Positions_mono", "joints3d_mm")):
                pose = expected[f"{kind}/{camera}"][0, row].reshape(32, -1)
                np.testing.assert_array_equal(np.float32(original[kind]), pose)
                np.testing.assert_array_equal(np.float32(poses[stored][slot]), pose)
        self.assertEqual([text(name) for name in poses.attrs["joint_names"]][13], "Neck")
        self.assertEqual(text(shard["pairs/action"][0]), "Directions 1")

    def test_human36m_extracted_and_mpii_lists_have_no_paired_frames(self):
        sources = [{"dataset": "human36m", "root": str(SHARED / "human36m_lists"), "layout": "extracted",
                    "annotations": str(SHARED / "human36m_lists" / "test_h36m_body3d.npz"), "pairs": pairs([1])},
                   {"dataset": "mpii_list", "root": str(SHARED / "mpii_lists"),
                    "annotations": str(SHARED / "mpii_lists" / "test_mpii.json"), "pairs": pairs([1])}]
        for source, frames in zip(sources, [4, 5]):
            _, err = run("convert", self.write_manifest(manifest([source])), expect=66)
            self.assertIn(f"got 0 of {frames} labelled frames", err)

    def test_a_video(self):
        _, shards = self.convert(manifest(
            [{"dataset": "frames", "root": str(SHARED / "clips" / "04_coffee.mp4"), "pairs": pairs([1, 6])}],
            image={"width": 64, "height": 36, "fit": "stretch", "preset": "mpii"},
            output={"directory": "out", "samples_per_shard": 512}))
        gaps = shards[0]["pairs/gap_frames"][:]
        self.assertEqual(set(gaps), {1, 6})
        np.testing.assert_allclose(shards[0]["pairs/gap_s"][:], gaps / 29.97, rtol=1e-4)


if __name__ == "__main__":
    program.main(needs_shared_data=True)

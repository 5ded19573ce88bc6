"""Ground truth of optical flow beside images and recordings, from its files to the shards, by stock h5py."""

import shutil

import cv2
import h5py
import numpy as np

import program
from folders import quarantined
from program import manifest, run
from small_job import LENIENT

SIZE = 64, 96  # height, width


def texture(height, width):
    image = np.random.default_rng(4).uniform(0, 255, (height, width)).astype(np.float32)
    image = cv2.GaussianBlur(image, (0, 0), 1.5)
    return cv2.normalize(image, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)


class Flow(program.InFolder):
    def convert(self, job, *options):
        """The one shard, open."""
        path = self.write_manifest(job)
        run("convert", path, "--progress", "none", *options)
        run("verify", "--deep", self.folder / job["output"]["directory"])
        (shard,) = (self.folder / job["output"]["directory"]).glob("*-of-*.h5")
        return h5py.File(shard)

    def write_flow(self, name, flow, known):
        """As KITTI's development kit writes it: cv2 stores blue, green, red."""
        path = self.folder / "training" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(path), np.dstack([known, 64 * flow[1] + 2**15, 64 * flow[0] + 2**15]).astype(np.uint16))

    def test_of_kitti_lies_beside_the_images(self):
        wide, (x, y) = texture(SIZE[0] + 16, SIZE[1] + 16), (6, -2)  # what is seen moves to the right and up
        for scene in range(2):
            for frame, left, top in ((10, 8, 8), (11, 8 - x, 8 - y)):
                path = self.folder / f"training/image_2/{scene:06}_{frame}.png"
                path.parent.mkdir(parents=True, exist_ok=True)
                cv2.imwrite(str(path), wide[top:top + SIZE[0], left:left + SIZE[1]])
            flow, known = np.empty((2, *SIZE)), np.ones(SIZE)
            flow[0], flow[1], known[:10] = x, y, 0  # nothing is known of the sky
            self.write_flow(f"flow_occ/{scene:06}_10.png", flow, known)
            self.write_flow(f"flow_noc/{scene:06}_10.png", flow, known * (np.arange(SIZE[1]) < 50))
        source = {"dataset": "frames", "root": "training/image_2", "flow": True,
                  "pairs": {"gaps": [1], "side": "after"}}
        half = {"height": SIZE[0] // 2, "width": SIZE[1] // 2, "preset": "mpii"}
        with self.convert(manifest([source], image=half)) as shard:
            self.assertEqual(shard["pairs/sample_id"].asstr()[:].tolist(), ["000000_10", "000001_10"])
            self.assertEqual(shard["pairs/label_position"][:].tolist(), [0, 0])
            flow, valid = shard["labels/flow"][:], shard["labels/flow_valid"][:].astype(bool)
        self.assertTrue((flow[:, 0, 5:] == x / 2).all() and (flow[:, 1, 5:] == y / 2).all())
        self.assertFalse(flow[:, :, :5].any())
        self.assertTrue(valid[:, 5:, :25].all() and not valid[:, :5].any() and not valid[:, :, 25:].any())

        flow, known = np.ones((2, *SIZE)), np.ones(SIZE)
        self.write_flow("flow_occ/000001_10.png", flow, known)
        said = "".join(run("verify", "--deep", self.folder / "out", expect=1))
        self.assertIn("000001_10", said)
        self.assertNotIn("000000_10", said)
        (self.folder / "training/flow_occ/000001_10.png").write_bytes(b"half of a PNG")
        job = manifest([source], image=half, errors=LENIENT)
        job["output"]["directory"] = "damaged"
        self.convert(job).close()
        ((sample, reason),) = quarantined(self.folder / "damaged").items()
        self.assertEqual(sample, "000001_10")
        self.assertIn("in training/flow_occ/000001_10.png", reason)

    def test_an_export_to_dsec_says_what_it_cannot_hold(self):
        (self.folder / "training/image_2").mkdir(parents=True)
        for frame in (10, 11):
            cv2.imwrite(str(self.folder / f"training/image_2/000000_{frame}.png"), texture(16, 600))
        flow = np.zeros((2, 16, 600))
        flow[0, :8], flow[0, 8:] = 255, 256
        self.write_flow("flow_occ/000000_10.png", flow, np.ones((16, 600)))
        self.convert(manifest([{"dataset": "frames", "root": "training/image_2", "flow": True,
                                "pairs": {"gaps": [1], "side": "after"}}], image={"preset": "mpii"})).close()
        said = "".join(run("export", self.folder / "out", "--to", "dsec", "--out", self.folder / "dsec"))
        self.assertIn("left out: pixels of flow of 256 px or more, which DSEC's images do not hold: "
                      f"{8 * (600 - 256)}\n", said)
        (written,) = self.folder.glob("dsec/dsec/train/*/flow/forward/000000.png")
        valid = cv2.imread(str(written), cv2.IMREAD_UNCHANGED)[..., 0]
        self.assertEqual([int(valid[:8].sum()), int(valid[8:].sum())], [8 * (600 - 255), 0])

    def test_of_mvsec_is_numpys(self):
        random = np.random.default_rng(2)
        flow = random.normal(0, 2, (2, 3, *SIZE))
        flow[:, :, :20] = 0  # no depth
        flow[0, 1, 30] = np.nan
        times = np.array([1.0, 1.05, 1.1])
        events = np.column_stack([random.integers(0, SIZE[1], 300), random.integers(0, SIZE[0], 300),
                                  np.linspace(0.99, 1.11, 300), random.choice([-1, 1], 300)])
        with h5py.File(self.folder / "drive_data.hdf5", "w") as file:
            file["davis/left/events"] = events
            file["davis/left/image_raw"] = np.zeros((2, *SIZE), np.uint8)
            file["davis/left/image_raw_ts"] = [1.0, 1.1]
            file["davis/left/image_raw_event_inds"] = np.searchsorted(events[:, 2], [1.0, 1.1], "right") - 1
        for save in (np.savez, np.savez_compressed):
            save(self.folder / "drive_gt_flow_dist.npz", timestamps=times, x_flow_dist=flow[0], y_flow_dist=flow[1])
            job = manifest([{"dataset": "recording", "root": "drive_data.hdf5", "flow": True}], image={},
                           generator={"kind": "events"})
            job["output"]["directory"] = save.__name__
            with self.convert(job) as shard:
                begins, ends = (shard[f"pairs/{side}_time_s"][:] for side in ("prev", "next"))
                read, valid = shard["labels/flow"][:], shard["labels/flow_valid"][:].astype(bool)
            np.testing.assert_allclose([begins, ends], [times[:-1], times[1:]])
            known = np.isfinite(flow).all(0) & flow.any(0)
            expected = np.where(known, flow, 0)[:, :2]
            np.testing.assert_allclose(read, expected.swapaxes(0, 1), rtol=2**-11, atol=2**-25)
            y, x = np.mgrid[:SIZE[0], :SIZE[1]]
            inside = [(0 <= x + read[i, 0]) & (x + read[i, 0] < SIZE[1] - 0.999) & (0 <= y + read[i, 1])
                      & (y + read[i, 1] < SIZE[0] - 0.999) for i in range(2)]
            np.testing.assert_array_equal(valid, known[:2] & inside)

    def test_of_an_export_to_dsec_is_read_again(self):
        """Without its photographs, whose times say how long a recording lasts, too."""
        (self.folder / "photos").mkdir()
        for i in range(3):
            cv2.imwrite(str(self.folder / f"photos/{'abc'[i]}.png"), texture(SIZE[0] + i, SIZE[1]))
        moving = {"from": "stills", "side": "after", "motion": {"translation_px": [2, 6], "rotation_deg": 3}}
        job = manifest([{"dataset": "frames", "root": "photos", "flow": True, "pairs": moving}],
                       image={"height": SIZE[0], "width": SIZE[1], "fit": "crop", "preset": "mpii"},
                       generator={"kind": "esim"})
        with self.convert(job) as shard:
            written = shard["labels/flow"][:], shard["labels/flow_valid"][:]
        run("export", self.folder / "out", "--to", "dsec", "--out", self.folder / "dsec")
        for images in self.folder.glob("dsec/dsec/train/*/images"):
            shutil.rmtree(images)
        job = manifest([{"dataset": "recording", "root": "dsec/dsec/train", "flow": True}], image={},
                       generator={"kind": "events"})
        job["output"]["directory"] = "again"
        with self.convert(job) as shard:
            self.assertEqual([name.split("/")[0] for name in shard["pairs/sample_id"].asstr()], ["a", "b", "c"])
            self.assertEqual(shard["pairs/label_position"][:].tolist(), [0, 0, 0])
            read = shard["labels/flow"][:], shard["labels/flow_valid"][:]
        np.testing.assert_array_equal(read[1], written[1])
        valid = written[1].astype(bool)[:, None].repeat(2, 1)
        self.assertGreater(valid.mean(), 0.8)
        np.testing.assert_array_equal(read[0][valid], written[0][valid])


if __name__ == "__main__":
    program.main()

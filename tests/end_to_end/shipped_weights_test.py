"""What the weights that come with the program promise, through the program: still images, real events, direction of
motion.

With EVENTGAN_CANDIDATE_WEIGHTS=FILE.safetensors these weights are judged in place of the shipped ones.
"""

import hashlib
import json
import os
import unittest

import h5py
import numpy as np

import program
from moving_texture import write_images
from program import SHARED, SOURCE, pairs, run, text

CANDIDATE = os.environ.get("EVENTGAN_CANDIDATE_WEIGHTS") and os.path.abspath(os.environ["EVENTGAN_CANDIDATE_WEIGHTS"])
FOLDER = SOURCE / "manifests" / "weights"
SHIPPED = sorted(FOLDER.glob("eventgan-*.safetensors"))

TOLD = FOLDER / "eventgan-sensor.safetensors"  # these draw events, which match no camera's one by one
THRESHOLDS = [0.15, 0.3, 0.6]
# events per pixel of a still pair, of weights that have learnt real cameras' noise: of 20 ms of 1 Hz
MOST_TOLD_STILL = 0.02
LEAST_RATIO = 3  # of the events at the lowest threshold to those at the highest

# Images of a moving texture, and of one that rests.
HEIGHT, WIDTH = 96, 128
FRAMES = 7
SPEED_PX = 1  # a frame
TEXTURES = [1, 2, 3]
GAPS = [1, 6]
# A still pair's events, as a share of those of a pair that moves by a pixel. Not 0, since a network makes no exact
# nothing; at a fiftieth a still scene costs its reader less than one event in a patch where the slowest motion makes
# fifty.
MOST_OF_STILL = 0.02
# Events per pixel of the farthest pair, so that a network without any events does not pass.
LEAST_OF_FAR = 0.05

# Real events that the training has not seen: six recordings of four kinds of sensor, one of which it has not seen at
# all.
REAL = FOLDER / "train-8.json"  # its `validation`
# The frames of one are ten times as large as the others': of these the last three, as many pixels as another has.
LARGE, FIRST_OF_LARGE = 'hsergb_waterbomb.hdf5", "format": "mvsec", "first_frame": ', (18, 22)
REAL_GAP = 1
HIGHER = ["f1_time", "time_correlation"]
LOWER = ["pool_mse_2"]

# The ends of the clips, which the training has not seen either, as the simulated sensor sees them.
CLIPS = ["01_dog", "03_blocks", "04_coffee"]
FIRST_FRAME, FRAME_COUNT = 270, 8
CLIP_SIZE = {"width": 346, "height": 260}
CLIP_GAP = 1
SENSOR = {"positive_threshold": 0.2, "negative_threshold": 0.2, "threshold_spread": 0.04}
LEAST_RIGHT_DIRECTION = 0.5  # of the pixels with events; at random 1/6


def needs_shared_data(test):
    return unittest.skipUnless(SHARED.is_dir(), "no ../shared/data")(test)


def realism(recordings, *arguments):
    """Scores of each recording, by method: name → score → number."""
    weights = ["--weights", CANDIDATE] if CANDIDATE and "--weights" not in arguments else []
    out, _ = run("realism", recordings, *weights, *arguments, "--json", "--progress", "none")
    return [{method["name"]: method["mean"] for method in recording["methods"]}
            for recording in json.loads(out)["recordings"]]


class ShippedWeights(program.InFolder):
    def real(self):
        """The training manifest whose validation recordings are compared with."""
        text = REAL.read_text().replace('"../../../shared/data/', f'"{SHARED}/')
        all_of_it, few = (f"{LARGE}{first}" for first in FIRST_OF_LARGE)
        self.assertIn(all_of_it, text)
        path = self.folder / "real.json"
        path.write_text(text.replace(all_of_it, few))
        return path

    def convert_by_default(self, root):
        job = {"format": "eventgan-manifest", "version": 1, "name": "job", "seed": 1,
               "sources": [{"dataset": "frames", "root": str(root), "pairs": pairs(GAPS, choose="all")}],
               "image": {"preset": "mpii"},
               "output": {"directory": "out", "samples_per_shard": 512, "dtype": "float32"}}
        if CANDIDATE:
            job["generator"] = {"weights": CANDIDATE}
        _, err = run("convert", self.write_manifest(job), "--progress", "none")
        self.assertNotIn("UNTRAINED", err)
        shard, = (self.folder / "out").glob("*-of-*.h5")
        return h5py.File(shard)

    def test_events_come_with_motion(self):
        steps = range(0, FRAMES * SPEED_PX, SPEED_PX)
        for seed in TEXTURES:
            write_images(self.folder / "images" / f"moving_{seed}", steps, HEIGHT, WIDTH, seed)
            write_images(self.folder / "images" / f"still_{seed}", [0] * FRAMES, HEIGHT, WIDTH, seed)
        shard = self.convert_by_default(self.folder / "images")
        events = shard["events/volume"][:].sum(axis=1).mean(axis=(1, 2))  # per pixel
        still = np.array(["still" in text(path) for path in shard["pairs/prev_path"]])
        gaps = shard["pairs/gap_frames"][:]
        self.assertEqual(still.sum(), len(TEXTURES) * sum(FRAMES - gap for gap in GAPS))
        near, far = (events[~still & (gaps == gap)].mean() for gap in GAPS)
        print(f"events per pixel: still at most {events[still].max():.6f}, moving {near:.5f} and {far:.5f}, "
              f"{GAPS} apart")
        self.assertLess(events[still].max(), MOST_OF_STILL * near)
        self.assertGreater(far, near)
        self.assertGreater(far, LEAST_OF_FAR)

    @unittest.skipIf(CANDIDATE, "other weights are judged")
    def test_the_plan_tells_which_weights(self):
        write_images(self.folder / "images", range(FRAMES), HEIGHT, WIDTH, TEXTURES[0])
        shard = self.convert_by_default(self.folder / "images")
        hashes = {hashlib.sha256(path.read_bytes()).hexdigest() for path in SHIPPED}
        used = json.loads((self.folder / "out" / "plan.json").read_text())["fingerprint"]["weights"]
        self.assertIn(used, hashes)
        self.assertEqual(text(shard.attrs["weights_hash"]), used)

    @needs_shared_data
    def test_nearer_to_cameras_than_the_fitted_difference(self):
        for weights in [CANDIDATE] if CANDIDATE else set(SHIPPED) - {TOLD}:
            scores = realism(self.real(), "--gaps", REAL_GAP, "--with", "network,difference", "--weights",
                             weights)
            self.assertEqual(len(scores), 6)
            for score in HIGHER + LOWER:
                network, model = (np.array([each[name][score] for each in scores])
                                  for name in ("network", "difference"))
                print(f"{weights.name if not CANDIDATE else CANDIDATE}: {score}, network / difference:",
                      (network / model).round(2), network.mean() / model.mean())
                with self.subTest(score, weights=str(weights)):
                    if score in HIGHER:
                        self.assertGreater(network.mean(), model.mean())
                    else:
                        self.assertTrue((network < model).all(), network / model)

    def events_at(self, threshold):
        """Events per pixel of still and of moving pairs."""
        job = {"format": "eventgan-manifest", "version": 1, "name": "job", "seed": 1,
               "sources": [{"dataset": "frames", "root": str(self.folder / "images"),
                            "pairs": pairs([1], choose="all")}],
               "generator": {"weights": str(TOLD), "sensor": {"threshold": threshold}},
               "image": {"preset": "mpii"}, "output": {"directory": f"out-{threshold}", "samples_per_shard": 512}}
        run("convert", self.write_manifest(job), "--progress", "none")
        shard, = (self.folder / f"out-{threshold}").glob("*-of-*.h5")
        with h5py.File(shard) as file:
            self.assertTrue((file["pairs/threshold"][:] == threshold).all())
            still = np.array(["still" in text(path) for path in file["pairs/prev_path"]])
            events = file["events/volume"][:].astype(float).sum(axis=1)
        # whole ones at each pixel, but for how they are stored
        self.assertLess(np.abs(events - events.round()).max(), 0.02)
        return events[still].mean(), events[~still].mean()

    @unittest.skipIf(CANDIDATE or not TOLD.exists(), "other weights are judged")
    def test_a_higher_threshold_makes_fewer_events(self):
        for name, steps in {"still": [0] * FRAMES, "moving": range(0, FRAMES * SPEED_PX, SPEED_PX)}.items():
            write_images(self.folder / "images" / name, steps, HEIGHT, WIDTH, TEXTURES[0])
        still, moving = np.array([self.events_at(threshold) for threshold in THRESHOLDS]).T
        print(f"events per pixel at thresholds {THRESHOLDS}: still {still.round(5)}, moving {moving.round(4)}")
        self.assertTrue((np.diff(moving) < 0).all(), moving)
        self.assertGreater(moving[0], LEAST_RATIO * moving[-1])
        self.assertLess(still.max(), MOST_TOLD_STILL)

    @needs_shared_data
    @unittest.skipIf(CANDIDATE or not TOLD.exists(), "other weights are judged")
    def test_a_told_sensor_has_the_cameras_bins_and_polarities(self):
        out, _ = run("realism", self.real(), "--gaps", REAL_GAP, "--with", "network,difference", "--weights", TOLD,
                     "--json", "--progress", "none")
        for recording in json.loads(out)["recordings"]:
            network, model = recording["methods"]
            shares, real = (np.array(each["mean"]["events_per_channel"]) / each["mean"]["events_per_pixel"]
                            for each in (network, recording["real"]))
            print(f"{recording['recording']}: distance of shares {network['share_distance']:.3f}, difference's "
                  f"{model['share_distance']:.3f}")
            with self.subTest(recording["recording"]):
                self.assertLess(network["share_distance"], model["share_distance"])
                self.assertAlmostEqual(shares[:9].sum(), real[:9].sum(), delta=0.03)

    @needs_shared_data
    def test_keeps_the_direction_of_motion(self):
        sources = [{"path": str(SHARED / "clips" / f"{clip}.mp4"), "first_frame": FIRST_FRAME,
                    "frame_count": FRAME_COUNT}
                   for clip in CLIPS]
        job = {"format": "eventgan-simulation", "version": 1, "name": "job", "seed": 1, "sources": sources,
               "size": CLIP_SIZE, "sensor": SENSOR, "output": {"directory": "recordings"}}
        run("simulate", self.write_manifest(job), "--progress", "none")
        pixels = right = 0
        for clip in CLIPS:
            recording = self.folder / "recordings" / f"{clip}.hdf5"
            direction = realism(recording, "--with", "network", "--gaps", CLIP_GAP)[0]["network"]["direction"]
            print(f"{clip}: {direction['within_30_deg']} of {direction['pixels']} pixels within 30 degrees")
            pixels += direction["pixels"]
            right += direction["within_30_deg"]
        print(f"together {right / pixels:.3f}")
        self.assertGreaterEqual(right, LEAST_RIGHT_DIRECTION * pixels)


if __name__ == "__main__":
    if not SHIPPED and not CANDIDATE:
        print(f"skipped: no eventgan-*.safetensors in {FOLDER}")
        raise SystemExit(program.SKIPPED)
    program.main()

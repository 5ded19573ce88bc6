"""From images to simulated recordings, to a trained network, to shards and scores: nothing from outside is needed."""

import csv
import hashlib
import json
import pathlib
import shutil
import signal
import subprocess
import tempfile
import time
from xml.etree import ElementTree

import h5py
import numpy as np

import program
from moving_texture import write_images
from program import PROGRAM, manifest, pairs, run
from safetensors_rules import read_safetensors
from small_job import small_job

HEIGHT, WIDTH = 48, 64
FRAMES = 8
SPEED_PX = 2  # to the right, a frame
FRAMES_PER_SECOND = 30
THRESHOLD = 0.2
LOG_EPSILON = 0.001
SENSOR = {"positive_threshold": THRESHOLD, "negative_threshold": THRESHOLD, "threshold_spread": 0,
          "log_epsilon": LOG_EPSILON}
RECORDINGS = ["clip", "difference", "still-000", "still-001"]
AFFINE_PX = 6
AFFINE_FRAMES = 4
STEPS = {"flow": 12, "reconstruction": 6, "generator": 30}
CHANNELS = 2
CONVERTED_GAPS = [1, 3]
SCORES = ["f1_raw", "f1_time", "f1_time_polarity", "pool_mse_2", "pool_mse_4", "time_correlation",
          "polarity_correlation", "events_per_pixel", "positive_share"]
PATIENCE_S = 120


def simulation():
    clip = {"path": "images", "frames_per_second": FRAMES_PER_SECOND}
    return {
        "format": "eventgan-simulation", "version": 1, "name": "small", "seed": 3,
        "sources": [
            {**clip, "name": "clip"},
            {**clip, "name": "difference", "method": "difference"},
            {**clip, "name": "still", "method": "affine", "frame_count": 2, "frame_step": 4,
             "frames_per_image": AFFINE_FRAMES, "max_displacement_px": AFFINE_PX}],
        "size": {"width": WIDTH, "height": HEIGHT}, "sensor": SENSOR, "output": {"directory": "recordings"},
    }


def training():
    return {
        "format": "eventgan-training", "version": 1, "name": "tiny", "seed": 5,
        "recordings": [{"path": "recordings/clip.hdf5", "format": "mvsec", "weight": 2},
                       {"path": "recordings/still-000.hdf5", "format": "mvsec"}],
        "validation": [{"path": "recordings/still-001.hdf5", "format": "mvsec"}],
        "gaps": [1, 2, 3], "crop": {"width": 48, "height": 48}, "batch": 2,
        "network": {"generator_channels": CHANNELS, "discriminator_channels": 4, "cycle_channels": 2},
        "augmentation": {"gain": [0.8, 1.2], "gamma": [0.8, 1.2], "static_fraction": 0.2},
        # A state on disk after each step, so that a look into training.csv tells how far it is.
        "steps": STEPS, "output": {"directory": "whole", "checkpoint_minutes": 0},
    }


def setUpModule():
    global work, images
    work = pathlib.Path(tempfile.mkdtemp(prefix="eventgan-training-"))
    images = write_images(work / "images", range(0, FRAMES * SPEED_PX, SPEED_PX), HEIGHT, WIDTH, seed=1)
    for index in range(FRAMES):
        (work / "images" / f"frame_{index:02d}.json").write_text(json.dumps({"seen": index}))
    (work / "simulation.json").write_text(json.dumps(simulation()))
    (work / "training.json").write_text(json.dumps(training()))
    run("simulate", work / "simulation.json", "--progress", "none")
    run("train", work / "training.json", "--threads", "1", "--progress", "none")


def tearDownModule():
    shutil.rmtree(work)


def log_intensity(image):
    return np.log(image / 255 + LOG_EPSILON)


def temporaries(folder):
    return [path for path in folder.rglob("*") if path.name.startswith(".") or path.suffix == ".tmp"]


class Recordings(program.InFolder):
    def test_there_is_one_for_each_clip_and_for_each_still_image(self):
        self.assertEqual(sorted(path.name for path in (work / "recordings").iterdir()),
                         [f"{name}.hdf5" for name in RECORDINGS])

    def test_they_are_in_the_layout_of_mvsec(self):
        for name in RECORDINGS:
            with self.subTest(name), h5py.File(work / "recordings" / f"{name}.hdf5") as file:
                camera = file["davis/left"]
                x, y, t, polarity = camera["events"][:].T
                times, frames = camera["image_raw_ts"][:], camera["image_raw"]
                self.assertGreater(len(t), 100)
                self.assertTrue((np.diff(t) >= 0).all())
                self.assertEqual(set(polarity), {-1, 1})
                for place, side in [(x, WIDTH), (y, HEIGHT)]:
                    np.testing.assert_array_equal(place, np.floor(place))
                    self.assertTrue(((place >= 0) & (place < side)).all())
                count = FRAMES if name in ("clip", "difference") else AFFINE_FRAMES
                self.assertEqual((frames.shape, frames.dtype), ((count, HEIGHT, WIDTH), np.uint8))
                np.testing.assert_allclose(times, np.arange(count) / FRAMES_PER_SECOND, atol=1e-9)
                # The last event at or before each frame, -1 where there is none.
                np.testing.assert_array_equal(camera["image_raw_event_inds"][:],
                                              np.searchsorted(t, times, side="right") - 1)
                self.assertEqual(json.loads(program.text(file.attrs["simulation"]))["seed"], 3)

    def test_frames_of_a_clip_are_its_images(self):
        for name in ["clip", "difference"]:
            with h5py.File(work / "recordings" / f"{name}.hdf5") as file:
                np.testing.assert_array_equal(file["davis/left/image_raw"][:], images)

    def test_events_sum_to_the_change_of_log_intensity(self):
        # Each event moves a pixel's level by a threshold, and the level stays within one of the intensity.
        change = log_intensity(images[-1]) - log_intensity(images[0])
        for name in ["clip", "difference"]:
            with self.subTest(name), h5py.File(work / "recordings" / f"{name}.hdf5") as file:
                x, y, _, polarity = file["davis/left/events"][:].T
                level = np.zeros((HEIGHT, WIDTH))
                np.add.at(level, (y.astype(int), x.astype(int)), THRESHOLD * polarity)
                self.assertLess(np.abs(level - change).max(), THRESHOLD * (1 + 1e-3))

    def test_flow_is_there_where_things_move(self):
        with h5py.File(work / "recordings" / "clip.hdf5") as file:
            flow = file["davis/left/flow_dist"][:]
            self.assertEqual(flow.shape, (FRAMES - 1, 2, HEIGHT, WIDTH))
            # Estimated, and wrong at the edge where the texture comes in.
            np.testing.assert_allclose(np.median(flow, axis=(0, 2, 3)), [SPEED_PX, 0], atol=0.2)
        for name in ["still-000", "still-001"]:
            with h5py.File(work / "recordings" / f"{name}.hdf5") as file:
                farthest = np.hypot(*file["davis/left/flow_dist"][0]).max()
                self.assertTrue(0 < farthest <= AFFINE_PX + 0.01, farthest)
        with h5py.File(work / "recordings" / "difference.hdf5") as file:
            self.assertNotIn("flow_dist", file["davis/left"])

    def test_threads_do_not_change_bytes(self):
        run("simulate", work / "simulation.json", "--output", self.folder, "--threads", "1", "--progress", "none")
        for name in RECORDINGS:
            self.assertEqual((self.folder / f"{name}.hdf5").read_bytes(),
                             (work / "recordings" / f"{name}.hdf5").read_bytes())
        self.assertEqual(temporaries(self.folder), [])


def without_seconds(table):
    with open(table, newline="") as file:
        return [{key: value for key, value in row.items() if key != "seconds"} for row in csv.DictReader(file)]


class Training(program.InFolder):
    def stop_in(self, phase):
        """Trains until at least a few steps of the phase are done, and stops it as `kill` does;
        exit code and messages."""
        table = self.folder / "training.csv"
        before = table.read_text() if table.is_file() else ""
        process = subprocess.Popen([PROGRAM, "train", work / "training.json", "--output", self.folder, "--threads", "1",
                                    "--progress", "none"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        give_up = time.monotonic() + PATIENCE_S
        while process.poll() is None and time.monotonic() < give_up:
            now = table.read_text() if table.is_file() else ""
            if now != before and f"\n{phase},3," in now:
                process.send_signal(signal.SIGTERM)
                break
            time.sleep(0.005)
        try:
            out, err = process.communicate(timeout=PATIENCE_S)
        finally:
            process.kill()
        return process.returncode, out + err

    def test_stopped_twice_it_ends_with_the_same_bytes(self):
        for phase in ["flow", "generator"]:
            code, messages = self.stop_in(phase)
            self.assertEqual(code, 75, messages)
            self.assertFalse((self.folder / "weights.safetensors").exists())
            self.assertEqual(temporaries(self.folder), [])
            read_safetensors(self.folder / "checkpoints" / "latest.safetensors")
            self.assertLess(len(without_seconds(self.folder / "training.csv")), sum(STEPS.values()))
        _, err = run("train", work / "training.json", "--output", self.folder, "--threads", "1", "--progress", "none")
        self.assertEqual(err, "")
        whole = work / "whole"
        for name in ["weights.safetensors", "weights-latest.safetensors", "validation.csv"]:
            self.assertEqual((self.folder / name).read_bytes(), (whole / name).read_bytes(), name)
        self.assertEqual(without_seconds(self.folder / "training.csv"), without_seconds(whole / "training.csv"))

    def test_run_again_when_complete_it_changes_nothing(self):
        shutil.copytree(work / "whole", self.folder / "whole")
        run("train", work / "training.json", "--output", self.folder / "whole", "--threads", "1", "--progress", "none")
        for path in (work / "whole").rglob("*.*"):
            if path.suffix in (".safetensors", ".csv"):
                copy = self.folder / "whole" / path.relative_to(work / "whole")
                self.assertEqual(copy.read_bytes(), path.read_bytes(), path)

    def test_the_losses_of_each_step_are_there(self):
        rows = without_seconds(work / "whole" / "training.csv")
        self.assertEqual([(row["phase"], int(row["step"])) for row in rows],
                         [(phase, step) for phase, steps in STEPS.items() for step in range(steps)])
        for row in rows:
            if row["phase"] == "generator":
                # Two steps of the discriminator, one of the generator.
                column = "generator.total" if int(row["step"]) % 3 == 2 else "discriminator"
            else:
                column = row["phase"]
            self.assertTrue(np.isfinite(float(row[column])), row)
        self.assertEqual(ElementTree.parse(work / "whole" / "curves.svg").getroot().tag,
                         "{http://www.w3.org/2000/svg}svg")

    def test_weights_are_safetensors_and_tell_where_they_come_from(self):
        tensors, metadata = read_safetensors(work / "whole" / "weights.safetensors")
        self.assertEqual(tensors["head.weight"][0], [CHANNELS, 2, 3, 3])
        self.assertEqual(tensors["pred.weight"][0], [18, CHANNELS, 1, 1])
        self.assertEqual(len(tensors), 2 * 14)  # folded: a weight and a bias each
        for name, (_, content) in tensors.items():
            self.assertTrue(np.isfinite(np.frombuffer(content, "<f4")).all(), name)
        text = (work / "training.json").read_text()
        self.assertEqual(metadata["origin"], "eventgan train")
        self.assertEqual(metadata["training_manifest"], text)
        self.assertEqual(metadata["training_manifest_sha256"], hashlib.sha256(text.encode()).hexdigest())
        self.assertEqual(metadata["training_steps"], ", ".join(f"{phase} {steps}" for phase, steps in STEPS.items()))
        listed = dict(line.split("\t") for line in metadata["training_recordings_sha256"].splitlines())
        for recording in training()["recordings"]:
            content = (work / recording["path"]).read_bytes()
            self.assertEqual(listed[recording["path"]], hashlib.sha256(content).hexdigest())

    def test_the_shortest_example_runs_as_it_is_but_for_its_steps(self):
        write_images(self.folder / "images", range(0, FRAMES * SPEED_PX, SPEED_PX), 128, 144, seed=2)
        (self.folder / "simulation.json").write_text(json.dumps({
            "format": "eventgan-simulation", "version": 1, "name": "one", "size": {"width": 144, "height": 128},
            "output": {"directory": "."},
            "sources": [{"path": "images", "name": "recording", "method": "difference",
                         "frames_per_second": FRAMES_PER_SECOND}]}))
        run("simulate", self.folder / "simulation.json", "--progress", "none")
        example, steps = (program.SOURCE / "manifests" / "examples"
                          / "train_one.json").read_text(), '"steps": { "generator": 2000 }'
        self.assertEqual((example.count(steps), example.count('"path": "recording.hdf5"')), (1, 1))
        (self.folder / "train_one.json").write_text(example.replace(steps, '"steps": { "generator": 2 }'))
        run("train", self.folder / "train_one.json", "--threads", "1", "--progress", "none")
        rows = without_seconds(self.folder / "training" / "training.csv")
        self.assertEqual([row["phase"] for row in rows], 2 * ["generator"])
        self.assertTrue(all(np.isfinite(float(row["generator.total"])) for row in rows), rows)
        self.assertEqual(len(read_safetensors(self.folder / "training" / "weights.safetensors")[0]), 2 * 14)

    def test_other_settings_do_not_go_on(self):
        shutil.copytree(work / "whole", self.folder / "whole")
        other = work / "other.json"
        other.write_text(json.dumps({**training(), "batch": 4}))
        _, err = run("train", other, "--output", self.folder / "whole", "--progress", "none", expect=64)
        self.assertIn("batch", err)
        self.assertNotIn("crop", err)


def contents(group):
    """Every dataset of a group: path → values."""
    found = {}

    def add(name, item):
        if isinstance(item, h5py.Dataset):
            found[name] = item[()].tolist()

    group.visititems(add)
    return found


class TrainedWeights(program.InFolder):
    def convert(self, name, generator):
        source = {"dataset": "frames", "root": str(work / "images"), "frames_per_second": FRAMES_PER_SECOND,
                  "pairs": pairs(CONVERTED_GAPS, choose="all")}
        job = manifest([source], generator=generator,
                       output={"directory": name, "dtype": "float32", "samples_per_shard": 64})
        run("convert", self.write_manifest(job), "--progress", "none")
        run("verify", self.folder / name)
        shard, = (self.folder / name).glob("*-of-*.h5")
        return h5py.File(shard)

    def test_a_network_and_both_models_make_the_same_shards_but_for_the_volumes(self):
        weights = work / "whole" / "weights.safetensors"
        shards = {"network": self.convert("network", {"weights": str(weights)}),
                  "esim": self.convert("esim", {"kind": "esim", "sensor": SENSOR, "max_displacement_px": AFFINE_PX}),
                  "difference": self.convert("difference", {"kind": "difference", "sensor": SENSOR})}
        network = shards["network"]
        self.assertEqual(len(network["pairs/sample_id"]), sum(FRAMES - gap for gap in CONVERTED_GAPS))
        self.assertEqual(json.loads(bytes(network["labels/original"][0])),
                         {"seen": int(network["pairs/label_index"][0])})
        self.assertEqual(program.text(network.attrs["weights_hash"]), hashlib.sha256(weights.read_bytes()).hexdigest())
        for kind in ["esim", "difference"]:
            for group in ["pairs", "labels"]:
                np.testing.assert_equal(contents(shards[kind][group]), contents(network[group]), f"{group} of {kind}")
            self.assertTrue(shards[kind]["valid"][:].all())
            self.assertIn("events", program.text(shards[kind]["events/volume"].attrs["unit"]))
        volumes = {kind: shard["events/volume"][:] for kind, shard in shards.items()}
        for one, other in [("network", "esim"), ("network", "difference"), ("esim", "difference")]:
            self.assertEqual(volumes[one].shape, volumes[other].shape)
            self.assertFalse(np.array_equal(volumes[one], volumes[other]), (one, other))
        self.assert_counts_of_the_difference(shards["difference"], volumes["difference"])

    def assert_counts_of_the_difference(self, shard, volumes):
        """Each volume's events, positive minus negative, make up the change of log intensity, but for less than one."""
        logs = log_intensity(images)
        for volume, first, last in zip(volumes, shard["pairs/prev_index"][:], shard["pairs/next_index"][:]):
            signed = volume[:9].sum(axis=0) - volume[9:].sum(axis=0)
            self.assertLess(np.abs(signed - (logs[last] - logs[first]) / THRESHOLD).max(), 1 + 1e-3)

    def test_realism_scores_the_network_and_both_models(self):
        out, _ = run("realism", work / "recordings" / "clip.hdf5", "--weights", work / "whole" / "weights.safetensors",
                     "--gaps", "1,2", "--esim-draws", "2", "--json", "--progress", "none")
        report, = json.loads(out)["recordings"]
        count = (FRAMES - 1) + (FRAMES - 2)
        self.assertEqual([method["name"] for method in report["methods"]], ["network", "difference", "esim"])
        self.assertEqual(len(report["pairs"]), count)
        for method in report["methods"]:
            self.assertEqual(len(method["pairs"]), count)
            self.assertEqual(len(method["mean"]["events_per_channel"]), 18)
            for scores in [method["mean"], *method["pairs"]]:
                self.assertLessEqual(set(SCORES), set(scores), method["name"])
                self.assertIn("direction", scores)
        real, difference = report["real"]["mean"], report["methods"][1]["mean"]
        self.assertEqual((real["f1_raw"], real["pool_mse_2"]), (1, 0))
        self.assertAlmostEqual(real["time_correlation"], 1)
        # A model that sees both frames finds most of the pixels that a model of the same sensor finds.
        self.assertGreater(difference["f1_time"], 0.5)

    def test_realism_of_several_recordings_ends_with_their_mean(self):
        arguments = (work / "recordings" / "clip.hdf5", work / "training.json", "--with", "difference", "--progress",
                     "none")
        report = json.loads(run("realism", *arguments, "--json")[0])
        self.assertEqual([pathlib.Path(one["recording"]).name for one in report["recordings"]],
                         ["clip.hdf5", "still-001.hdf5"])
        each = [one["methods"][0] for one in report["recordings"]]
        for score in SCORES:
            self.assertAlmostEqual(report["mean"]["difference"][score], np.mean([one["mean"][score] for one in each]))
            low, high = each[0]["bounds"][score]
            self.assertTrue(low <= each[0]["mean"][score] <= high, score)
        text, _ = run("realism", *arguments, "--out", self.folder)
        self.assertRegex(text, r"(?m)^  mean +↑ ")
        self.assertEqual({path.parent.name for path in self.folder.glob("*/*.png")}, {"clip", "still-001"})

    def test_a_recording_that_is_too_short_for_the_gap_is_left_out_of_several(self):
        clip, gap = work / "recordings" / "clip.hdf5", ["--with", "difference", "--progress", "none", "--json",
                                                        "--gaps", FRAMES - 1]
        short = work / "recordings" / "still-001.hdf5"
        with h5py.File(short) as file:
            self.assertLess(len(file["davis/left/image_raw"]), FRAMES)
        out, err = run("realism", short, clip, *gap)
        self.assertEqual([pathlib.Path(one["recording"]).name for one in json.loads(out)["recordings"]], ["clip.hdf5"])
        self.assertIn("still-001.hdf5", err)
        run("realism", short, *gap, expect=64)
        run("realism", short, short, *gap, expect=64)
        out, err = run("fit", short, clip, "--gaps", FRAMES - 1)
        self.assertIn("pairs of frames: 1 fitted", out)
        self.assertIn("still-001.hdf5", err)
        run("fit", short, short, "--gaps", FRAMES - 1, expect=64)

    def test_a_fitted_sensor_is_taken_by_convert_and_realism(self):
        clip, document = work / "recordings" / "clip.hdf5", self.folder / "sim.json"
        out, err = run("fit", clip, "--weights", "shipped:8", "--name", "sim", "--out", document)
        self.assertRegex(out, r"difference: 0\.\d+ ± ")
        self.assertIn("do not know their sensor", err)
        again, err = run("fit", clip, "--name", "sim", "--out", document)
        self.assertEqual(again, out)
        self.assertNotIn("do not know their sensor", err)
        sensor = json.loads(document.read_text())
        self.assertEqual(sensor["name"], "sim")
        self.assertIn("fit of clip.hdf5", sensor["origin"])
        folder = self.folder / "job"
        run("convert", small_job(folder, people=0, generator={"kind": "difference", "sensor": "../sim.json"}),
            "--progress", "none")
        document.unlink()
        run("verify", folder / "out")
        for path in folder.glob("out/*.h5"):
            with h5py.File(path) as shard:
                np.testing.assert_allclose(shard["pairs/threshold"][:], sensor["threshold"])
            self.assertIn("sensor sim", run("inspect", path)[0])
        fields = json.loads((folder / "out" / "plan.json").read_text())["fingerprint"]
        self.assertEqual(fields["manifest $.generator.sensor.name"], '"sim"')
        told = {"threshold": [0.2, 0.3], "noise": {"shot_hz": 1}}
        run("convert", small_job(self.folder / "told", people=0, generator={"kind": "difference", "sensor": told}),
            "--progress", "none")
        for path in self.folder.glob("told/out/*.h5"):
            self.assertIn(", threshold 0.2..0.3, noise of shot_hz 1, leak_hz 0, hot_pixels 0", run("inspect", path)[0])
        out, _ = run("realism", clip, "--with", "difference", "--sensor", "davis346", "--progress", "none")
        self.assertNotIn("(fitted)", out)
        run("realism", clip, "--sensor", "davis346", "--threshold", "0.2", expect=64)
        run("fit", clip, "--name", "../x", expect=64)
        run("fit", clip, "--out", "x.txt", expect=64)
        other = self.folder / "manifest.json"
        other.write_text("{}")
        _, err = run("fit", clip, "--out", other, expect=64)
        self.assertIn("expected a sensor's document, or no file", err)
        self.assertEqual(other.read_text(), "{}")
        run("fit", clip, "--out", self.folder / "none" / "x.json", expect=66)
        run("fit", self.folder / "none.hdf5", expect=66)

    def test_what_tells_nothing_leaves_a_good_document_as_it_is(self):
        quiet, document = self.folder / "quiet.hdf5", self.folder / "sim.json"
        shutil.copyfile(work / "recordings" / "clip.hdf5", quiet)
        run("fit", quiet, "--name", "sim", "--out", document)
        good = document.read_bytes()
        with h5py.File(quiet, "a") as file:
            events = file["davis/left/events"][:0]
            del file["davis/left/events"]
            file["davis/left/events"] = events
        out, err = run("fit", quiet, "--name", "sim", "--out", document, expect=66)
        self.assertIn("got none", err)
        self.assertEqual(document.read_bytes(), good)


if __name__ == "__main__":
    program.main()

"""A camera's own events as a source of `convert`: their volumes, labels and times as numpy has them, and what goes wrong with them."""

import json
import pathlib
import shutil
import sys

import cv2
import h5py
import numpy as np

import program
from camera_files import DHP19_JOINTS, DHP19_MATRICES, HEIGHT, WIDTH, random_events, volume_of, write_dhp19, write_mvsec
from program import SHARED, SOURCE, run, shard_bytes, text

sys.path.insert(0, str(SOURCE / "manifests" / "python"))

HEADER = "time_s,left,top,right,bottom,class,category\n"
FRAMES = [10.0 + 0.05 * k for k in range(9)]
# At a frame; between two; in the silence; without cars.
LABELS = HEADER + ("10.100000,2,3,12,13,car,easy\n10.100000,14,3,30,20,car,hard\n10.100000,0,15,9,24,car,dont_care\n"
                   "10.170000,5,5,20,20,car,easy\n10.300000,5,5,20,20,car,hard\n10.350000\n")


def events_manifest(source, **changes):
    defaults = {"image": {}, "generator": {"kind": "events"},
                "output": {"directory": "out", "dtype": "float32", "samples_per_shard": 2}}
    return program.manifest([source], **{**defaults, **changes})


def rows(out):
    """The valid samples by id: volume, times, difficulty, ignore, boxes."""
    samples = {}
    for path in sorted(pathlib.Path(out).glob("*.h5")):
        with h5py.File(path) as shard:
            offsets = shard["labels/boxes/offsets"][:] if "labels/boxes" in shard else None
            for i, name in enumerate(shard["pairs/sample_id"][:]):
                if not shard["valid"][i]:
                    continue
                own = slice(*offsets[i:i + 2])
                boxes = shard["labels/boxes"]
                samples[text(name)] = {
                    "volume": shard["events/volume"][i], "flags": shard["events/statistics/flags"][i],
                    "times": [shard[f"pairs/{key}"][i] for key in ("prev_time_s", "next_time_s")],
                    "gap": (shard["pairs/gap_frames"][i], shard["pairs/gap_s"][i]), "place": shard["pairs/label_position"][i],
                    "xyxy": boxes["xyxy"][own], "ignore": boxes["ignore"][own],
                    "difficulty": boxes["difficulty"][own] if "difficulty" in boxes else np.full(own.stop - own.start, -1)}
    return samples


class Recordings(program.InFolder):
    def setUp(self):
        super().setUp()
        self.events = np.concatenate([random_events(3000, 10.0, 10.25, 3), random_events(500, 10.31, 10.4, 4)])
        write_mvsec(self.folder / "drive.hdf5", self.events, FRAMES)
        (self.folder / "drive.csv").write_text(LABELS)
        self.out = self.folder / "out"

    def manifest(self, source=(), **changes):
        return self.write_manifest(events_manifest({"dataset": "recording", "root": "drive.hdf5", **dict(source)}, **changes))

    def between(self, begin, end):
        times = self.events[:, 2]
        return self.events[(times > begin) & (times <= end)]

    def test_volumes_times_and_labels_are_those_of_the_window(self):
        stdout, stderr = run("convert", self.manifest())
        self.assertIn("4 of 4 pairs written, 0 quarantined", stdout)
        samples = rows(self.out)
        self.assertEqual(list(samples), ["drive/0000000010.100000", "drive/0000000010.170000", "drive/0000000010.300000",
                                         "drive/0000000010.350000"])
        first, between, silent, empty = samples.values()
        for sample, begin, end in [(first, FRAMES[1], FRAMES[2]), (between, 10.12, 10.17), (silent, FRAMES[5], FRAMES[6])]:
            np.testing.assert_allclose(sample["times"], [begin, end], rtol=0, atol=1e-9)
            np.testing.assert_allclose(sample["volume"], volume_of(self.between(begin, end)), rtol=0, atol=1e-5)
            self.assertEqual((sample["gap"][0], sample["place"]), (0, 1))
        self.assertGreater(first["volume"].sum(), 500)
        self.assertEqual((silent["flags"], silent["volume"].any()), (1, False))  # no events: empty and sound
        self.assertEqual((first["difficulty"].tolist(), first["ignore"].tolist()), ([0, 2, -1], [0, 0, 1]))
        self.assertEqual(first["xyxy"][0].tolist(), [2, 3, 12, 13])
        self.assertEqual(len(empty["xyxy"]), 0)
        self.assertIn("sound: 2 shards, 4 samples", run("verify", self.out, "--deep")[0])
        run("finalize", self.out)
        self.assertEqual(run("preview", self.out, "--out", self.folder / "pictures")[1], "")
        self.assertEqual(len(list((self.folder / "pictures").iterdir())), 4)
        run("report", self.out)
        self.assertIn("windows of events", (self.out / "report.html").read_text())

    def test_the_papers_columns_come_out_of_the_scores(self):
        run("convert", self.manifest())
        from eventgan_shards import evaluate
        found = [{"image_id": "drive/0000000010.100000", "category_id": "car", "bbox": [2, 3, 10, 10], "score": 0.9},
                 {"image_id": "drive/0000000010.100000", "category_id": "car", "bbox": [0, 15, 9, 9], "score": 0.8},
                 {"image_id": "drive/0000000010.300000", "category_id": "car", "bbox": [5, 5, 15, 15], "score": 0.7}]
        (self.folder / "found.json").write_text(json.dumps(found))
        report, _, _ = evaluate.evaluate_detections(self.folder / "found.json", evaluate.Samples(self.out, None, None, None))
        car = report["classes"]["car"]
        self.assertEqual((car["truths"], car["easy"], car["hard"]), (4, 2, 2))
        self.assertEqual((car["recall_easy"], car["recall_hard"], car["precision"]), (0.5, 0.5, 1.0))  # what is on "dont_care" counts nothing

    def greys_shown(self, *where):
        """How many pixels of each image that preview draws of `where` have the one grey of some recordings."""
        images = self.folder / "pictures"
        shutil.rmtree(images, ignore_errors=True)
        told, warned = run("preview", *where, "--out", images, "--frames", self.folder)
        drawn = [cv2.imread(line) for line in told.splitlines()]
        return [[int((image == grey).all(-1).sum()) for grey in (91, 155, 203)] for image in drawn], warned

    def test_a_sample_leads_to_the_frames_of_its_own_source(self):
        # Two cameras of one file; and a folder whose name begins as the file's, in which the time of each frame is another.
        (self.folder / "drive.csv").unlink()
        with h5py.File(self.folder / "drive.hdf5", "r+") as file:
            for camera, grey in {"left": 91, "right": 203}.items():
                file.require_group(f"davis/{camera}")
                for name, values in {"events": self.events, "image_raw_ts": np.array(FRAMES),
                                     "image_raw": np.full((len(FRAMES), HEIGHT, WIDTH), grey, np.uint8)}.items():
                    file.pop(f"davis/{camera}/{name}", None)
                    file[f"davis/{camera}/{name}"] = values
        images = self.folder / "driv" / "images"
        images.mkdir(parents=True)
        for k in range(len(FRAMES)):
            cv2.imwrite(str(images / f"{k}.png"), np.full((HEIGHT, WIDTH), 155, np.uint8))
        (self.folder / "driv" / "images.txt").write_text("".join(f"{t} images/{k}.png\n" for k, t in enumerate(FRAMES)))
        np.savetxt(self.folder / "driv" / "events.txt", self.events[:, [2, 0, 1, 3]].clip(0), fmt=["%.9f", "%d", "%d", "%d"])
        sources = [{"dataset": "recording", "root": "driv"}] + [
            {"dataset": "recording", "root": "drive.hdf5", "camera": camera} for camera in ("left", "right")]
        run("convert", self.write_manifest({**events_manifest({}, output={"directory": "out", "samples_per_shard": 9}),
                                            "sources": sources}))
        shards = sorted(self.out.glob("*.h5"))
        self.assertEqual(len(shards), 3)
        frame = HEIGHT * WIDTH
        for shard, own in zip(shards, (1, 0, 2)):  # the place of the source's grey
            for count in self.greys_shown(shard, "--count", "2")[0]:
                self.assertGreater(count[own], frame)
                self.assertLess(sum(count) - count[own], 50)  # the edges of letters have some
        counts, warned = self.greys_shown(self.out, "--count", "24")
        self.assertEqual([int(np.argmax(count)) for count in counts], 8 * [1] + 8 * [0] + 8 * [2])
        self.assertEqual(warned, "")
        lone = self.folder / "elsewhere" / shards[2].name  # without its plan: no frame rather than another's
        lone.parent.mkdir()
        shutil.copy(shards[2], lone)
        counts, warned = self.greys_shown(lone, "--sample", "3")
        self.assertLess(max(counts[0]), 50)
        self.assertIn("expected the shard's plan beside it", warned)
        self.assertIn("drive/0000000010.200000", warned)

    def test_windows_of_other_kinds_and_labels_in_their_middle(self):
        run("convert", self.manifest({"window_s": 0.02, "label_at": "middle"}))
        for sample, time in zip(rows(self.out).values(), [10.1, 10.17, 10.3, 10.35]):
            np.testing.assert_allclose(sample["times"], [time - 0.01, time + 0.01], rtol=0, atol=1e-9)
            np.testing.assert_allclose(sample["volume"], volume_of(self.between(*sample["times"])), rtol=0, atol=1e-5)
            self.assertEqual(sample["place"], 0.5)
        run("convert", self.manifest({"window_events": 400}), "--output", self.folder / "counted")
        for sample, time in zip(rows(self.folder / "counted").values(), [10.1, 10.17, 10.3, 10.35]):
            until = np.searchsorted(self.events[:, 2], time + 1e-9, side="right")
            window = self.events[until - 400:until]
            self.assertEqual(sample["times"], [window[0, 2], window[-1, 2]])
            np.testing.assert_allclose(sample["volume"], volume_of(window), rtol=0, atol=1e-5)

    def test_events_are_placed_and_normalised_as_frames_are(self):
        run("convert", self.manifest(image={"width": 40, "height": 16, "fit": "letterbox"}, volume={"normalize": "eta98"}))
        sample = rows(self.out)["drive/0000000010.100000"]
        # 32x24 in 40x16: by 16/24 to 21x16, with 9 columns of border to the left.
        window = self.between(FRAMES[1], FRAMES[2]).copy()
        window[:, 0] = np.floor((window[:, 0] + 0.5) * 21 / 32) + 9
        window[:, 1] = np.floor((window[:, 1] + 0.5) * 16 / 24)
        expected = volume_of(window, height=16, width=40)
        values = np.sort(expected[expected > 0])
        eta98 = values[max(int(0.98 * len(values)), 1) - 1]
        np.testing.assert_allclose(sample["volume"], np.minimum(expected, eta98) / eta98, rtol=0, atol=1e-5)
        np.testing.assert_allclose(sample["xyxy"][0], [2 * 21 / 32 + 9, 2, 12 * 21 / 32 + 9, 13 * 16 / 24])

    def test_a_corrupt_window_is_quarantined_and_mended_by_retry(self):
        lenient = {"errors": {"policy": "quarantine", "max_count": 9, "max_fraction": 1}}
        index = int(np.searchsorted(self.events[:, 2], 10.08))
        with h5py.File(self.folder / "drive.hdf5", "r+") as file:
            file["davis/left/events"][index, 0] = WIDTH
        labels = LABELS.replace("10.170000,5,5,20,20", "10.170000,50,5,60,20") + "99,1,1,2,2,car,easy\n"  # outside, in place and time
        (self.folder / "drive.csv").write_text(labels)
        run("convert", self.manifest(**lenient))
        reasons = {entry["sample_id"]: entry["reason"] for path in self.out.glob("job-*.json")
                   for entry in json.loads(path.read_text())["quarantined"]}
        self.assertEqual(set(reasons), {f"drive/00000000{time}" for time in ("10.100000", "10.170000", "99.000000")})
        self.assertIn(f"(event {index})", reasons["drive/0000000010.100000"])
        self.assertIn("drive.csv (10.170000 s)", reasons["drive/0000000010.170000"])
        self.assertIn("which the recording lasts, got 99 s", reasons["drive/0000000099.000000"])
        with h5py.File(self.folder / "drive.hdf5", "r+") as file:
            file["davis/left/events"][index, 0] = self.events[index, 0]
        (self.folder / "drive.csv").write_text(labels.replace("10.170000,50,5,60,20", "10.170000,5,5,20,20"))
        run("retry", self.out)
        self.assertEqual(len(rows(self.out)), 4)
        sample = rows(self.out)["drive/0000000010.100000"]
        np.testing.assert_allclose(sample["volume"], volume_of(self.between(FRAMES[1], FRAMES[2])), rtol=0, atol=1e-5)
        self.assertIn("sound", run("verify", self.out, "--deep")[0])

    def test_parts_and_threads_give_the_same_bytes_and_changed_inputs_are_refused(self):
        manifest = self.manifest()
        run("convert", manifest, "--threads", "2")
        parts = self.folder / "parts"
        for part in ("1/2", "0/2"):
            run("convert", manifest, "--output", parts, "--shards", part, "--threads", "1")
        self.assertEqual(shard_bytes(self.out), shard_bytes(parts))
        before = shard_bytes(self.out)
        self.assertIn("4 pairs", run("plan", manifest)[0])
        run("convert", manifest)  # nothing is left to do
        self.assertEqual(shard_bytes(self.out), before)
        (self.folder / "drive.csv").write_text(LABELS.replace("easy", "hard"))
        self.assertIn("annotations", run("convert", manifest, expect=64)[1])
        (self.folder / "drive.csv").write_text(LABELS)
        write_mvsec(self.folder / "drive.hdf5", self.events[:-100], FRAMES)
        self.assertIn("frames", run("convert", manifest, expect=64)[1])

    def test_clocks_that_do_not_meet_are_a_warning_and_counted_in_the_report(self):
        (self.folder / "drive.csv").unlink()
        write_mvsec(self.folder / "drive.hdf5", self.events, [time + 1e9 for time in FRAMES])
        manifest = self.manifest()
        for command in ("plan", "convert"):
            stdout, stderr = run(command, manifest)
            self.assertIn("warning: expected windows within the times of the events, 10.", stderr)
            self.assertIn("got 8 of 8 outside them", stderr)
            self.assertIn("note: expected windows within the times of the events", stdout)
        run("report", self.out)
        page = (self.out / "report.html").read_text()
        self.assertIn('data-key="source.0.empty" data-value="8"', page)
        self.assertIn("all 8 volumes of", page)

    def test_names_of_classes_with_control_characters_are_refused(self):
        # In a shard both would be "ca".
        (self.folder / "drive.csv").write_text(HEADER + "10.1,1,2,3,4,ca\0r,\n10.17,1,2,3,4,ca\0t,\n")
        error = run("convert", self.manifest(), expect=66)[1]
        self.assertIn(f'got "ca\\u0000r", in {self.folder / "drive.csv"} (line 2)', error)
        self.assertIn('got "ca\\u0000t"', error)

    def test_without_labels_each_frame_is_a_sample_and_a_limit_makes_a_trial(self):
        (self.folder / "drive.csv").unlink()
        manifest = self.manifest()
        self.assertIn("windows          8", run("plan", manifest)[0])
        run("convert", manifest, "--limit", "3")
        trial = rows(self.folder / "out-trial-3")
        self.assertEqual(list(trial), [f"drive/00000000{time:.6f}" for time in FRAMES[1:4]])

    def test_what_does_not_go_together_is_one_line(self):
        frames = {"dataset": "frames", "root": "clip", "pairs": program.pairs([1])}
        for manifest, expected in [(events_manifest(frames), 'since generator.kind is "events"'),
                                   (events_manifest({"dataset": "recording", "root": "drive.hdf5"}, generator={"kind": "difference"}),
                                    'since generator.kind is not "events"'),
                                   (events_manifest({"dataset": "recording", "root": "drive.hdf5", "pairs": program.pairs([1])}),
                                    "whose samples are windows of events"),
                                   (events_manifest({"dataset": "recordings", "root": "drive.hdf5"}), '"recording"')]:
            self.assertIn(expected, run("plan", self.write_manifest(manifest), expect=64)[1])
        for command in ("tradeoff", "calibrate"):
            error = run(command, self.manifest(), expect=64)[1]
            self.assertIn('got "events"', error)
            self.assertEqual(len(error.strip().splitlines()), 1)
        self.assertIn("expected a recording", run("plan", self.manifest({"root": "drive.csv"}), expect=66)[1])

    def test_a_real_recording(self):
        if not SHARED.is_dir():
            self.skipTest("no ../shared/data")
        shutil.copytree(SHARED / "davis" / "slider_depth", self.folder / "slider_depth")
        run("convert", self.manifest({"root": "slider_depth"}))
        rows_of_file = np.loadtxt(self.folder / "slider_depth" / "events.txt")
        samples = list(rows(self.out).values())
        self.assertEqual([round(float(sample["volume"].sum())) for sample in samples], [7778, 11318])
        for sample in samples:
            window = rows_of_file[(rows_of_file[:, 0] > sample["times"][0]) & (rows_of_file[:, 0] <= sample["times"][1])]
            np.testing.assert_allclose(sample["volume"], volume_of(window[:, [1, 2, 0, 3]], height=180, width=240), rtol=0, atol=1e-5)


class Dhp19(program.InFolder):
    def test_windows_and_projected_poses(self):
        poses = write_dhp19(self.folder / "dhp19")["S1_1_1"]
        manifest = self.write_manifest(events_manifest({"dataset": "dhp19", "root": "dhp19"}))
        run("convert", manifest)
        count = 0
        for path in sorted((self.folder / "out").glob("*.h5")):
            with h5py.File(path) as shard:
                self.assertEqual([text(name) for name in shard["labels/poses"].attrs["joint_names"]], DHP19_JOINTS)
                for i, name in enumerate(shard["pairs/sample_id"][:]):
                    subject, action, camera, number = text(name).split("/")
                    self.assertEqual((subject, action), ("S1", "1_1"))
                    first = 7500 * int(number)
                    with h5py.File(self.folder / "dhp19/DVS_movies/S1/session1/mov1.h5") as file:
                        group = file[f"cam{camera}"]
                        x, y, t, p = (group[key][0, first:first + 7500].astype(float) for key in ("x", "y", "timeStamp", "polarity"))
                    expected = volume_of(np.stack([x, y, t * 1e-6, 2 * p - 1], 1), height=260, width=346)
                    np.testing.assert_allclose(shard["events/volume"][i], expected, rtol=0, atol=1e-4)
                    np.testing.assert_allclose([shard["pairs/prev_time_s"][i], shard["pairs/next_time_s"][i]], t[[0, -1]] * 1e-6)
                    begin, end = (int(time // 10000) for time in t[[0, -1]])
                    mean = np.array([poses[joint][begin:end + 1].mean(0) for joint in DHP19_JOINTS])
                    u, v, w = DHP19_MATRICES[int(camera)] @ np.c_[mean, np.ones(13)].T
                    np.testing.assert_allclose(shard["labels/poses/joints"][i], np.stack([u / w, 260 - v / w], 1), atol=1e-9)
                    self.assertEqual(text(shard["pairs/camera"][i]), camera)
                    count += 1
        self.assertEqual(count, 4)  # two whole windows of two cameras of S1, which alone is for training
        self.assertIn("sound", run("verify", self.folder / "out", "--deep")[0])
        self.assertEqual(run("preview", self.folder / "out", "--out", self.folder / "pictures")[1], "")


if __name__ == "__main__":
    program.main()

"""A camera's own events as a source of `convert`: their volumes, labels and times as numpy has them,
and what goes wrong with them."""

import json
import os
import pathlib
import pickle
import shutil
import subprocess
import sys

import cv2
import h5py
import numpy as np

import failing_files
import program
from camera_files import (BBOX, DHP19_JOINTS, DHP19_MATRICES, HEIGHT, WIDTH, random_events, volume_of,
                          whole_microseconds, write_columns, write_dat, write_dhp19, write_event_utils, write_mvsec,
                          write_v2e)
from folders import quarantined
from program import PACKAGE, SHARED, run, shard_bytes, text
from small_job import LENIENT

sys.path.insert(0, str(PACKAGE))

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
    for path in sorted(pathlib.Path(out).glob("*-of-*.h5")):
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
                    "gap": (shard["pairs/gap_frames"][i], shard["pairs/gap_s"][i]),
                    "place": shard["pairs/label_position"][i],
                    "xyxy": boxes["xyxy"][own], "ignore": boxes["ignore"][own],
                    "difficulty": boxes["difficulty"][own] if "difficulty" in boxes
                    else np.full(own.stop - own.start, -1)}
    return samples


class Recordings(program.InFolder):
    def setUp(self):
        super().setUp()
        self.events = np.concatenate([random_events(3000, 10.0, 10.25, 3), random_events(500, 10.31, 10.4, 4)])
        write_mvsec(self.folder / "drive.hdf5", self.events, FRAMES)
        (self.folder / "drive.csv").write_text(LABELS)
        self.out = self.folder / "out"

    def manifest(self, source=(), **changes):
        return self.write_manifest(events_manifest({"dataset": "recording", "root": "drive.hdf5", **dict(source)},
                                                   **changes))

    def between(self, begin, end):
        times = self.events[:, 2]
        return self.events[(times > begin) & (times <= end)]

    def test_volumes_times_and_labels_are_those_of_the_window(self):
        stdout, stderr = run("convert", self.manifest())
        self.assertIn("4 of 4 pairs written, 0 quarantined", stdout)
        samples = rows(self.out)
        self.assertEqual(list(samples),
                         ["drive/0000000010.100000", "drive/0000000010.170000", "drive/0000000010.300000",
                          "drive/0000000010.350000"])
        first, between, silent, empty = samples.values()
        for sample, begin, end in [(first, FRAMES[1], FRAMES[2]), (between, 10.12, 10.17),
                                   (silent, FRAMES[5], FRAMES[6])]:
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
        self.assertEqual(run("preview", self.out, "--out", self.folder / "images")[1], "")
        self.assertEqual(len(list((self.folder / "images").iterdir())), 4)
        run("report", self.out)
        self.assertIn("windows of events", (self.out / "report.html").read_text())

    def test_the_papers_columns_come_out_of_the_scores(self):
        run("convert", self.manifest())
        from eventgan import evaluate
        found = [{"image_id": "drive/0000000010.100000", "category_id": "car", "bbox": [2, 3, 10, 10], "score": 0.9},
                 {"image_id": "drive/0000000010.100000", "category_id": "car", "bbox": [0, 15, 9, 9], "score": 0.8},
                 {"image_id": "drive/0000000010.300000", "category_id": "car", "bbox": [5, 5, 15, 15], "score": 0.7}]
        (self.folder / "found.json").write_text(json.dumps(found))
        report, _, _ = evaluate.evaluate_detections(self.folder / "found.json",
                                                    evaluate.Samples(self.out, None, None, None))
        car = report["classes"]["car"]
        self.assertEqual((car["truths"], car["easy"], car["hard"]), (4, 2, 2))
        # what is on "dont_care" counts nothing
        self.assertEqual((car["recall_easy"], car["recall_hard"], car["precision"]), (0.5, 0.5, 1.0))

    def greys_shown(self, *where):
        """How many pixels of each image that preview draws of `where` have the one grey of some recordings."""
        images = self.folder / "images"
        shutil.rmtree(images, ignore_errors=True)
        told, warned = run("preview", *where, "--out", images, "--frames", self.folder)
        drawn = [cv2.imread(line) for line in told.splitlines()]
        return [[int((image == grey).all(-1).sum()) for grey in (91, 155, 203)] for image in drawn], warned

    def test_a_sample_leads_to_the_frames_of_its_own_source(self):
        # Two cameras of one file; and a folder whose name begins as the file's, in which the time of each frame is
        # another.
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
        np.savetxt(self.folder / "driv" / "events.txt", self.events[:, [2, 0, 1, 3]].clip(0),
                   fmt=["%.9f", "%d", "%d", "%d"])
        sources = [{"dataset": "recording", "root": "driv"}] + [
            {"dataset": "recording", "root": "drive.hdf5", "camera": camera} for camera in ("left", "right")]
        run("convert", self.write_manifest({**events_manifest({}, output={"directory": "out", "samples_per_shard": 9}),
                                            "sources": sources}))
        shards = sorted(self.out.glob("*-of-*.h5"))
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
        run("convert",
            self.manifest(image={"width": 40, "height": 16, "fit": "letterbox"}, volume={"normalize": "eta98"}))
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
        index = int(np.searchsorted(self.events[:, 2], 10.08))
        with h5py.File(self.folder / "drive.hdf5", "r+") as file:
            file["davis/left/events"][index, 0] = WIDTH
        # outside, in place and time
        labels = LABELS.replace("10.170000,5,5,20,20", "10.170000,50,5,60,20") + "99,1,1,2,2,car,easy\n"
        (self.folder / "drive.csv").write_text(labels)
        run("convert", self.manifest(errors=LENIENT))
        reasons = quarantined(self.out)
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

    def test_without_labels_each_frame_is_a_sample_and_a_limit_makes_a_trial(self):
        (self.folder / "drive.csv").unlink()
        manifest = self.manifest()
        self.assertIn("windows          8", run("plan", manifest)[0])
        run("convert", manifest, "--limit", "3")
        trial = rows(self.folder / "out-trial-3")
        self.assertEqual(list(trial), [f"drive/00000000{time:.6f}" for time in FRAMES[1:4]])

    def test_what_does_not_go_together_is_one_line(self):
        for command in ("tradeoff", "calibrate"):
            error = run(command, self.manifest(), expect=64)[1]
            self.assertIn('got "events"', error)
            self.assertEqual(len(error.strip().splitlines()), 1)
        self.assertIn("expected events as t, x, y, p", run("plan", self.manifest({"root": "drive.csv"}), expect=66)[1])

    def test_a_real_recording(self):
        if not SHARED.is_dir():
            self.skipTest("no ../shared/data")
        shutil.copytree(SHARED / "davis" / "slider_depth", self.folder / "slider_depth")
        run("convert", self.manifest({"root": "slider_depth"}))
        rows_of_file = np.loadtxt(self.folder / "slider_depth" / "events.txt")
        samples = list(rows(self.out).values())
        self.assertEqual([round(float(sample["volume"].sum())) for sample in samples], [7778, 11318])
        for sample in samples:
            window = rows_of_file[(rows_of_file[:, 0] > sample["times"][0])
                                  & (rows_of_file[:, 0] <= sample["times"][1])]
            np.testing.assert_allclose(sample["volume"], volume_of(window[:, [1, 2, 0, 3]], height=180, width=240),
                                       rtol=0, atol=1e-5)


class WithoutFrames(program.InFolder):
    """Recordings of today's layouts, most of them events alone."""
    SENSOR = {"width": WIDTH, "height": HEIGHT}

    def setUp(self):
        super().setUp()
        self.events, self.ticks = whole_microseconds(random_events(5000, 20.0, 20.33, 8))
        self.out = self.folder / "out"

    def convert(self, root, expect=0, **source):
        shutil.rmtree(self.out, ignore_errors=True)
        source = {"dataset": "recording", "root": root, "window_s": 0.05, **source}
        return run("convert", self.write_manifest(events_manifest(source)), expect=expect)

    def check_windows(self, events, length=0.05):
        """Consecutive windows, each event in one of them."""
        begin = events[0, 2] - 2.5e-7
        count = int(np.ceil((events[-1, 2] - begin) / length))
        samples = rows(self.out)
        self.assertEqual(len(samples), count)
        held = 0
        for k, sample in enumerate(samples.values()):
            np.testing.assert_allclose(sample["times"], [begin + k * length, begin + (k + 1) * length], rtol=0,
                                       atol=1e-9)
            window = events[(events[:, 2] > begin + k * length) & (events[:, 2] <= begin + (k + 1) * length)]
            np.testing.assert_allclose(sample["volume"], volume_of(window), rtol=0, atol=1e-4)
            held += len(window)
        self.assertEqual(held, len(events))
        self.assertIn("sound", run("verify", self.out, "--deep")[0])

    def test_dsec(self):
        write_columns(self.folder / "seq/events/left/events.h5", self.events, offset=int(self.ticks[0]) - 700,
                      compression="gzip")
        told = self.convert("seq", sensor=self.SENSOR)[0]
        self.assertIn("7 of 7 pairs written, 0 quarantined", told)
        self.check_windows(self.events)
        self.assertEqual(run("preview", self.out, "--out", self.folder / "images")[1], "")
        self.assertEqual(len(list((self.folder / "images").iterdir())), 7)
        run("report", self.out)

    def test_blosc(self):
        plugins = [path.parent for path in pathlib.Path("/usr/lib").glob("*/hdf5/serial/plugins/libH5Zblosc.so")]
        if not plugins:
            self.skipTest("no hdf5-filter-plugin-blosc-serial")
        file = self.folder / "seq/events/left/events.h5"
        write = ("import pickle, sys; from camera_files import *; write_columns(*pickle.load(sys.stdin.buffer), "
                 "offset=0, compression=32001, compression_opts=(0, 0, 0, 0, 5, 1, 5))")
        subprocess.run([sys.executable, "-c", write], check=True, input=pickle.dumps((file, self.events)),
                       cwd=pathlib.Path(__file__).parent, env={**os.environ, "HDF5_PLUGIN_PATH": str(plugins[0])})
        self.convert("seq", sensor=self.SENSOR)
        self.check_windows(self.events)
        empty = self.folder / "empty"
        empty.mkdir()
        error = run("plan", self.folder / "manifest.json", expect=66, environment={"HDF5_PLUGIN_PATH": str(empty)})[1]
        self.assertIn("expected HDF5's filter Blosc to be installed, got none (apt-get install "
                      "hdf5-filter-plugin-blosc-serial)", error)

    def test_m3ed(self):
        late = self.events[self.events[:, 2] > 20.1]
        for camera, events in {"left": self.events, "right": late}.items():
            write_columns(self.folder / f"{camera}.h5", events - [0, 0, 20, 0], f"prophesee/{camera}",
                          f"prophesee/{camera}/ms_map_idx")
        with h5py.File(self.folder / "left.h5", "a") as file, h5py.File(self.folder / "right.h5") as right:
            right.copy("prophesee/right", file["prophesee"])
            for camera in ("left", "right"):
                file[f"prophesee/{camera}/calib/resolution"] = [WIDTH, HEIGHT]
            file["ovc/left/data"] = np.zeros((2, 8, 8, 1), np.uint8)
        (self.folder / "right.h5").unlink()
        for camera, events in {"left": self.events, "right": late}.items():
            told = self.convert("left.h5", camera=camera)[0]
            self.assertIn("opened without frames, which are another camera's (ovc)", told)
            self.check_windows(whole_microseconds(events - [0, 0, 20, 0])[0])

    def test_m3ed_packed_by_lzf_as_it_is_distributed(self):
        # h5py has the filter itself; the program needs HDF5's plugin, and Debian's does not name its library.
        if not list(pathlib.Path("/usr/lib").glob("*/hdf5/serial/plugins/liblzf_filter.so")):
            self.skipTest("HDF5's plugin for LZF is not installed (hdf5-plugin-lzf liblzf1)")
        events = self.events - [0, 0, 20, 0]
        write_columns(self.folder / "m3ed.h5", events, "prophesee/left", "prophesee/left/ms_map_idx",
                      compression="lzf")
        with h5py.File(self.folder / "m3ed.h5", "a") as file:
            file["prophesee/left/calib/resolution"] = [WIDTH, HEIGHT]
        self.convert("m3ed.h5")
        self.check_windows(whole_microseconds(events)[0])

    def test_a_table(self):
        np.savez_compressed(self.folder / "a.npz", t_us=self.ticks, x=self.events[:, 0].astype(np.uint16),
                            y=self.events[:, 1].astype(np.uint16), p=(self.events[:, 3] > 0).astype(np.uint8))
        source = {"root": "a.npz", "columns": {"t": "t_us"}}
        self.convert(sensor=self.SENSOR, **source)
        self.check_windows(self.events)
        self.assertIn("expected the sensor's size", self.refused({**source, "window_s": 0.05}))
        self.assertIn("expected window_s, or labels, since the recording has no frames",
                      self.refused({**source, "sensor": self.SENSOR}))

    def refused(self, source):
        return run("plan", self.write_manifest(events_manifest({"dataset": "recording", **source})), expect=66)[1]

    def test_a_folder_of_tables_with_labels(self):
        folder = self.folder / "windows"
        folder.mkdir()
        halves = [self.events[:2000], self.events[2000:]]
        for name, half in zip("ab", halves):
            t, x, y, p = half[:, 2], half[:, 0], half[:, 1], half[:, 3] > 0
            np.savez(folder / f"{name}.npz", t_us=np.round(t * 1e6).astype(np.int64), x=x.astype(np.int16),
                     y=y.astype(np.int16), p=p)
            (folder / f"{name}.csv").write_text(HEADER + f"{t[-1]:.6f},2,3,12,13,person,easy\n")
        self.convert("windows", sensor=self.SENSOR, columns={"t": "t_us"}, window_s=1)
        samples = rows(self.out)
        self.assertEqual(list(samples), [f"{name}/{half[-1, 2]:017.6f}" for name, half in zip("ab", halves)])
        for sample, half in zip(samples.values(), halves):
            np.testing.assert_allclose(sample["volume"], volume_of(half), rtol=0, atol=1e-4)
            self.assertEqual(sample["xyxy"].tolist(), [[2, 3, 12, 13]])

    def test_prophesees_boxes(self):
        write_columns(self.folder / "drive_td.h5", self.events, size=(HEIGHT, WIDTH), compression="gzip")
        boxes = np.zeros(6, BBOX)
        boxes[:] = [(20_100_000, 2, 3, 10.5, 7, 0, 5, 1), (20_100_000, 4, 4, 4, 4, 2, 6, 0.5),
                    (20_300_000, 0, 0, 32, 24, 2, 6, 1), (20_100_000, WIDTH, 3, 9, 9, 1, 7, 1),
                    (20_200_000, -5, 20, 9, 9, 2, 8, 1), (20_250_000, 3, 3, 0, 9, 2, 8, 1)]
        np.save(self.folder / "drive_bbox.npy", boxes)
        (self.folder / "label_map_dictionary.json").write_text('{"0": "pedestrian", "1": "two wheeler", "2": "car"}')
        for told in self.convert("drive_td.h5"):
            self.assertIn("1 file with boxes beyond the sensor: 1 cut to it, 2 left out", told)
        samples = rows(self.out)
        self.assertEqual([(name[-9:], sample["xyxy"].tolist()) for name, sample in samples.items()],
                         [("20.100000", [[2, 3, 12.5, 10], [4, 4, 8, 8]]), ("20.200000", [[0, 20, 4, HEIGHT]]),
                          ("20.250000", []), ("20.300000", [[0, 0, WIDTH, HEIGHT]])])
        for sample, end in zip(samples.values(), (20.1, 20.2, 20.25, 20.3)):
            window = self.events[(self.events[:, 2] > end - 0.05) & (self.events[:, 2] <= end)]
            np.testing.assert_allclose(sample["volume"], volume_of(window), rtol=0, atol=1e-4)
        boxes_of_shards = []
        for path in sorted(self.out.glob("*-of-*.h5")):
            with h5py.File(path) as shard:
                stored = shard["labels/boxes"]
                names = [text(name) for name in stored["class_id"].attrs["class_names"]]
                boxes_of_shards += zip((names[k] for k in stored["class_id"][:]), stored["track_id"][:].tolist())
        self.assertEqual(sorted(boxes_of_shards), [("car", 6), ("car", 6), ("car", 8), ("pedestrian", 5)])
        boxes["w"][1] = np.nan
        boxes["class_id"][2] = 7
        np.save(self.folder / "drive_bbox.npy", boxes)
        error = self.refused({"root": "drive_td.h5", "window_s": 0.05})
        self.assertIn("expected w in -1e+06..1e+06, got nan", error)
        self.assertIn("drive_bbox.npy (row 1)", error)
        self.assertIn("expected a class of label_map_dictionary.json, got class_id 7", error)

    def test_what_needs_frames_says_so(self):
        write_columns(self.folder / "seq/events/left/events.h5", self.events, size=(HEIGHT, WIDTH))
        expected = "expected a recording with frames, got one without"
        self.assertIn(expected, run("realism", self.folder / "seq", "--with", "difference", expect=66)[1])
        frames = {"dataset": "frames", "root": "clip", "pairs": program.pairs([1])}
        manifest = self.write_manifest(program.manifest([frames]))
        self.assertIn(expected, run("tradeoff", manifest, "--real", self.folder / "seq", expect=66)[1])

    def test_prophesees_events(self):
        write_dat(self.folder / "gen1_td.dat", self.events)
        self.convert("gen1_td.dat")
        self.check_windows(self.events)

    def test_v2es_events(self):
        write_v2e(self.folder / "v2e.h5", self.events)
        self.convert("v2e.h5", sensor=self.SENSOR)
        self.check_windows(self.events)

    def test_event_utils_events(self):
        write_event_utils(self.folder / "e.h5", self.events, polarity=np.bool_)
        self.convert("e.h5")
        self.check_windows(self.events)
        random = np.random.default_rng(3)
        images = [random.integers(0, 256, (HEIGHT, WIDTH, *channels), dtype=np.uint8) for channels in ((), (3,), (1,))]
        times = [20.05, 20.1, 20.3]
        write_event_utils(self.folder / "hqf.h5", self.events, images, times, resolution=(HEIGHT, WIDTH, 3))
        self.check_intervals("hqf.h5", times)
        self.assertEqual(run("preview", self.out, "--out", self.folder / "images")[1], "")

    def check_intervals(self, root, times):
        """A sample of each interval between frames."""
        shutil.rmtree(self.out, ignore_errors=True)
        run("convert", self.write_manifest(events_manifest({"dataset": "recording", "root": root})))
        samples = rows(self.out)
        self.assertEqual(len(samples), len(times) - 1)
        for sample, begin, end in zip(samples.values(), times, times[1:]):
            np.testing.assert_allclose(sample["times"], [begin, end], rtol=0, atol=1e-9)
            window = self.events[(self.events[:, 2] > begin) & (self.events[:, 2] <= end)]
            np.testing.assert_allclose(sample["volume"], volume_of(window), rtol=0, atol=1e-4)

    def test_windows_with_yolos_texts(self):
        folder = self.folder / "pedro"
        folder.mkdir()
        parts = np.array_split(self.events, 3)
        texts = ["0 0.5 0.25 0.25 0.5\n1 0.75 0.5 0.125 0.25\n", "", "1 0.5 0.5 1 1\n"]
        for name, part, label in zip("abc", parts, texts):
            table = np.stack([np.round(part[:, 2] * 1e6), part[:, 0], part[:, 1], part[:, 3] > 0], 1)
            np.save(folder / f"{name}.npy", table.astype(np.int64))
            (folder / f"{name}.txt").write_text(label)
        for changes in ({}, {"label_at": "middle"}):
            shutil.rmtree(self.out, ignore_errors=True)
            source = {"dataset": "recording", "root": "pedro", "sensor": self.SENSOR, **changes}
            told = run("convert", self.write_manifest(events_manifest(source)))[0]
            self.assertIn("3 of 3 pairs written, 0 quarantined", told)
            samples = rows(self.out)
            for (name, sample), part in zip(samples.items(), parts):
                end = part[[0, -1], 2].mean() if "label_at" in changes else part[-1, 2]
                self.assertAlmostEqual(float(name.split("/")[1]), end, delta=1e-6)
                np.testing.assert_allclose(sample["volume"], volume_of(part), rtol=0, atol=1e-4)
            self.assertEqual([sample["xyxy"].tolist() for sample in samples.values()],
                             [[[12, 0, 20, 12], [22, 9, 26, 15]], [], [[0, 0, 32, 24]]])
        # PEDRo's labels lie in a folder of their own, and a file above it names the classes.
        (self.folder / "yolo" / "train").mkdir(parents=True)
        for name in "abc":
            shutil.move(folder / f"{name}.txt", self.folder / "yolo" / "train")
        (self.folder / "yolo" / "classes.txt").write_text("person\ndog\n")
        source["annotations"] = "yolo/train"
        manifest = self.write_manifest(events_manifest(source))
        shutil.rmtree(self.out)
        run("convert", manifest)
        with h5py.File(next(self.out.glob("*-of-*.h5"))) as shard:
            names = [text(name) for name in shard["labels/boxes/class_id"].attrs["class_names"]]
            self.assertEqual([names[k] for k in shard["labels/boxes/class_id"][:]], ["person", "dog"])
            self.assertEqual(bytes(shard["labels/original"][0]).decode(), texts[0])
        (self.folder / "yolo" / "classes.txt").write_text("dog\nperson\n")
        self.assertIn("annotations", run("convert", manifest, expect=64)[1])
        (self.folder / "yolo/train/b.txt").write_text("7 0.5 0.5 1 1\n")
        self.assertIn("expected a class 0..1", run("plan", manifest, expect=66)[1])

    def test_an_index_of_times_changes_no_byte(self):
        write_dat(self.folder / "a.dat", self.events)
        manifest = self.write_manifest(events_manifest({"dataset": "recording", "root": "a.dat", "window_s": 0.05}))
        run("plan", manifest, "--freeze")
        index = self.out / "plan.index"
        index.write_bytes(index.read_bytes()[:-9] + b"123456789")  # damaged: as none
        run("convert", manifest)
        self.check_windows(self.events)
        other = self.folder / "other"
        for part in ("0/2", "1/2"):  # the second takes the first one's
            run("convert", manifest, "--output", other, "--shards", part)
        self.assertEqual(index.read_bytes(), (other / "plan.index").read_bytes())
        self.assertEqual(shard_bytes(self.out), shard_bytes(other))

    def test_later_commands_take_the_index_of_times(self):
        write_mvsec(self.folder / "drive.hdf5", self.events, [20.0 + 0.05 * k for k in range(7)])
        self.convert("drive.hdf5")
        for command in (["convert", self.folder / "manifest.json"], ["retry", self.out], ["report", self.out],
                        ["preview", self.out, "--out", self.folder / "images"]):
            done = failing_files.run(self.out, "", *command)
            self.assertEqual(done.code, 0, done.err)
            self.assertIn("plan.index", [call.path.name for call in done.calls if call.kind == "open"], command)

    def test_more_recordings_than_files_may_be_open(self):
        many = self.folder / "many"
        many.mkdir()
        for k in range(150):
            events = random_events(20, 1.0, 1.04, k)
            write_dat(many / f"d{k}_td.dat", events)
            if k % 2:
                write_event_utils(many / f"e{k}.h5", events)
            else:
                write_columns(many / f"h{k}_td.h5", events, size=(HEIGHT, WIDTH))
        manifest = self.write_manifest(events_manifest({"dataset": "recording", "root": "many", "window_s": 0.05},
                                                       output={"directory": "out", "samples_per_shard": 100}))
        done = subprocess.run(["sh", "-c", 'ulimit -n 64; exec "$0" "$@"', program.PROGRAM, "convert", str(manifest)],
                              capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("300 of 300 pairs written, 0 quarantined", done.stdout)
        self.assertEqual({float(round(sample["volume"].sum())) for sample in rows(self.out).values()}, {20.0})

    def test_init_guesses_the_sensor_and_convert_is_told_it(self):
        events = random_events(3000, 1.0, 1.2, 5, height=470, width=610)
        write_dat(self.folder / "camera.dat", events)
        header = (self.folder / "camera.dat").read_bytes()
        (self.folder / "camera.dat").write_bytes(header.replace(b"% Height 24\n% Width 32\n", b""))
        manifest = self.folder / "manifest.json"
        told = run("init", self.folder / "camera.dat", "--out", manifest)[0]
        self.assertIn("set \"sensor\" (the events reach x = ", told)
        self.assertIn("as those of a camera of 640x480", told)
        self.assertIn('// "sensor": { "width": 640, "height": 480 },', manifest.read_text())
        out = self.folder / "out"
        error = run("convert", self.folder / "camera.dat", "--output", out, expect=66)[1]
        self.assertIn("expected --sensor WIDTHxHEIGHT, the size that no file gives, got none", error)
        for wrong in ("640", "0x480", "640x", "640x480x2", "x480"):
            self.assertIn("--sensor: expected WIDTHxHEIGHT",
                          run("convert", self.folder / "camera.dat", "--sensor", wrong, expect=64)[1])
        told = run("convert", self.folder / "camera.dat", "--output", self.folder / "trial", "--sensor", "640x480",
                   "--limit", 1)[0]
        self.assertTrue(told.endswith(f"eventgan convert {self.folder / 'camera.dat'} --sensor 640x480 --output DIR\n"),
                        told)
        run("convert", self.folder / "camera.dat", "--output", out, "--sensor", "640x480")
        with h5py.File(next(out.glob("*-of-*.h5"))) as shard:
            self.assertEqual(shard["events/volume"].shape[2:], (480, 640))
            self.assertAlmostEqual(float(shard["events/volume"][:].astype(float).sum()), 3000, delta=2)
        run("convert", self.folder / "camera.dat", "--output", out)
        self.assertIn("expected 640x480, as when the job began",
                      run("convert", self.folder / "camera.dat", "--output", out, "--sensor", "1280x720",
                          expect=64)[1])
        self.assertIn("expected a folder, video or recording, got a manifest",
                      run("convert", manifest, "--sensor", "640x480", expect=64)[1])

    def test_a_davis_recording_is_its_conversion(self):
        if not SHARED.is_dir():
            self.skipTest("no ../shared/data")
        read = []
        for name in ("davis346.aedat4", "davis346_eventgan_layout.hdf5"):
            self.convert(str(SHARED / "davis" / name), window_s=0.03)
            read.append(list(rows(self.out).values()))
        self.assertEqual(len(read[0]), 3)
        for ours, converted in zip(*read):
            self.assertEqual(ours["times"], converted["times"])
            np.testing.assert_array_equal(ours["volume"], converted["volume"])


class Dhp19(program.InFolder):
    def test_windows_and_projected_poses(self):
        poses = write_dhp19(self.folder / "dhp19")["S1_1_1"]
        manifest = self.write_manifest(events_manifest({"dataset": "dhp19", "root": "dhp19"}))
        run("convert", manifest)
        count = 0
        for path in sorted((self.folder / "out").glob("*-of-*.h5")):
            with h5py.File(path) as shard:
                self.assertEqual([text(name) for name in shard["labels/poses"].attrs["joint_names"]], DHP19_JOINTS)
                for i, name in enumerate(shard["pairs/sample_id"][:]):
                    subject, action, camera, number = text(name).split("/")
                    self.assertEqual((subject, action), ("S1", "1_1"))
                    first = 7500 * int(number)
                    with h5py.File(self.folder / "dhp19/DVS_movies/S1/session1/mov1.h5") as file:
                        group = file[f"cam{camera}"]
                        x, y, t, p = (group[key][0, first:first + 7500].astype(float)
                                      for key in ("x", "y", "timeStamp", "polarity"))
                    expected = volume_of(np.stack([x, y, t * 1e-6, 2 * p - 1], 1), height=260, width=346)
                    np.testing.assert_allclose(shard["events/volume"][i], expected, rtol=0, atol=1e-4)
                    np.testing.assert_allclose([shard["pairs/prev_time_s"][i], shard["pairs/next_time_s"][i]],
                                               t[[0, -1]] * 1e-6)
                    begin, end = (int(time // 10000) for time in t[[0, -1]])
                    mean = np.array([poses[joint][begin:end + 1].mean(0) for joint in DHP19_JOINTS])
                    u, v, w = DHP19_MATRICES[int(camera)] @ np.c_[mean, np.ones(13)].T
                    np.testing.assert_allclose(shard["labels/poses/joints"][i], np.stack([u / w, 260 - v / w], 1),
                                               atol=1e-9)
                    self.assertEqual(text(shard["pairs/camera"][i]), camera)
                    count += 1
        self.assertEqual(count, 4)  # two whole windows of two cameras of S1, which alone is for training
        self.assertIn("sound", run("verify", self.folder / "out", "--deep")[0])
        self.assertEqual(run("preview", self.folder / "out", "--out", self.folder / "images")[1], "")


if __name__ == "__main__":
    program.main()

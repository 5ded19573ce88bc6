"""Exports of whole recordings, DSEC's, RVT's, Prophesee's and DV's, read as these read them: with numpy and h5py, or
as their pages describe the bytes."""

import importlib.util
import json
import pathlib
import shutil
import sys
import tempfile
import types
import unittest.mock

import h5py
import numpy as np
import PIL.Image

import aedat4
import exported_demo as demo
import program
import small_job
from camera_files import volume_of
from dsec_sequence import DsecSequence, half_size
from exported_demo import Export, of, read_samples
from exported_recordings import (BBOX_DTYPE, TRACKS_DTYPE, arrays_of, decode_evt3, read_columns, read_windows,
                                 slice_dsec)
from program import run
from rvt_sequence import GEN1, GEN4, RvtSequence, columns_of, frame_times, kept_boxes, own_code, stacked_histogram

setUpModule, tearDownModule = demo.set_up, demo.tear_down
READERS = program.SHARED.parent / "readers"


class Recordings(Export):
    @classmethod
    def setUpClass(cls):
        """A KITTI tracking sequence of 12 frames of 0.1 s each, and one of 3 frames: windows of 1 to 3 frames,
        all of them."""
        cls.drive = pathlib.Path(tempfile.mkdtemp(dir=demo.folder)) / "drive"
        random = np.random.default_rng(11)
        (cls.drive / "label_02").mkdir(parents=True)
        for name, count in (("0000", 12), ("bbox", 3)):
            lines = []
            for k in range(count):
                small_job.save_image(cls.drive / "image_02" / name / f"{k:06d}.png", random)
                boxes = [(5, "Car", 2 + k, 3, 12 + k, 9), (-1, "DontCare", 0, 0, 4, 4)] if k != 4 else []
                if k % 2:
                    # cut, and within the last pixel
                    boxes += [(7, "Pedestrian", 25, 10, 40, 30), (9, "Car", 31.25, 2, 32, 9)]
                lines += [f"{k} {track} {kind} 0 0 -10 {left} {top} {right} {bottom} -1 -1 -1 -1000 -1000 -1000 -10"
                          for track, kind, left, top, right, bottom in boxes if name == "0000"]
            (cls.drive / "label_02" / f"{name}.txt").write_text("".join(line + "\n" for line in lines))
        (cls.drive / "image_02" / "0000" / "000008.png").write_bytes(b"broken")
        manifest = cls.drive.parent / "manifest.json"
        source = {"dataset": "kitti_tracking", "root": str(cls.drive), "pairs": program.pairs([1, 2, 3], choose="all")}
        manifest.write_text(json.dumps(program.manifest([source], generator={"kind": "difference"},
                                                        errors=small_job.LENIENT)))
        cls.source = manifest.parent / "out"
        run("convert", manifest, "--progress", "none")
        cls.samples = {key[2]: sample for key, sample in read_samples(cls.source).items()}

    def check_volume(self, columns, window, sample):
        """Events of a window against the sample's volume: whole numbers of events, times cut to a microsecond."""
        begin, end = window[:2]
        t, x, y, p = columns
        self.assertEqual(len(t), window[3])
        self.assertTrue((np.diff(t) >= 0).all() and (begin <= t).all() and (t < end).all())
        again, bins = np.zeros(sample["volume"].shape), len(sample["volume"]) // 2
        star = (bins - 1) * (t - begin) / (end - begin)
        low = np.minimum(star.astype(int), bins - 2)
        for bin_, share in ((low, 1 - (star - low)), (low + 1, star - low)):
            np.add.at(again, (np.where(p > 0, 0, bins) + bin_, y, x), share)
        expected = np.floor(sample["volume"].astype(float) + 0.5)
        np.testing.assert_allclose(again, expected, atol=2e-5 + 9e-6 * expected.max() * 8 / ((end - begin) * 1e-6))

    def check_boxes(self, found, sample, time):
        boxes = sample["boxes"]
        kept = np.flatnonzero(boxes["ignore"] == 0)
        self.assertEqual(set(found["t"]) - {time}, set())
        xyxy = np.stack([found["x"], found["y"], found["x"] + found["w"], found["y"] + found["h"]], axis=1)
        np.testing.assert_allclose(xyxy, boxes["xyxy"][kept], atol=1e-4)
        np.testing.assert_array_equal(found["class_confidence"], 1)
        names = [name for name in sample["classes"] if name != "DontCare"]
        self.assertEqual([names[i] for i in found["class_id"]], [sample["classes"][i] for i in boxes["class_id"][kept]])
        return kept

    def check_dsec(self, known):
        """Every recording of the export; the ids of its samples."""
        seen = []
        for path in sorted((self.out / "dsec").glob("*/*")):
            windows = read_windows(path / "windows.txt")
            times = np.genfromtxt(path / "images" / "timestamps.txt", dtype="int64")
            self.assertEqual(list(times), sorted({time for window in windows for time in window[:3]}))
            with h5py.File(path / "events" / "left" / "events.h5") as file:
                self.assertEqual([file[name].dtype for name in ("events/x", "events/y", "events/t", "events/p",
                                                                "ms_to_idx", "t_offset")],
                                 ["u2", "u2", "u4", "u1", "u8", "i8"])
                t, index = file["events/t"][:], file["ms_to_idx"][:]
                np.testing.assert_array_equal(index, np.searchsorted(t, np.arange(len(index)) * 1000))
                self.assertEqual(file["t_offset"][()], windows[0][0])
                self.assertEqual(sum(window[3] for window in windows), len(t))
                for before, after in zip(windows, windows[1:]):
                    self.assertLessEqual(before[1], after[0])
                    self.assertLess(before[2], after[2])
                for window in windows:
                    self.check_volume(slice_dsec(file, *window[:2]), window, known[path.parent.name, window[4]])
                size = file.attrs["height"], file.attrs["width"]
            self.assertEqual(size, known[path.parent.name, windows[0][4]]["volume"].shape[1:])
            self.check_half_size(path / "events" / "left", size)
            images = sorted((path / "images" / "left" / "distorted").iterdir())
            self.assertEqual([image.name for image in images], [f"{i:06d}.png" for i in range(len(times))])
            for image in images:
                with PIL.Image.open(image) as opened:
                    self.assertEqual((opened.height, opened.width, opened.mode), (*size, "RGB"))
            if (path / "object_detections").exists():
                sequence = DsecSequence(path)
                self.assertEqual(sequence.tracks.dtype, TRACKS_DTYPE)
                self.assertEqual(sum(sequence.counts), len(sequence.tracks))
                for window in windows:
                    boxes = sequence.boxes(list(times).index(window[2]))
                    self.check_boxes(boxes, known[path.parent.name, window[4]], window[2])
            seen += [(path.parent.name, window[4]) for window in windows]
        self.assertEqual(len(seen), len(set(seen)))
        return seen

    def check_half_size(self, folder, size):
        """events_2x.h5 against events.h5, whose index it has for its own events."""
        columns, half = (read_columns(folder / name) for name in ("events.h5", "events_2x.h5"))
        for found, expected in zip(half, half_size(columns, size)):
            np.testing.assert_array_equal(found, expected)
        with h5py.File(folder / "events.h5") as file, h5py.File(folder / "events_2x.h5") as half_file:
            self.assertEqual((half_file.attrs["height"], half_file.attrs["width"]), (size[0] // 2, size[1] // 2))
            self.assertEqual(half_file["t_offset"][()], file["t_offset"][()])
            self.assertEqual(len(half_file["ms_to_idx"]), len(file["ms_to_idx"]))
            np.testing.assert_array_equal(half_file["ms_to_idx"][:], np.searchsorted(
                half_file["events/t"][:], np.arange(len(file["ms_to_idx"])) * 1000))

    def test_dsec(self):
        self.export("dsec", "--counts", "rounded")
        known = {(key[0], key[2]): sample for key, sample in demo.samples.items()}
        self.assertEqual(sorted(self.check_dsec(known)), sorted(known))
        folders = {path.name for path in (self.out / "dsec" / "train").iterdir()}
        self.assertIn("kitti_object+000000", folders)
        self.assertIn("human36m+S1+Walking-1+54138969", folders)
        for path in (self.out / "dsec" / "train").glob("human36m*"):
            self.assertFalse((path / "object_detections").exists())
        # Human3.6M's times are known: a frame takes 20 ms there.
        of_video = [window for path in (self.out / "dsec" / "train").glob("human36m*")
                    for window in read_windows(path / "windows.txt")]
        for begin, end, label, _, sample_id in of_video:
            sample = known["train", sample_id]
            self.assertEqual([begin, end],
                             [round(sample["pairs"][name] * 1e6) for name in ("prev_time_s", "next_time_s")])
        names = json.loads((self.out / "label_map_dictionary.json").read_text())
        self.assertEqual(names["0"], "Car")

    def test_overlapping_windows_are_different_recordings(self):
        self.export("dsec", "--counts", "rounded", source=self.source)
        known = {("train", sample_id): sample for sample_id, sample in self.samples.items()}
        self.assertEqual(sorted(self.check_dsec(known)), sorted(known))
        recordings = {path.name: read_windows(path / "windows.txt") for path in (self.out / "dsec" / "train").iterdir()}
        self.assertEqual({name.split("~")[0] for name in recordings}, {"0000", "bbox"})
        for name, windows in recordings.items():
            for begin, end, label, _, sample_id in windows:
                pairs = self.samples[sample_id]["pairs"]
                self.assertEqual((begin, end, label), tuple(int(pairs[key]) * 10 ** 5
                                                            for key in ("prev_index", "next_index", "label_index")))
            for time, image in self.images_of(self.out / "dsec" / "train" / name):
                np.testing.assert_array_equal(image, self.frame(name, time))
        # There are no more recordings than windows at one time.
        most = max(sum(begin < time < end for name, windows in recordings.items() if name.startswith("0000")
                       for begin, end, *_ in windows)
                   for time in np.arange(0.5, 12) * 1e5)
        self.assertEqual(sum(name.startswith("0000") for name in recordings), most)
        tracks = np.concatenate([np.load(path) for path in self.out.rglob("tracks.npy")])
        self.assertEqual(set(tracks["track_id"]), {5, 7, 9})
        left_out = self.described()["left_out"]
        self.assertEqual(left_out["boxes to ignore"],
                         sum((s["boxes"]["ignore"] == 1).sum() for s in self.samples.values()))
        self.assertEqual(len(self.described()["quarantined"]), 6)

    @staticmethod
    def images_of(recording):
        """Each line of timestamps.txt with its image."""
        times = (recording / "images" / "timestamps.txt").read_text().split()
        for time, path in zip(times, sorted((recording / "images" / "left" / "distorted").iterdir())):
            with PIL.Image.open(path) as image:
                yield int(time), np.asarray(image)

    def frame(self, recording, time_us, drive=None):
        """The drive's, in three equal channels."""
        folder = (drive or self.drive) / "image_02" / recording.split("~")[0]
        with PIL.Image.open(folder / f"{time_us // 100_000:06d}.png") as image:
            return np.asarray(image.convert("RGB"))

    def test_dsec_has_the_labelled_frame_where_it_lies_between_a_pair(self):
        drive = self.out.parent / "drive"
        shutil.copytree(self.drive, drive)
        source = {"dataset": "kitti_tracking", "root": "drive", "pairs": program.pairs([2], side="around")}
        source = self.converted(source, errors=small_job.LENIENT)
        _, err = self.export("dsec", "--counts", "rounded", source=source, expect=66)
        self.assertIn("image_02/0000/000008.png", err)  # others that have it are in quarantine
        small_job.save_image(drive / "image_02" / "0000" / "000008.png", np.random.default_rng(8))
        self.export("dsec", "--counts", "rounded", source=source)
        known = {(key[0], key[2]): sample for key, sample in read_samples(source).items()}
        self.assertEqual(sorted(self.check_dsec(known)), sorted(known))
        for recording in (self.out / "dsec" / "train").iterdir():
            for begin, end, label, _, _ in read_windows(recording / "windows.txt"):
                self.assertEqual((label - begin, end - label), (100_000, 100_000))
            for time, image in self.images_of(recording):
                np.testing.assert_array_equal(image, self.frame(recording.name, time, drive))

    def test_dsec_goes_without_frames_that_are_gone(self):
        frames = self.converted_frames("", range(4))
        moved = self.out.parent / "elsewhere"
        moved.mkdir()
        (self.out.parent / "clip").rename(moved / "clip")
        said, _ = self.export("dsec", source=frames)
        self.assertRegex(said, r"note: no images of frames in split train: .*clip/\d{4}\.png.*--frames names the")
        recording = self.out / "dsec" / "train" / "clip"
        self.assertEqual({path.name for path in (recording / "images").iterdir()}, {"timestamps.txt"})
        self.export("dsec", "--frames", moved, "--overwrite", source=frames)
        times = [time for time, _ in self.images_of(recording)]
        self.assertEqual(times, [0, 1_000_000, 2_000_000, 3_000_000])
        # A source that has its frames does not lose one in silence.
        (moved / "clip" / "0002.png").unlink()
        shutil.rmtree(self.out)
        _, err = self.export("dsec", "--frames", moved, source=frames, expect=66)
        self.assertIn("clip/0002.png", err)

    def test_dsec_det_reads_it(self):
        if not READERS.is_dir():
            self.skipTest("no ../shared/readers")
        self.export("dsec", source=self.source)
        stubs = {name: types.ModuleType(name) for name in ("hdf5plugin", "numba", "seaborn")}
        stubs["numba"].jit = lambda **_: lambda function: function
        stubs["seaborn"].color_palette = lambda _, count: np.linspace([0, 0, 0], [1, 1, 1], count)
        path = [str(READERS / "dsec_det" / "src"), *sys.path]
        with unittest.mock.patch.dict(sys.modules, stubs), unittest.mock.patch.object(sys, "path", path):
            dataset = importlib.import_module("dsec_det.dataset")
            opened = dataset.DSECDet(self.out / "dsec", "train", "back", debug=True)
            boxes = place = 0
            for folder in opened.subsequence_directories:
                sequence = DsecSequence(folder)
                self.assertEqual(len(sequence.images), len(sequence.times))
                for i in range(len(sequence.times) - 1):
                    sample, place = opened[place], place + 1
                    self.assertEqual(sample["tracks"].tobytes(), sequence.boxes(i).tobytes())
                    for name, column in zip("txyp", sequence.events(i)):
                        np.testing.assert_array_equal(sample["events"][name], column)
                    np.testing.assert_array_equal(sample["image"], self.frame(folder.name, sequence.times[i]))
                    boxes += len(sample["tracks"])
                boxes += len(sequence.boxes(len(sequence.times) - 1))  # which begins no sample
            self.assertEqual(place, len(opened))
        self.assertEqual(boxes, sum((sample["boxes"]["ignore"] == 0).sum() for sample in self.samples.values()))

    def converted(self, source, **changes):
        """The finalized folder of a job of one source."""
        manifest = self.out.parent / "manifest.json"
        manifest.write_text(json.dumps(program.manifest([{"pairs": program.pairs([1]), **source}],
                                                        generator={"kind": "difference"}, **changes)))
        run("convert", manifest, "--progress", "none")
        return manifest.parent / "out"

    def converted_frames(self, sequence, numbers, **source):
        """The same of images of these numbers, in a folder `sequence` of the source's, or in it."""
        for k in numbers:
            small_job.save_image(self.out.parent / "clip" / sequence / f"{k:04d}.png", np.random.default_rng(k))
        return self.converted({"dataset": "frames", "root": "clip", **source})

    def test_frames_without_times_are_a_second_each(self):
        frames = self.converted_frames("a b", (3, 4, 5, 6))
        said, _ = self.export("dsec", source=frames)
        self.assertIn("3 samples are of images without times: their clock counts 1 frame a second", said)
        self.assertEqual(len(self.described()["notes"]), 1)
        said, _ = self.export("dsec", source=frames)  # which is done
        self.assertIn("images without times", said)
        recording, = (self.out / "dsec" / "train").iterdir()
        self.assertEqual(recording.name, "a%20b")
        windows = read_windows(recording / "windows.txt")
        found = read_samples(frames)
        self.assertEqual({window[4]: window[:2] for window in windows},
                         {key[2]: tuple(int(sample["pairs"][name]) * 10 ** 6 for name in ("prev_index", "next_index"))
                          for key, sample in found.items()})
        self.assertGreater(len(windows), 1)
        self.assertFalse((recording / "object_detections").exists())

    def test_every_tenth_frame_of_25_a_second(self):
        frames = self.converted_frames("clip", (30, 40, 50, 60))
        said, _ = self.export("raw", "--frames-per-second", "25", source=frames)
        self.assertIn("25 frames a second", said)
        windows = read_windows(self.out / "raw" / "train" / "clip_windows.txt")
        self.assertEqual([window[:2] for window in windows], [(0, 40000), (40000, 80000), (80000, 120000)])

    def test_a_clock_beyond_all_times_is_refused(self):
        frames = self.converted_frames("clip", range(99999999990, 99999999993))
        _, err = self.export("raw", "--frames-per-second", "0.001", source=frames, expect=64)
        self.assertRegex(err, r"expected a sequence that ends before 1e\+12 s, got frame 9999999999\d at 0.001 a "
                              r"second, in .*\.h5 \(--frames-per-second\)")
        self.export("raw", source=frames, out=self.out / "slower")
        windows = read_windows(self.out / "slower" / "raw" / "train" / "clip_windows.txt")
        self.assertEqual([window[:2] for window in windows], [(0, 10 ** 6), (10 ** 6, 2 * 10 ** 6)])

    def test_a_folder_of_images_is_one_sequence(self):
        self.export("dsec", source=self.converted_frames("", range(4), frames_per_second=20))
        recording, = (self.out / "dsec" / "train").iterdir()
        self.assertEqual(recording.name, "clip")
        self.assertEqual([window[:2] for window in read_windows(recording / "windows.txt")],
                         [(50000 * k, 50000 * (k + 1)) for k in range(3)])

    def test_rvt_has_the_volumes_of_samples(self):
        for source, known in ((self.source, {("train", key): sample for key, sample in self.samples.items()}),
                              (None, {(key[0], key[2]): sample for key, sample in of(dataset="kitti_object").items()})):
            with self.subTest(source=source):
                self.out = pathlib.Path(tempfile.mkdtemp(dir=demo.folder)) / "export"
                self.export("rvt", "--counts", "rounded", "--representation", "volume", source=source)
                self.check_rvt(known)

    def check_rvt(self, known):
        seen, in_frame, unlabelled = [], 0, 0
        for path in sorted((self.out / "raw").glob("*/*_windows.txt")):
            split, name, windows = path.parent.name, path.name.removesuffix("_windows.txt"), read_windows(path)
            of_it = [known[split, window[4]] for window in windows]
            seen += [(split, window[4]) for window in windows]
            self.assertEqual(windows[0][0], 0)
            with h5py.File(path.with_name(f"{name}_td.h5")) as file:
                size = file["events/height"][()].item(), file["events/width"][()].item()
                self.assertEqual(size, of_it[0]["volume"].shape[1:])
                columns = [file[f"events/{column}"][:].astype("int64") for column in "txyp"]
                for window, sample in zip(windows, of_it):
                    first, last = np.searchsorted(columns[0], window[:2])
                    self.check_volume([column[first:last] for column in columns], window, sample)
            counts = [(sample["boxes"]["ignore"] == 0).sum() for sample in of_it]
            boxes = path.with_name(f"{name}_bbox.npy")
            self.assertEqual(boxes.exists(), sum(counts) > 0)
            if not boxes.exists():
                unlabelled += len(windows)
                self.assertFalse((self.out / "preprocessed" / split / name).exists())
                continue
            # The names that RVT's preprocessing finds the events and the sequence by.
            self.assertEqual(boxes.stem.split("bbox")[0] + "td.h5", f"{name}_td.h5")
            rows = np.load(boxes)
            self.assertEqual(rows.dtype, BBOX_DTYPE)
            self.assertEqual(len(rows), sum(counts))
            for window, sample in zip(windows, of_it):
                self.check_boxes(rows[rows["t"] == window[2]], sample, window[2])
            sequence = RvtSequence(self.out / "preprocessed" / split / name, "eventgan_nbins=9", size)
            self.assertEqual(sequence.labels.dtype, BBOX_DTYPE)
            self.assertEqual(list(sequence.repr_times), [window[1] for window in windows])
            for volume, sample in zip(sequence.data, of_it):
                np.testing.assert_array_equal(volume, np.concatenate([sample["volume"][9:], sample["volume"][:9]]))
            for k, time in enumerate(sequence.frame_times):
                labels, place = sequence.frame(k)
                self.assertEqual(windows[place][2], time)
                xyxy = of_it[place]["boxes"]["xyxy"][of_it[place]["boxes"]["ignore"] == 0]
                xyxy = xyxy[(xyxy[:, 0] < size[1] - 1) & (xyxy[:, 1] < size[0] - 1)]
                np.testing.assert_allclose(np.stack([labels[key] for key in "xywh"], axis=1),
                                           np.hstack([xyxy[:, :2], xyxy[:, 2:] - xyxy[:, :2]]), atol=1e-4)
                in_frame += len(labels)
        self.assertEqual(sorted(seen), sorted(known))
        left_out = self.described()["left_out"]
        kept = sum((sample["boxes"]["ignore"] == 0).sum() for sample in known.values())
        self.assertEqual(left_out.get("boxes within the last pixel, where RVT's frame ends (in raw alone)", 0),
                         kept - in_frame)
        self.assertEqual(left_out.get("samples of recordings without boxes (in raw alone)", 0), unlabelled)

    def test_rvt_has_what_its_preprocessing_makes_of_the_recordings(self):
        for size, words in (((0, 0), []), (GEN1, ["--representation", "histogram:4"]), (GEN4, [])):
            with self.subTest(size=size):
                out = pathlib.Path(tempfile.mkdtemp(dir=demo.folder))
                source = self.source
                if size[0]:
                    job = json.loads((self.source.parent / "manifest.json").read_text())
                    job["image"] = {**job["image"], "height": size[0], "width": size[1]}
                    job["sources"][0]["pairs"] = program.pairs([1])
                    job["generator"]["sensor"] = {"positive_threshold": 4, "negative_threshold": 4}  # few events
                    job["output"]["directory"] = str(out / "shards")
                    (out / "manifest.json").write_text(json.dumps(job))
                    run("convert", out / "manifest.json", "--progress", "none")
                    source = out / "shards"
                self.export("rvt", *words, source=source, out=out / "export")
                self.check_preprocessed(out / "export", 4 if words else 10)
                if size[0] and READERS.is_dir() and importlib.util.find_spec("torch"):
                    self.check_with_own_code(out / "export", 4 if words else 10, size)

    def check_with_own_code(self, out, bins, size):
        """RVT's own classes give what RvtSequence, written after them, gives, and its preprocessing the same files."""
        name, scale = f"stacked_histogram_dt=50_nbins={bins}", 0.5 if size == GEN4 else 1
        compared = made = 0
        with own_code(str(READERS / "rvt")) as (samples, preprocess):
            # Of Gen4's size the script wants labels at 30 or 60 Hz.
            for boxes in sorted((out / "raw").glob("*/*_bbox.npy")) if size == GEN1 else ():
                recording = boxes.name.removesuffix("_bbox.npy")
                of_rvt, ours = out / "rvts" / recording, out / "preprocessed" / boxes.parent.name / recording
                preprocess(boxes, *boxes.parent.glob(f"{recording}_td*.h5"), of_rvt, bins)
                self.assertEqual(of_rvt.exists(), ours.exists())
                for path in sorted(of_rvt.rglob("*.*")):
                    self.assertEqual(*map(arrays_of, (ours / path.relative_to(of_rvt), path)))
                    made += 1
            for labels in sorted((out / "preprocessed").glob("*/*/labels_v2")):
                sequence = RvtSequence(labels.parent, name, size)
                for length in (1, 3):
                    of_both = zip(samples(labels.parent, name, length, size),
                                  (sequence.random_access(length), sequence.streams(length)))
                    for found, expected in of_both:
                        self.assertEqual(len(found), len(expected))
                        for (data, boxes), (expected_data, expected_boxes) in zip(found, expected):
                            np.testing.assert_array_equal(data, expected_data)
                            for rows, of_them in zip(boxes, expected_boxes, strict=True):
                                self.assertEqual(rows is None, of_them is None)
                                if rows is not None:
                                    np.testing.assert_allclose(rows, columns_of(of_them, size, scale), atol=1e-4)
                                    compared += len(rows)
        self.assertGreater(compared, 0)
        self.assertEqual(made > 0, size == GEN1)

    def check_preprocessed(self, out, bins):
        labels_without_frame, made = 0, 0
        for path in sorted((out / "raw").glob("*/*_td*.h5")):
            split, name = path.parent.name, path.name.split("_td")[0]
            with h5py.File(path) as file:
                size = file["events/height"][()].item(), file["events/width"][()].item()
                t, x, y, p = (file[f"events/{column}"][:].astype("int64") for column in "txyp")
            self.assertEqual(path.name, name + ("_td.dat.h5" if size == GEN1 else "_td.h5"))
            boxes = path.with_name(f"{name}_bbox.npy")
            boxes = kept_boxes(np.load(boxes), size, split) if boxes.exists() else np.empty(0, BBOX_DTYPE)
            label_times = np.unique(boxes["t"])
            frames, ends = frame_times(label_times, size)
            labels_without_frame += len(label_times) - len(frames)
            below = out / "preprocessed" / split / name
            self.assertEqual(below.exists(), len(frames) > 0)
            if not frames:
                continue
            made += 1
            sequence = RvtSequence(below, f"stacked_histogram_dt=50_nbins={bins}", size)
            self.assertEqual((list(sequence.frame_times), list(sequence.repr_times)), (frames, ends))
            np.testing.assert_array_equal(sequence.repr_idx, np.searchsorted(ends, frames))
            np.testing.assert_array_equal(sequence.labels, boxes[np.isin(boxes["t"], frames)])
            self.assertEqual(sequence.labels.dtype, boxes.dtype)
            self.assertEqual(sequence.data.dtype, np.uint8)
            for data, end in zip(sequence.data, ends):
                of_it = slice(np.searchsorted(t, end - 50000), np.searchsorted(t, end, side="right"))
                expected = stacked_histogram(*(column[of_it] for column in (t, x, y, p)), size, bins)
                np.testing.assert_array_equal(data, expected[:, 1::2, 1::2] if size == GEN4 else expected)
        self.assertGreater(made, 0)
        left_out = json.loads((out / "export.json").read_text())["left_out"]
        self.assertEqual(left_out.get("labels of samples before 0.1 s or between RVT's (in raw alone)", 0),
                         labels_without_frame)

    def test_raw_has_the_events_and_boxes_of_rvt(self):
        rvt, raw = self.out / "rvt", self.out / "raw"
        self.export("rvt", source=self.source, out=rvt)
        self.export("raw", source=self.source, out=raw)
        recordings = sorted((rvt / "raw").glob("*/*_td.h5"))
        self.assertGreater(len(recordings), 2)
        for path in recordings:
            split, name = path.parent.name, path.name.removesuffix("_td.h5")
            size, (t, x, y, p) = decode_evt3((raw / "raw" / split / f"{name}.raw").read_bytes())
            with h5py.File(path) as file:
                self.assertEqual(size, (file["events/height"][()], file["events/width"][()]))
                for column, found in (("t", t), ("x", x), ("y", y), ("p", p)):
                    np.testing.assert_array_equal(found, file[f"events/{column}"][:])
            for ending in ("_bbox.npy", "_windows.txt"):
                of_rvt, of_raw = path.with_name(name + ending), raw / "raw" / split / (name + ending)
                self.assertEqual(of_rvt.read_bytes() if of_rvt.exists() else b"",
                                 of_raw.read_bytes() if ending == "_windows.txt" or len(np.load(of_raw)) else b"")

    def test_aedat4_has_the_events_and_boxes_of_raw_and_the_frames(self):
        raw, dv = self.out / "raw", self.out / "dv"
        self.export("raw", source=self.source, out=raw)
        self.export("aedat4", source=self.source, out=dv)
        recordings = sorted((dv / "aedat4").glob("*/*.aedat4"))
        self.assertEqual([path.stem for path in recordings], sorted(path.stem for path in raw.rglob("*.raw")))
        for path in recordings:
            of_raw = raw / "raw" / path.parent.name / path.stem
            windows = read_windows(path.with_name(f"{path.stem}_windows.txt"))
            clock = windows[0][0]
            self.assertEqual([tuple(time - clock for time in window[:3]) + window[3:] for window in windows],
                             read_windows(of_raw.with_name(f"{path.stem}_windows.txt")))
            (width, height), (t, x, y, p), frames = aedat4.read(path)
            size, (t_raw, *others) = decode_evt3(of_raw.with_suffix(".raw").read_bytes())
            self.assertEqual((height, width), size)
            for found, expected in ((t, t_raw + clock), *zip((x, y, p), others)):
                np.testing.assert_array_equal(found, expected)
            boxes, raw_boxes = (np.load(at.with_name(f"{path.stem}_bbox.npy")) for at in (path, of_raw))
            self.assertEqual(list(boxes["t"]), list(raw_boxes["t"] + clock))
            boxes["t"] = raw_boxes["t"]
            self.assertEqual(boxes.tobytes(), raw_boxes.tobytes())
            # A frame takes 0.1 s; a pair's are at the ends of its window, and are there once.
            self.assertEqual([time for time, _ in frames], sorted({time for window in windows for time in window[:2]}))
            for time, pixels in frames:
                with PIL.Image.open(self.drive / "image_02" / path.stem.split("~")[0].replace("%62", "b") /
                                    f"{time // 100_000:06d}.png") as image:
                    np.testing.assert_array_equal(pixels, image)

    def test_aedat4_has_frames_in_colour_and_those_of_clips_made_of_stills(self):
        images = np.random.default_rng(5).integers(0, 256, (2, small_job.HEIGHT, small_job.WIDTH, 3), dtype=np.uint8)
        (self.out.parent / "clip").mkdir(parents=True)
        for k, image in enumerate(images):
            PIL.Image.fromarray(image).save(self.out.parent / "clip" / f"{k}.png")
        source = {"dataset": "frames", "root": "clip"}
        self.export("aedat4", source=self.converted(source))
        _, _, frames = aedat4.read(self.out / "aedat4" / "train" / "clip.aedat4")
        self.assertEqual([time for time, _ in frames], [0, 1_000_000])
        np.testing.assert_array_equal([pixels[..., ::-1] for _, pixels in frames], images)

        shutil.rmtree(self.out.parent / "out")
        stills = self.converted({**source, "pairs": {"from": "stills", "frames": 4}}, errors=small_job.LENIENT)
        self.export("aedat4", source=stills, out=self.out.parent / "stills")
        recordings = sorted((self.out.parent / "stills" / "aedat4" / "train").glob("*.aedat4"))
        self.assertEqual(len(recordings), 2)
        for path in recordings:
            _, (t, *_), frames = aedat4.read(path)
            self.assertGreater(len(t), 0)
            self.assertEqual([pixels.ndim for _, pixels in frames], [3] * 5)  # four, and the one before
            for (_, before), (_, after) in zip(frames, frames[1:]):
                self.assertFalse(np.array_equal(before, after))

    def test_aedat4_wants_the_frames(self):
        frames = self.converted_frames("", range(4))
        moved = self.out.parent / "elsewhere"
        moved.mkdir()
        (self.out.parent / "clip").rename(moved / "clip")
        _, err = self.export("aedat4", source=frames, expect=66)
        self.assertRegex(err, r"clip/\d{4}\.png")
        self.assertIn("--frames names the folder", err)
        self.export("aedat4", "--frames", moved, "--overwrite", source=frames)
        _, _, found = aedat4.read(self.out / "aedat4" / "train" / "clip.aedat4")
        self.assertEqual(len(found), 4)
        _, err = self.export("aedat4", "--frames", self.out.parent, source=frames, expect=64)
        self.assertIn("got another export", err)

    def test_convert_reads_each_export_again(self):
        source = self.converted({"dataset": "kitti_tracking", "root": str(self.drive)}, errors=small_job.LENIENT)
        known = {key[2]: sample for key, sample in read_samples(source).items()}

        def read_again(folder, **keys):
            self.assertIn(f'run eventgan convert "{folder}"', run("init", folder.parents[1], expect=66)[1])
            self.assertIn("recording of an event camera", run("init", folder, "--out", folder.parent / "init.json")[0])
            manifest = folder.parent / "manifest.json"
            manifest.write_text(json.dumps(program.manifest(
                [{"dataset": "recording", "root": str(folder), **keys}], image={}, generator={"kind": "events"},
                output={"directory": "again", "dtype": "float32"})))
            run("convert", manifest, "--progress", "none")
            return {key[2]: sample for key, sample in read_samples(manifest.parent / "again").items()}

        def check_events(events, begin, end, sample):
            """As `convert` counts a window: without its begin, with its end."""
            t, x, y, p = events
            inside = (t > begin) & (t <= end)
            rows = np.stack([x, y, t, p], 1)[inside]
            np.testing.assert_allclose(sample["volume"], volume_of(rows, len(sample["volume"]) // 2,
                                                                   *sample["volume"].shape[1:]), atol=1e-4)
            return len(rows)

        for to, file, windows, read in (
                ("rvt", "raw/train/0000_td.h5", "raw/train/0000_windows.txt", read_columns),
                ("dsec", "dsec/train/0000/events/left/events.h5", "dsec/train/0000/windows.txt", read_columns),
                ("raw", "raw/train/0000.raw", "raw/train/0000_windows.txt", lambda at: decode_evt3(at.read_bytes())[1]),
                ("aedat4", "aedat4/train/0000.aedat4", "aedat4/train/0000_windows.txt", lambda at: aedat4.read(at)[1])):
            with self.subTest(to):
                out = self.out / to
                self.export(to, "--counts", "rounded", source=source, out=out)
                again = read_again(out / file.split("/")[0] / "train", window_s=0.1)
                again = {sample_id.split("/")[1]: sample for sample_id, sample in again.items()}
                events = read(out / file)
                for begin, end, label, count, sample_id in read_windows(out / windows):
                    boxes = known[sample_id]["boxes"]
                    kept = np.flatnonzero(boxes["ignore"] == 0)
                    if not len(kept):
                        continue  # no box has its time
                    sample = again.pop(f"{label / 1e6:017.6f}")
                    self.assertEqual(check_events(events, begin, end, sample), count)
                    self.assertEqual([round(sample["pairs"][key] * 1e6) for key in ("prev_time_s", "next_time_s")],
                                     [begin, end])
                    np.testing.assert_allclose(sample["boxes"]["xyxy"], boxes["xyxy"][kept], atol=1e-4)
                    self.assertEqual(list(sample["boxes"]["track_id"]), list(boxes["track_id"][kept]))
                    self.assertEqual([sample["classes"][k] for k in sample["boxes"]["class_id"]],
                                     [known[sample_id]["classes"][k] for k in boxes["class_id"][kept]])
                self.assertEqual(again, {})
        out = self.out / "events"
        self.export("events", "--layout", "mvsec", "--counts", "rounded", source=source, out=out)
        again = read_again(out / "events" / "train")
        self.assertEqual(len(again), len(known))
        for sample_id, sample in again.items():
            with h5py.File(out / "events" / "train" / f"{sample_id.split('/')[0]}.hdf5") as file:
                x, y, t, p = file["davis/left/events"][:].T
            self.assertEqual(check_events((t, x.astype(int), y.astype(int), p), 0, 1, sample), len(t))

    def test_raw_says_at_once_that_its_pixels_have_eleven_bits(self):
        manifest = small_job.small_job(self.out.parent / "wide", cars=2, people=0, errors=small_job.LENIENT,
                                       image={"width": 2560, "height": 16, "preset": "mpii"})
        run("convert", manifest, "--progress", "none")
        _, err = self.export("raw", source=manifest.parent / "out", expect=64)
        self.assertIn("expected volumes of at most 2048 pixels a side for --to raw, got 2560x16", err)
        self.assertFalse(self.out.exists())

    def test_rvt_names_files_of_gen1_as_its_preprocessing_does_and_leaves_no_bbox_in_a_name(self):
        source = {"dataset": "kitti_tracking", "root": str(self.drive), "pairs": program.pairs([2])}
        self.export("rvt", source=self.converted(source, errors=small_job.LENIENT,
                                                 image={"width": 304, "height": 240, "preset": "mpii"}))
        self.assertEqual({path.name.split("_")[0] for path in (self.out / "raw" / "train").glob("*_td.dat.h5")}
                         - {"0000", "0000~2"}, {"%62box"})

    def test_a_class_map_and_no_events(self):
        classes = demo.folder / "dsec.json"
        classes.write_text(json.dumps({"Pedestrian": 0, "Car": 2}))
        black = self.out.parent / "black"
        shutil.copytree(self.drive, black)
        for path in (black / "image_02").rglob("*.png"):
            PIL.Image.new("L", (small_job.WIDTH, small_job.HEIGHT)).save(path)
        source = self.converted({"dataset": "kitti_tracking", "root": str(black)})
        for to in ("dsec", "rvt", "aedat4"):
            self.export(to, "--classes", classes, source=source, out=self.out / to)
            self.assertEqual(json.loads((self.out / to / "label_map_dictionary.json").read_text()),
                             {"0": "Pedestrian", "2": "Car"})
        with h5py.File(self.out / "dsec/dsec/train/0000/events/left/events.h5") as file:
            self.assertEqual(file["events/t"].shape, (0,))
            np.testing.assert_array_equal(file["ms_to_idx"][:], np.zeros(1101))
        _, (t, *_), frames = aedat4.read(self.out / "aedat4/aedat4/train/0000.aedat4")
        self.assertEqual((len(t), len(frames)), (0, 12))
        tracks = np.load(self.out / "dsec/dsec/train/0000/object_detections/left/tracks.npy")
        self.assertEqual(set(tracks["class_id"]), {0, 2})
        classes.write_text(json.dumps({"Car": 256}))
        _, err = self.export("dsec", "--classes", classes, source=source, expect=64)
        self.assertIn("at most 255", err)


if __name__ == "__main__":
    program.main()

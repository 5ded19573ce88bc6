"""Recordings as cameras and tools leave them: out of order, cut, padded, of kinds that are not read. `convert` loses
none of their events in silence, and says of each that it does not read why."""

import pathlib
import shutil

import cv2
import h5py
import numpy as np

import program
from camera_files import (BBOX, HEIGHT, WIDTH, random_events, volume_of, whole_microseconds, write_columns, write_dat,
                          write_evt3, write_mvsec)
from folders import quarantined
from program import run
from small_job import LENIENT, save_image

SENSOR = {"width": WIDTH, "height": HEIGHT}


class AsWritten(program.InFolder):
    def setUp(self):
        super().setUp()
        self.out = self.folder / "out"
        self.events = whole_microseconds(random_events(4000, 0, 4, 5))[0]

    def manifest(self, root, errors=LENIENT, **source):
        return self.write_manifest(program.manifest(
            [{"dataset": "recording", "root": root, "split": "test", **source}], image={},
            generator={"kind": "events"}, errors=errors, output={"directory": "out", "dtype": "float32"}))

    def convert(self, root, expect=0, **source):
        shutil.rmtree(self.out, ignore_errors=True)
        return run("convert", self.manifest(root, **{"window_s": 0.5, **source}), expect=expect)

    def samples(self):
        """Of each its id, whether it is valid, its times and its volume."""
        found = []
        for path in sorted(pathlib.Path(self.out).glob("*-of-*.h5")):
            with h5py.File(path) as shard:
                pairs = shard["pairs"]
                found += zip(map(program.text, pairs["sample_id"][:]), shard["valid"][:] == 1,
                             np.stack([pairs["prev_time_s"][:], pairs["next_time_s"][:]], 1),
                             shard["events/volume"][:])
        return found

    def check_windows(self, events, invalid=0):
        samples = self.samples()
        self.assertEqual(sum(not valid for _, valid, _, _ in samples), invalid)
        for name, valid, (begin, end), volume in samples:
            if valid:
                window = events[(events[:, 2] > begin) & (events[:, 2] <= end)]
                np.testing.assert_allclose(volume, volume_of(window), rtol=0, atol=1e-4, err_msg=name)
        return len(samples)

    def table(self, name, events):
        columns = {"t": whole_microseconds(events)[1], "x": events[:, 0].astype(np.uint16),
                   "y": events[:, 1].astype(np.uint16), "p": (events[:, 3] > 0).astype(np.uint8)}
        path = self.folder / name
        if path.suffix == ".npz":
            np.savez(path, **columns)
        elif path.suffix == ".csv":
            np.savetxt(path, np.stack(list(columns.values()), 1), fmt="%d", delimiter=",", header="t,x,y,p",
                       comments="")
        else:
            np.save(path, np.stack(list(columns.values()), 1).astype(np.int64))

    def pieces(self):
        """A recording behind the one before it, and two blocks exchanged: sorted in pieces, not as a whole."""
        first, second = self.events[::2], self.events[1::2]
        yield np.concatenate([first, second])
        ends = self.events[0, 2] - 2.5e-7 + np.arange(1, 4)  # of every other window
        parts = np.split(self.events, np.searchsorted(self.events[:, 2], ends, side="right"))
        yield np.concatenate([parts[0], parts[2], parts[1], parts[3]])

    def test_tables_sorted_in_pieces_are_sorted(self):
        for events in self.pieces():
            for name in ("a.npz", "a.npy", "a.csv"):
                self.table(name, events)
                told = self.convert(name, sensor=SENSOR)[0]
                self.assertIn("the events are sorted by time", told)
                self.assertEqual(self.check_windows(self.events), 8)

    def test_arrays_with_labels_beside_them_are_found_as_windows(self):
        folder = self.folder / "windows"
        folder.mkdir()
        for name in ("a.npy", "b.npy"):
            self.table(f"windows/{name}", self.events)
        (folder / "classes.txt").write_text("person\n")
        run("init", folder, "--out", self.folder / "none.json", expect=66)  # any numbers
        for name in ("a.txt", "b.txt"):
            (folder / name).write_text("0 0.5 0.5 0.25 0.5\n")
        told = run("convert", folder, "--output", self.out, "--sensor", f"{WIDTH}x{HEIGHT}")[0]
        self.assertIn("2 of 2 ", told)
        self.assertIn("boxes: 2 person\n", told)

    def test_files_sorted_in_pieces_lose_no_event_in_silence(self):
        catted, blocks = self.pieces()
        for events, invalid in ((catted, 8), (blocks, 4)):
            write_dat(self.folder / "a.dat", events)
            write_evt3(self.folder / "a.raw", events)
            with h5py.File(self.folder / "a_td.h5", "w") as file:
                for name, values in zip("xytp", (*events.T[:2].astype(np.uint16), whole_microseconds(events)[1],
                                                 (events[:, 3] > 0).astype(np.uint8))):
                    file[f"events/{name}"] = values
                file["events/height"], file["events/width"] = HEIGHT, WIDTH
            write_mvsec(self.folder / "mvsec.hdf5", events, self.events[0, 2] - 2.5e-7 + 0.5 * np.arange(9))
            for name in ("a.dat", "a.raw", "a_td.h5", "mvsec.hdf5"):
                with self.subTest(name, invalid=invalid):
                    if name == "a.raw" and invalid == 8:
                        continue  # its counter may have wrapped
                    self.convert(name, **({"time_shift": False} if name == "a.raw" else {}))
                    # From the earlier block's first to the later one's last event, each window is in doubt.
                    self.check_windows(self.events, invalid)

    def test_an_exchanged_pair_is_lifted_or_the_fault_of_its_window(self):
        times, steps = self.events[1:, 2], np.diff(self.events[:, 2])
        lifted = int(np.flatnonzero((steps > 0) & (steps < 0.0009) & (times > 3.2))[0])
        k = int(np.flatnonzero((steps > 0.0021) & (times > 1.7))[0])
        small, events, expected = self.events.copy(), self.events.copy(), self.events.copy()
        for exchanged, places in ((small, (lifted,)), (events, (lifted, k)), (expected, (lifted,))):
            for i in places:
                exchanged[[i, i + 1]] = exchanged[[i + 1, i]]
        expected[lifted + 1, 2] = expected[lifted, 2]
        folder = self.folder / "all"
        folder.mkdir()
        write_dat(folder / "a_td.dat", events)
        write_evt3(folder / "b.raw", events)
        with h5py.File(folder / "c_td.h5", "w") as file:
            for name, values in zip("xytp", (*events.T[:2].astype(np.uint16), whole_microseconds(events)[1],
                                             events[:, 3] > 0)):  # polarity as bool: an enum in HDF5
                file[f"events/{name}"] = values
            file["events/height"], file["events/width"] = HEIGHT, WIDTH
        write_dat(folder / "d_td.dat", small)
        told = self.convert("all")[0]
        self.assertIn("3 quarantined", told)
        self.assertIn("1 is lifted to the latest before, in ", told)
        self.assertEqual(self.check_windows(expected, invalid=3), 32)
        for reason in quarantined(self.out).values():
            self.assertIn("expected times that never decrease", reason)
            self.assertIn(f"(event {k + 1})", reason)

    def test_labels_beside_raw_lie_on_the_recordings_clock(self):
        # In column 3 k in second k of the recording, whose camera's clock began at 2 s.
        times = np.arange(0.002, 10, 0.002)
        events = np.stack([3 * np.floor(times), np.ones_like(times), times, np.ones_like(times)], 1)
        write_evt3(self.folder / "a.raw", events, begin_us=2_000_000, padding=7)
        boxes = np.zeros(5, BBOX)
        boxes[:] = [(t, 2, 3, 10, 7, 0, 5, 1) for t in range(3_500_000, 8_000_000, 1_000_000)]
        np.save(self.folder / "a_bbox.npy", boxes)
        for changes, first in (({}, 9), ({"time_shift": False}, 3)):
            told = self.convert("a.raw", window_s=0.05, **changes)[0]
            self.assertIn("words of reserved types are passed over: 715", told)
            columns = [set(np.nonzero(volume)[2]) for _, _, _, volume in self.samples()]
            self.assertEqual(columns, [{first + 3 * k} for k in range(5)])

    def test_what_is_not_read_says_why(self):
        write_evt3(self.folder / "evt21.raw", self.events, form="EVT21")
        (self.folder / "disagree.raw").write_bytes(b"% evt 3.0\n% geometry 32x32\n% format EVT3;height=9;width=32\n")
        with h5py.File(self.folder / "ecf.hdf5", "w") as file:
            file["CD/events"] = np.zeros(3, [("x", "<u2"), ("y", "<u2"), ("p", "<i2"), ("t", "<i8")])
        np.savez(self.folder / "arr0.npz", np.zeros((3, 2)))
        np.save(self.folder / "ts.npy", np.zeros(3, [("ts", "<i8"), ("x", "<u2"), ("y", "<u2"), ("p", "u1")]))
        ticks = whole_microseconds(self.events)[1]
        with h5py.File(self.folder / "nosize_td.h5", "w") as file:
            for name, values in zip("xytp", (*self.events.T[:2].astype(np.uint16), ticks, self.events[:, 3] > 0)):
                file[f"events/{name}"] = values
        for name, why in {"evt21.raw": "expected events on the sensor of 32x24, got none: ",
                          "disagree.raw": "expected lines that agree, got another \"height\"",
                          "ecf.hdf5": "(metavision_file_to_csv writes a table of it, which is read)",
                          "arr0.npz": "got arrays arr_0.npy", "ts.npy": "got fields ts, x, y, p",
                          "nosize_td.h5": "expected the sensor's size in the file"}.items():
            with self.subTest(name):
                source = {} if name == "nosize_td.h5" else {"sensor": SENSOR}
                error = self.convert(name, expect=66, **source)[1]
                self.assertIn(why, error)
                self.assertIn(name, error)
        self.convert("nosize_td.h5", sensor=SENSOR)
        self.assertEqual(self.check_windows(self.events), 8)

    def test_a_cut_recording_of_a_folder_counts_as_errors_do(self):
        folder = self.folder / "data"
        write_columns(folder / "good_td.h5", self.events, size=(HEIGHT, WIDTH))
        write_columns(folder / "second_td.h5", self.events, size=(HEIGHT, WIDTH))
        whole = (folder / "second_td.h5").read_bytes()
        (folder / "second_td.h5").write_bytes(whole[:len(whole) // 2])
        error = self.convert("data", expect=66, errors=program.manifest([])["errors"])[1]
        self.assertIn("got 1 of 2 that cannot", error)
        self.assertIn("truncated file", error)
        self.assertIn("second_td.h5", error)
        error = self.convert("data", errors=LENIENT)[1]
        self.assertIn("truncated file", error)
        self.assertEqual(self.check_windows(self.events), 8)

    def test_a_table_without_events_is_a_still_scene(self):
        folder = self.folder / "windows"
        folder.mkdir()
        for name, events in (("a", self.events), ("b", self.events[:0])):
            self.table(f"windows/{name}.npy", events)
            (folder / f"{name}.txt").write_text("0 0.5 0.5 0.25 0.5\n")
        size = f"{WIDTH}x{HEIGHT}"
        told, warned = run("convert", folder, "--output", self.out, "--sensor", size)
        self.assertIn("boxes: 2 of class 0\n", told)
        for text in (told, warned):
            self.assertIn("1 recording without events (1 empty event volume): ", text)
        volumes = [volume for _, valid, _, volume in self.samples() if valid]
        self.assertEqual([volume.any() for volume in volumes], [True, False])

    def test_v2es_texts_begin_with_comments(self):
        (self.folder / "v2e" / "images").mkdir(parents=True)
        for k in range(9):
            save_image(self.folder / "v2e" / "images" / f"{k}.png", np.random.default_rng(k))
        (self.folder / "v2e" / "images.txt").write_text("".join(f"{0.5 * k} images/{k}.png\n" for k in range(9)))
        lines = "".join(f"{t:.6f} {int(x)} {int(y)} {int(p > 0)}\n" for x, y, t, p in self.events)
        (self.folder / "v2e" / "events.txt").write_text("#!events.txt\n# This is a text DVS created by v2e\n" + lines)
        run("convert", self.manifest("v2e"))
        self.assertEqual(self.check_windows(self.events), 8)

    def test_still_pixels_leak_at_times_of_their_own(self):
        still = np.full((HEIGHT, WIDTH), 120, np.uint8)
        (self.folder / "seq").mkdir()
        for k in range(12):
            cv2.imwrite(str(self.folder / "seq" / f"{k:04}.png"), still)
        sensor = {"positive_threshold": 0.2, "negative_threshold": 0.2, "leak_rate_hz": 9.5}
        run("convert", self.write_manifest(program.manifest(
            [{"dataset": "frames", "root": "seq", "frames_per_second": 10, "pairs": program.pairs([1])}], image={},
            generator={"kind": "difference", "sensor": sensor}, output={"directory": "out", "dtype": "float32"})))
        counts = [volume.sum() / still.size for _, _, _, volume in self.samples()]
        self.assertEqual(len(counts), 11)
        np.testing.assert_allclose(counts, 0.95, rtol=0, atol=0.1)
        run("simulate", self.write_manifest({
            "format": "eventgan-simulation", "version": 1, "name": "s", "seed": 1, "sensor": {**sensor,
                                                                                            "leak_rate_hz": 2},
            "sources": [{"path": "seq", "method": "difference", "frames_per_second": 10, "name": "c"}],
            "output": {"directory": "simulated"}}, "simulation.json"))
        with h5py.File(next((self.folder / "simulated").glob("*.hdf5"))) as file:
            events = file["davis/left/events"][:]
        self.assertAlmostEqual(len(events) / still.size / 1.1, 2, delta=0.2)
        self.assertGreater(len(np.unique(events[:, 2])), 0.9 * len(events))  # no two at one instant
        self.assertTrue((events[:, 3] == 1).all())


if __name__ == "__main__":
    program.main()

"""Exports of converted recordings have the camera's own events, in every format."""

import io
import json
import tarfile

import cv2
import h5py
import numpy as np

import aedat4
import exported_demo as demo
import program
from camera_files import random_events, whole_microseconds, write_mvsec
from exported_demo import Export
from exported_recordings import decode_evt3, read_columns, read_windows
from program import run

setUpModule, tearDownModule = demo.set_up, demo.tear_down


class EventsOfACamera(Export):
    """A recording of 32x24, converted at twice the size, has the camera's own events in every format."""
    FRAMES = [10.0 + 0.05 * k for k in range(5)]
    COUNTS = "run eventgan convert with the manifest again if recordings have moved; --counts draws events"

    def setUp(self):
        super().setUp()
        self.job = self.out.parent
        self.rows = whole_microseconds(random_events(3000, 9.98, 10.3, seed=5))[0]
        write_mvsec(self.job / "walk.hdf5", self.rows, self.FRAMES)
        (self.job / "walk.csv").write_text("time_s,left,top,right,bottom,class\n" + "".join(
            f"{time:.6f},4,6,20,22,person\n" for time in self.FRAMES[1:]))

    def convert(self, **changes):
        source = {"dataset": "recording", "root": str(self.job / "walk.hdf5"), **changes.pop("source", {})}
        manifest = self.job / "manifest.json"
        manifest.write_text(json.dumps(program.manifest(
            [source], generator={"kind": "events"}, image={"width": 64, "height": 48}, **changes)))
        run("convert", manifest, "--progress", "none")
        return self.job / "out"

    def expected(self, begin, end):
        """t in microseconds, x, y and p of the recording's events after `begin`, up to `end`."""
        ticks = np.round(self.rows[:, 2] * 1e6).astype(np.int64)
        of_window = (ticks > begin) & (ticks <= end)
        x, y, _, p = self.rows[of_window].astype(np.int64).T
        return np.stack([ticks[of_window], 2 * x + 1, 2 * y + 1, p > 0])

    def test_every_format_has_them(self):
        source = self.convert()
        begin, end = (int(self.FRAMES[k] * 1e6) for k in (0, -1))
        for to, read, clock in (
                ("dsec", lambda at: read_columns(at / "dsec/train/walk/events/left/events.h5"), 0),
                ("rvt", lambda at: read_columns(at / "raw/train/walk_td.h5"), begin),
                ("raw", lambda at: decode_evt3((at / "raw/train/walk.raw").read_bytes())[1], begin),
                ("aedat4", lambda at: aedat4.read(at / "aedat4/train/walk.aedat4")[1], 0)):
            with self.subTest(to=to):
                self.export(to, source=source, out=self.out / to)
                np.testing.assert_array_equal(np.stack(read(self.out / to)) + [[clock], [0], [0], [0]],
                                              self.expected(begin, end))
                self.assertIn("counts recorded\n", self.described(self.out / to)["settings"])
        self.export("events", source=source, out=self.out / "events")
        for first, last in zip(self.FRAMES, self.FRAMES[1:]):
            name = f"walk+{last:017.6f}".replace(".", "%2E")
            t, *others = np.loadtxt(self.out / "events/events/train" / f"{name}.txt").T
            expected = self.expected(int(first * 1e6), int(last * 1e6))
            np.testing.assert_allclose(first + t, expected[0] * 1e-6, atol=1e-8)
            np.testing.assert_array_equal(others, expected[1:])

    def test_webdataset_has_what_they_become(self):
        source = self.convert()
        for word, dtype, expected in (
                ("count", np.float32, lambda t, pixel, p: np.stack([pixel(p == 1), pixel(p == 0)])),
                ("histogram:4", np.uint8, lambda t, pixel, p: np.minimum(10, np.stack(
                    [pixel((p == side) & (np.minimum(4 * t, 3).astype(int) == k))
                     for side in (0, 1) for k in range(4)]))),
                ("voxel:2", np.float32, lambda t, pixel, p: np.stack(
                    [pixel((2 * p - 1) * share) for share in (1 - t, t)]))):
            with self.subTest(word=word):
                out = self.out / word.replace(":", "_")
                self.export("webdataset", "--representation", word, source=source, out=out)
                self.assertIn(f"representation {word}\ncounts recorded\n", self.described(out)["settings"])
                with tarfile.open(next(out.glob("*.tar"))) as tar:
                    arrays = {member.name: np.load(io.BytesIO(tar.extractfile(member).read()))
                              for member in tar if member.name.endswith(".npz")}
                self.assertEqual(len(arrays), len(self.FRAMES) - 1)
                for first, last in zip(self.FRAMES, self.FRAMES[1:]):
                    found = arrays[f"walk+{last:017.6f}".replace(".", "%2E") + ".npz"]
                    self.assertEqual(found.files, ["representation"])
                    ticks, x, y, p = self.expected(int(first * 1e6), int(last * 1e6))
                    share = (ticks * 1e-6 - first) / (last - first)

                    def pixel(weights, x=x, y=y):
                        return np.histogram2d(y, x, bins=(48, 64), range=((0, 48), (0, 64)), weights=weights)[0]

                    self.assertEqual(found["representation"].dtype, dtype)
                    np.testing.assert_allclose(found["representation"], expected(share, pixel, p), atol=1e-5)

    def test_windows_that_begin_at_half_a_microsecond(self):
        """The label is in the middle of 33.333 ms: no event is moved to another microsecond."""
        source = self.convert(source={"window_s": 0.033333, "label_at": "middle"})
        self.export("dsec", source=source)
        found = np.stack(read_columns(self.out / "dsec/train/walk/events/left/events.h5"))
        for time in self.FRAMES[1:]:
            begin, end = (np.round(1e6 * time + side * 16666.5) for side in (-1, 1))
            inside = (found[0] > begin + 1) & (found[0] < end - 1)
            np.testing.assert_array_equal(found[:, inside], self.expected(begin + 1, end - 2))

    def test_the_surface_at_a_label_has_the_events_up_to_its_time(self):
        """hpe's: an event at the label's own time is on it, one a microsecond later is not."""
        label = self.FRAMES[1]
        write_mvsec(self.job / "walk.hdf5", np.array([[8, 8, label, 1], [24, 16, label + 1e-6, 1]]), self.FRAMES)
        (self.job / "walk.csv").unlink()
        (self.job / "walk.json").write_text(json.dumps(
            {"format": "eventgan-labels", "version": 1, "joint_names": ["head"],
             "samples": [{"time_s": label, "persons": [{"joints": [[10, 10]]}]}]}))
        self.export("hpe", source=self.convert())
        surface = cv2.imread(str(next(self.out.glob("hpe/train/eros/*.png"))), cv2.IMREAD_GRAYSCALE)
        self.assertEqual(np.unravel_index(surface.argmax(), surface.shape), (2 * 8 + 1, 2 * 8 + 1))
        self.assertEqual(surface[:, 40:].max(), 0)

    def test_windows_of_so_many_events(self):
        self.export("dsec", source=self.convert(source={"window_events": 100}))
        seen = 0
        for path in self.out.glob("dsec/train/*"):
            t, *others = read_columns(path / "events/left/events.h5")
            for begin, end, _, count, _ in read_windows(path / "windows.txt"):
                inside = (begin <= t) & (t <= end)
                self.assertEqual((inside.sum(), count), (100, 100))
                np.testing.assert_array_equal(np.stack([t, *others])[:, inside], self.expected(begin - 1, end))
                seen += 1
        self.assertEqual(seen, 4)

    def test_other_recordings_than_were_converted(self):
        source = self.convert()
        with h5py.File(self.job / "walk.hdf5", "r+") as file:
            del file["davis/left/events"]
            file["davis/left/events"] = self.rows[self.rows[:, 2] != self.rows[1500, 2]]
        _, err = self.export("raw", source=source, expect=66)
        self.assertRegex(err, r"expected \d+ positive and \d+ negative events, of which the volume is made, got \d+ "
                              r"and \d+, in .*walk.hdf5 \(walk/0+10.\d+\)")
        self.assertIn(self.COUNTS, err)
        (self.job / "walk.hdf5").unlink()
        _, err = self.export("raw", source=source, out=self.out / "gone", expect=66)
        self.assertIn("walk.hdf5", err)
        self.assertIn(self.COUNTS, err)
        self.assertFalse((self.out / "gone").exists())
        self.export("raw", "--counts", "rounded", source=source, out=self.out / "drawn")
        _, (t, *_) = decode_evt3((self.out / "drawn/raw/train/walk.raw").read_bytes())
        self.assertGreater(len(t), 1000)


if __name__ == "__main__":
    program.main()

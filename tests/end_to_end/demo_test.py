"""The demo dataset, from nothing to images; determinism; what damage to the inputs does."""

import json
import pathlib
import shutil
import signal
import subprocess
import tempfile
import time

import h5py
import numpy as np

import program
from program import read_commented, run, shard_bytes, text


def setUpModule():
    global demo, converted, said
    demo = pathlib.Path(tempfile.mkdtemp(prefix="eventgan-demo-")) / "demo"
    run("make-demo", demo)
    converted = demo.parent / "converted"
    said = run("convert", demo / "manifest.json", "--output", converted, "--progress", "none", "--threads", "2")


def tearDownModule():
    shutil.rmtree(demo.parent)


def rows(folder):
    """Each sample of a folder's shards: (shard, slot, sample id)."""
    for path in sorted(pathlib.Path(folder).glob("*-of-*.h5")):
        with h5py.File(path) as shard:
            for slot, sample in enumerate(shard["pairs/sample_id"][:]):
                yield path, slot, text(sample)


class Demo(program.InFolder):
    def test_converts_verifies_and_previews(self):
        out, err = said
        self.assertEqual(err.count("warning"), 1)
        self.assertRegex(err, r"warning: shipped:\d+ are stand-in weights")
        self.assertIn("0 quarantined", out)
        self.assertIn("sound", run("verify", converted)[0])
        shards = sorted((converted).glob("*-of-*.h5"))
        self.assertGreaterEqual(len(shards), 3)
        for shard in shards:
            images, err = run("preview", shard, "--out", self.folder / "p", "--count", "2")
            self.assertEqual(err, "")
            for image in images.split():
                self.assertEqual(pathlib.Path(image).read_bytes()[:8], b"\x89PNG\r\n\x1a\n")
            self.assertIn("sample", run("inspect", shard)[0])
            json.loads(run("inspect", shard, "--json")[0])
            json.loads(run("inspect", shard, "--sample", "0", "--json")[0])

    def test_few_scenes_make_a_job_too(self):
        for scenes in (1, 2, 3):
            folder = self.folder / f"scenes-{scenes}"
            run("make-demo", folder, "--scenes", scenes)
            run("convert", folder / "manifest.json", "--limit", 5, "--progress", "none")
            splits = {path.name.split("-")[1] for path in (folder / "events-trial-5").glob("*-of-*.h5")}
            self.assertEqual(splits, {"train", "val"})

    def test_made_in_part_nothing_of_it_is_left(self):
        folder = self.folder / "stopped"
        making = subprocess.Popen([program.PROGRAM, "make-demo", folder, "--scenes", "100000"], stderr=subprocess.PIPE,
                                  text=True)
        while not (folder / "kitti" / "training" / "calib" / "000000.txt").exists():
            time.sleep(0.01)
        making.send_signal(signal.SIGINT)
        _, err = making.communicate(timeout=60)
        self.assertEqual((making.returncode, err), (75, "error: stopped; the unfinished dataset was removed\n"))
        self.assertFalse(folder.exists())

    def test_plan_writes_nothing_and_agrees_with_convert(self):
        before = sorted(demo.rglob("*"))
        planned = json.loads(run("plan", demo / "manifest.json", "--json")[0])
        self.assertEqual(sorted(demo.rglob("*")), before)
        self.assertEqual(planned["pairs"], len(list(rows(converted))))
        self.assertEqual(planned["shards"], len(shard_bytes(converted)))

    def test_threads_do_not_change_bytes(self):
        run("convert", demo / "manifest.json", "--output", self.folder / "one", "--threads", "1", "--progress", "none")
        self.assertEqual(shard_bytes(self.folder / "one"), shard_bytes(converted))

    def test_json_progress_is_json(self):
        out, err = run("convert", demo / "manifest.json", "--limit", "3", "--output", self.folder / "out", "--progress",
                       "json")
        self.assertEqual(json.loads(out)["event"], "report")
        for line in err.splitlines():
            self.assertIn(json.loads(line)["event"], ["progress", "warning", "note"])

    def test_kitti_labels_are_the_file_and_lie_in_the_volume(self):
        seen = 0
        for path, slot, sample in rows(converted):
            with h5py.File(path) as shard:
                if shard.attrs["dataset"] != "kitti_object":
                    continue
                seen += 1
                label = demo / "kitti" / "training" / "label_2" / f"{sample.split('@')[0]}.txt"
                self.assertEqual(bytes(shard["labels/original"][slot]), label.read_bytes())
                first, last = shard["labels/boxes/offsets"][slot:slot + 2]
                annotated = [line.split() for line in label.read_text().splitlines()]
                self.assertEqual(last - first, len(annotated))
                matrix = shard["pairs/source_to_volume"][slot]
                for row, columns in zip(range(first, last), annotated):
                    source = np.array(columns[4:8], float)
                    np.testing.assert_array_equal(shard["labels/boxes/xyxy_source"][row], source)
                    # Back from the volume: an edge lies half a pixel before the point of the same number.
                    unclipped = shard["labels/boxes/xyxy_unclipped"][row].reshape(2, 2) - 0.5
                    back = (unclipped - matrix[:, 2]) / np.diag(matrix[:, :2]) + 0.5
                    np.testing.assert_allclose(back.ravel(), source, atol=0.01)
                    ignore = columns[0] == "DontCare"
                    self.assertEqual(bool(shard["labels/boxes/ignore"][row]), ignore)
        self.assertGreater(seen, 0)

    def test_damaged_inputs_are_quarantined_each_with_its_file(self):
        broken = self.folder / "demo"
        shutil.copytree(demo, broken)
        training = broken / "kitti" / "training"
        ids = sorted(path.stem for path in (training / "label_2").glob("*.txt"))
        corrupt, empty, gone, malformed, outside = ids[:5]
        for step in "123":  # whichever gap was drawn
            previous = training / "prev_2" / f"{corrupt}_0{step}.png"
            bytes_ = bytearray(previous.read_bytes())
            bytes_[len(bytes_) // 2] ^= 0xff
            previous.write_bytes(bytes_)
        (training / "image_2" / f"{empty}.png").write_bytes(b"")
        (training / "image_2" / f"{gone}.png").unlink()
        with open(training / "label_2" / f"{malformed}.txt", "a") as file:
            file.write("Car 0.00 0 1.5 10.0\n")
        (training / "label_2" / f"{outside}.txt").write_text(
            "Car 0.00 0 0.00 5000.00 10.00 5100.00 20.00 1.5 1.6 3.9 1.0 1.5 10.0 0.0\n")
        person = sorted((broken / "mpii" / "sequences").iterdir())[0]
        for frame in person.iterdir():
            frame.write_bytes(frame.read_bytes()[:-400])  # truncated JPEG
        reasons = {corrupt: "prev_2", empty: f"image_2/{empty}.png", gone: f"image_2/{gone}.png",
                   malformed: f"label_2/{malformed}.txt", outside: f"label_2/{outside}.txt", person.name: person.name}

        def convert(name, max_fraction, source, expect=0):
            """By a model that is quicker than the network."""
            job = read_commented(demo / "manifest.json")
            job.update(generator={"kind": "difference"})
            job["errors"]["max_fraction"] = max_fraction
            (source / "damage.json").write_text(json.dumps(job))
            return run("convert", source / "damage.json", "--output", self.folder / name, "--progress", "none",
                       expect=expect)

        self.assertIn("quarantined", convert("out", 0.01, broken, expect=65)[1])
        out, _ = convert("whole", 0.5, broken)  # within the limits the run is complete
        self.assertIn(f"{len(reasons)} quarantined", out)
        self.assertIn("sound", run("verify", self.folder / "whole")[0])

        quarantined = {}
        for record in (self.folder / "whole").glob("demo-*.json"):
            for entry in json.loads(record.read_text())["quarantined"]:
                quarantined[entry["sample_id"]] = entry["reason"]
                with h5py.File(record.with_suffix(".h5")) as shard:
                    self.assertEqual(shard["valid"][entry["slot"]], 0)
                    self.assertEqual(text(shard["pairs/sample_id"][entry["slot"]]), entry["sample_id"])
                    self.assertFalse(shard["events/volume"][entry["slot"]].any())
        self.assertEqual(set(quarantined), set(reasons))
        for sample, where in reasons.items():
            self.assertIn(where, quarantined[sample])
        # Every other sample holds what it holds without the damage.
        convert("sound", 0.5, demo)
        (demo / "damage.json").unlink()
        sound = {(path.name, slot): sample for path, slot, sample in rows(self.folder / "sound")}
        damaged = {(path.name, slot): sample for path, slot, sample in rows(self.folder / "whole")}
        self.assertEqual(sound, damaged)
        for (name, slot), sample in sound.items():
            if sample in quarantined:
                continue
            with h5py.File(self.folder / "sound" / name) as a, h5py.File(self.folder / "whole" / name) as b:
                np.testing.assert_array_equal(a["events/volume"][slot], b["events/volume"][slot])


if __name__ == "__main__":
    program.main()

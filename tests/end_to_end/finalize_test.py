"""Completing a dataset: dataset.json and dataset.h5, read with stock h5py and with the project's own reader."""

import hashlib
import json
import pathlib
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import textwrap
import unittest

import h5py
import numpy as np

import program
from folders import content, same_folder
from folders import shards as shards_in
from program import run
from small_job import small_job

sys.path.insert(0, str(program.PACKAGE))
import eventgan

SHARDS = 8  # 3 of cars, 3 of the same cars as "val", 2 of people
CARS, PEOPLE = "kitti_object-24x32", "mpii_list-24x32"


def setUpModule():
    global folder, manifest, done
    folder = pathlib.Path(tempfile.mkdtemp(prefix="eventgan-finalize-"))
    manifest = with_validation(small_job(folder / "job"))
    done = folder / "done"
    convert(done, "--no-finalize")
    run("finalize", done)


def tearDownModule():
    shutil.rmtree(folder)


def with_validation(path):
    """The job with its cars a second time, as split "val", between the two others."""
    job = json.loads(path.read_text())
    job["sources"].insert(1, {**job["sources"][0], "split": "val"})
    path.write_text(json.dumps(job))
    return path


def convert(out, *arguments, job=None, expect=0):
    return run("convert", job or manifest, "--output", out, "--threads", "1", "--progress", "none", *arguments,
               expect=expect)


def columns(group):
    found = {}
    group.visititems(lambda name, item: found.update({name: item}) if isinstance(item, h5py.Dataset) else None)
    return {name: item for name, item in found.items() if name.split("/")[0] not in ("shards", "splits")}


class Finalize(unittest.TestCase):
    def setUp(self):
        self.out = pathlib.Path(tempfile.mkdtemp(dir=folder)) / "out"

    def copy(self):
        shutil.copytree(done, self.out)
        return self.out

    def description(self, out=None):
        return json.loads(((out or done) / "dataset.json").read_text())

    def test_convert_completes_the_dataset(self):
        told, _ = convert(self.out)
        self.assertIn(f"{self.out}: dataset.json, dataset.h5", told.splitlines())
        same_folder(self.out, done)
        self.assertEqual(content(self.out)["dataset.h5"], content(done)["dataset.h5"])
        for part in ["--shards", "0/1"], ["--shards", "0/2"], ["--no-finalize"]:
            (self.out / "dataset.json").unlink(missing_ok=True)
            told, _ = convert(self.out, *part)
            self.assertEqual((self.out / "dataset.json").exists(), part == ["--shards", "0/1"], part)
        report = json.loads(run("convert", manifest, "--output", self.out, "--progress", "json")[0].splitlines()[-1])
        self.assertTrue(report["finalized"])
        same_folder(self.out, done)

    def test_the_description_fits_the_files(self):
        description = self.description()
        self.assertTrue(description["complete"])
        self.assertEqual([shard["name"] for shard in description["shards"]],
                         [f"small-train-{i:05d}-of-00005.h5" for i in range(3)]
                         + [f"small-val-{i:05d}-of-00003.h5" for i in range(3)]
                         + [f"small-train-{i:05d}-of-00005.h5" for i in (3, 4)])
        for entry in [*description["shards"], description["view"]]:
            data = (done / entry["name"]).read_bytes()
            self.assertEqual(len(data), entry["size_bytes"])
            self.assertEqual(hashlib.sha256(data).hexdigest(), entry["sha256"])
        self.assertEqual(description["plan_hash"], hashlib.sha256((done / "plan.json").read_bytes()).hexdigest())
        self.assertEqual(description["settings"], json.loads(manifest.read_text()))
        counts = description["counts"]
        # Image k has k % 3 cars: 0 + 1 + 2 + 0 + 1 of the five, in two splits.
        self.assertEqual(counts["total"]["boxes_by_class"], {"Car": 8})
        self.assertEqual(counts["by_split"]["val"]["samples"], 5)
        self.assertEqual(counts["by_dataset"]["mpii_list"]["persons"], 4)
        self.assertEqual(len(description["sources"][2]["joint_names"]), 16)

    def test_the_view_is_its_shards_one_after_the_other(self):
        with h5py.File(done / "dataset.h5") as file:
            self.assertEqual(list(file.attrs["views"]), [CARS, PEOPLE])
            for view in (file[CARS], file[PEOPLE]):
                names = list(view["shards/name"].asstr())
                shards = [h5py.File(done / name) for name in names]
                for name, column in columns(view).items():
                    parts = [shard[name][:] for shard in shards]
                    if name.endswith("offsets"):
                        rows = np.concatenate([np.diff(part) for part in parts])
                        np.testing.assert_array_equal(np.diff(column), rows, name)
                    elif column.dtype.kind == "O":
                        self.assertEqual([bytes(v) for v in column], [bytes(v) for part in parts for v in part])
                    else:
                        np.testing.assert_array_equal(column, np.concatenate(parts), name)
                for shard in shards:
                    shard.close()

    def test_a_split_is_one_range_of_rows(self):
        with h5py.File(done / "dataset.h5") as file:
            view = file[CARS]
            self.assertEqual(list(view["splits/name"].asstr()), ["train", "val"])
            np.testing.assert_array_equal(view["splits/first"], [0, 5])
            first, last = view["labels/boxes/offsets"][7:9]  # the third of "val", with two cars
            self.assertEqual(view["labels/boxes/xyxy_source"][first:last, 0].tolist(), [2, 3])

    def test_again_it_changes_nothing(self):
        before = content(done)
        run("finalize", done)
        self.assertEqual(content(done), before)

    def test_two_workers_give_the_same_files(self):
        for part in ("1/2", "0/2"):
            convert(self.out, "--shards", part)
        run("finalize", self.out)
        same_folder(self.out, done)

    def test_any_time_beside_a_worker(self):
        worker = subprocess.Popen([program.PROGRAM, "convert", manifest, "--output", self.out, "--threads", "1"],
                                  stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        codes = set()
        while worker.poll() is None:
            looked = subprocess.run([program.PROGRAM, "finalize", self.out, "--partial"], capture_output=True)
            codes.add(looked.returncode)
        self.assertEqual(worker.returncode, 0)
        self.assertLessEqual(codes, {0, 1, 66})  # some shards, none yet, no plan yet
        run("finalize", self.out)
        same_folder(self.out, done)

    def test_what_is_missing_is_listed_and_nothing_written(self):
        convert(self.out, "--shards", "0/4")  # shards 0 and 4 of the plan
        before = content(self.out)
        said, _ = run("finalize", self.out, expect=1)
        for entry in self.description()["shards"]:
            is_there = (self.out / entry["name"]).exists()
            self.assertEqual(f"{entry['name']}: missing" in said, not is_there)
        self.assertEqual(content(self.out), before)

    def test_a_part_if_asked(self):
        convert(self.out, "--shards", "0/4")
        said, _ = run("finalize", self.out, "--partial", "--json")
        self.assertEqual(len(json.loads(said)["missing"]), SHARDS - 2)
        self.assertFalse(self.description(self.out)["complete"])
        self.assertEqual(len(self.description(self.out)["missing"]), SHARDS - 2)
        self.assertEqual(len(eventgan.Shards(self.out, partial=True)), 4)
        convert(self.out)
        run("finalize", self.out)
        same_folder(self.out, done)

    def test_a_damaged_commit_record_and_a_short_shard_are_missing(self):
        out = self.copy()
        first, second = shards_in(out)[:2]
        (out / first).with_suffix(".json").write_text("{")
        (out / second).write_bytes((out / second).read_bytes()[:-1])
        said, _ = run("finalize", out, expect=1)
        self.assertIn(str((out / first).with_suffix(".json")), said)
        self.assertRegex(said, f"{second}: expected size in bytes")

    def test_no_plan_is_a_missing_input(self):
        self.out.mkdir()
        run("finalize", self.out, expect=66)

    def test_too_many_in_quarantine(self):
        job = small_job(self.out.parent / "job", people=0)
        broken = job.parent / "cars/image_2/000001.png"
        broken.write_bytes(broken.read_bytes()[:200])
        convert(self.out, job=job, expect=65)
        run("finalize", self.out, expect=65)
        lenient = job.with_name("lenient.json")
        lenient.write_text(json.dumps({**json.loads(job.read_text()), "errors":
                                       {"policy": "quarantine", "max_count": 1, "max_fraction": 1}}))
        convert(self.out, job=lenient)
        _, error = run("finalize", self.out, expect=65)  # by the limits of the manifest in the plan
        self.assertIn("--manifest", error)
        run("finalize", self.out, "--manifest", lenient)
        quarantined = self.description(self.out)["quarantined"]
        self.assertEqual([sample["sample_id"] for sample in quarantined], ["000001"])
        samples = eventgan.Shards(self.out)
        self.assertNotIn("000001", [sample["pair"]["sample_id"] for sample in samples])
        self.assertEqual(len(samples), 4)


class Reading(unittest.TestCase):
    """What manifests/guides/shard_format.md says about reading a finalized folder."""

    def setUp(self):
        self.out = pathlib.Path(tempfile.mkdtemp(dir=folder)) / "out"
        shutil.copytree(done, self.out)

    def in_python(self, code, files=None):
        """Runs code in another process with a limit of open files; what it prints."""
        limit = (files, files)
        prepare = files and (lambda: resource.setrlimit(resource.RLIMIT_NOFILE, limit))
        return subprocess.run([sys.executable, "-c", textwrap.dedent(code)], cwd=self.out, check=True, text=True,
                              capture_output=True, preexec_fn=prepare).stdout

    def test_the_lines_of_python_on_the_page_run(self):
        page = (program.SOURCE / "manifests" / "guides" / "shard_format.md").read_text(encoding="utf-8")
        code = "\n".join(line[4:] for line in re.findall(r"(?m)^    .*$", page.split("### dataset.h5")[1]))
        names = {}
        exec(code.replace("out/dataset.h5", str(self.out / "dataset.h5")), names)
        self.assertEqual(names["i"], 4)  # the last of "train", with one car
        self.assertEqual(names["volume"].shape, (18, 24, 32))
        self.assertEqual(names["found"].shape, (1, 4))

    def test_too_few_open_files_read_as_nan_until_the_dataset_is_closed(self):
        code = """
            import h5py, numpy as np, os
            with h5py.File("dataset.h5") as file:
                view = file["kitti_object-24x32"]
                taken = [os.open("/dev/null", os.O_RDONLY) for _ in range({})]
                volumes = view["events/volume"]
                gone = [bool(np.isnan(volumes[i]).any()) for i in range(10)]
                del volumes
                again = [bool(np.isnan(view["events/volume"][i]).any()) for i in range(10)]
                print(any(gone), any(again))
        """
        self.assertEqual(self.in_python(code.format(0)).split(), ["False", "False"])
        # Of 64 descriptors 4 are left for 6 shards (0 to 2 and the view's own are taken too).
        self.assertEqual(self.in_python(code.format(56), files=64).split(), ["True", "False"])

    def test_the_reader_takes_the_plan_s_order_and_splits(self):
        samples = eventgan.Shards(self.out)
        listed = [shard["name"] for shard in json.loads((self.out / "dataset.json").read_text())["shards"]]
        self.assertEqual([path.name for path in samples.paths], listed)
        self.assertEqual(len(samples), 14)
        val = eventgan.Shards(self.out, split="val")
        self.assertEqual([sample["pair"]["sample_id"] for sample in val], [f"{k:06d}" for k in range(5)])
        with self.assertRaisesRegex(ValueError, "split of train, val, got 'test'"):
            eventgan.Shards(self.out, split="test")

    def test_the_reader_opens_few_files_and_none_before_it_reads(self):
        said = self.in_python(f"""
            import sys, os
            sys.path.insert(0, {str(program.PACKAGE)!r})
            import eventgan
            samples = eventgan.Shards(".", split="train", open_files=2)
            print(len(samples._files._open))
            print(sum(bool(sample["volume"].any()) for sample in samples), len(samples._files._open))
        """, files=32)
        self.assertEqual(said.split(), ["0", "9", "2"])

    def test_splits_without_a_description(self):
        (self.out / "dataset.json").unlink()
        self.assertEqual(len(eventgan.Shards(self.out, split="val")), 5)
        self.assertEqual(len(eventgan.Shards(self.out)), 14)

    def test_the_view_stands_for_its_folder(self):
        self.assertEqual(len(eventgan.Shards(self.out / "dataset.h5")), 14)

    def test_the_reader_refuses_shards_that_were_not_described(self):
        name = shards_in(self.out)[0]
        record = (self.out / name).with_suffix(".json")
        for change in (lambda: record.write_text(record.read_text().replace('"sha256": "', '"sha256": "0')),
                       lambda: (self.out / name).write_bytes(b"short"),
                       lambda: (self.out / name).unlink()):
            change()
            with self.assertRaisesRegex(ValueError, name):
                eventgan.Shards(self.out)

    def test_the_reader_needs_no_commit_records_once_there_is_a_description(self):
        for name in shards_in(self.out):
            (self.out / name).with_suffix(".json").unlink()
        self.assertEqual(len(eventgan.Shards(self.out)), 14)

    def test_other_descriptions_are_refused(self):
        (self.out / "dataset.json").write_text('{"format": "eventgan-dataset", "version": "2.0"}')
        with self.assertRaisesRegex(ValueError, "expected eventgan-dataset 1.x, got eventgan-dataset 2.0"):
            eventgan.Shards(self.out)


if __name__ == "__main__":
    program.main()

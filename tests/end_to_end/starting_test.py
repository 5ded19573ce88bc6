"""The first minutes: a manifest for what lies in a folder, the manifests to copy, a trial of a job."""

import json
import os
import pathlib
import shutil
import sys
import tempfile
import unittest

import cv2
import h5py
import numpy as np

import program
from camera_files import random_events, write_dhp19, write_mvsec
from moving_texture import texture, write_images, write_video
from program import SHARED, SOURCE, read_commented, run, shard_bytes, text
from small_job import save_image, small_job, write_cars, write_people

sys.path.insert(0, str(SOURCE / "tests" / "fuzz"))
from make_corpus import Cdf

EXAMPLES = SOURCE / "manifests" / "examples"


STILLS = {"from": "stills", "motion": {"translation_px": [2, 8], "rotation_deg": 2, "scale": 0.03, "frames": 1}}


class Init(program.InFolder):
    def init(self, *where, expect=0, **options):
        out = self.folder / "job" / "manifest.json"
        shutil.rmtree(out.parent, ignore_errors=True)
        out.parent.mkdir()
        told, errors = run("init", *where, "--out", out, expect=expect, **options)
        if expect:
            self.assertEqual(errors.count("\n"), 1, errors)
            self.assertFalse(out.exists())
            return errors
        self.assertIn(f"eventgan plan {out}", told)
        return told, out

    def trial(self, manifest, pairs, limit=2):
        """Converts a few pairs by the manifest."""
        run("convert", manifest, "--limit", limit, "--progress", "none")
        trial, = (manifest.parent / "out").iterdir()
        run("verify", trial)
        counted = 0
        for shard in trial.glob("*-of-*.h5"):
            with h5py.File(shard) as opened:
                counted += int(opened["valid"][:].sum())
        self.assertEqual(counted, min(limit, pairs))

    def test_kitti_object(self):
        write_cars(self.folder / "kitti" / "training", 5, np.random.default_rng(7))
        for path in ["kitti", "kitti/training", "kitti/training/"]:
            with self.subTest(path):
                told, manifest = self.init("kitti_object", self.folder / path)
                self.assertIn("KITTI object: 5 labelled frames, 5 annotation files\n", told)
                self.assertIn("by gap: gap 1: 5, gap 2: 5, gap 3: 5, gap 4: 0, gap 5: 0, gap 6: 0\n", told)
                self.assertIn("no devkit", told)
                self.assertIn("no calib", told)
                self.assertNotIn("prev_2", told)
                for line in told.splitlines()[:3]:
                    self.assertIn(f"// {line}\n", manifest.read_text())
                source, = read_commented(manifest)["sources"]
                self.assertEqual(source["root"], str(self.folder / "kitti" / "training"))
                self.assertEqual(source["pairs"]["gaps"], [1, 2])
        self.trial(manifest, 5)

    def test_gaps_without_paired_frames_are_left_out(self):
        write_cars(self.folder / "training", 2, np.random.default_rng(7))
        for image in (self.folder / "training" / "prev_2").glob("*_0[23].png"):
            image.unlink()
        _, manifest = self.init(self.folder)
        self.assertEqual(read_commented(manifest)["sources"][0]["pairs"]["gaps"], [1])

    def test_kitti_tracking(self):
        random = np.random.default_rng(7)
        for k in range(4):
            save_image(self.folder / "t" / "image_02" / "0000" / f"{k:06d}.png", random)
        (self.folder / "t" / "label_02").mkdir()
        (self.folder / "t" / "label_02" / "0000.txt").write_text("")
        told, manifest = self.init("kitti_tracking", self.folder / "t")
        self.assertIn("KITTI tracking: 4 labelled frames of 1 sequence", told)
        self.assertIn("gap 1: 3, gap 2: 2, gap 3: 1, gap 4: 0", told)
        self.trial(manifest, 3)

    def test_people_lists(self):
        root = self.folder / "people"
        write_people(root, 3, np.random.default_rng(7))
        told, manifest = self.init(root)
        self.assertIn("MPII as a list of people: 3 labelled frames", told)
        source, = read_commented(manifest)["sources"]
        self.assertEqual(source["annotations"], str(root / "people.json"))
        self.assertEqual(source["sequences"], str(root / "sequences"))
        self.trial(manifest, 3)
        shutil.copy(root / "people.json", root / "train.json")
        (root / "other.json").write_text('{"format": "coco"}')
        told, manifest = self.init(root)
        self.assertEqual(read_commented(manifest)["sources"][0]["annotations"], str(root / "train.json"))
        self.assertIn("another list of people, left out: people.json", told)
        self.assertNotIn("other.json", told)
        shutil.rmtree(root / "sequences")
        self.assertIn("no sequences", self.init(root)[0])

    def test_images_and_videos(self):
        for clip in ["a", "b"]:
            write_images(self.folder / "clips" / clip, range(4), 24, 32, seed=7)
        write_video(self.folder / "videos" / "one.mp4", 5)
        write_video(self.folder / "videos" / "two.mp4", 4)
        for path, frames, gap_1 in [("clips/a", 4, 3), ("clips", 8, 6), ("videos", 9, 7), ("videos/one.mp4", 5, 4)]:
            for dataset in [[], ["frames"]]:
                with self.subTest(path=path, dataset=dataset):
                    told, manifest = self.init(*dataset, self.folder / path)
                    self.assertIn(f"images or videos: {frames} frames", told)
                    self.assertIn(f"gap 1: {gap_1}, ", told)
                    self.assertEqual("frames_per_second" in told, path.startswith("clips"))
            self.trial(manifest, gap_1, limit=100)

    def test_paths_start_at_the_manifest_where_they_are_given_so(self):
        write_video(self.folder / "videos" / "one.mp4", 3)
        here = os.getcwd()
        os.chdir(self.folder)
        self.addCleanup(os.chdir, here)
        pathlib.Path("jobs").mkdir()
        run("init", "videos/one.mp4", "--out", "jobs/one.json")
        self.assertEqual(read_commented(pathlib.Path("jobs/one.json"))["sources"][0]["root"], "../videos/one.mp4")
        run("plan", "jobs/one.json")
        os.chdir("videos")
        run("init", ".")
        self.assertEqual(read_commented(pathlib.Path("manifest.json"))["sources"][0]["root"], ".")
        run("plan", "manifest.json")

    def test_no_manifest_is_overwritten(self):
        write_video(self.folder / "one.mp4", 3)
        manifest = self.folder / "mine.json"
        manifest.write_text("mine")
        _, errors = run("init", self.folder / "one.mp4", "--out", manifest, expect=64)
        self.assertIn(f"expected the name of a new file, got an existing one, in {manifest}", errors)
        self.assertEqual(manifest.read_text(), "mine")
        here = os.getcwd()
        os.chdir(self.folder)
        self.addCleanup(os.chdir, here)
        run("init", "one.mp4")
        _, errors = run("init", "one.mp4", expect=64)
        self.assertEqual(errors, "error: expected no manifest yet, got an existing one, in manifest.json "
                         "(--out FILE gives another name)\n")

    def test_of_one_name_no_flag_lets_the_second_take_the_first_ones_place(self):
        write_video(self.folder / "a" / "one.mp4", 3)
        write_video(self.folder / "b" / "one.mp4", 5)
        jobs = self.folder / "jobs"
        jobs.mkdir()
        for clip in "ab":
            run("init", self.folder / clip / "one.mp4", "--out", jobs / f"{clip}.json")
        run("convert", jobs / "a.json", "--progress", "none")
        before = shard_bytes(jobs / "out" / "one-events")
        self.assertEqual(len(before), 1)
        for more in [], ["--overwrite"]:
            _, errors = run("convert", jobs / "b.json", *more, "--progress", "none", expect=64)
            self.assertIn("choose another output folder, or remove that one yourself", errors)
            self.assertIn(f"{self.folder / 'a' / 'one.mp4'}", errors)
            self.assertEqual(shard_bytes(jobs / "out" / "one-events"), before)

    def test_names_of_files_break_no_comment_and_steer_no_terminal(self):
        root = self.folder / "people"
        write_people(root, 2, np.random.default_rng(7))
        (root / "people.json").rename(root / "train.json")
        for name in ["li\nne.json", "e\x1b[2Jsc.json", os.fsdecode(b"l\xe4tin.json")]:
            shutil.copy(root / "train.json", root / name)
        told, manifest = self.init(root)
        self.assertNotIn("\x1b", told)
        for name in ["li\\nne.json", "e\\u001b[2Jsc.json"]:  # no manifest can name the third
            self.assertIn(f"another list of people, left out: {name}\n", told)
            self.assertIn(f"// another list of people, left out: {name}\n", manifest.read_text())
        run("plan", manifest)

    def test_images_that_are_no_sequence_are_told(self):
        random = np.random.default_rng(7)
        root = self.folder / "training"
        write_cars(root, 9, random)
        told, manifest = self.init(root / "image_2")
        part = ("warning: this is only a part of KITTI object, without its labels and pairs: run eventgan init "
                f"\"{root}\"\n")
        self.assertIn(part, told)
        self.assertIn(f"// {part}", manifest.read_text())
        self.assertRegex(told, r"(?m)^8 of 8 compared pairs of neighbouring images do not show the same scene, "
                         r"first \S*image_2/000000.png and \S*image_2/000001.png$")
        self.assertIn("no sequences: each image makes a pair with itself", told)
        self.assertNotIn("several sizes", told)
        self.assertEqual(read_commented(manifest)["sources"][0]["pairs"], STILLS)
        self.assertEqual(read_commented(manifest)["image"], {})
        cv2.imwrite(str(root / "image_2" / "000004.png"), np.zeros((20, 30), np.uint8))
        told, manifest = self.init(root / "image_2")
        self.assertIn("\nimages of several sizes in one folder, 32x24 in ", told)
        self.assertEqual(read_commented(manifest)["image"], {"width": 346, "height": 260, "fit": "letterbox"})

        wide = texture(48, 80, 7)
        for folder in "ab":  # of two sizes, but each of one
            (self.folder / "clips" / folder).mkdir(parents=True)
            for k in range(5):
                cv2.imwrite(str(self.folder / "clips" / folder / f"{k}.png"),
                            wide[:, 3 * k:3 * k + 64 - 8 * (folder == "a")])
        for path in ["clips", "clips/a"]:
            told, manifest = self.init(self.folder / path)
            self.assertNotIn("warning", told)
            self.assertEqual(read_commented(manifest)["sources"][0]["pairs"],
                             {"gaps": [1], "side": "before", "choose": "one"})

    @unittest.skipUnless(SHARED.is_dir(), "no ../shared/data")
    def test_real_sequences_and_stills_are_told_apart(self):
        frames = SHARED / "labelled_frames"
        sequences = [SHARED / "kitti_raw/2011_09_26/2011_09_26_drive_0052_sync/image_02/data",
                     SHARED / "mpii/sequences", SHARED / "human36m_fetch/S1/Directions-1/imageSequence",
                     SHARED / "davis/slider_depth/images", frames / "camvid/images", frames / "davis_tennis/images",
                     frames / "davis_carshadow/images", frames / "cdnet_traffic/images", frames / "mot17_mini/images",
                     frames / "sot_car/images", frames / "sot_person/images"]
        stills = [SHARED / "kitti_object/training/image_2", SHARED / "mpii_lists/images", frames / "coco256/images",
                  frames / "pennfudan/images", frames / "voc100/images", frames / "kitti_mini/images"]
        for path in sequences + stills:
            with self.subTest(path):
                told, manifest = self.init("frames", path)
                self.assertEqual("from" in read_commented(manifest)["sources"][0]["pairs"], path in stills)
                self.assertEqual("do not show the same scene" in told, path in stills, told)
                self.assertEqual("several sizes" in told, path in stills, told)

    def test_what_is_no_dataset_is_said_in_one_line(self):
        empty = self.folder / "empty"
        empty.mkdir()
        (self.folder / "notes.txt").write_text("notes")
        for path in [empty, self.folder / "notes.txt", pathlib.Path("/proc/self/fd")]:
            self.assertIn("expected KITTI object, KITTI tracking, KITTI raw, MPII Human Pose, Human3.6M, MPII "
                          "as a list of people, recording of an event camera, images or videos, got none of these, "
                          f"in {path}", self.init(path, expect=66))
        self.assertIn("expected a folder or a video", self.init(self.folder / "absent", expect=66))
        stream = self.folder / "a.es"
        stream.write_bytes(b"Event Stream")
        self.assertIn("got an Event Stream (.es), in ", self.init(stream, expect=66))
        self.assertIn("got an Event Stream (.es), in ",
                      run("convert", stream, "--sensor", "346x260", "--output", self.folder / "o", expect=64)[1])
        ticks = self.folder / "ticks.npy"  # the sensor's size is asked for last
        np.save(ticks, np.stack([np.arange(6000) // 6, np.arange(6000) * 7 % 64, np.arange(6000) * 5 % 48,
                                 np.arange(6000) % 2], 1))
        self.assertIn("since the times may be us (0.000999 s, 6000 events, 6.01 million a second) or ms (0.999 s, ",
                      self.init(ticks, expect=66))
        self.assertIn("PATH: expected a value, got nothing", self.init("", expect=64))
        write_cars(self.folder / "k", 1, np.random.default_rng(7))
        self.assertIn("PATH: expected a value, got nothing", self.init(self.folder / "k", "", expect=64))
        self.assertIn("DATASET or PATH: expected a dataset (kitti_object, ", self.init("kitti", empty, expect=64))
        self.assertIn("manifests/examples has a manifest", self.init("dhp19", empty, expect=64))
        self.assertIn("expected MPII Human Pose (mpii), got KITTI object (kitti_object), in ",
                      self.init("mpii", self.folder / "k", expect=66))
        shutil.rmtree(self.folder / "k" / "image_2")
        self.assertIn("expected a folder, got nothing that can be read, in ", self.init(self.folder / "k", expect=66))
        (self.folder / "v").mkdir()
        (self.folder / "v" / "broken.mp4").write_text("no video")
        self.assertIn("expected a video, got a file that cannot be read as one, in ",
                      self.init(self.folder / "v", expect=66))

    def test_several_make_one_manifest(self):
        """Each with its own keys, gaps and findings; one size and one preset for all."""
        random = np.random.default_rng(7)
        write_cars(self.folder / "all" / "cars", 3, random)
        write_people(self.folder / "all" / "people", 2, random)
        write_video(self.folder / "all" / "one.mp4", 4)
        write_video(self.folder / "other" / "one.mp4", 5)
        given = [self.folder / path for path in ["all/cars", "all/people", "all/one.mp4", "other/one.mp4"]]
        told, manifest = self.init(*given)
        written = read_commented(manifest)
        self.assertEqual([(source["dataset"], source["root"], source["pairs"]["gaps"], source["pairs"]["side"])
                          for source in written["sources"]],
                         [("kitti_object", str(given[0]), [1, 2], "before"),
                          ("mpii_list", str(given[1]), [2, 4], "around"),
                          ("frames", str(given[2]), [1], "before"), ("frames", str(given[3]), [1], "before")])
        self.assertEqual(written["image"], {"width": 346, "height": 260, "fit": "letterbox", "preset": "kitti"})
        self.assertEqual((written["name"], written["output"]["directory"]), ("cars-events", "out/cars-events"))
        for path, finding in zip(given,
                                 ["KITTI object: 3 labelled frames", "MPII as a list of people: 2 labelled frames",
                                  "images or videos: 4 frames", "images or videos: 5 frames"]):
            self.assertIn(f"{path}\n{finding}", told)
            self.assertIn(f"    // {path}\n    // {finding}", manifest.read_text())
        self.trial(manifest, 3 + 2 + 3 + 4, limit=100)

        _, manifest = self.init(*given[:3])  # in one folder: named after that
        self.assertEqual(read_commented(manifest)["name"], "all-events")
        _, manifest = self.init("frames", *given[2:])  # of one kind: as of one
        self.assertEqual((read_commented(manifest)["image"], len(read_commented(manifest)["sources"])), ({}, 2))
        self.assertIn("expected KITTI object (kitti_object), got MPII as a list of people (mpii_list), in ",
                      self.init("kitti_object", *given[:3], expect=66))
        for same in given[0] / "label_2" / "..", given[0]:
            self.assertIn(f"expected each folder or video once, got it twice: {given[0]}",
                          self.init(given[0], given[2], same, expect=64))

    def test_several_paths_start_at_the_manifest_where_all_are_given_so(self):
        write_video(self.folder / "a" / "one.mp4", 3)
        write_video(self.folder / "b" / "two.mp4", 3)
        here = os.getcwd()
        os.chdir(self.folder)
        self.addCleanup(os.chdir, here)
        for given, roots in [(["a", "b/two.mp4"], ["a", "b/two.mp4"]),
                             (["a", self.folder / "b"], [f"{self.folder}/a", f"{self.folder}/b"])]:
            run("init", *given)
            self.assertEqual([source["root"] for source in read_commented(pathlib.Path("manifest.json"))["sources"]],
                             roots)
            run("plan", "manifest.json")
            pathlib.Path("manifest.json").unlink()
        pathlib.Path("b").rename("frames")  # a folder named as a dataset
        run("init", "a", "frames", "--out", "1.json")
        run("init", "frames", "frames", "--out", "2.json")
        run("init", "./frames", "a", "--out", "3.json")
        self.assertEqual([[source["root"] for source in read_commented(pathlib.Path(f"{k}.json"))["sources"]]
                          for k in (1, 2, 3)],
                         [["a", "frames"], ["frames"], ["frames", "a"]])

    @unittest.skipUnless(SHARED.is_dir(), "no ../shared/data")
    def test_real_datasets(self):
        # By folder: dataset, labelled frames, those with a paired frame at the first gap that its side has.
        expected = {"kitti_object": ("kitti_object", 4, 1), "kitti_raw": ("kitti_raw", 21, 20), "mpii": ("mpii", 2, 1),
                    "human36m_fetch": ("human36m", 18, 16), "davis/slider_depth/images": ("frames", 3, 2),
                    "clips/01_dog.mp4": ("frames", 289, 288)}
        for path, (dataset, frames, partners) in expected.items():
            with self.subTest(path):
                told, manifest = self.init(SHARED / path)
                self.assertEqual(read_commented(manifest)["sources"][0]["dataset"], dataset)
                word = "frames" if dataset == "frames" else "labelled frames"
                self.assertIn(f": {frames} {word}", told)
                self.assertRegex(told, rf"by gap: gap \d: {partners},")
                self.trial(manifest, partners)
        self.assertIn("gap 1: 1, gap 2: 1, gap 3: 1, gap 4: 1, gap 5: 1, gap 6: 1",
                      self.init(SHARED / "kitti_object")[0])
        self.assertIn("expected one dataset, got ", self.init(SHARED, expect=66))


class Trial(program.InFolder):
    def setUp(self):
        super().setUp()
        self.manifest = small_job(self.folder)

    def convert(self, *more, expect=0):
        return run("convert", self.manifest, "--progress", "none", *more, expect=expect)

    def ids(self, name):
        ids = []
        for path in sorted((self.folder / name).glob("*-of-*.h5")):
            with h5py.File(path) as shard:
                ids += map(text, shard["pairs/sample_id"][:])
        return ids

    def test_lies_in_a_folder_of_its_own(self):
        out, _ = self.convert("--limit", 4)
        self.assertEqual([path.name for path in self.folder.glob("out*")], ["out-trial-4"])
        self.assertIn("4 of 4 pairs written", out)
        self.assertTrue(
            out.endswith(f"trial run: 4 pairs of the job. For all pairs:  eventgan convert {self.manifest}\n"), out)
        self.assertEqual(self.ids("out-trial-4"), ["000000", "000001", "000000000", "000000001"])  # two of each source
        trial = shard_bytes(self.folder / "out-trial-4")
        self.assertIn("in 2 of 2 shards (2 done before)", self.convert("--limit", 4)[0])
        self.assertEqual(shard_bytes(self.folder / "out-trial-4"), trial)
        self.assertNotIn("trial run", self.convert()[0])
        self.assertEqual(len(self.ids("out")), 9)
        self.assertEqual(shard_bytes(self.folder / "out-trial-4"), trial)
        for command in ["status", "verify", "finalize", "retry"]:
            run(command, self.folder / "out-trial-4")

    def test_is_no_beginning_of_the_whole(self):
        mine = self.folder / "mine"
        out, _ = self.convert("--limit", 4, "--output", mine)
        self.assertTrue(out.endswith("trial run: 4 pairs of the job. For all pairs, into another folder:  "
                                     f"eventgan convert {self.manifest} --output DIR\n"), out)
        self.assertEqual(len(self.ids("mine")), 4)
        _, errors = self.convert("--output", mine, expect=64)
        self.assertIn(f"expected no trial of this job, got one made with --limit 4, in {self.folder}/mine (choose",
                      errors)
        self.convert("--output", mine, "--overwrite")
        self.assertEqual(len(self.ids("mine")), 9)
        self.convert()
        self.assertIn("limit: expected nothing, got 4",
                      self.convert("--limit", 4, "--output", self.folder / "out", expect=64)[1])

    def test_a_mended_sample_of_a_trial_is_retried(self):
        manifest = json.loads(self.manifest.read_text())
        manifest["errors"] = {"max_count": 9, "max_fraction": 1}
        self.manifest.write_text(json.dumps(manifest))
        image = self.folder / "cars" / "image_2" / "000001.png"
        whole = image.read_bytes()
        image.write_bytes(whole[:-20])
        self.assertIn("1 quarantined", self.convert("--limit", 4)[0])
        image.write_bytes(whole)
        out, _ = run("retry", self.folder / "out-trial-4")
        self.assertIn("1 of 1 quarantined sample fixed", out)
        self.assertIn("4 of 4 pairs written, 0 quarantined", self.convert("--limit", 4)[0])

    def test_a_limit_beyond_the_job_is_the_job(self):
        self.convert("--limit", 1000)
        self.convert()
        self.assertEqual(self.ids("out-trial-1000"), self.ids("out"))

    def test_no_pairs_are_no_trial(self):
        for limit in ["0", "-1", "many"]:
            self.assertIn("--limit", self.convert("--limit", limit, expect=64)[1])


class Examples(program.InFolder):
    """manifests/examples, copied beside the files that they say they need, and nothing else."""

    @classmethod
    def setUpClass(cls):
        cls.tree = pathlib.Path(tempfile.mkdtemp(prefix="eventgan-examples-"))
        cls.addClassCleanup(shutil.rmtree, cls.tree)
        run("make-demo", cls.tree / "demo")
        for name in ["kitti", "mpii", "h36m"]:
            (cls.tree / "demo" / name).rename(cls.tree / name)
        cls.write_human36m(frames=60)
        write_video(cls.tree / "clip.mp4", 91)
        random = np.random.default_rng(7)
        for k in range(202):
            save_image(cls.tree / "drive" / "image_02" / "data" / f"{k:010d}.png", random)
        save_image(cls.tree / "photos" / "one.png", random)
        cls.write_raw()
        write_mvsec(cls.tree / "drive.hdf5", random_events(2000, 0, 1, 7), [0, 0.25, 0.5, 0.75])
        (cls.tree / "drive.csv").write_text("time_s,left,top,right,bottom,class,category\n"
                                            + "".join(f"{0.25 * k},1,2,20,20,car,easy\n" for k in (1, 2, 3)))
        write_dhp19(cls.tree / "dhp19")
        for example in EXAMPLES.glob("*.json"):
            shutil.copy(example, cls.tree)

    @classmethod
    def write_human36m(cls, frames):
        write_video(cls.tree / "h36m" / "S1" / "Videos" / "Walking.54138969.mp4", frames, frames_per_second=50)
        poses = cls.tree / "h36m" / "S1" / "MyPoseFeatures" / "D2_Positions" / "Walking.54138969.cdf"
        poses.parent.mkdir(parents=True)
        joints = np.random.default_rng(8).uniform(5, 40, (frames, 64)).astype("<f4")
        poses.write_bytes(Cdf().file(frames, 64, numbers=joints.tobytes()))

    @classmethod
    def write_raw(cls):
        """The demo's street as a drive of KITTI raw: image n is its frame n + 3, as the images before it need."""
        training = cls.tree / "kitti" / "training"
        drive = cls.tree / "kitti" / "raw" / "2011_09_26" / "2011_09_26_drive_0001_sync" / "image_02" / "data"
        drive.mkdir(parents=True)
        numbers = sorted(int(path.stem) for path in (training / "label_2").iterdir())
        mapping = cls.tree / "kitti" / "devkit" / "mapping"
        mapping.mkdir(parents=True)
        (mapping / "train_rand.txt").write_text(",".join(str(n + 1) for n in range(max(numbers) + 1)) + "\n")
        lines = []
        for n in range(max(numbers) + 1):
            lines.append(f"2011_09_26 2011_09_26_drive_0001_sync {10 * n + 6:010d}\n")
            if n in numbers:
                shutil.copy(training / "image_2" / f"{n:06d}.png", drive / f"{10 * n + 6:010d}.png")
        (mapping / "train_mapping.txt").write_text("".join(lines))

    def test_every_job_can_be_planned(self):
        jobs = [path for path in sorted(EXAMPLES.glob("*.json"))
                if read_commented(path)["format"] == "eventgan-manifest"]
        self.assertGreaterEqual(len(jobs), 6)
        for job in jobs:
            with self.subTest(job.name):
                planned = json.loads(run("plan", self.tree / job.name, "--json")[0])
                self.assertGreater(planned["pairs"], 0)
                self.assertGreater(planned["pairs_measured"], 0)

    def test_the_simulation_finds_its_frames(self):
        recordings = set()
        for source in read_commented(EXAMPLES / "simulate.json")["sources"]:
            self.assertTrue((self.tree / source["path"]).exists(), source)
            name = source.get("name", pathlib.Path(source["path"]).stem)
            recordings.add(f"recordings/{name}-000.hdf5" if source.get("method") == "affine"
                           else f"recordings/{name}.hdf5")
        train = read_commented(EXAMPLES / "train.json")
        named = {recording["path"] for recording in train["recordings"] + train["validation"]}
        self.assertEqual(named, recordings)


if __name__ == "__main__":
    program.main()

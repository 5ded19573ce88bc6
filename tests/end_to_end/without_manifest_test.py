"""`convert` and `plan` of a folder or a video: the manifest that `init` would write,
kept in the output folder from then on."""

import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import tempfile

import cv2
import h5py
import numpy as np

import failing_files
import program
from folders import content, records, shards, temporaries
from moving_texture import texture, write_images, write_video
from program import run
from small_job import save_image, write_cars

FRAMES = 131  # pairs of neighbours: three shards of 64, 64 and 2
QUIET = ("--progress", "none")


def setUpModule():
    global clip, whole
    clip = pathlib.Path(tempfile.mkdtemp(prefix="eventgan-clip-"))
    write_images(clip / "walk", range(FRAMES), 24, 32, seed=7)
    whole = clip / "whole"
    run("convert", clip / "walk", "--output", whole, *QUIET)


def tearDownModule():
    shutil.rmtree(clip)


def save_photographs(folder, count, classes):
    """Images of two sizes, each with a box of each class."""
    folder.mkdir()
    rows = ["image,class,left,top,right,bottom"]
    for k in range(count):
        cv2.imwrite(str(folder / f"{k}.png"), texture(48 + k % 2, 64, seed=k))
        rows += [f"{k}.png,{name},8,8,24,30" for name in classes]
    (folder / "boxes.csv").write_text("\n".join(rows) + "\n")


def convert(given, out, *more, expect=0):
    return run("convert", given, "--output", out, *QUIET, *more, expect=expect)


class WithoutManifest(program.InFolder):
    def init(self, *given):
        """What `init` writes for the same."""
        out = self.folder / "of-init.json"
        told, _ = run("init", *given, "--out", out)
        text = out.read_text()
        out.unlink()
        return text, told

    def in_folder(self):
        """The test's folder as the current one."""
        here = os.getcwd()
        os.chdir(self.folder)
        self.addCleanup(os.chdir, here)

    def test_a_folder_is_converted_by_what_init_proposes(self):
        text, told = self.init(clip / "walk")
        self.assertEqual((whole / "manifest.json").read_text(), text.replace('"out/walk-events"', '"."'))
        self.assertEqual(len(shards(whole)), 3)
        _, err = convert(clip / "walk", self.folder / "out")
        findings = told[:told.index("manifest written")]
        self.assertTrue(err.startswith(findings + f"manifest: {self.folder}/out/manifest.json\n"), err)
        mine, its = content(self.folder / "out"), content(whole)
        del mine["run.json"], its["run.json"]
        self.assertEqual(mine, its)
        _, err = convert(clip / "walk", self.folder / "out")
        self.assertTrue(err.startswith(f"manifest: {self.folder}/out/manifest.json, kept as it was when the "
                                       "job began\n"), err)
        self.assertNotIn("NO LABELS", err)

    def test_the_kept_manifest_is_that_of_the_folder(self):
        """Of the same job wherever both lie: the output folder may be moved."""
        out = self.folder / "out"
        shutil.copytree(whole, out)
        told, err = run("convert", out / "manifest.json", *QUIET)
        self.assertIn("130 of 130 pairs written, 0 quarantined, in 3 of 3 shards (3 done before)", told)
        self.assertIn(f"the manifest is now in {out}", err)
        told, err = convert(clip / "walk", out)
        self.assertIn("(3 done before)", told)
        self.assertNotIn("is now in", err)
        run("status", out / "manifest.json")
        run("verify", out, "--deep")
        run("retry", out)
        run("preview", out, "--out", self.folder / "images", "--count", 1)
        run("finalize", out)

    def test_a_folder_of_one_folder_of_videos_is_that_one(self):
        for name in ("a", "b"):
            write_video(self.folder / "data" / "videos" / f"{name}.mp4", 4)
        text, _ = self.init(self.folder / "data")
        self.assertIn(f'"root": "{self.folder}/data/videos"', text)

    def test_paths_named_after_splits_are_these(self):
        for split in ("train", "valid", "test"):
            write_video(self.folder / split / f"{split}.mp4", 4)
        text, _ = self.init(*(self.folder / split for split in ("test", "train", "valid")))
        self.assertEqual(re.findall(r'"root": ".*/(\w+)",\n(?: *"split": "(\w+)")?', text),
                         [("test", "test"), ("train", ""), ("valid", "val")])
        text, _ = self.init(self.folder / "test")
        self.assertNotIn('"split"', text)

    def test_a_video_is_handed_over_and_everything_is_told_once(self):
        write_video(self.folder / "one.mp4", 4)
        for line in ["manifest: {0}/manifest.json\n", "manifest: {0}/manifest.json, kept"]:
            told, err = convert(self.folder / "one.mp4", self.folder / "out")
            self.assertEqual(err.count("manifest: "), 1, err)
            self.assertIn(line.format(self.folder / "out"), err)
            self.assertEqual((err.count("generator: "), err.count("warning: "), told.count("3 of 3 pairs written")),
                             (1, 1, 1), err)
        alone = self.folder / "eventgan"
        shutil.copy(program.PROGRAM, alone)
        done = subprocess.run([alone, "convert", self.folder / "one.mp4", "--output", self.folder / "new"],
                              capture_output=True, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertRegex(done.stderr, r"\Aerror: expected eventgan-video, got none in .*\n\Z")
        self.assertFalse((self.folder / "new").exists())

    def test_without_output_it_is_as_init_and_convert_here(self):
        self.in_folder()
        told, err = run("convert", clip / "walk", "--limit", 2, *QUIET)
        self.assertEqual(sorted(os.listdir("out")), ["walk-events", "walk-events-trial-2"])
        self.assertEqual(os.listdir("out/walk-events"), ["manifest.json"])
        self.assertIn(f"For all pairs:  eventgan convert {clip / 'walk'}\n", told)
        self.assertTrue(err.startswith("output folder: out/walk-events-trial-2 (--output DIR names another)\n"), err)
        self.assertIn("of a folder or video out/NAME-events", " ".join(run("convert", "--help")[0].split()))
        for manifest in [clip / "walk", "out/walk-events/manifest.json"]:
            self.assertIn("(1 done before)", run("convert", manifest, "--limit", 2, *QUIET)[0])
        run("convert", clip / "walk", *QUIET)
        self.assertEqual(shards("out/walk-events"), shards(whole))
        self.assertIn("3 of 3", run("status", "out/walk-events")[0])

    def test_photographs_for_a_camera_and_classes(self):
        """--camera and --classes write what init writes; others are left out and counted."""
        save_photographs(self.folder / "photos", 3, ("car", "dog", "cat"))
        wanted = ("--camera", "moves", "--classes", "dog,car")
        self.in_folder()
        run("init", "photos", *wanted)
        told, err = convert("photos", "out", *wanted)
        self.assertIn("6 boxes", told)
        self.assertIn("3 boxes of other classes left out", told)
        ours, its = (json.loads(re.sub("(?m) *// .*$", "", pathlib.Path(path).read_text()))
                     for path in ("manifest.json", "out/manifest.json"))
        self.assertEqual(ours["sources"][0]["pairs"], its["sources"][0]["pairs"])
        self.assertEqual(its["sources"][0]["pairs"]["motion"]["rests"], 0)
        self.assertEqual(its["generator"]["weights"], "shipped:16")
        with h5py.File(pathlib.Path("out", shards("out")[0])) as shard:
            self.assertEqual([*shard["labels/boxes/class_id"].attrs["class_names"]], ["dog", "car"])
        _, err = convert("photos", "out", "--camera", "both", expect=64)
        self.assertIn("--camera: expected what was given when the job began", err)
        _, err = convert("photos", "out", "--no-labels", expect=64)
        self.assertIn("--no-labels: expected what was given when the job began", err)
        _, err = convert("manifest.json", "new", *wanted, expect=64)
        self.assertIn("--camera moves --classes dog,car: expected a folder, video or recording, got a manifest", err)
        _, err = convert("photos", "new", "--classes", "dgo", expect=66)
        self.assertIn("expected classes of the source (car, cat, dog), got dgo", err)
        self.assertIn("; did you mean dog?", err)

    def test_one_of_44_photographs_may_fail(self):
        save_photographs(self.folder / "photos", 44, ("car",))
        (self.folder / "photos/43.png").write_bytes(b"broken")
        told, err = convert(self.folder / "photos", self.folder / "out")
        self.assertIn("43 of 44 pairs written, 1 quarantined, in 1 of 1 shard", told)
        (self.folder / "photos/42.png").write_bytes(b"broken")
        _, err = convert(self.folder / "photos", self.folder / "new", expect=65)
        self.assertIn("expected at most 1 quarantined pair (errors in the manifest), got 2 of 44", err)

    def test_plan_writes_nothing_unless_it_freezes(self):
        self.in_folder()
        told, err = run("plan", clip / "walk")
        self.assertIn("total: 130 pairs in 3 shards", told)
        self.assertIn("images or videos: 131 frames of 1 sequence, NO LABELS", err)
        self.assertEqual(os.listdir("."), [])
        run("plan", clip / "walk", "--freeze")
        self.assertEqual(sorted(os.listdir("out/walk-events")), ["manifest.json", "plan.json", "run.json"])
        run("plan", clip / "walk", "--freeze", "--output", self.folder / "mine")
        convert(clip / "walk", self.folder / "mine")
        self.assertEqual(shards(self.folder / "mine"), shards(whole))

    def test_stopped_and_killed_runs_are_resumed(self):
        """Also between the manifest and the plan."""
        calls = failing_files.changes(failing_files.run(self.folder / "out", "", "convert", clip / "walk", "--output",
                                                        self.folder / "out", "--threads", "1", *QUIET).calls)
        manifest, plan = (next(n for n, call in enumerate(calls, 1) if call.kind == "link" and name in call.path.name)
                          for name in ["manifest.json", "plan.json"])
        self.assertLess(manifest, plan)
        text = next(n for n, call in enumerate(calls, 1) if call.kind == "write" and "manifest.json" in call.path.name)
        shard = next(n for n, call in enumerate(calls, 1) if call.kind == "write"
                     and "00001-of-00003.h5" in call.path.name)
        for rule, code in [(f"SIGTERM any {shard}", 75), (f"kill-before any {manifest}", -signal.SIGKILL),
                           (f"kill-after any {manifest}", -signal.SIGKILL),
                           (f"kill-before any {plan}", -signal.SIGKILL),
                           (f"kill-after any {shard}", -signal.SIGKILL), (f"ENOSPC any {text}", 1)]:
            with self.subTest(rule=rule):
                out = self.folder / rule.replace(" ", "-")
                outcome = failing_files.run(out, rule, "convert", clip / "walk", "--output", out, "--threads", "1",
                                            *QUIET)
                self.assertTrue(outcome.struck)
                self.assertEqual(outcome.code, code, outcome.err)
                if rule.startswith("ENOSPC"):
                    self.assertEqual(os.listdir(out), [])
                convert(clip / "walk", out)
                mine, its = content(out), content(whole)
                del mine["run.json"], its["run.json"]
                self.assertEqual(mine, its)
                self.assertEqual(temporaries(out), [])

    def test_workers_that_begin_at_once_agree(self):
        out = self.folder / "out"
        workers = [subprocess.Popen([program.PROGRAM, "convert", clip / "walk", "--output", out, "--shards", f"{k}/3",
                                     "--threads", "1", *QUIET],
                                    stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) for k in range(3)]
        for worker in workers:
            _, err = worker.communicate(timeout=300)
            self.assertEqual(worker.returncode, 0, err)
        self.assertEqual(len(records(out)), 3)
        self.assertEqual((out / "manifest.json").read_text(), (whole / "manifest.json").read_text())
        run("verify", out, "--deep")

    def test_a_folder_that_changes_keeps_its_manifest(self):
        walk, out = self.folder / "walk", self.folder / "out"
        write_images(walk, range(4), 24, 32, seed=7)
        convert(walk, out)
        kept = (out / "manifest.json").read_bytes()
        frozen = (out / "plan.json").read_bytes()
        save_image(walk / "sub" / "one.png", np.random.default_rng(7))  # left out: nothing changes
        self.assertIn("(1 done before)", convert(walk, out)[0])
        cv2.imwrite(str(walk / "frame_03.png"), texture(48, 64, 8))  # init would find two sizes, and propose stills
        self.assertIn('"stills"', self.init(walk)[0])
        _, err = convert(walk, out, expect=64)
        self.assertIn("frames: expected ", err)
        self.assertIn("--overwrite starts again", err)
        self.assertEqual((out / "plan.json").read_bytes(), frozen)
        cv2.imwrite(str(walk / "frame_03.png"), texture(24, 32, 8))
        convert(walk, out, "--overwrite")
        self.assertNotEqual((out / "plan.json").read_bytes(), frozen)
        self.assertEqual((out / "manifest.json").read_bytes(), kept)

    def test_an_edited_manifest_stays(self):
        out = self.folder / "out"
        out.mkdir()
        text = (whole / "manifest.json").read_text()
        (out / "manifest.json").write_text(text.replace('"gaps": [1]', '"gaps": [2]'))
        convert(clip / "walk", out)
        self.assertIn("129 of 129 pairs", convert(clip / "walk", out)[0])

    def test_another_jobs_folder_is_refused(self):
        write_images(self.folder / "run" / "walk", range(4), 24, 32, seed=8)  # of the same name
        out = self.folder / "out"
        convert(self.folder / "run" / "walk", out)
        before = content(out)
        for more in [], ["--overwrite"], ["--limit", "2"]:
            _, err = convert(clip / "walk", out, *more, expect=64)
            self.assertIn(f"error: expected the manifest for {clip / 'walk'} (frames), got that of another job, in "
                          f"{out}/manifest.json (--output names another folder; eventgan convert {out}/manifest.json "
                          "goes on with that job)\n", err)
        (out / "manifest.json").unlink()
        del before["manifest.json"]
        for given in clip / "walk", self.folder / "run" / "walk":
            _, err = convert(given, out, expect=64)
            self.assertIn("got that of a job whose manifest is elsewhere", err)
        (out / "manifest.json").write_text('{"name": "a web page"}')
        self.assertIn(f"{out}/manifest.json: $.format", convert(clip / "walk", out, expect=64)[1])
        (out / "manifest.json").unlink()
        self.assertEqual(content(out), before)

    def test_what_makes_no_pairs_is_told_and_nothing_is_written(self):
        out = self.folder / "out"
        (self.folder / "empty").mkdir()
        self.assertIn("images or videos, got none of these, in ", convert(self.folder / "empty", out, expect=66)[1])
        write_video(self.folder / "one.mp4", 1)
        _, err = convert(self.folder / "one.mp4", out, expect=66)
        self.assertIn("error: expected labelled frames that make pairs, got none, in ", err)
        self.assertIn("1 frame of 1 sequence, NO LABELS", err)
        self.assertEqual(err.count("\n"), 1, err)
        for given in "none.mp4", "none":
            self.assertIn(given, convert(self.folder / given, out, expect=66)[1])
        convert(clip / "walk", "", expect=64)
        run("plan", clip / "walk", "--freeze", "--output", "", expect=64)
        self.assertFalse(out.exists())

    def test_warnings_are_told_and_every_line_of_json_is_json(self):
        write_cars(self.folder / "training", 3, np.random.default_rng(7))
        _, err = run("plan", self.folder / "training" / "image_2", "--progress", "none")
        self.assertRegex(err, r"(?m)^warning: this is only a part of KITTI object")
        _, err = run("convert", self.folder / "training", "--output", self.folder / "out", "--progress", "json")
        for line in err.splitlines():
            self.assertRegex(line, r"^\{.*\}$")
        self.assertIn("KITTI object: 3 labelled frames", err)

    def test_a_shell_may_give_a_manifest_under_any_name(self):
        manifest = self.folder / "job"
        shutil.copy(whole / "manifest.json", manifest)
        self.assertIn("total: 130 pairs", run("plan", manifest)[0])


if __name__ == "__main__":
    program.main()

"""Inputs that are there and cannot be read, or are not what they seem: each ends in a quarantined sample or one clear
line, in no time and never in a crash."""

import json
import os
import pathlib
import re
import resource
import shutil
import subprocess
import zipfile

import h5py
import numpy as np
import PIL.Image

import failing_files
import program
from folders import quarantined
from program import run
from small_job import LENIENT, save_image, small_job

NOBODY = 65534


def run_without_rights(test, *arguments):
    """Permissions mean nothing to root, so as somebody else, to whom all of the test's folder is given, with a copy of
    the program: the build may lie where only root may enter."""
    if os.geteuid() != 0:
        run(*arguments)
        return
    copied = shutil.copy(program.PROGRAM, test.folder)
    for path in [test.folder, *test.folder.rglob("*")]:
        os.chown(path, NOBODY, NOBODY)
    try:
        done = subprocess.run([copied, *map(str, arguments)], capture_output=True, text=True, timeout=120,
                              user=NOBODY, group=NOBODY, extra_groups=[])
    except PermissionError as error:
        test.skipTest(f"nobody may not run what lies in {test.folder}: {error}")
    if done.returncode != 0:
        raise AssertionError(f"expected exit code 0, got {done.returncode}\n{done.stdout}\n{done.stderr}")


def in_time(*arguments, expect):
    """Both outputs; fails if the program waits for a writer or a device's end."""
    done = subprocess.run([program.PROGRAM, *map(str, arguments)], capture_output=True, text=True, timeout=120)
    if done.returncode != expect:
        raise AssertionError(f"expected exit code {expect}, got {done.returncode} of "
                             f"{arguments}\n{done.stdout}\n{done.stderr}")
    return done.stdout + done.stderr


def replace(path, how):
    path.unlink()
    if how == "fifo":
        os.mkfifo(path)
    elif how == "device":
        path.symlink_to("/dev/zero")
    elif how == "loop":
        path.symlink_to(path.name)
    else:
        path.mkdir()


class Labels(program.InFolder):
    def test_one_that_cannot_be_read_is_quarantined_and_mended_by_retry(self):
        for how, reason in {"loop": "Too many levels of symbolic links", "fifo": "Not a regular file",
                            "device": "Not a regular file", "folder": "Is a directory"}.items():
            with self.subTest(how):
                job = self.folder / how
                manifest = small_job(job, people=0, errors=LENIENT)
                label = job / "cars" / "label_2" / "000003.txt"
                text = label.read_bytes()
                replace(label, how)
                in_time("plan", manifest, expect=0)
                in_time("convert", manifest, expect=0)
                out = job / "out"
                self.assertEqual(list(quarantined(out)), ["000003"])
                self.assertIn(f"'{reason}', in cars/label_2/000003.txt", quarantined(out)["000003"])
                label.rmdir() if how == "folder" else label.unlink()
                label.write_bytes(text)
                run("retry", out)
                self.assertEqual(quarantined(out), {})

    def test_too_few_open_files_are_a_fault_of_the_run(self):
        """Whatever the job may quarantine: a run with a higher limit makes all samples."""
        manifest = small_job(self.folder / "job", people=0, errors=LENIENT)
        refused = 0
        for limit in range(5, 25):
            done = subprocess.run([program.PROGRAM, "convert", manifest, "--threads", "2"], capture_output=True,
                                  text=True, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE,
                                                                                   (limit, limit)))
            self.assertEqual(quarantined(self.folder / "job" / "out"), {}, f"with {limit} open files")
            if done.returncode != 0:
                self.assertEqual(done.returncode, 1, done.stderr)
                self.assertIn("Too many open files", done.stderr)
                refused += 1
        self.assertGreater(refused, 0)
        run("convert", manifest)
        self.assertEqual(quarantined(self.folder / "job" / "out"), {})

    def test_one_without_permission_is_quarantined(self):
        manifest = small_job(self.folder / "job", people=0, errors=LENIENT)
        label = self.folder / "job" / "cars" / "label_2" / "000003.txt"
        label.chmod(0)
        out = self.folder / "out"
        run_without_rights(self, "convert", manifest, "--output", out)
        self.assertIn("'Permission denied', in cars/label_2/000003.txt", quarantined(out)["000003"])
        self.assertEqual(len(quarantined(out)), 1)

    def test_one_with_an_io_error_is_quarantined(self):
        manifest = small_job(self.folder / "job", people=0, errors=LENIENT)
        done = failing_files.run(self.folder / "job" / "cars" / "label_2" / "000003.txt", "EIO open 1+", "convert",
                                 manifest)
        self.assertEqual((done.code, done.struck), (0, True), done.err)
        reasons = quarantined(self.folder / "job" / "out")
        self.assertEqual(list(reasons), ["000003"])
        self.assertIn("'Input/output error', in cars/label_2/000003.txt", reasons["000003"])

    def frames(self, label):
        folder = self.folder / "clip"
        shutil.rmtree(folder, ignore_errors=True)
        for k in range(3):
            save_image(folder / f"{k}.png", np.random.default_rng(k))
        (folder / "1.json").write_text(label)
        source = {"dataset": "frames", "root": "clip", "pairs": program.pairs([1])}
        out = self.folder / "out"
        shutil.rmtree(out, ignore_errors=True)
        in_time("convert", self.write_manifest(program.manifest(
            [source], name="small", generator={"kind": "difference"}, errors=LENIENT)), expect=0)
        return quarantined(out)

    def test_deep_nesting_and_double_keys_in_a_sidecar_are_faults_of_its_sample(self):
        self.assertEqual(self.frames('{"a": {"b": [1]}}'), {})
        self.assertIn("at most 32 levels", self.frames('{"a": ' + "[" * 100_000 + "]" * 100_000 + "}")["1"])
        self.assertIn("$.a: expected the key once", self.frames('{"a": 1, "a": 2}')["1"])


class Files(program.InFolder):
    """Those that the command line or the manifest name: a FIFO in their place is reported, not waited for."""

    def refused(self, path, *arguments):
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists():
            os.mkfifo(path)
        self.assertIn(path.name, in_time(*arguments, expect=66))

    def of_source(self, **source):
        return self.write_manifest(program.manifest([{"pairs": program.pairs([1]), **source}],
                                                    generator={"kind": "difference"}))

    def test_a_fifo_is_never_waited_for(self):
        self.refused(self.folder / "job.json", "plan", self.folder / "job.json")
        self.refused(self.folder / "old.pt", "import-weights", self.folder / "old.pt", self.folder / "w.safetensors")
        self.refused(self.folder / "clip.mp4", "plan", self.of_source(dataset="frames", root="clip.mp4"))
        self.refused(self.folder / "m" / "list.json",
                     "plan", self.of_source(dataset="mpii_list", root="m", annotations="m/list.json"))
        self.refused(self.folder / "h" / "S1" / "Walking-1" / "annot.h5",
                     "plan", self.of_source(dataset="human36m", layout="fetch", root="h"))
        self.refused(self.folder / "x" / "list.npz", "plan", self.of_source(
            dataset="human36m", layout="extracted", root="x", annotations="x/list.npz"))
        videos = self.folder / "o" / "S1" / "Videos"
        videos.mkdir(parents=True)
        (videos / "Walking.7.mp4").write_bytes(b"")
        self.refused(self.folder / "o" / "S1" / "MyPoseFeatures" / "D2_Positions" / "Walking.7.cdf",
                     "plan", self.of_source(dataset="human36m", layout="official", root="o"))
        weights = self.write_manifest(
            program.manifest([{"dataset": "frames", "root": "m", "pairs": program.pairs([1])}],
                             generator={"weights": "w.safetensors"}))
        save_image(self.folder / "m" / "0.png", np.random.default_rng(0))
        save_image(self.folder / "m" / "1.png", np.random.default_rng(1))
        self.refused(self.folder / "w.safetensors", "plan", weights)
        self.refused(self.folder / "r.hdf5", "realism", self.folder / "r.hdf5", "--with", "difference")

    def test_a_fifo_for_the_annotations_of_mpii(self):
        root = self.folder / "m"
        root.mkdir()
        os.mkfifo(root / "mpii_human_pose_v1_u12_1.mat")
        self.refused(root / "mpii_human_pose_v1_sequences_keyframes.mat", "plan",
                     self.of_source(dataset="mpii", root="m"))

    def test_a_truncated_npz_that_was_found_is_a_missing_input(self):
        root = self.folder / "x"
        root.mkdir()
        with zipfile.ZipFile(root / "list.npz", "w") as archive:
            for name in ["imgname", "center", "scale", "part", "S"]:
                archive.writestr(name + ".npy", b"x" * 1000)
        path = root / "list.npz"
        path.write_bytes(path.read_bytes()[:-40])
        self.assertIn("list.npz",
                      in_time("plan", self.of_source(dataset="human36m", layout="extracted", root="x"), expect=66))


class Names(program.InFolder):
    def test_two_that_differ_by_the_case_of_letters_are_not_exported_as_one(self):
        """On Windows and macOS, where an export may go, both are one file."""
        photos = self.folder / "photos"
        for name in ("sun.png", "Sun.png"):
            save_image(photos / name, np.random.default_rng(3))
        job = self.write_manifest(program.manifest(
            [{"dataset": "frames", "root": "photos", "pairs": {"from": "stills", "side": "before"}}],
            generator={"kind": "difference"}, image={"width": 32, "height": 24}))
        run("convert", job)
        run("finalize", self.folder / "out")
        export = ("export", self.folder / "out", "--to", "webdataset", "--out", self.folder / "tar")
        run(*export)  # names within one file
        for again in range(2):  # begun or not
            _, err = run("export", self.folder / "out", "--to", "events", "--out", self.folder / "export", expect=66)
            self.assertRegex(err, "expected names of files that differ in more than the case of letters, got .*[sS]un")

    def test_control_characters_in_them_reach_no_terminal(self):
        evil = "a\x1b]0;owned\x07\x9b31m\nsound: 9 shards"
        clip = self.folder / "clip" / evil
        clip.mkdir(parents=True)
        random = np.random.default_rng(1)
        for number in range(4):
            save_image(clip / f"{number:06}.png", random)
        (clip / "000002.png").write_bytes(b"rubbish")
        (clip / "odd\x1b.txt").write_text("")
        source = {"dataset": "frames", "root": "clip", "pairs": program.pairs([1])}
        manifest = self.write_manifest(program.manifest([source], errors=LENIENT))
        out = self.folder / "out"

        def check(*command):
            done = subprocess.run([program.PROGRAM, *map(str, command)], capture_output=True, timeout=120)
            said = (done.stdout + done.stderr).decode()
            self.assertTrue(said.strip(), command)
            self.assertEqual([c for c in said if c != "\n" and (c < " " or "\x7f" <= c < "\xa0")], [], command)
            self.assertNotIn("\nsound: 9 shards", said, command)

        for command in ("plan", "convert"):
            check(command, manifest)
        shard = next(out.glob("*-of-*.h5"))
        for command in [("status", out), ("retry", out), ("verify", out, "--deep"), ("inspect", shard),
                        ("inspect", shard, "--sample", 0),
                        ("finalize", out), ("report", out), ("preview", out, "--out", self.folder / "images"),
                        ("preview", out, "--out", self.folder / "more", "--sample", evil)]:
            check(*command)

    def test_a_manifest_in_a_folder_whose_name_is_not_utf_8_works(self):
        folder = os.fsencode(self.folder / "job") + b"-\xff\xe9"
        manifest = small_job(pathlib.Path(os.fsdecode(folder)), people=0)
        out = os.path.join(folder, b"out")
        for arguments in [["convert", manifest], ["retry", out], ["finalize", out], ["verify", out, "--deep"],
                          ["status", out]]:
            done = subprocess.run([program.PROGRAM, *arguments], capture_output=True, timeout=120)
            self.assertEqual(done.returncode, 0, (arguments, done.stdout, done.stderr))
            self.assertNotIn(b"json.exception", done.stderr)
        recorded = json.loads((pathlib.Path(os.fsdecode(out)) / "run.json").read_text())
        self.assertEqual(bytes(recorded["manifest_folder_bytes"]), folder)


class SixteenBits(program.InFolder):
    """A thermal camera's images, whose values fill a seventieth of the 16 bits."""

    def convert(self, folder, **image):
        job = program.manifest([{"dataset": "frames", "root": folder, "pairs": program.pairs([1])}],
                               name=folder, image=image, output={"directory": f"out-{folder}"},
                               generator={"kind": "difference"})
        told, _ = run("convert", self.write_manifest(job, f"{folder}.json"), "--overwrite")
        with h5py.File(next((self.folder / f"out-{folder}").glob("*-of-*.h5"))) as shard:
            return told, shard["events/volume"][()], json.loads(shard.attrs["preprocessing"])

    def test_a_narrow_range_is_named_and_can_be_spread(self):
        wide = np.random.default_rng(5).integers(51_200, 52_220, (2, 24, 32), endpoint=True)
        wide[:, 0, 0], wide[:, 0, 1] = 51_200, 52_220  # both ends are there
        narrow = (wide - 51_200) / 4 + 0.5  # 255 / 1,020, and rounded
        for folder, images in (("wide", wide.astype(np.uint16)), ("narrow", narrow.astype(np.uint8))):
            (self.folder / folder).mkdir()
            for number, image in enumerate(images):
                PIL.Image.fromarray(image).save(self.folder / folder / f"{number}.png")
        told, volume, _ = self.convert("wide")
        # 0.1 % of 1,536 values at either end is one value; room of a quarter is 255.
        self.assertRegex(told, r"note: images of 16 bits use less than a quarter of their values, .*"
                                 r'"image": {"range": \[509\d\d, 524\d\d\]} would spread them, in wide')
        _, expected, _ = self.convert("narrow")
        self.assertGreater(expected.sum(), 3 * volume.sum())
        told, volume, preprocessing = self.convert("wide", range=[51_200, 52_220])
        np.testing.assert_array_equal(volume, expected)
        self.assertEqual(preprocessing["range"], [51_200, 52_220])
        self.assertNotIn("16 bits", told)
        run("verify", "--deep", self.folder / "out-wide")
        told, _ = run("init", self.folder / "wide", "--out", self.folder / "drafted.json")
        self.assertIn("images of 16 bits use less than a quarter of their values", told)
        written = re.search(r'"range": \[(\d+), (\d+)\]', (self.folder / "drafted.json").read_text())
        low, high = map(int, written.groups())
        self.assertTrue(50_900 < low < 51_000 < 52_400 < high < 52_500, (low, high))


if __name__ == "__main__":
    program.main()

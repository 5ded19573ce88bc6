"""A disk that is full or broken: a message with the path and the reason, nothing half-written,
and the next run goes on."""

import json
import os
import re
import resource
import shutil
import subprocess
import sys
import unittest

import failing_files
import program
from folders import content, same_content, same_folder, temporaries
from program import run
from small_job import LENIENT, broken_cars, small_job

REASONS = {"ENOSPC": "No space left on device", "EIO": "Input/output error", "EDQUOT": "Disk quota exceeded",
           "EROFS": "Read-only file system"}
FAILED = 1
MAY_MOUNT = "EVENTGAN_TEST_IN_MOUNT_NAMESPACE"


class DiskFailure(program.InFolder):
    def setUp(self):
        super().setUp()
        self.manifest = small_job(self.folder / "job", cars=2, people=1, errors=LENIENT)  # two shards
        self.expected = self.folder / "undisturbed"
        self.calls = failing_files.changes(self.convert(self.expected, "").calls)

    def convert(self, out, rule=None):
        arguments = ("convert", self.manifest, "--output", out, "--threads", "1", "--progress", "none")
        return failing_files.run(out, rule, *arguments) if rule is not None else run(*arguments)

    def told_and_clean(self, out, rule, outcome, expected):
        """The failure is reported with a path below `out` and its reason; what is in the folder is whole."""
        self.assertTrue(outcome.struck, rule)
        self.assertEqual(outcome.code, FAILED, f"{rule}\n{outcome.out}\n{outcome.err}")
        self.assertIn(str(out), outcome.err, rule)
        self.assertIn(REASONS[rule.split()[0]], outcome.err, rule)
        self.assertNotIn("terminate called", outcome.err, rule)
        if not out.exists():
            return
        self.assertEqual(temporaries(out), [], rule)
        there = content(out)  # parses every commit record
        same_content(there, {name: what for name, what in expected.items() if name in there}, f"{out} ({rule})")

    def fails_then_resumes(self, rule):
        out = self.folder / rule.replace(" ", "-")
        self.told_and_clean(out, rule, self.convert(out, rule), content(self.expected))
        self.convert(out)
        same_folder(out, self.expected)
        shutil.rmtree(out)

    def is_told(self, call):
        """A full disk spares unlink; a file that was not written to is closed whatever that says."""
        written = {call.path for call in self.calls if call.kind == "write"}
        return call.kind != "unlink" and (call.kind != "close" or call.path in written)

    def rules(self, failure, kinds, step):
        calls = [(n, self.calls[n - 1]) for n in failing_files.thinned(self.calls, step)]
        return [f"{failure} any {n}" for n, call in calls if call.kind in kinds and self.is_told(call)]

    def test_full_at_every_call_that_takes_space(self):
        failing_files.for_each(self.fails_then_resumes,
                               self.rules("ENOSPC", ["create", "write", "truncate", "rename", "mkdir"], step=8))

    def test_error_at_every_sync_close_and_rename_and_at_some_writes(self):
        failing_files.for_each(self.fails_then_resumes,
                               self.rules("EIO", ["sync", "close", "rename", "create", "write"], step=20))

    def test_other_reasons(self):
        failing_files.for_each(self.fails_then_resumes,
                               ["EDQUOT write 9", "EDQUOT create 3", "EROFS mkdir 1", "EROFS create 1"])

    def test_disk_that_stays_full(self):
        last = max(n for n, call in enumerate(self.calls, 1) if self.is_told(call))
        numbers = range(1, last + 1, 9)
        failing_files.for_each(self.fails_then_resumes, [f"ENOSPC any {n}+" for n in numbers])
        failing_files.for_each(self.fails_then_resumes, [f"EIO any {n}+" for n in numbers[::3]])

    def test_file_system_without_hard_links(self):
        """The plan is frozen by another way there."""
        out = self.folder / "out"
        outcome = self.convert(out, "EIO link 1+")
        self.assertEqual(outcome.code, 0, outcome.err)
        same_folder(out, self.expected)

    def test_short_writes_are_no_error(self):
        out = self.folder / "out"
        outcome = self.convert(out, "short write 1+")
        self.assertEqual(outcome.code, 0, outcome.err)
        same_folder(out, self.expected)

    def test_error_of_reading_is_never_taken_for_done(self):
        """Listing, commit records, shards, plan: either it is reported, or the shard is made again."""
        reads = [call for call in self.convert(self.expected, "").calls if call.kind == "open"]
        self.assertGreater(len(reads), 4)

        def read_fails(number):
            out = self.folder / f"read-{number}"
            shutil.copytree(self.expected, out)
            outcome = self.convert(out, f"EIO open {number}")
            self.assertTrue(outcome.struck)
            self.assertIn(outcome.code, (0, FAILED), outcome.err)
            if reads[number - 1].path.name not in ("run.json", "plan.index"):  # which are no more than conveniences
                self.assertNotEqual(outcome.err, "",
                                    f"expected a warning or an error, got nothing, of {reads[number - 1]}")
            self.assertEqual(temporaries(out), [])
            self.convert(out)
            same_folder(out, self.expected)

        failing_files.for_each(read_fails, range(1, len(reads) + 1))

    def fails_then_again(self, name, before, after, rule, *command):
        """A command on a copy of `before` that ends as `after` when nothing fails."""
        out = self.folder / f"{name}-{rule.replace(' ', '-')}"
        shutil.copytree(before, out)
        outcome = failing_files.run(out, rule, *command[:1], out, *command[1:])
        self.assertTrue(outcome.struck, rule)
        self.assertEqual(outcome.code, FAILED, f"{rule}\n{outcome.out}\n{outcome.err}")
        self.assertIn(str(out), outcome.err, rule)
        self.assertIn(REASONS[rule.split()[0]], outcome.err, rule)
        self.assertEqual(temporaries(out), [], rule)
        there, was, will = content(out), content(before), content(after)
        for file, what in there.items():
            self.assertIn(what, (was.get(file), will.get(file)), f"{rule}: {file}")
        run(*command[:1], out, *command[1:])
        same_content(content(out), will, out)
        shutil.rmtree(out)

    def rules_for(self, calls):
        some = [n for n in failing_files.thinned(calls) if calls[n - 1].kind not in ("unlink", "link")]
        return [f"{'EIO' if calls[n - 1].kind in ('sync', 'close') else 'ENOSPC'} any {n}" for n in some]

    def test_finalize_at_every_step(self):
        after = self.folder / "after"
        shutil.copytree(self.expected, after)
        calls = failing_files.changes(failing_files.run(after, "", "finalize", after).calls)
        failing_files.for_each(lambda rule: self.fails_then_again("finalize", self.expected, after, rule, "finalize"),
                               self.rules_for(calls))

    def test_finalize_when_a_shard_that_is_read_does_not_close(self):
        """Nothing is lost by it, so that it is no failure; nor may HDF5's end find a file half closed."""
        after = self.folder / "after"
        shutil.copytree(self.expected, after)
        calls = [call for call in failing_files.run(after, "", "finalize", after).calls if call.kind == "shut"]
        self.assertIn(".h5", {call.path.suffix for call in calls})

        def fails(number):
            out = self.folder / f"shut-{number}"
            shutil.copytree(self.expected, out)
            outcome = failing_files.run(out, f"EIO shut {number}", "finalize", out)
            self.assertTrue(outcome.struck)
            self.assertEqual(outcome.code, 0, outcome.err)
            same_content(content(out), content(after), out)
            shutil.rmtree(out)

        failing_files.for_each(fails, range(1, len(calls) + 1))

    def test_retry_at_every_step(self):
        before = self.folder / "before"
        with broken_cars(self.folder / "job", [1]):
            self.convert(before)
        after = self.folder / "after"
        shutil.copytree(before, after)
        command = ("retry", "--threads", "1")
        calls = failing_files.changes(failing_files.run(after, "", "retry", after, "--threads", "1").calls)
        # Between shard and commit record the shard is not done: the next retry makes it again.
        failing_files.for_each(lambda rule: self.fails_then_again("retry", before, after, rule, *command),
                               self.rules_for(calls))

    def test_really_small_disk(self):
        """Runs the test below where it may mount."""
        alone = ["unshare", "--user", "--map-root-user", "--mount"]
        if shutil.which("unshare") is None or subprocess.run([*alone, "true"], capture_output=True).returncode != 0:
            self.skipTest("no mount namespaces here")
        done = subprocess.run([*alone, sys.executable, __file__, "SmallDisk"], capture_output=True, text=True,
                              env={**os.environ, MAY_MOUNT: "1"})
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertNotIn("skipped", done.stderr)


class SizeLimit(program.InFolder):
    """`ulimit -f`: the system would end the program with SIGXFSZ, without a word."""

    def setUp(self):
        super().setUp()
        self.manifest = small_job(self.folder / "job")
        self.out = self.folder / "job" / "out"

    def refused(self, size, written_to, *arguments):
        done = subprocess.run([program.PROGRAM, *map(str, arguments)], capture_output=True, text=True,
                              preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)))
        self.assertEqual(done.returncode, FAILED, f"{arguments}\n{done.stderr}")
        self.assertRegex(done.stderr,
                         re.escape(str(written_to)) + r".*ulimit -f allows files of " + str(size) + " bytes", arguments)
        self.assertNotIn("damaged", done.stderr)
        folder = written_to if written_to.is_dir() else written_to.parent
        self.assertEqual(list(folder.rglob(".*.tmp")), [], arguments)

    def test_every_writer_names_its_file_and_the_limit(self):
        self.refused(500, self.out, "convert", self.manifest)  # the plan
        run("convert", self.manifest, "--output", self.folder / "undisturbed")
        largest = max(path.stat().st_size for path in (self.folder / "undisturbed").iterdir())
        self.refused(largest - 1, self.out, "convert", self.manifest)  # a shard
        run("convert", self.manifest)
        same_folder(self.out, self.folder / "undisturbed")

        for name in ("dataset.json", "dataset.h5"):  # else nothing is written
            (self.out / name).unlink()
        self.refused(2000, self.out, "finalize", self.out)
        self.refused(2000, self.out, "report", self.out)
        run("report", self.out)
        images = self.folder / "images"
        self.refused(500, images, "preview", self.out, "--out", images)
        run("finalize", self.out)
        for to in ("yolo", "coco", "mpii", "hpe", "davis", "webdataset", "events", "dsec", "rvt", "raw", "aedat4"):
            exported = self.folder / to
            self.refused(150, exported, "export", self.out, "--to", to, "--out", exported)
            self.refused(400, exported, "export", self.out, "--to", to, "--out", exported)
            run("export", self.out, "--to", to, "--out", exported)
        demo = self.folder / "demo"
        self.refused(5000, demo, "make-demo", demo)
        network = json.loads(self.manifest.read_text())
        network["generator"] = {"weights": "untrained:2"}
        self.manifest.write_text(json.dumps(network))
        weights = self.folder / "weights"
        weights.mkdir()
        self.refused(2000, weights, "calibrate", self.manifest, "--out", weights / "calibrated.safetensors")

    def test_retry_leaves_the_shard_as_it_was(self):
        manifest = small_job(self.folder / "lenient", cars=2, people=0, errors=LENIENT)
        out = self.folder / "lenient" / "out"
        with broken_cars(self.folder / "lenient", [1]):
            run("convert", manifest)
        before = content(out)
        shard, = out.glob("*-of-*.h5")
        self.refused(shard.stat().st_size // 2, out, "retry", out)
        same_content({name: what for name, what in content(out).items() if name in before}, before, out)
        run("retry", out)
        run("verify", out, "--deep")


@unittest.skipUnless(MAY_MOUNT in os.environ, "run by test_really_small_disk")
class SmallDisk(program.InFolder):
    def test_convert_until_full_then_with_more_room(self):
        manifest = small_job(self.folder / "job")
        run("convert", manifest, "--progress", "none")
        undisturbed = self.folder / "job" / "out"
        disk = self.folder / "disk"
        disk.mkdir()
        subprocess.run(["mount", "-t", "tmpfs", "-o", "size=160k", "tmpfs", disk], check=True)
        out = disk / "out"
        _, err = run("convert", manifest, "--output", out, "--progress", "none", expect=FAILED)
        self.assertRegex(err, re.escape(str(out)) + r".*No space left on device")
        self.assertEqual(temporaries(out), [])
        done = [json.loads(path.read_text())["shard"] for path in out.glob("*-of-*.json")]
        self.assertGreater(len(done), 0)
        self.assertLess(len(done), 5)
        there = content(out)
        same_content(there, {name: what for name, what in content(undisturbed).items() if name in there}, out)
        subprocess.run(["mount", "-o", "remount,size=4m", disk], check=True)
        report, _ = run("convert", manifest, "--output", out, "--progress", "none")
        self.assertIn(f"({len(done)} done before)", report)
        same_folder(out, undisturbed)
        subprocess.run(["umount", disk], check=True)


if __name__ == "__main__":
    program.main()

"""kill -9 at every step: whatever is in the folder then, the next run ends with the bytes of an undisturbed one."""

import json
import random
import re
import shutil

import numpy as np

import failing_files
import program
from folders import content, records, same_content, same_folder, temporaries
from program import run
from small_job import LENIENT, broken_cars, save_image, small_job


class Crash(program.InFolder):
    def convert(self, out, rule=None, threads=1, more=()):
        arguments = ("convert", self.manifest, "--output", out, "--threads", threads, "--progress", "none", *more)
        return failing_files.run(out, rule, *arguments) if rule is not None else run(*arguments)

    def undisturbed(self, **job):
        """Converts the job in a folder of its own; the calls it made."""
        self.manifest = small_job(self.folder / "job", **job)
        self.expected = self.folder / "undisturbed"
        calls = failing_files.changes(self.convert(self.expected, "").calls)
        self.assertEqual(temporaries(self.expected), [])
        run("verify", self.expected, "--deep")  # and so every folder of the same bytes
        return calls

    def killed_then_resumed(self, rule):
        out = self.folder / rule.replace(" ", "-")
        killed = self.convert(out, rule)
        self.assertEqual(killed.code, -9, f"{rule}\n{killed.out}\n{killed.err}")
        self.convert(out)
        same_folder(out, self.expected)
        shutil.rmtree(out)

    def test_convert_killed_at_every_call(self):
        calls = self.undisturbed(cars=2, people=1)  # two shards
        self.assertEqual(len(records(self.expected)), 2)
        # Before a call the disk is as it was after the call before.
        numbers = failing_files.thinned(calls)
        failing_files.for_each(self.killed_then_resumed, [f"kill-before any {n}" for n in numbers])
        self.killed_then_resumed(f"kill-after any {len(calls)}")

    def test_convert_killed_around_each_step_of_a_commit(self):
        calls = self.undisturbed(cars=2, people=1)
        shard = sorted(path.name for path in self.expected.glob("*-of-*.h5"))[0]
        record = shard.replace(".h5", ".json")
        steps = [(call.kind, n) for n, call in enumerate(calls, 1)
                 if record in call.path.name or (shard in call.path.name and call.kind != "write")]
        self.assertLessEqual({"create", "write", "sync", "close", "rename"}, {kind for kind, _ in steps})
        rules = [f"kill-after any {n}" for _, n in steps]
        rules += [f"kill-within any {n}" for kind, n in steps if kind == "write"]
        rules += [f"kill-within write {n}" for n in (1, 4, 20)]  # the plan, a volume, HDF5's own data
        failing_files.for_each(self.killed_then_resumed, rules)

    def test_convert_killed_fifty_times_at_random(self):
        calls = self.undisturbed(cars=60, people=40, samples_per_shard=1)
        shards = len(records(self.expected))
        calls_per_shard = len(calls) // shards
        dice = random.Random(50)
        out = self.folder / "killed"
        kills = 0
        while kills < 50:
            # A life commits one shard on the average, so that the job outlives fifty of them.
            calls_left, delay_us = dice.randrange(1, 3 * calls_per_shard), dice.randrange(2000)
            life = self.convert(out, f"kill-later any {calls_left} {delay_us}", threads=2)
            if life.code != -9:
                break
            kills += 1
        self.assertEqual(kills, 50)
        self.assertLess(len(records(out)), shards, "done before the last kill")
        self.assertGreater(len(records(out)), 10, "hardly anything was done between the kills")
        self.convert(out)
        same_folder(out, self.expected)
        run("verify", out, "--deep")

    def test_what_labels_lost_is_told_of_the_shards_before_the_kill_too(self):
        dice = np.random.default_rng(7)
        (self.folder / "labels").mkdir()
        (self.folder / "labels" / "classes.txt").write_text("car\n")
        for k in range(7):
            save_image(self.folder / "images" / f"{k:06d}.png", dice)
            (self.folder / "labels" / f"{k:06d}.txt").write_text("0 1.009 0.5 0.001 0.5\n")  # beside the image
        source = {"dataset": "frames", "root": "images", "labels": {"format": "yolo", "path": "labels"},
                  "pairs": program.pairs([1])}
        self.manifest = self.write_manifest(program.manifest(
            [source], generator={"kind": "difference"}, output={"directory": "out", "samples_per_shard": 2}))

        def notes(told):
            return re.findall("(?m)^  note: (.*)$", told)

        whole = self.convert(self.folder / "whole", "")
        expected = notes(whole.out)
        self.assertIn("6 boxes of labels left out: expected ", expected[-1])
        second = next(n for n, call in enumerate(failing_files.changes(whole.calls), 1)
                      if call.kind == "rename" and call.path.name == "job-train-00001-of-00003.json")
        killed = self.folder / "killed"
        self.assertEqual(self.convert(killed, f"kill-after any {second}").code, -9)
        self.assertEqual(len(records(killed)), 2)
        for _ in range(2):  # the second finds all done
            self.assertEqual(notes(self.convert(killed)[0]), expected)
        same_folder(killed, self.folder / "whole")
        parts = self.folder / "parts"
        for part in ("0/2", "1/2"):
            self.convert(parts, more=["--shards", part])
        for command in ("finalize", "status"):
            self.assertEqual(notes(run(command, parts)[0]), expected)
        self.assertEqual(json.loads((parts / "dataset.json").read_text())["sources"][0]["notes"], expected)

    def test_overwrite_killed_while_discarding(self):
        """Of the folder's two plans one is in force, and no shard of the other counts."""
        self.undisturbed(cars=2, people=1)
        earlier = self.folder / "earlier"
        manifest = self.folder / "job" / "earlier.json"
        manifest.write_text(json.dumps({**json.loads(self.manifest.read_text()), "seed": 8}))
        run("convert", manifest, "--output", earlier)
        run("finalize", earlier)
        command = ("convert", self.manifest, "--overwrite", "--threads", "1", "--progress", "none", "--output")
        out = self.folder / "out"
        shutil.copytree(earlier, out)
        calls = failing_files.changes(failing_files.run(out, "", *command, out).calls)
        same_folder(out, self.expected)
        frozen = next(n for n, call in enumerate(calls, 1) if call.path.name == "plan.json" and call.kind == "link")

        def killed_then_again(n):
            out = self.folder / f"overwrite-{n}"
            shutil.copytree(earlier, out)
            self.assertEqual(failing_files.run(out, f"kill-before any {n}", *command, out).code, -9)
            if (out / "plan.json").exists() and n <= frozen:
                run("convert", self.manifest, "--output", out, expect=64)
                run(*command, out)
            else:
                self.convert(out)
            same_folder(out, self.expected)
            shutil.rmtree(out)

        failing_files.for_each(killed_then_again, range(1, frozen + 3))

    def test_finalize_killed_at_every_call(self):
        self.undisturbed(cars=2, people=1)
        whole = self.folder / "whole"
        shutil.copytree(self.expected, whole)
        calls = failing_files.changes(failing_files.run(whole, "", "finalize", whole).calls)
        expected = content(whole)
        self.assertIn("dataset.h5", expected)
        self.assertIn("dataset.json", expected)

        def killed_then_again(n):
            out = self.folder / f"finalize-{n}"
            shutil.copytree(self.expected, out)
            killed = failing_files.run(out, f"kill-before any {n}", "finalize", out)
            self.assertEqual(killed.code, -9, killed.err)
            run("finalize", out)
            same_content(content(out), expected, out)
            shutil.rmtree(out)

        failing_files.for_each(killed_then_again, failing_files.thinned(calls))

    def test_finalize_after_a_retry_killed_between_shard_and_commit_record(self):
        self.undisturbed(cars=4, people=1, errors=LENIENT)
        broken = self.folder / "broken"
        with broken_cars(self.folder / "job", [1]):
            self.convert(broken)
        before = {name: bytes for name, bytes in content(broken).items() if not name.startswith("dataset.")}
        spoiled, = (shard for shard, record in records(broken).items() if record["quarantined"])
        whole = self.folder / "whole"
        shutil.copytree(broken, whole)
        calls = failing_files.changes(failing_files.run(whole, "", "retry", whole, "--threads", "1").calls)
        replaced = next(n for n, call in enumerate(calls, 1) if call.kind == "rename" and call.path.name == spoiled)

        for more in [], ["--partial"]:
            out = self.folder / f"finalized{len(more)}"
            shutil.copytree(broken, out)
            killed = failing_files.run(out, f"kill-after any {replaced}", "retry", out, "--threads", "1")
            self.assertEqual(killed.code, -9, killed.err)
            self.assertNotEqual(content(out)[spoiled], before[spoiled])
            self.assertEqual(len(temporaries(out)), 1)  # the shard's former self
            run("finalize", out, *more)
            now = content(out)
            self.assertEqual({name: now[name] for name in before}, before)
            self.assertEqual(temporaries(out), [])
            run("verify", out)

    def test_retry_killed_at_every_call(self):
        self.undisturbed(cars=4, people=1, errors=LENIENT)  # three shards
        broken = self.folder / "broken"
        with broken_cars(self.folder / "job", [1]):
            self.convert(broken)
        self.assertEqual(sum(len(record["quarantined"]) for record in records(broken).values()), 1)

        whole = self.folder / "whole"
        shutil.copytree(broken, whole)
        calls = failing_files.changes(failing_files.run(whole, "", "retry", whole, "--threads", "1").calls)
        self.assertEqual(sum(len(record["quarantined"]) for record in records(whole).values()), 0)
        self.assertEqual(temporaries(whole), [])
        expected = content(whole)

        def killed_then_again(n):
            out = self.folder / f"retry-{n}"
            shutil.copytree(broken, out)
            killed = failing_files.run(out, f"kill-before any {n}", "retry", out, "--threads", "1")
            self.assertEqual(killed.code, -9, killed.err)
            # before that, it would refuse the inputs that have changed
            if n % 2 and (out / "amendments.json").exists():
                self.convert(out, more=["--no-finalize"])
            run("retry", out, "--threads", "1")
            same_content(content(out), expected, out)
            shutil.rmtree(out)

        failing_files.for_each(killed_then_again, failing_files.thinned(calls))


if __name__ == "__main__":
    program.main()

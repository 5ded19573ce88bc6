"""Signals: exit code 75 within the grace period, no temporary left, and the next run completes the job.

The layer of failing_files sends the signal at a chosen change of the folder, so that each moment is met without luck.
"""

import json
import os
import pathlib
import shutil
import signal
import subprocess
import tempfile
import time

import failing_files
import program
from folders import records, same_folder, temporaries
from program import run
from small_job import LENIENT, broken_cars, small_job

STOPPED = 75


def setUpModule():
    global job, whole, calls
    job = pathlib.Path(tempfile.mkdtemp(prefix="eventgan-stop-"))
    small_job(job, cars=60, people=30, samples_per_shard=30)  # three shards
    whole = job / "out"
    calls = failing_files.changes(failing_files.run(whole, "", "convert", job / "manifest.json",
                                                    "--threads", "1").calls)


def tearDownModule():
    shutil.rmtree(job)


class Stop(program.InFolder):
    def command(self, out, *more):
        return ("convert", job / "manifest.json", "--output", out, "--threads", "1", "--progress", "none", *more)

    def signalled(self, rule, *more):
        """A run with a signal: its folder and its outcome."""
        out = self.folder / rule.replace(" ", "-")
        outcome = failing_files.run(out, rule, *self.command(out, *more))
        self.assertTrue(outcome.struck, rule)
        return out, outcome

    def stops_clean(self, rule, *more):
        """Stopped, unless the signal came too late for the last shard; nothing half-done either way, and the next run
        completes the job. How many shards were done by then."""
        out, outcome = self.signalled(rule, *more)
        done = len(records(out)) if out.exists() else 0
        self.assertEqual(outcome.code, STOPPED if done < 3 else 0, f"{rule}\n{outcome.err}")
        if out.exists():
            self.assertEqual(temporaries(out), [], rule)
            self.assertEqual(len(list(out.glob("*-of-*.h5"))), done, rule)
        self.completes(out)
        return done

    def completes(self, out):
        run(*self.command(out))
        same_folder(out, whole)
        shutil.rmtree(out)

    def number_of(self, kind, ending, occurrence=1):
        """Which call, counted over all kinds, is the occurrence-th of a kind on a file with an ending (temporaries
        too)."""
        of_kind = [n for n, call in enumerate(calls, 1) if call.kind == kind and ending in call.path.name]
        return of_kind[occurrence - 1]

    def test_each_signal_at_each_kind_of_moment(self):
        moments = {
            "before the folder exists": self.number_of("mkdir", ""),
            "while the plan is frozen": self.number_of("link", "plan.json"),
            "before the first sample": self.number_of("create", ".h5"),
            "in a shard": self.number_of("write", ".h5", 7),
            "in a close": self.number_of("truncate", ".h5"),
            "before a shard's fsync": self.number_of("sync", ".h5"),
            "before a shard's rename": self.number_of("rename", ".h5"),
            "before a commit record": self.number_of("create", "-of-00003.json"),
            "in a commit record": self.number_of("write", "-of-00003.json"),
            "before a commit record's rename": self.number_of("rename", "-of-00003.json"),
            "in the second shard": self.number_of("write", "00001-of-00003.h5", 3),
            "at the very end": len(calls),
        }
        rules = [f"{name} any {number}" for position, number in enumerate(moments.values())
                 for name in ("SIGTERM", "SIGINT", "SIGUSR1")[position % 3:][:2]]
        failing_files.for_each(self.stops_clean, rules)

    def test_while_checking_what_is_done(self):
        for number in (2, 4, 6):
            with self.subTest(number=number):
                out = self.folder / f"SIGTERM-open-{number}"
                shutil.copytree(whole, out)
                for record in sorted(out.glob("*-of-*.json"))[2:]:
                    record.unlink()
                _, outcome = self.signalled(f"SIGTERM open {number}")
                self.assertEqual(outcome.code, STOPPED, outcome.err)
                self.assertEqual(temporaries(out), [])
                self.assertEqual(len(records(out)), 2)
                self.completes(out)

    def test_without_grace_the_open_shard_is_dropped(self):
        self.assertEqual(self.stops_clean(f"SIGTERM any {self.number_of('write', '.h5', 3)}", "--grace", "0"), 0)

    def test_with_grace_the_open_shard_is_finished_and_no_other(self):
        for shard in (0, 1):
            number = self.number_of("write", f"0000{shard}-of-00003.h5", 3)
            self.assertEqual(self.stops_clean(f"SIGUSR1 any {number}", "--grace", "3600"), shard + 1)

    def test_schedulers_may_repeat_their_signal(self):
        for name in ("SIGTERM", "SIGUSR1"):
            self.assertEqual(self.stops_clean(f"{name} any {self.number_of('write', '.h5', 3)}+", "--grace", "3600"), 1)

    def test_a_second_interrupt_ends_at_once_and_the_next_run_cleans_up(self):
        out, outcome = self.signalled(f"SIGINT any {self.number_of('write', '.h5', 3)}+", "--grace", "3600")
        self.assertEqual(outcome.code, -signal.SIGINT)
        self.assertEqual(records(out), {})
        self.assertNotEqual(temporaries(out), [])
        self.completes(out)

    def test_retry_stops_and_is_taken_up_again(self):
        manifest = small_job(self.folder / "job", cars=12, people=0, errors=LENIENT)
        broken = self.folder / "broken"
        with broken_cars(self.folder / "job", [1, 4, 7]):
            run("convert", manifest, "--output", broken)
        mended = self.folder / "mended"
        shutil.copytree(broken, mended)
        made = failing_files.changes(failing_files.run(mended, "", "retry", mended, "--threads", "1").calls)
        self.assertFalse(any(record["quarantined"] for record in records(mended).values()))

        def stops_and_goes_on(number):
            out = self.folder / f"retry-{number}"
            shutil.copytree(broken, out)
            outcome = failing_files.run(out, f"SIGTERM any {number}", "retry", out, "--threads", "1")
            left = any(record["quarantined"] for record in records(out).values())
            self.assertEqual(outcome.code, STOPPED if left else 0, outcome.err)
            self.assertEqual(temporaries(out), [])
            run("retry", out)
            same_folder(out, mended)

        failing_files.for_each(stops_and_goes_on, range(1, len(made), len(made) // 8))


class SlowShard(program.InFolder):
    """A shard that takes far longer than any grace period here."""

    MOST_S = 30  # to end after the signal; the job itself takes minutes

    def has_written(self, out):
        try:
            return any(path.stat().st_size for path in out.glob(".*.h5.*.tmp"))
        except FileNotFoundError:  # a claim, which is gone again
            return False

    def test_status_counts_the_samples_of_the_shard_under_way_as_the_bar_does(self):
        manifest = self.slow_job()
        out = self.folder / "job" / "out"
        process = subprocess.Popen([program.PROGRAM, "convert", manifest, "--threads", "1", "--progress", "json"],
                                   stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        self.addCleanup(process.communicate)
        self.addCleanup(process.kill)
        for line in process.stderr:
            progress = json.loads(line)
            if progress["event"] == "progress" and "phase" not in progress and progress["done"] > 0:
                break
        samples = {"under_way": 0}
        while samples["under_way"] < progress["done"]:
            self.assertIsNone(process.poll(), "ended before status told")
            samples = json.loads(run("status", out, "--json")[0])["samples"]
            self.assertEqual((samples["written"], samples["quarantined"]), (0, 0))
        self.assertLessEqual(samples["under_way"], 100)
        self.assertRegex(run("status", out)[0],
                         r"samples  0 of 100 written, \d+ more in unfinished shards, 0 quarantined")

    def slow_job(self):
        return small_job(self.folder / "job", cars=100, people=0, samples_per_shard=100,
                         generator={"weights": "untrained:16"}, image={"width": 640, "height": 480, "preset": "mpii"})

    def test_ends_within_the_grace_period(self):
        manifest = self.slow_job()
        out = self.folder / "job" / "out"
        for name, more in [("SIGTERM", ["--grace", "1"]), ("SIGINT", []), ("SIGUSR1", ["--grace", "0"])]:
            with self.subTest(signal=name):
                process = subprocess.Popen([program.PROGRAM, "convert", manifest, "--threads", "1", *more],
                                           stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
                self.addCleanup(process.kill)
                while not self.has_written(out):
                    self.assertIsNone(process.poll(), "ended before its first sample")
                    time.sleep(0.01)
                start = time.monotonic()
                process.send_signal(getattr(signal, name))
                err = process.communicate(timeout=600)[1]
                self.assertEqual(process.returncode, STOPPED, err)
                self.assertLess(time.monotonic() - start, self.MOST_S)
                self.assertEqual(sorted(os.listdir(out)), ["plan.json", "run.json"])


if __name__ == "__main__":
    program.main()

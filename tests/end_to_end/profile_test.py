"""`convert --profile` and `retry --profile`: a trace of every stage and thread, whatever ends the run,
and the same shards."""

import collections
import json
import math
import os
import shutil

import failing_files
import program
from folders import records, same_folder, shards
from program import run
from small_job import LENIENT, broken_cars, small_job

STAGES = ("read", "generate", "finish", "write")
STOPPED = 75


class Profile(program.InFolder):
    def setUp(self):
        super().setUp()
        self.manifest = small_job(self.folder / "job", errors=LENIENT)  # nine samples in five shards
        self.plain = self.folder / "plain"
        self.out = self.folder / "out"
        self.file = self.folder / "traces" / "trace.json"
        self.file.parent.mkdir()

    def convert(self, *more, out=None, expect=0):
        """The standard error stream."""
        return run("convert", self.manifest, "--output", out or self.out, *more, expect=expect)[1]

    def profiled(self, *more, expect=0):
        err = self.convert("--profile", self.file, *more, expect=expect)
        self.assertIn(str(self.file), err)
        return self.trace()

    def trace(self):
        self.assertEqual(os.listdir(self.file.parent), [self.file.name])
        trace = json.loads(self.file.read_text())
        self.assertEqual(trace["displayTimeUnit"], "ms")
        self.nests(trace)
        return trace

    def nests(self, trace):
        """Every span of a thread lies in the one around it, or behind the one before; every thread has a name."""
        threads = collections.defaultdict(list)
        for event in events(trace, "X"):
            threads[event["tid"]].append(event)
        named = [event["tid"] for event in events(trace, "M", "thread_name")]
        self.assertEqual(sorted(named), sorted(threads))
        for work in threads.values():
            ends = [math.inf]
            for event in sorted(work, key=lambda event: (event["ts"], -event["dur"])):
                while event["ts"] >= ends[-1]:
                    ends.pop()
                end = event["ts"] + event["dur"]
                self.assertLessEqual(end, ends[-1] + 1e-3, event)
                ends.append(end)

    def test_every_sample_has_each_stage_once(self):
        self.convert(out=self.plain)
        planned = sorted(record["samples"] for record in records(self.plain).values())
        for threads in (1, 4):
            shutil.rmtree(self.out, ignore_errors=True)
            trace = self.profiled("--threads", threads)
            same_folder(self.out, self.plain)
            for stage in STAGES:
                work = events(trace, "X", stage)
                slots = {(event["args"]["shard"], event["args"]["slot"]) for event in work}
                self.assertEqual((len(work), len(slots)), (9, 9), stage)
                self.assertEqual(sorted(collections.Counter(shard for shard, _ in slots).values()), planned)
                self.assertEqual(len({event["args"]["sample"] for event in work}), 9)
                self.assertTrue(all(event["args"]["pixels"] == 24 * 32 for event in work))
            for event in events(trace, "X", "finish"):
                self.assertGreater(event["args"]["bytes"], 0)
            self.assertEqual(sorted(event["args"]["shard"] for event in events(trace, "X", "commit shard")),
                             shards(self.out))
            self.assertEqual(len(events(trace, "X", "write commit record")), 5)
            for once in ("load generator", "make plan", "fingerprint", "freeze plan", "make shards"):
                self.assertEqual(len(events(trace, "X", once)), 1, once)
            self.assertEqual(len(events(trace, "X", "plan source")), 2)
            self.assertLessEqual(len(events(trace, "M", "thread_name")), threads)
            for counter in ("resident memory", "samples in flight", "samples at work"):
                self.assertTrue(events(trace, "C", counter), counter)
            self.assertIn("eventgan", trace["otherData"]["program"])

    def test_the_times_are_those_of_the_run(self):
        out = run("convert", self.manifest, "--output", self.out, "--threads", "2", "--progress", "json",
                  "--profile", self.file)[0]
        report = json.loads(out.splitlines()[-1])
        trace = self.trace()
        whole = max(event["ts"] + event["dur"] for event in events(trace, "X"))
        stages = sum(event["dur"] for stage in STAGES for event in events(trace, "X", stage))
        make = events(trace, "X", "make shards")[0]["dur"]
        self.assertGreater(stages, 0)
        self.assertLessEqual(stages, 2 * make + 1)
        self.assertLessEqual(make, whole)
        self.assertLessEqual(make, 1e6 * report["wall_seconds"])
        for stage in STAGES:  # processor time, which the report counts too, a little inside
            traced = 1e-6 * sum(event["tdur"] for event in events(trace, "X", stage))
            self.assertGreaterEqual(traced, report["stage_seconds"][stage] - 1e-4, stage)

    def test_a_second_run_hashes_what_is_done(self):
        self.profiled()
        trace = self.profiled()
        hashed = events(trace, "X", "hash earlier shard")
        self.assertEqual(sorted(event["args"]["shard"] for event in hashed), shards(self.out))
        self.assertEqual(events(trace, "X", "read"), [])

    def test_a_fault_stands_where_it_arose(self):
        with broken_cars(self.folder / "job", [1]):
            trace = self.profiled()
        faults = [event for event in events(trace, "X") if "fault" in event["args"]]
        self.assertEqual([event["name"] for event in faults], ["read"])
        self.assertIn("000001.png", faults[0]["args"]["fault"])
        for stage in STAGES:
            self.assertEqual(len(events(trace, "X", stage)), 9)

        _, err = run("retry", self.out, "--profile", self.file)
        self.assertIn(str(self.file), err)
        trace = self.trace()
        for stage in STAGES:
            self.assertEqual(len(events(trace, "X", stage)), 1, stage)
        self.assertEqual(len(events(trace, "X", "commit shard")), 1)
        self.assertFalse(any(record["quarantined"] for record in records(self.out).values()))

    def test_of_a_stopped_run_up_to_there(self):
        outcome = failing_files.run(self.out, "SIGTERM write 3", "convert", self.manifest, "--output", self.out,
                                    "--threads", "1", "--profile", self.file)
        self.assertEqual(outcome.code, STOPPED, outcome.err)
        self.assertIn(str(self.file), outcome.err)
        self.assertTrue(events(self.trace(), "X", "read"))
        self.convert()
        self.convert(out=self.plain)
        same_folder(self.out, self.plain)

    def test_of_a_run_that_fails_up_to_there(self):
        outcome = failing_files.run(self.out, "ENOSPC write 5+", "convert", self.manifest, "--output", self.out,
                                    "--threads", "1", "--profile", self.file)
        self.assertEqual(outcome.code, 1, outcome.err)
        self.assertTrue(events(self.trace(), "X", "read"))

    def test_where_no_trace_can_be_nothing_is_begun(self):
        precious = self.folder / "notes.txt"
        precious.write_text("mine")
        self.plain.mkdir()
        for file in (self.folder, self.folder / "none" / "t.json", precious, self.manifest, self.out / "t.json", ""):
            with self.subTest(file=file):
                self.assertIn("--profile", self.convert("--profile", file, expect=64))
                self.assertFalse(self.out.exists())
        for out in (self.plain, f"{self.plain}/"):
            self.assertIn("outside", self.convert("--profile", self.plain / "t.json", out=out, expect=64))
        before = os.getcwd()
        os.chdir(self.plain)
        self.addCleanup(os.chdir, before)
        self.assertIn("outside", self.convert("--profile", "t.json", out=".", expect=64))
        self.assertEqual(precious.read_text(), "mine")
        self.assertEqual(os.listdir(self.plain), [])

    def test_a_trace_that_is_lost_on_the_way_costs_nothing_else(self):
        self.convert(out=self.plain)
        outcome = failing_files.run(self.file.parent, "ENOSPC write 2+", "convert", self.manifest, "--output", self.out,
                                    "--profile", self.file)
        self.assertTrue(outcome.struck)
        self.assertEqual(outcome.code, 0, outcome.err)
        self.assertIn("no trace written: ", outcome.err)
        self.assertEqual(os.listdir(self.file.parent), [])
        same_folder(self.out, self.plain)

    def test_json_for_machines(self):
        _, err = run("convert", self.manifest, "--output", self.out, "--progress", "json", "--profile", self.file)
        notes = [json.loads(line) for line in err.splitlines()]
        self.assertIn(str(self.file), notes[-1]["text"])


def events(trace, phase, name=None):
    return [event for event in trace["traceEvents"] if event["ph"] == phase and name in (None, event["name"])]


if __name__ == "__main__":
    program.main()

"""Many workers on one folder, who know of each other by its files alone: it ends whole, and as one worker makes it."""

import json
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import tempfile
import time
import unittest

import program
from folders import records, same_folder, temporaries
from program import run
from small_job import small_job

SHARDS = 14  # of the job below
OF_CLUSTERS = ("SHARD_", "SLURM_", "JOB_COMPLETION_", "OMPI_")
PATIENCE_S = 300  # far more than any of these takes; nobody waits for a dead worker


def setUpModule():
    global folder, manifest, alone
    folder = pathlib.Path(tempfile.mkdtemp(prefix="eventgan-workers-"))
    manifest = small_job(folder / "job", cars=20, people=8)
    alone = folder / "alone"
    finish(start(alone))
    run("verify", alone)
    assert len(records(alone)) == SHARDS


def tearDownModule():
    shutil.rmtree(folder)


def start(out, *arguments, variables=None, job=None):
    """A worker in a process of its own, in no cluster but that of `variables`."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(OF_CLUSTERS)}
    environment.update(variables or {})
    command = [program.PROGRAM, "convert", job or manifest, "--output", out, "--threads", "1", "--progress", "none"]
    return subprocess.Popen([*map(str, command), *map(str, arguments)], env=environment, text=True,
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def finish(*workers, expect=0):
    """Waits for the workers; what each printed, on both streams."""
    said = []
    for worker in workers:
        out, err = worker.communicate(timeout=PATIENCE_S)
        if worker.returncode != expect:
            raise AssertionError(f"expected exit code {expect}, got {worker.returncode}, of "
                                 f"{worker.args}\n{out}\n{err}")
        said.append(out + err)
    return said


def status(out):
    return json.loads(run("status", out, "--json")[0])


def shard_names():
    return sorted(records(alone))


class Workers(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(dir=folder))
        self.out = self.folder / "out"

    def assert_as_alone(self):
        run("finalize", self.out)  # which workers with a part leave to be done
        same_folder(self.out, alone)
        self.assertIn("sound", run("verify", self.out)[0])

    def test_two_with_everything(self):
        said = finish(start(self.out), start(self.out))
        self.assert_as_alone()
        for text in said:  # each has seen to all of it
            self.assertIn(f"in {SHARDS} of {SHARDS} shards", text)

    def test_four_with_overlapping_parts_while_others_look(self):
        workers = [start(self.out, "--shards", part) for part in ("0/2", "1/2", "1/3", "all")]
        looks = 0
        while any(worker.poll() is None for worker in workers):
            if (self.out / "plan.json").exists():
                now = status(self.out)
                shards = now["shards"]
                self.assertEqual(shards["done"] + shards["running"] + shards["missing"], SHARDS)
                self.assertEqual(now["damaged"], [])
                self.assertEqual(now["left_over"], [])
                looks += 1
            time.sleep(0.01)
        finish(*workers)
        self.assert_as_alone()
        self.assertTrue(status(self.out)["complete"])

    def test_four_of_four(self):
        finish(*(start(self.out, "--shards", f"{part}/4") for part in range(4)))
        self.assert_as_alone()

    def test_three_workers_for_seven_parts(self):
        waiting, workers = list(range(7)), []
        while waiting or workers:
            workers = [worker for worker in workers if worker.poll() is None or finish(worker) is None]
            while waiting and len(workers) < 3:
                workers.append(start(self.out, "--shards", f"{waiting.pop()}/7"))  # the last part first
            time.sleep(0.01)
        self.assert_as_alone()

    def test_the_only_part_of_one_is_everything(self):
        finish(start(self.out, "--shards", "0/1"))
        self.assert_as_alone()

    def test_a_part_beyond_the_plan_is_nothing_to_do(self):
        said, = finish(start(self.out, "--shards", f"{SHARDS}/{SHARDS + 1}"))
        self.assertIn(f"part {SHARDS} of {SHARDS + 1}", said)
        self.assertEqual(records(self.out), {})
        finish(start(self.out, variables={"SLURM_ARRAY_TASK_ID": "4000"}))
        self.assertEqual(records(self.out), {})
        finish(start(self.out, "--shards", "all"))
        self.assert_as_alone()

    def test_a_cluster_says_the_part(self):
        names = shard_names()
        done = set()
        for variables, shards in [
                ({"SHARD_INDEX": "3", "SHARD_COUNT": "7"}, {3, 10}),
                ({"SHARD_INDEX": "0", "SLURM_ARRAY_TASK_ID": "1"}, {0}),
                # A retry of the tasks 3 and 5: the array has two tasks now, the plan as many shards as ever.
                ({"SLURM_ARRAY_TASK_ID": "5", "SLURM_ARRAY_TASK_COUNT": "2", "SLURM_PROCID": "0"}, {5}),
                ({"JOB_COMPLETION_INDEX": "6"}, {6}),
                ({"JOB_COMPLETION_INDEX": "2", "SHARD_COUNT": "6"}, {2, 8}),
                ({"OMPI_COMM_WORLD_RANK": "1", "OMPI_COMM_WORLD_SIZE": "10"}, {1, 11}),
                ({"SLURM_PROCID": "4", "SLURM_STEP_NUM_TASKS": "9"}, {4, 13})]:
            with self.subTest(variables):
                finish(start(self.out, variables=variables))
                done |= {names[shard] for shard in shards}
                self.assertEqual(set(records(self.out)), done)
        # A batch script is no task of a step, though Slurm gives it a SLURM_PROCID.
        finish(start(self.out, variables={"SLURM_PROCID": "0", "SLURM_NTASKS": "4"}))
        self.assert_as_alone()

    def test_a_part_that_is_none_is_refused(self):
        for arguments, variables, named in [(["--shards", "4/4"], {}, "--shards"),
                                            ([], {"SHARD_INDEX": "4", "SHARD_COUNT": "4"}, "SHARD_INDEX"),
                                            ([], {"SLURM_ARRAY_TASK_ID": "one"}, "SLURM_ARRAY_TASK_ID"),
                                            ([], {"SHARD_COUNT": "4"}, "SHARD_COUNT")]:
            said, = finish(start(self.out, *arguments, variables=variables), expect=64)
            self.assertIn(named, said)
        self.assertFalse(self.out.exists())

    def test_a_race_to_freeze_the_plan_has_one_winner(self):
        # The limits for errors change no shard's samples, but each manifest's text is another one, and is in the
        # plan.
        jobs = []
        for worker in range(6):
            job = json.loads(manifest.read_text())
            job["errors"]["max_count"] = worker
            jobs.append(manifest.parent / f"race_{worker}.json")
            jobs[-1].write_text(json.dumps(job))
        finish(*(start(self.out, "--shards", f"{worker}/6", job=job) for worker, job in enumerate(jobs)))
        frozen = json.loads((self.out / "plan.json").read_text())["manifest"]
        winner, = [job for job in jobs if job.read_text() == frozen]
        by_winner = self.folder / "by_winner"
        finish(start(by_winner, job=winner))
        run("finalize", self.out)
        same_folder(self.out, by_winner)
        self.assertIn("sound", run("verify", self.out)[0])

    def test_nobody_waits_for_a_dead_worker(self):
        finish(start(self.out, "--shards", "0/2"))
        dead = self.out / f".{shard_names()[1]}.node7-4026531836.4242.0.tmp"
        dead.write_bytes(b"half a shard")
        now = status(self.out)
        self.assertEqual(now["shards"], {"planned": SHARDS, "done": 7, "running": 1, "missing": 6})
        entry, = now["running"]
        self.assertEqual((entry["shard"], entry["host"], entry["pid"], entry["writer"]),
                         (shard_names()[1], "node7-4026531836", 4242, "unknown"))
        finish(start(self.out))
        # Another host's process may live for all that is known here; after an hour of silence it does not.
        self.assertEqual(temporaries(self.out), [dead.name])
        os.utime(dead, (time.time() - 3700,) * 2)
        self.assertEqual([entry["file"] for entry in status(self.out)["left_over"]], [dead.name])
        finish(start(self.out))
        self.assert_as_alone()

    def test_nobody_waits_for_a_sleeping_worker_and_it_may_wake(self):
        sleeper = self.asleep_at_a_shard()
        try:
            finish(start(self.out))
            self.assertEqual(set(records(self.out)), set(shard_names()))
        finally:
            sleeper.send_signal(signal.SIGCONT)
        finish(sleeper)
        self.assert_as_alone()

    def asleep_at_a_shard(self):
        """A worker that was stopped while it wrote; on a busy machine one can be through before it is caught."""
        for _ in range(20):
            worker = start(self.out)
            while worker.poll() is None:
                if any(".h5." in name and f".{worker.pid}." in name for name in self.under_way()):
                    worker.send_signal(signal.SIGSTOP)
                    return worker
            finish(worker)
            shutil.rmtree(self.out)
        self.fail("no worker was caught at work")

    def under_way(self):
        return temporaries(self.out) if self.out.exists() else []


class Status(unittest.TestCase):
    def test_a_folder_without_a_plan_is_refused(self):
        for absent in (folder, folder / "absent"):
            _, err = run("status", absent, expect=66)
            self.assertIn(str(absent), err)

    def test_text(self):
        out, err = run("status", alone)
        self.assertEqual(err, "")
        self.assertIn(f"{SHARDS} of {SHARDS} done, 0 running, 0 missing", out)
        self.assertIn("28 of 28 written, 0 quarantined", out)
        self.assertIn("every shard is done", out)

    def test_what_went_wrong(self):
        out = pathlib.Path(tempfile.mkdtemp(dir=folder)) / "out"
        shutil.copytree(alone, out)
        names = shard_names()
        (out / names[0]).write_bytes(b"")
        (out / names[1]).with_suffix(".json").unlink()
        host = f"{socket.gethostname().replace('.', '_')}-{os.stat('/proc/self/ns/pid').st_ino}"
        left = out / f".{names[2]}.{host}.{self.dead_pid()}.0.tmp"
        left.touch()
        now = status(out)
        self.assertEqual(now["shards"], {"planned": SHARDS, "done": SHARDS - 2, "running": 0, "missing": 2})
        for line, name in zip(now["damaged"], names[:2], strict=True):
            self.assertIn(str(out / name.removesuffix(".h5")), line)
        self.assertEqual([(entry["file"], entry["writer"]) for entry in now["left_over"]], [(left.name, "dead")])
        self.assertEqual(now["pairs_per_second"], 0)
        self.assertIsNone(now["seconds_left"])

    @staticmethod
    def dead_pid():
        with subprocess.Popen(["true"]) as process:
            process.wait()
        return process.pid


if __name__ == "__main__":
    program.main()

"""The job files of docker/slurm in a real Slurm: stopped, cancelled, requeued, and still the bytes of a local run."""

import json
import pathlib
import re
import shlex
import shutil
import sys
import tempfile
import unittest

sys.path.append(str(pathlib.Path(__file__).parents[1] / "end_to_end"))
import folders
import moving_texture
import program
import small_job
from slurm_cluster import Cluster, SLURM, command, field, print_logs, state, wait_until, why_not

SHARDS = 4
SAMPLES_PER_SHARD = 6
HEIGHT, WIDTH = 320, 480


def slow_job(folder):
    """A manifest of SHARDS shards, seconds of work each: little data, compressed as hard as can be."""
    frames = SHARDS * SAMPLES_PER_SHARD + 1
    moving_texture.write_images(folder / "frames" / "scene", [4 * index for index in range(frames)], HEIGHT, WIDTH,
                                seed=3)
    manifest = program.manifest(
        [{"dataset": "frames", "root": "frames", "pairs": program.pairs([1])}],
        image={"width": WIDTH, "height": HEIGHT, "preset": "mpii"}, generator={"kind": "difference"},
        output={"directory": "out", "samples_per_shard": SAMPLES_PER_SHARD, "dtype": "float32", "deflate_level": 9})
    path = folder / "manifest.json"
    path.write_text(json.dumps(manifest))
    return path


def submit(*arguments):
    """Sends a job through submit.sh; the ids of its arrays and of finalize.
    The line that it advises must run as it is."""
    out = command(SLURM / "submit.sh", *arguments, EVENTGAN=program.PROGRAM)
    advised = shlex.split(re.search(r"^look: (.+)$", out, re.MULTILINE)[1])
    assert advised[:2] == [program.PROGRAM, "status"] and len(advised) == 3, out
    assert (pathlib.Path(advised[2]) / "plan.json").is_file(), out
    return re.findall(r"^array (\d+):", out, re.MULTILINE), re.search(r"^finalize (\d+):", out, re.MULTILINE)[1]


def start_soon(task):
    """Slurm lets a requeued job wait for two minutes. Not at once, since a node refuses a job that it ended in the same
    second."""
    wait_until(f"{task} pending", lambda: state(task) == "PENDING")
    command("scontrol", "update", f"JobId={task}", "StartTime=now+3seconds")


class Slurm(unittest.TestCase):
    def setUp(self):
        # A folder as people have them: scripts that do not quote, and Slurm's own %, would trip over it.
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="a job 100%j-", dir=cluster.folder))

    def finished(self, job):
        wait_until(f"{job} ended", lambda: state(job) in ("COMPLETED", "FAILED", "TIMEOUT", "NODE_FAIL"))
        self.assertEqual(state(job), "COMPLETED", self.logs())

    def logs(self):
        return "".join(f"---- {log}\n{log.read_text()}" for log in sorted(self.folder.glob("*-logs/*.log")))

    def test_an_array_with_a_cancelled_and_a_stopped_task(self):
        manifest = slow_job(self.folder)
        local, out = self.folder / "local", self.folder / "out"
        command(program.PROGRAM, "convert", manifest, "--output", local, "--progress", "none")
        command(program.PROGRAM, "finalize", local)

        # --grace 0: what is stopped drops its shard.
        (array,), finalize = submit(manifest, "--time=10", "--", "--grace", "0", "--progress", "none")
        command("scontrol", "hold", finalize)
        cancelled, stopped = f"{array}_1", f"{array}_2"
        for task in (1, 2):
            shard = f"job-train-{task:05d}-of-{SHARDS:05d}"
            wait_until(f"shard {task} begun", lambda: any(shard in name for name in folders.temporaries(out)))
        command("scancel", cancelled)
        command("scancel", "--batch", "--signal=USR1", stopped)  # as --signal does ahead of the time limit

        wait_until("the task cancelled", lambda: state(cancelled) == "CANCELLED")
        command("scontrol", "requeue", cancelled)
        start_soon(cancelled)
        start_soon(stopped)
        for task in range(SHARDS):
            self.finished(f"{array}_{task}")
            self.assertEqual(field(f"{array}_{task}", "Restarts"), str(int(task in (1, 2))))
        log = {task: (self.folder / "manifest-logs" / f"convert-{array}_{task}.log").read_text()
               for task in range(SHARDS)}
        for task, restarted in [(0, False), (1, True), (2, True), (3, False)]:
            self.assertEqual(re.findall(r"exit code (\d+)", log[task]), ["75", "0"] if restarted else ["0"], log[task])
        self.assertIn("forwards USR1", log[2])
        self.assertIn(": requeued", log[2])
        self.assertNotIn(": requeued", log[1])  # who cancels a task does not want it back

        self.assertEqual(state(finalize), "PENDING")
        command("scontrol", "release", finalize)
        self.finished(finalize)
        folders.same_folder(out, local)

    def test_more_shards_than_an_array_may_have_and_fewer_workers_than_shards(self):
        manifest = small_job.small_job(self.folder)
        arrays, finalize = submit(manifest, self.folder / "by shard")
        self.assertEqual(len(arrays), 2)  # five shards, MaxArraySize 4
        (array,), workers_finalize = submit(manifest, self.folder / "by worker", "--workers=2")
        self.finished(finalize)
        self.finished(workers_finalize)
        self.assertEqual([state(task) for task in (f"{array}_0", f"{array}_1")], ["COMPLETED"] * 2)
        self.assertTrue(json.loads(command(program.PROGRAM, "status", self.folder / "by shard", "--json"))["complete"])
        folders.same_folder(self.folder / "by worker", self.folder / "by shard")

    def test_what_would_fail_again_is_not_requeued(self):
        manifest = small_job.small_job(self.folder)
        command(program.PROGRAM, "plan", manifest, "--freeze")
        other = self.folder / "other.json"
        other.write_text(manifest.read_text().replace('"seed": 7', '"seed": 8'))
        self.fails_once(64, other, "--output", self.folder / "out")
        shutil.rmtree(self.folder / "cars" / "label_2")
        self.fails_once(66, manifest, "--output", self.folder / "new")

    def fails_once(self, code, *arguments):
        log = self.folder / f"log-{code}"
        job = command("sbatch", "--parsable", "--array=0", f"--output={log}".replace("%", "%%"),
                      SLURM / "convert.sbatch", *arguments, EVENTGAN=program.PROGRAM).strip()
        task = f"{job}_0"
        wait_until(f"{task} failed", lambda: state(task) == "FAILED")
        self.assertEqual(field(task, "ExitCode"), f"{code}:0", log.read_text())
        self.assertEqual(field(task, "Restarts"), "0")

    def test_finalize_says_what_is_missing(self):
        manifest = small_job.small_job(self.folder)
        command(program.PROGRAM, "convert", manifest, "--shards", "0/2")
        job = command("sbatch", "--parsable", f"--output={self.folder}/log".replace("%", "%%"),
                      SLURM / "finalize.sbatch", self.folder / "out", EVENTGAN=program.PROGRAM).strip()
        wait_until("finalize failed", lambda: state(job) == "FAILED")
        self.assertEqual(field(job, "ExitCode"), "1:0")
        self.assertIn("-00001-of-", (self.folder / "log").read_text())


if __name__ == "__main__":
    reason = why_not()
    if reason:
        print(f"skipped: {reason}")
        sys.exit(program.SKIPPED)
    with Cluster("MaxArraySize=4", cpus=SHARDS) as cluster:
        result = unittest.main(verbosity=2, exit=False).result
        if not result.wasSuccessful():
            print_logs(cluster.folder)
    sys.exit(not result.wasSuccessful())

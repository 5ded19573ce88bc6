"""A one-node Slurm for a test (docker/slurm/one_node_cluster.sh), and what its jobs do."""

import os
import pathlib
import re
import shutil
import signal
import subprocess
import tempfile
import time

SLURM = pathlib.Path(os.environ["EVENTGAN_SOURCE_DIR"]) / "docker" / "slurm"
PATIENCE_S = 100
LONGEST_S = 240  # of all; below ctest's limit, which would leave the daemons behind


def why_not():
    """Why there can be no cluster here; None if there can."""
    missing = [name for name in ("munged", "slurmctld", "slurmd", "sbatch", "srun") if not shutil.which(name)]
    if missing:
        return f"no {', '.join(missing)}: docker/bootstrap.sh packages slurm"
    return None if os.geteuid() == 0 else "Slurm's daemons need root"


def command(*arguments, expect=0, **variables):
    """Runs a command; its output. Fails on another exit code, and after PATIENCE_S."""
    done = subprocess.run(list(map(str, arguments)), capture_output=True, text=True, timeout=PATIENCE_S,
                          env={**os.environ, **variables})
    if done.returncode != expect:
        raise AssertionError(f"expected exit code {expect}, got {done.returncode}, of {' '.join(map(str, arguments))}\n"
                             f"{done.stdout}\n{done.stderr}")
    return done.stdout


def wait_until(what, condition):
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        if time.monotonic() > deadline:
            raise AssertionError(f"expected within {PATIENCE_S} s: {what}\n{command('scontrol', 'show', 'jobs')}")
        time.sleep(0.1)


def field(job, name):
    """Of a job ("7") or of one task of an array ("7_2"): "JobState", "Restarts", "ExitCode", ..."""
    return re.search(rf"\b{name}=(\S*)", command("scontrol", "--oneliner", "show", "job", job))[1]


def state(job):
    return field(job, "JobState")


def interrupt(number, frame):
    raise KeyboardInterrupt(f"signal {number}")  # which unittest does not take for one test's failure


class Cluster:
    """Runs while the block does, LONGEST_S at most. Its folder goes with it; an error prints the logs first."""

    def __init__(self, *settings, cpus):
        self.settings, self.cpus = settings, cpus

    def __enter__(self):
        signal.signal(signal.SIGTERM, interrupt)
        signal.signal(signal.SIGALRM, interrupt)
        signal.alarm(LONGEST_S)
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="eventgan-slurm-"))
        try:
            command(SLURM / "one_node_cluster.sh", "start", self.folder, *self.settings, CPUS=str(self.cpus))
        except BaseException as error:
            self.__exit__(type(error), error, None)
            raise
        os.environ["SLURM_CONF"] = str(self.folder / "slurm.conf")
        return self

    def __exit__(self, kind, error, trace):
        signal.alarm(0)
        if kind:
            print_logs(self.folder)
        command(SLURM / "one_node_cluster.sh", "stop", self.folder)
        os.environ.pop("SLURM_CONF", None)
        shutil.rmtree(self.folder)


def print_logs(folder):
    for log in sorted(folder.glob("*.log")):
        print(f"---- {log}\n" + log.read_text(errors="replace")[-4000:], flush=True)

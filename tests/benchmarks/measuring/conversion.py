"""Whole runs of `eventgan convert`: what they take, by stage, and what they wrote."""

import dataclasses
import hashlib
import json
import os
import subprocess
import tempfile

from measuring.cores import pin_to


@dataclasses.dataclass(frozen=True)
class Job:
    frames: str                  # folder of frames; one pair fewer
    height: int
    width: int
    weights: str = "shipped"     # as the manifest's generator.weights
    precision: str = "float32"
    dtype: str = "uint8"
    deflate_level: int = 1
    threads: int = 1
    samples_per_shard: int = 64
    preset: str = "kitti"
    generator: dict | None = None  # the manifest's, in place of weights and precision

    def manifest(self):
        return {
            "format": "eventgan-manifest", "version": 1, "name": "benchmark", "seed": 7,
            "sources": [{"dataset": "frames", "root": str(self.frames),
                         "pairs": {"gaps": [1], "side": "before", "choose": "one"}}],
            "image": {"height": self.height, "width": self.width, "fit": "stretch", "preset": self.preset},
            "generator": self.generator or {"weights": self.weights, "precision": self.precision},
            "output": {"directory": "out", "samples_per_shard": self.samples_per_shard, "dtype": self.dtype,
                       "deflate_level": self.deflate_level},
        }


@dataclasses.dataclass(frozen=True)
class Conversion:
    """What one run took."""
    pairs: int
    wall_s: float
    cpu_s: float        # of the whole process, from its start to its end
    stage_s: dict       # processor seconds by stage, as the program reports them
    peak_mb: float      # largest resident memory
    stored_bytes: int
    digest: str         # SHA-256 over the shards' bytes
    libraries: str      # with their versions, as the plan's fingerprint has them


class ConversionRefused(Exception):
    """The program does not do this job here: the last line it wrote to stderr."""


def convert(program, job, keep=None):
    """Runs a job on as many cores as it has threads; `keep(folder)` may look at the shards before they are deleted."""
    with tempfile.TemporaryDirectory(prefix="eventgan-benchmark-") as name:
        manifest = os.path.join(name, "manifest.json")
        with open(manifest, "w") as file:
            json.dump(job.manifest(), file)
        with tempfile.TemporaryFile("w+") as errors:
            process = subprocess.Popen([program, "convert", manifest, "--threads", str(job.threads), "--progress",
                                        "json"],
                                       stdout=subprocess.PIPE, stderr=errors, text=True, preexec_fn=pin_to(job.threads))
            with process.stdout:
                said = process.stdout.read()
            _, status, usage = os.wait4(process.pid, 0)  # getrusage() knows only the largest of all children
            process.returncode = os.waitstatus_to_exitcode(status)
            errors.seek(0)
            complaint = (errors.read().strip().splitlines() or ["no word"])[-1]
        if process.returncode != 0:
            raise ConversionRefused(complaint)
        report = json.loads(said.splitlines()[-1])
        folder = os.path.join(name, "out")
        with open(os.path.join(folder, "plan.json")) as file:
            fingerprint = json.load(file)["fingerprint"]
        if keep:
            keep(folder)
        return Conversion(pairs=report["written"], wall_s=report["wall_seconds"], cpu_s=usage.ru_utime + usage.ru_stime,
                          stage_s=report["stage_seconds"], peak_mb=usage.ru_maxrss * 1024 / 1e6,
                          stored_bytes=report["stored_bytes"], digest=_digest(folder),
                          libraries=fingerprint["libraries"])


def _digest(folder):
    whole = hashlib.sha256()
    for name in sorted(name for name in os.listdir(folder) if name.endswith(".h5")):
        with open(os.path.join(folder, name), "rb") as file:
            whole.update(hashlib.file_digest(file, "sha256").digest())
    return whole.hexdigest()


@dataclasses.dataclass(frozen=True)
class PairCost:
    """What one pair more takes: two runs of different length, so that neither start nor end counts."""
    wall_s: float
    cpu_s: float
    stage_s: dict


def pair_cost(few, many):
    pairs = many.pairs - few.pairs
    return PairCost(wall_s=(many.wall_s - few.wall_s) / pairs, cpu_s=(many.cpu_s - few.cpu_s) / pairs,
                    stage_s={stage: (many.stage_s[stage] - few.stage_s.get(stage, 0)) / pairs
                             for stage in many.stage_s})

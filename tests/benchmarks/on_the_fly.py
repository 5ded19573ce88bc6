"""What a training gets of volumes: made on the fly by FramePairs, or read from shards,
by one and by two workers of a DataLoader."""

import dataclasses
import os
import shutil
import sys
import time

import torch
from torch.utils.data import DataLoader, Dataset

from measuring.calibration import NotCalibrated, calibrated
from measuring.conversion import Job, convert
from measuring.frames import link_frames, original_frames, small_copies
from measuring.machine import native_precisions
from measuring.report import Part, Table
from measuring.spread import rotated, spread

WEIGHTS = "shipped:8"


@dataclasses.dataclass(frozen=True)
class Settings:
    rounds: int
    pairs: int = 64
    size: tuple = (260, 861)
    batch: int = 4


SETTINGS = {
    "full": Settings(5),
    "quick": Settings(3, pairs=32),
    "trial": Settings(1, pairs=4, size=(32, 32), batch=2),
}


class Stored(Dataset):
    """The volumes of shards, as FramePairs has its own."""

    def __init__(self, shards):
        self._shards = shards

    def __len__(self):
        return len(self._shards)

    def __getitem__(self, index):
        return torch.from_numpy(self._shards[index]["volume"]), index


def pairs_a_second(dataset, batch, workers):
    """Of the second epoch: in the first the workers start."""
    loader = DataLoader(dataset, batch, num_workers=workers, persistent_workers=True, multiprocessing_context="spawn")
    for _ in range(2):
        start = time.perf_counter()
        for _ in loader:
            pass
        seconds = time.perf_counter() - start
    return len(dataset) / seconds


def measure(bench):
    settings = SETTINGS[bench.effort]
    sys.path.insert(0, str(bench.build / "python"))
    try:
        from eventgan import Generator, Shards
    except ImportError as error:
        return Part([], {"on_the_fly": str(error)})
    from eventgan.torch import FramePairs, HalfVolumes

    originals, _ = original_frames(bench)
    folders = {"as they are": link_frames(bench.scratch / "frames", originals, settings.pairs + 1)}
    small = small_copies(bench.scratch / "small", originals, *settings.size)
    folders["of the volume's size"] = link_frames(bench.scratch / "small-frames", small, settings.pairs + 1)
    sources = {name: [(a, b, i) for i, (a, b) in enumerate(zip(frames, frames[1:]))]
               for name, frames in ((name, sorted(folder.iterdir())) for name, folder in folders.items())}

    datasets, jobs, missing = {}, {}, {}
    for precision in [each for each in native_precisions() if each != "float32"] or ["float32"]:
        try:
            weights = calibrated(bench, WEIGHTS, settings.size) if precision == "int8" else WEIGHTS
        except NotCalibrated as fault:
            missing[precision] = str(fault)
            continue
        generator = Generator(weights, precision=precision, size=settings.size, preset="kitti")
        datasets |= {f"FramePairs, {precision}, images {name}": FramePairs(generator, source)
                     for name, source in sources.items()}
        jobs[f"convert, {precision}, images as they are"] = Job(folders["as they are"], *settings.size,
                                                                              weights, precision)
    stored = bench.scratch / "shards"
    convert(bench.program, next(iter(jobs.values())), lambda folder: shutil.copytree(folder, stored))
    datasets["Shards, uint8, deflate level 1"] = Stored(Shards(stored, fields=["volume"], partial=True))
    datasets |= {f"{name}, HalfVolumes": HalfVolumes(dataset) for name, dataset in datasets.items()
                 if not name.endswith("of the volume's size")}

    os.environ.pop("OMP_NUM_THREADS", None)  # for the workers
    contenders = {name: lambda workers, dataset=dataset: pairs_a_second(dataset, settings.batch, workers)
                  for name, dataset in datasets.items()}

    def conversion(job, threads):
        done = convert(bench.program, dataclasses.replace(job, threads=threads))
        return done.pairs / done.wall_s

    contenders |= {name: lambda threads, job=job: conversion(job, threads) for name, job in jobs.items()}
    found = {(name, workers): [] for name in contenders for workers in (1, 2)}
    for turn in range(settings.rounds):
        for name, workers in rotated(list(found), turn):
            found[name, workers].append(contenders[name](workers))

    table = Table("on_the_fly", ["volumes", "one worker, pairs a second", "two workers, pairs a second", "times one's"])
    for name in contenders:
        one, two = found[name, 1], found[name, 2]
        table.add(name, spread(one), spread(two), spread([b / a for a, b in zip(one, two)]))
    return Part([table], missing)

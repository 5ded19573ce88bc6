"""v2e's emulator beside the project's models and network: time from two frames to a volume, and the scores of `eventgan
realism`. v2e runs without noise, as the models do, and without SuperSloMo, whose time would be added.

The checkout's folder `stubs`, if there is one, stands in for packages that are not installed.
"""

import atexit
import dataclasses
import functools
import itertools
import json
import math
import pathlib
import re
import statistics
import subprocess
import sys
import time
import warnings

import h5py
import numpy as np
import PIL.Image
import torch

from measuring.bench import DATA
from measuring.calibration import NotCalibrated, calibrated
from measuring.conversion import Job, convert, pair_cost
from measuring.frames import link_frames, original_frames, small_copies
from measuring.machine import native_precisions
from measuring.realism_scores import event_volume, normalized, scores
from measuring.report import Part, Table
from measuring.spread import rotated, spread
from storage import Read

FRAME_S = 0.1            # between frames of KITTI
SPREAD_SHARE = 0.15      # of a threshold over the pixels: v2e's 0.03 of 0.2, and realism's
LOG_EPSILON = 0.02       # realism's, and the next
ESIM_DISPLACEMENT_PX = 5
LOWEST_THRESHOLD, HIGHEST_THRESHOLD = 0.01, 5
FIT_STEPS, FIT_TOLERANCE = 16, 0.005
PRESET = "mpii"          # kitti's would blur the frames
AGREEMENT = 2e-3         # of NumPy's scores with realism's: the network's engines round differently
V2E_MODES = {"v2e, pair by pair": {}, "v2e, as one video": {"video": True}, "v2e, pair by pair, blended": {"steps": 8}}


@dataclasses.dataclass(frozen=True)
class Settings:
    rounds: int
    few: int          # pairs of the short run, not timed
    many: int         # pairs of the long run
    size: tuple       # height, width
    thresholds: list  # at which the models are timed
    weights: list
    recordings: dict  # file in DATA and part of it, by name: what the shipped weights were not trained on


HELD_OUT = {  # the validation of manifests/weights/train-8.json
    "slider_depth": ("davis/slider_depth_mvsec_layout.hdf5", "1:2"),
    "evbench_seq1": ("recordings/evbench_seq1.hdf5", "15:19"),
    "evbench_seq3": ("recordings/evbench_seq3.hdf5", "12:15"),
    "emlb_demo01": ("recordings/emlb_demo01.hdf5", "0:12"),
    "eslnet_cups": ("recordings/eslnet_cups.hdf5", "22:29"),
    "hsergb_waterbomb": ("recordings/hsergb_waterbomb.hdf5", "18:24"),
}
SLIDER = {"slider_depth": HELD_OUT["slider_depth"]}
SETTINGS = {
    "full": Settings(5, 5, 25, (260, 861), [0.2, 0.5], ["shipped:8", "shipped:16"], HELD_OUT),
    "quick": Settings(3, 3, 13, (260, 861), [0.2, 0.5], ["shipped:8", "shipped:16"], SLIDER),
    "trial": Settings(1, 1, 3, (64, 96), [0.2], ["shipped:8"], SLIDER),
}


@dataclasses.dataclass(frozen=True)
class Emulated:
    events: int
    volume: np.ndarray  # [2 bins, y, x] float32, counts
    emulation_s: float  # processor seconds; of the first pair of a video, and of each pair by itself, both frames
    volume_s: float


def emulate(frames, times_s, threshold, video=False, steps=1):
    """Emulated of each pair of neighbours. `video`: the levels of one pair are where the one before left them; `steps`:
    frames that a pair is given in, all but the last blended from both."""
    from v2ecore.emulator import EventEmulator
    torch.manual_seed(0)
    emulator = None
    for previous, following in itertools.pairwise(range(len(frames))):
        start = time.process_time()
        if emulator is None or not video:
            emulator = EventEmulator(pos_thres=threshold, neg_thres=threshold, sigma_thres=SPREAD_SHARE * threshold,
                                     leak_rate_hz=0,
                                     device="cpu", output_height=frames.shape[1], output_width=frames.shape[2])
            atexit.unregister(emulator.cleanup)  # it would keep every emulator in memory
            emulator.generate_events(frames[previous], 0)  # it takes its first frame for one at 0, whatever it is told
            start_s = times_s[previous]
        parts = []
        for share in np.linspace(0, 1, steps + 1, dtype=np.float32)[1:]:
            frame = frames[following] if share == 1 else (1 - share) * frames[previous] + share * frames[following]
            made = emulator.generate_events(frame,
                                            (1 - share) * times_s[previous] + share * times_s[following] - start_s)
            if made is not None:
                parts.append(made)
        events = parts[0] if len(parts) == 1 else np.concatenate([np.empty((0, 4), np.float32), *parts])
        emulated = time.process_time()
        volume = event_volume(events, frames.shape[1:])
        yield Emulated(len(events), volume, emulated - start, time.process_time() - emulated)


def fitted(frames, times_s, wanted, video=False, steps=1):
    """The threshold with which v2e makes as many events as the camera, by bisection, as `realism` fits its models.
    `steps` do not change it: how often a level is crossed depends on the frames of the pair alone."""
    low, high = LOWEST_THRESHOLD, HIGHEST_THRESHOLD
    for _ in range(FIT_STEPS):
        middle = math.sqrt(low * high)
        made = sum(one.events for one in emulate(frames, times_s, middle, video))
        if abs(made - wanted) <= FIT_TOLERANCE * wanted:
            break
        low, high = (middle, high) if made > wanted else (low, middle)
    return middle


def save_images(folder, frames):
    """The files, in order."""
    files = [folder / f"{index:06d}.png" for index in range(len(frames))]
    for file, frame in zip(files, frames):
        PIL.Image.fromarray(frame).save(file)
    return files


def simulated_job(folder, size, kind, threshold):
    sensor = {"positive_threshold": threshold, "negative_threshold": threshold,
              "threshold_spread": SPREAD_SHARE * threshold, "log_epsilon": LOG_EPSILON}
    motion = {"max_displacement_px": ESIM_DISPLACEMENT_PX} if kind == "esim" else {}
    return Job(folder, *size, preset=PRESET, generator={"kind": kind, "sensor": sensor} | motion)


def network_jobs(bench, settings, folder, size, refused):
    """The network's, by name; int8 calibrated on KITTI's frames at that size. Adds to `refused` why one is missing."""
    jobs = {}
    for weights, precision in itertools.product(settings.weights, native_precisions()):
        try:
            prepared = calibrated(bench, weights, size) if precision == "int8" else weights
            jobs[f"{weights} {precision}"] = Job(folder, *size, prepared, precision, dtype="float32", preset=PRESET)
        except NotCalibrated as fault:
            refused[f"{weights} {precision}"] = str(fault)
    return jobs


@dataclasses.dataclass(frozen=True)
class Cost:
    """Of a pair, processor seconds."""
    whole_s: float
    volume_s: float | None  # of it putting the events into the volume, where that is apart
    events: float | None    # None: the network makes none


def cost_of_v2e(settings, folders, threshold, mode):
    frames = np.stack([np.asarray(PIL.Image.open(path), np.float32) for path in sorted(folders[1].iterdir())])
    each = emulate(frames, FRAME_S * np.arange(len(frames)), threshold, **mode)
    # kept, each volume would need new pages
    made = [dataclasses.replace(one, volume=None) for one in each][settings.few:]
    volume_s = statistics.fmean(one.volume_s for one in made)
    return Cost(volume_s + statistics.fmean(one.emulation_s for one in made), volume_s,
                statistics.fmean(one.events for one in made))


def cost_of_job(bench, folders, job):
    counted = []

    def count(output):
        shard, = pathlib.Path(output).glob("*-of-*.h5")
        with h5py.File(shard) as file:
            counted.append(sum(file[f"events/statistics/sum_{polarity}"][:].mean()
                               for polarity in ("positive", "negative")))

    few, many = (convert(bench.program, dataclasses.replace(job, frames=folder), count) for folder in folders)
    return Cost(pair_cost(few, many).stage_s["generate"], None, counted[-1] if job.generator else None)


def call_of(job):
    """eventgan.Generator of a job, in this process; None where the module is not built."""
    try:
        from eventgan import Generator
    except ImportError:
        return None
    manifest = job.manifest()
    with warnings.catch_warnings(action="ignore"):  # of stand-in weights
        settings = manifest["generator"]
        if settings.get("kind", "network") == "network":
            settings = {"precision": "float32", **settings}  # the program's default, not Python's
        return Generator(**settings, preset=job.preset, seed=manifest["seed"])


def cost_of_call(settings, folders, generator, job):
    frames = [np.asarray(PIL.Image.open(path)) for path in sorted(folders[1].iterdir())]
    seconds, events = [], []
    for previous, following in itertools.pairwise(frames):
        start = time.process_time()
        volume = generator(previous, following)
        seconds.append(time.process_time() - start)
        events.append(volume.sum(dtype=np.float64))
    return Cost(statistics.fmean(seconds[settings.few:]), None, statistics.fmean(events) if job.generator else None)


def add_times(table, bench, settings, what, images, refused):
    """`images`: files of one size, in order."""
    size = PIL.Image.open(images[0]).size[::-1]
    scratch = bench.folder(f"times-{size[0]}x{size[1]}")
    folders = [link_frames(scratch / f"frames-{pairs}", images, pairs + 1) for pairs in (settings.few, settings.many)]
    contenders = {f"{name}, threshold {threshold}": functools.partial(cost_of_v2e, settings, folders, threshold, mode)
                  for threshold in settings.thresholds for name, mode in V2E_MODES.items()}
    jobs = {f"{kind}, threshold {threshold}": simulated_job(folders[0], size, kind, threshold)
            for threshold in settings.thresholds for kind in ("difference", "esim")}
    jobs |= network_jobs(bench, settings, folders[0], size, refused)
    for name, job in jobs.items():
        contenders[name] = functools.partial(cost_of_job, bench, folders, job)
        if generator := call_of(job):
            contenders[f"{name}, by eventgan.Generator"] = functools.partial(cost_of_call, settings, folders, generator,
                                                                             job)

    costs = {name: [] for name in contenders}
    for turn in range(settings.rounds):
        for name in rotated(list(contenders), turn):
            costs[name].append(contenders[name]())
    first = next(iter(costs.values()))
    for name, rounds in costs.items():
        table.add(what, f"{size[0]}x{size[1]}", name, spread([1e3 * one.whole_s for one in rounds]),
                  "" if rounds[0].volume_s is None else 1e3 * spread([one.volume_s for one in rounds]).median,
                  "" if rounds[0].events is None else round(rounds[0].events),
                  spread([base.whole_s / one.whole_s for base, one in zip(first, rounds)]))


def time_table(bench, settings, refused):
    table = Table("v2e_times", ["frames", "size", "made by", "ms a pair", "of it the volume", "events a pair",
                                "times the first row's speed"])
    originals, what = original_frames(bench)
    add_times(table, bench, settings, what, small_copies(bench.scratch / "copies", originals, *settings.size), refused)
    slider = DATA / SLIDER["slider_depth"][0]
    if slider.exists():
        with h5py.File(slider) as file:
            images = save_images(bench.folder("slider"), file["davis/left/image_raw"])
        add_times(table, bench, settings, "slider_depth", images, refused)
    return table


@dataclasses.dataclass(frozen=True)
class Recorded:
    frames: np.ndarray   # [frame, y, x] uint8
    times_s: np.ndarray
    volumes: list        # of each pair of neighbours: V-hat [2 bins, y, x]
    events: int


def read_recording(path, part):
    first, last = map(int, part.split(":"))
    with h5py.File(path) as file:
        camera = file["davis/left"]
        times_s = camera["image_raw_ts"][first:last + 1]
        bounds = np.searchsorted(camera["events"][:, 2], times_s, side="right")
        events = [camera["events"][begin:end][:, [2, 0, 1, 3]] for begin, end in itertools.pairwise(bounds)]
        frames = camera["image_raw"][first:last + 1]
    volumes = [normalized(event_volume(one, frames.shape[1:])) for one in events]
    return Recorded(frames, times_s, volumes, bounds[-1] - bounds[0])


def mean_scores(volumes, recorded):
    each = [scores(*one)
            for one in zip(volumes, recorded.volumes, recorded.frames[:-1], recorded.frames[1:], strict=True)]
    return {key: np.nanmean([one[key] for one in each]) for key in each[0]}


def realism(bench, path, part, *more):
    """(means of the scores, its settings) by method, and of the real volumes."""
    done = subprocess.run([bench.program, "realism", path, "--frames", part, "--threads", "1", "--json", "--progress",
                           "none", *more],
                          capture_output=True, text=True, check=True)
    recording, = json.loads(done.stdout)["recordings"]
    return {one["name"]: (one["mean"], one["settings"])
            for one in [recording["real"] | {"name": "real"}, *recording["methods"]]}


def check_agreement(numpys, program, what):
    for key, value in numpys.items():
        if not abs(value - program[key]) <= AGREEMENT:
            raise SystemExit(f"expected {key} {program[key]} as `eventgan realism` has it, got {value} from NumPy, "
                             f"of {what}")


def recording_scores(bench, settings, name, refused):
    """Scores and threshold by contender."""
    path, part = settings.recordings[name]
    recorded = read_recording(DATA / path, part)
    folder = bench.folder(f"recording-{name}")
    save_images(folder, recorded.frames)

    models = realism(bench, DATA / path, part, "--with", "difference,esim")
    real = mean_scores(recorded.volumes, recorded)
    check_agreement(real, models["real"][0], f"the camera's volumes of {name}")
    found = {"real": (real, "")}
    for v2e_name, mode in V2E_MODES.items():
        threshold = fitted(recorded.frames.astype(np.float32), recorded.times_s, recorded.events, **mode)
        made = emulate(recorded.frames.astype(np.float32), recorded.times_s, threshold, **mode)
        found[v2e_name] = (mean_scores([normalized(one.volume) for one in made], recorded), threshold)
    for kind in ("difference", "esim"):
        means, its_settings = models[kind]
        found[kind] = (means, float(re.search(r"contrast threshold (\S+)", its_settings)[1]))
    for job_name, job in network_jobs(bench, settings, folder, recorded.frames.shape[1:], refused).items():
        read = Read()
        convert(bench.program, job, read)
        found[job_name] = (mean_scores(read.volumes, recorded), "")
        if job.precision == "float32":
            network, _ = realism(bench, DATA / path, part, "--with", "network", "--weights", job.weights)["network"]
            check_agreement(found[job_name][0], network, f"{job_name} of {name}")
    return found


SCORES = {"f1_raw": "F1 voxels", "f1_time": "F1 over time", "f1_time_polarity": "F1 over time and polarity",
          "pool_mse_2": "PoolMSE 2", "pool_mse_4": "PoolMSE 4", "time_correlation": "mean times",
          "polarity_correlation": "polarity",
          "events_per_pixel": "events per pixel", "positive_share": "positive share"}


def score_table(bench, settings, refused):
    """Of each recording, and the means over them."""
    at_hand = [name for name, (path, _) in settings.recordings.items() if (DATA / path).exists()]
    refused |= {f"scores on {name}": f"no {DATA / settings.recordings[name][0]}" for name in settings.recordings
                if name not in at_hand}
    found = {name: recording_scores(bench, settings, name, refused) for name in at_hand}
    table = Table("v2e_scores", ["recording", "frames", "made by", "threshold", *SCORES.values()])
    for name, contenders in found.items():
        for contender, (means, threshold) in contenders.items():
            table.add(name, settings.recordings[name][1], contender, threshold,
                      *(float(means[key]) for key in SCORES))
    for contender in next(iter(found.values()), {}):
        table.add("mean", "", contender, "",
                  *(float(np.mean([one[contender][0][key] for one in found.values()])) for key in SCORES))
    return table


def measure(bench):
    settings = SETTINGS[bench.effort]
    if bench.v2e is None or not (bench.v2e / "v2ecore").is_dir():
        return Part([], {"v2e": f"expected a checkout of SensorsINI/v2e with v2ecore, got none, in {bench.v2e}"})
    # at the end: installed packages come first
    sys.path += [str(bench.build / "python"), str(bench.v2e), str(bench.v2e / "stubs")]
    torch.set_num_threads(1)
    refused = {}
    return Part([time_table(bench, settings, refused), score_table(bench, settings, refused)], refused)

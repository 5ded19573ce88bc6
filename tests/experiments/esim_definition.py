#!/usr/bin/python3
"""`eventgan simulate` against ESIM's definition: of the same frames, events where log intensity, linear from frame to
frame, is a threshold away from the last event's (0.2 either way, no refractory time, no noise).

    tests/experiments/esim_definition.py --program build/release/eventgan --slider slider_depth/images --peers peers \\
        --out conformance

writes OUT/esim_definition.csv. `difference` is that definition; `stills` and `affine` move the scene between frames, so
theirs differ from it on purpose. The share of other counts is of pixels by polarity.
"""

import argparse
import csv
import itertools
import json
import pathlib
import subprocess
import sys
import time

import h5py
import numpy as np
import PIL.Image

THRESHOLD, LOG_EPSILON = 0.2, 0.001
TIE = 1e-6  # so near the next event, or just after one, at a frame rounding decides
SENSOR = {"positive_threshold": THRESHOLD, "negative_threshold": THRESHOLD, "threshold_spread": 0,
          "log_epsilon": LOG_EPSILON}
FRAMES_PER_SECOND = 20
HEIGHT, WIDTH, FRAMES = 180, 240, 21
SIZE = {"width": WIDTH, "height": HEIGHT}
ROUNDS = 3  # of which the fastest counts
COLUMNS = ["frames", "made by", "events", "÷ the definition's", "of other count", "largest time apart, us",
           "mean time apart, us", "events a second"]


def esim(frames, times_s):
    """Events [N, 4] of x, y, t in seconds, polarity -1 or +1, of frames uint8 [F, H, W] (Rebecq et al., ESIM, 2018),
    and bool [H, W] of pixels whose events hang on rounding, as where one event up is followed by the grey level before.
    """
    logs = np.log(frames / 255 + LOG_EPSILON)
    level, events, tied = logs[0].copy(), [np.empty((0, 4))], np.zeros(logs.shape[1:], bool)
    for (start, end), (before, after) in zip(itertools.pairwise(times_s), itertools.pairwise(logs)):
        while True:
            away = np.abs(after - level)
            tied |= np.abs(away - THRESHOLD) < TIE
            y, x = np.nonzero(away >= THRESHOLD)
            if not len(y):
                break
            polarity = np.sign(after - level)[y, x]
            level[y, x] += polarity * THRESHOLD
            part = (level[y, x] - before[y, x]) / (after[y, x] - before[y, x])
            events.append(np.column_stack([x, y, start + part * (end - start), polarity]))
    return np.concatenate(events), tied


def in_groups(events, size):
    """Of events the pixel by polarity, and its times in order."""
    height, width = size
    x, y, t, polarity = events.T
    group = ((polarity > 0) * height + y.astype(int)) * width + x.astype(int)
    order = np.lexsort([t, group])
    return group[order], t[order]


def difference_of(made, defined, tied):
    """Of the pixels that are not tied how many have other counts, by polarity; and of the rest the events' differences
    in time, in seconds."""
    (group, t), (defined_group, defined_t) = in_groups(made, tied.shape), in_groups(defined, tied.shape)
    counts, defined_counts = (np.bincount(one, minlength=2 * tied.size) for one in (group, defined_group))
    untied = ~np.tile(tied.ravel(), 2)
    same = untied & (counts == defined_counts)
    return np.count_nonzero(untied & ~same), np.abs(t[same[group]] - defined_t[same[defined_group]])


def simulate(program, folder, source):
    """Frames, times, events and px a frame of a source of `simulate`."""
    folder.mkdir(parents=True, exist_ok=True)
    manifest = folder / f"{source['method']}.json"
    manifest.write_text(json.dumps({
        "format": "eventgan-simulation", "version": 1, "name": "conformance", "seed": 1, "sensor": SENSOR,
        "size": source["size"], "sources": [{key: value for key, value in source.items() if key != "size"}],
        "output": {"directory": source["method"]}}))
    subprocess.run([program, "simulate", manifest, "--progress", "none"], check=True, stdout=subprocess.DEVNULL)
    path, = (folder / source["method"]).glob("*.hdf5")
    with h5py.File(path) as file:
        camera = file["davis/left"]
        px = np.hypot(*np.moveaxis(camera["flow_dist"][:], 1, 0)).mean() if "flow_dist" in camera else 0
        return camera["image_raw"][:], camera["image_raw_ts"][:], camera["events"][:], px


def texture(height, width, seed):
    """Soft noise at scales of 4 to 32 px: uint8 [height, width]."""
    random = np.random.default_rng(seed)
    total = sum(np.asarray(PIL.Image.fromarray(random.standard_normal((height // px + 2, width // px + 2))
                                               .astype(np.float32)).resize((width + 2 * px, height + 2 * px),
                                                                           PIL.Image.BICUBIC))[:height, :width]
                for px in (4, 8, 16, 32))
    return np.round(20 + 215 * (total - total.min()) / np.ptp(total)).astype(np.uint8)


def layers(folder, most_px):
    """A source of `simulate`: a photograph before which two boxes of its own move."""
    (folder / "labels").mkdir(parents=True)
    (folder / "photos").mkdir()
    PIL.Image.fromarray(texture(HEIGHT, WIDTH, 1)).save(folder / "photos" / "a.png")
    (folder / "labels" / "a.txt").write_text("0 0.3 0.4 0.2 0.4\n0 0.7 0.6 0.2 0.3\n")
    (folder / "labels" / "classes.txt").write_text("thing\n")
    moves = {"translation_px": [most_px / 2, most_px], "rotation_deg": 0, "scale": 0}
    manifest = {
        "format": "eventgan-manifest", "version": 1, "name": "layers", "seed": 1, "generator": {"kind": "esim"},
        "image": {**SIZE, "fit": "crop", "preset": "mpii"},
        "sources": [{"dataset": "frames", "root": "photos", "labels": {"format": "yolo", "path": "labels"},
                     "pairs": {"from": "stills", "frames": FRAMES, "side": "before",
                               "motion": {**moves, "objects": moves}}}],
        "output": {"directory": "unused"}}
    (folder / "layers.json").write_text(json.dumps(manifest))
    return {"method": "stills", "path": str(folder / "layers.json"), "size": SIZE}


def affine(folder, most_px):
    """A source of `simulate`: one image in one affine motion."""
    folder.mkdir(parents=True)
    PIL.Image.fromarray(texture(HEIGHT, WIDTH, 2)).save(folder / "a.png")
    return {"method": "affine", "path": str(folder), "frames_per_image": FRAMES,
            "max_displacement_px": most_px, "frames_per_second": FRAMES_PER_SECOND, "size": SIZE}


def difference(folder, frames):
    """A source of `simulate`: these frames as they are."""
    folder.mkdir(parents=True)
    for index, frame in enumerate(frames):
        PIL.Image.fromarray(frame).save(folder / f"{index:04d}.png")
    return {"method": "difference", "path": str(folder), "frames_per_second": FRAMES_PER_SECOND,
            "size": {"width": frames.shape[2], "height": frames.shape[1]}}


def rate(make):
    """Events a second of processor time, of a function that returns how many it made."""
    rates = []
    for _ in range(ROUNDS):
        start = time.process_time()
        rates.append(make() / (time.process_time() - start))
    return f"{max(rates):.2g}"


def rate_of(frames):
    """That of `difference` in eventgan.Generator, from pairs of frames to volumes."""
    from eventgan import Generator
    generator = Generator(kind="difference", sensor=SENSOR, preset="mpii", seed=1)  # mpii's frames stay as they are
    return rate(lambda: sum(generator(*pair).sum(dtype=float) for pair in itertools.pairwise(frames)))


def v2e(peers, frames, times_s):
    sys.path += [str(peers / "v2e"), str(peers / "v2e" / "stubs")]
    import torch
    from v2ecore.emulator import EventEmulator
    torch.set_num_threads(1)
    made = []

    def emulate():
        emulator = EventEmulator(pos_thres=THRESHOLD, neg_thres=THRESHOLD, sigma_thres=0, leak_rate_hz=0, device="cpu",
                                 output_height=frames.shape[1], output_width=frames.shape[2])
        made[:] = [emulator.generate_events(frame, t_s) for frame, t_s in zip(frames.astype(np.float32), times_s)]
        return sum(len(one) for one in made if one is not None)

    a_second = rate(emulate)
    return np.concatenate([one for one in made if one is not None])[:, [1, 2, 0, 3]].astype(float), a_second


def row(what, maker, events, a_second, defined, tied):
    others, apart_s = difference_of(events, defined, tied)
    return [what, maker, len(events), round(len(events) / len(defined), 3),
            round(others / np.count_nonzero(~tied) / 2, 4), f"{1e6 * apart_s.max(initial=0):.2g}",
            f"{1e6 * apart_s.mean():.2g}", a_second or ""]


def rows(program, folder, clips, frames, peers=None):
    """The table's. `clips`: (source, largest motion) by name; `frames`: uint8 [F, H, W] by name. Rates with `peers`."""
    seen = {}
    for name, (source, most_px) in clips.items():
        source = source(folder / name / "source", most_px)
        images, _, events, px = simulate(program, folder / name, source)
        seen[f"{name}, {px:.2g} px a frame"] = (images, source["method"], events)
    for what, (images, *made) in {**{name: [one] for name, one in frames.items()}, **seen}.items():
        read, times_s, events, _ = simulate(program, folder / what, difference(folder / what / "frames", images))
        assert np.array_equal(read, images), what
        defined, tied = esim(images, times_s)
        is_slow = what.startswith("slow")  # pairs of these begin anew, and have few events
        yield row(what, "difference", events, peers and not is_slow and rate_of(images), defined, tied)
        if made:
            yield row(what, *made, "", defined, tied)
        if peers:
            yield row(what, "v2e", *v2e(peers, images, times_s), defined, tied)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", type=pathlib.Path, required=True, help="the eventgan program")
    parser.add_argument("--slider", type=pathlib.Path, help="slider_depth's folder of frames; default: without")
    parser.add_argument("--peers", type=pathlib.Path, help="a folder with a checkout of v2e; default: without")
    parser.add_argument("--out", type=pathlib.Path, required=True, help="a new folder")
    args = parser.parse_args()
    args.out = args.out.resolve()
    args.out.mkdir(parents=True)
    frames = {} if not args.slider else {"slider_depth": np.stack([np.asarray(PIL.Image.open(path))
                                                                   for path in sorted(args.slider.iterdir())])}
    with open(args.out / "esim_definition.csv", "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerows([COLUMNS, *rows(args.program, args.out, CLIPS, frames, args.peers)])


CLIPS = {"layers": (layers, 4), "slow layers": (layers, 0.9), "image": (affine, 20), "slow image": (affine, 4)}

if __name__ == "__main__":
    main()

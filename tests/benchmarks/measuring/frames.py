"""Folders of frames to convert: KITTI's where they are at hand, else those of `eventgan make-demo`."""

import subprocess

import numpy as np
import PIL.Image

from measuring.bench import DATA


def original_frames(bench):
    """Frames in order, and what they are."""
    real = sorted(DATA.glob("kitti_raw/*/*/image_02/data/*.png"))
    if real:
        return real, f"{len(real)} real frames of KITTI raw, 1242x375"
    demo = bench.scratch / "demo"
    if not demo.exists():
        subprocess.run([bench.program, "make-demo", demo], check=True, stdout=subprocess.DEVNULL)
    made = sorted(max((list(folder.glob("*.jpg")) for folder in demo.rglob("*") if folder.is_dir()), key=len))
    return made, f"{len(made)} made-up frames of `eventgan make-demo`, {PIL.Image.open(made[0]).width} pixels wide"


def link_frames(folder, originals, count):
    """`count` links to the originals, to their end, back to their start and so on,
    so that neighbours are neighbours in time."""
    folder.mkdir(parents=True)
    there_and_back = list(originals) + list(originals[-2:0:-1])
    for index in range(count):
        original = there_and_back[index % len(there_and_back)]
        (folder / f"{index:06d}{original.suffix}").symlink_to(original)
    return folder


def frames_to_calibrate_on(bench):
    """All but those of write_input, on which the error is taken."""
    return original_frames(bench)[0][:-2]


def write_input(bench, size):
    """The last two frames as a generator's input: [2, y, x] float32 in [-1, 1], raw; the file."""
    height, width = size
    path = bench.scratch / f"input-{height}x{width}.raw"
    originals, _ = original_frames(bench)
    images = [PIL.Image.open(frame).convert("L").resize((width, height), PIL.Image.BILINEAR)
              for frame in originals[-2:]]
    (np.stack(images).astype(np.float32) / 127.5 - 1).tofile(path)
    return path


def small_copies(folder, originals, height, width):
    """The originals made small once, so that decoding does not outweigh a small network."""
    folder.mkdir(parents=True)
    copies = []
    for index, original in enumerate(originals):
        copies.append(folder / f"{index:06d}.png")
        PIL.Image.open(original).convert("L").resize((width, height), PIL.Image.BILINEAR).save(copies[-1])
    return copies


def fainter_copies(folder, originals, contrast):
    """The originals in grey, their distance from mid-grey multiplied with `contrast` below 1."""
    folder.mkdir(parents=True)
    copies = []
    for index, original in enumerate(originals):
        copies.append(folder / f"{index:06d}.png")
        PIL.Image.open(original).convert("L").point(lambda level: round(127.5 + (level - 127.5) * contrast)).save(
            copies[-1])
    return copies

"""A job that takes a blink: a few tiny images with boxes and with persons, made into small shards without a network."""

import contextlib
import json
import shutil

import numpy as np
import PIL.Image

import program

HEIGHT, WIDTH = 24, 32  # of the images and of the volumes
JOINTS = 16
# the manifest's `errors`: anything may be quarantined
LENIENT = {"policy": "quarantine", "max_count": 99, "max_fraction": 1}


def small_job(folder, cars=5, people=4, samples_per_shard=2, **changes):
    """Writes images and a manifest below `folder`; the manifest's path.

    The plan has ceil(cars / samples_per_shard) shards with boxes, then ceil(people / samples_per_shard) with persons:
    five with the values above. `changes` replace the manifest's keys; its output folder is FOLDER/out.
    """
    folder.mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng(7)
    sources = []
    if cars:
        write_cars(folder / "cars", cars, random)
        sources.append({"dataset": "kitti_object", "root": "cars", "pairs": program.pairs([1, 2, 3])})
    if people:
        write_people(folder / "people", people, random)
        sources.append({"dataset": "mpii_list", "root": "people", "annotations": "people/people.json",
                        "sequences": "people/sequences",
                        "pairs": program.pairs([2, 4], side="around")})
    defaults = {"name": "small", "image": {"width": WIDTH, "height": HEIGHT, "preset": "mpii"},
                "generator": {"kind": "difference"},
                "output": {"directory": "out", "samples_per_shard": samples_per_shard}}
    path = folder / "manifest.json"
    path.write_text(json.dumps(program.manifest(sources, **{**defaults, **changes})))
    return path


def save_image(path, random):
    path.parent.mkdir(parents=True, exist_ok=True)
    PIL.Image.fromarray(random.integers(0, 256, (HEIGHT, WIDTH), dtype=np.uint8)).save(path)


@contextlib.contextmanager
def broken_cars(folder, numbers):
    """Cuts the images of these cars short for a while."""
    images = [folder / "cars" / "image_2" / f"{k:06d}.png" for k in numbers]
    whole = [image.read_bytes() for image in images]
    for image, data in zip(images, whole):
        image.write_bytes(data[:-20])
    yield
    for image, data in zip(images, whole):
        image.write_bytes(data)


def write_cars(root, count, random):
    """KITTI's layout: image k has k % 3 cars."""
    (root / "label_2").mkdir(parents=True)
    for k in range(count):
        save_image(root / "image_2" / f"{k:06d}.png", random)
        for step in (1, 2, 3):
            save_image(root / "prev_2" / f"{k:06d}_{step:02d}.png", random)
        cars = [f"Car 0.00 0 0.10 {2 + n}.00 3.00 {12 + n}.50 20.00 1.5 1.6 3.9 1.0 1.5 10.0 0.2\n"
                for n in range(k % 3)]
        (root / "label_2" / f"{k:06d}.txt").write_text("".join(cars))


def write_people(root, count, random):
    """The pose trainers' JSON list: one person an image, which is frame 5 of a sequence of 9."""
    people = []
    for k in range(count):
        frames = root / "sequences" / f"{k:09d}"
        for frame in range(1, 10):
            save_image(frames / f"{frame:08d}.jpg", random)
        (root / "images").mkdir(exist_ok=True)
        shutil.copy(frames / "00000005.jpg", root / "images" / f"{k:09d}.jpg")
        people.append({"image": f"{k:09d}.jpg", "center": [16.0, 12.0], "scale": 0.1,
                       "joints": [[j + 8.0, 12.0] for j in range(JOINTS)], "joints_vis": [1] * JOINTS})
    (root / "people.json").write_text(json.dumps(people))

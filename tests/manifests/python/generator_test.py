"""eventgan.Generator: volumes bit for bit those of the program's shards, from threads and workers of all kinds;
and what it refuses."""

import concurrent.futures
import json
import os
import pathlib
import pickle
import re
import subprocess
import sys
import warnings

import numpy as np
import PIL.Image
import pytest

import eventgan

PROGRAM = os.environ["EVENTGAN_PROGRAM"]
FRAMES = 4
pytestmark = pytest.mark.filterwarnings("ignore:shipped.*stand-in", "ignore:the generator is UNTRAINED")


def scene(height, width, colour, seed=5):
    """FRAMES images: a smooth texture that moves by (2, 1) px a frame, and noise in one corner."""
    random = np.random.default_rng(seed)
    shape = (height + 16, width + 16, 3) if colour else (height + 16, width + 16)
    texture = random.normal(size=shape)
    for axis in (0, 1):
        for step in (1, 2, 4):
            texture = texture + np.roll(texture, step, axis)
    texture = np.clip(128 + 40 * texture / texture.std(), 0, 255).astype(np.uint8)
    images = [texture[k : k + height, 2 * k : 2 * k + width].copy() for k in range(FRAMES)]
    for image in images:
        image[:5, :7] = random.integers(0, 256, image[:5, :7].shape)
    return images


def boxes_of(height, width):
    """Two boxes of whole and half pixels: their edges survive COCO's left and width."""
    return [[width // 8, height // 8, width // 2 + 0.5, height // 2],
            [width // 2, height // 3, width - 0.5, height - 1]]


def write_job(folder, images, image, generator, volume, seed):
    """A folder of frames with two boxes each, in COCO's format, and a manifest for it that makes shards of float32."""
    (folder / "clip").mkdir(parents=True)
    for k, frame in enumerate(images):
        PIL.Image.fromarray(frame).save(folder / "clip" / f"{k:04d}.png")
    height, width = images[0].shape[:2]
    coco = {"images": [{"id": k, "file_name": f"{k:04d}.png", "height": height, "width": width}
                       for k in range(len(images))],
            "categories": [{"id": 1, "name": "thing"}],
            "annotations": [{"id": 10 * k + n, "image_id": k, "category_id": 1, "iscrowd": 0,
                             "bbox": [left, top, right - left, bottom - top]}
                            for k in range(len(images))
                            for n, (left, top, right, bottom) in enumerate(boxes_of(height, width))]}
    (folder / "coco.json").write_text(json.dumps(coco))
    manifest = {"format": "eventgan-manifest", "version": 1, "name": "same", "seed": seed,
                "sources": [{"dataset": "frames", "root": "clip", "labels": {"format": "coco", "path": "coco.json"},
                             "pairs": {"gaps": [1], "side": "before"}}],
                "image": image, "generator": generator, "volume": volume,
                "output": {"directory": "out", "dtype": "float32"}}
    (folder / "manifest.json").write_text(json.dumps(manifest))
    subprocess.run([PROGRAM, "convert", folder / "manifest.json", "--progress", "none"], check=True,
                   capture_output=True)
    return eventgan.Shards(folder / "out")


def precisions():
    """Those that this processor computes."""
    able = []
    for precision in ("float32", "bfloat16", "int8"):
        try:
            eventgan.Generator("shipped:8", precision=precision)
            able.append(precision)
        except ValueError:
            pass
    return able


CASES = {
    "as it is, odd": ((37, 53), {}, {}, {}),
    "smallest": ((16, 16), {}, {}, {}),
    "grey first": ((37, 53), {"preset": "mpii"}, {}, {}),
    "kitti": ((64, 80), {"preset": "kitti", "size": (48, 72)}, {}, {}),
    "letterbox": ((48, 90), {"size": (64, 64), "fit": "letterbox"}, {}, {}),
    "letterbox, high": ((90, 48), {"size": (64, 64), "fit": "letterbox"}, {}, {"normalize": "eta98"}),
    "crop": ((48, 90), {"size": (40, 40), "fit": "crop"}, {}, {}),
    "steps": ((48, 64), {"grey": "after_resize", "blur": 5, "size": (33, 47)}, {}, {}),
    "motion": ((64, 96), {}, {"scope": "motion", "motion_threshold": 60, "motion_margin_px": 0, "tile_px": 8}, {}),
    "labels": ((64, 96), {"size": (80, 80), "fit": "letterbox"},
               {"scope": "labels", "motion_threshold": 100, "motion_margin_px": 0,
                "label_margin_px": 2, "tile_px": 8}, {}),
    "labels only": ((64, 96), {}, {"scope": "labels_only", "label_margin_px": 0, "tile_px": 8}, {"normalize": "eta98"}),
}
MODELS = {
    "difference": {"kind": "difference", "sensor": {"positive_threshold": 0.1, "shot_noise_rate_hz": 3.0}},
    "esim": {"kind": "esim", "max_displacement_px": 4.0, "duration_s": 0.2},
}


def check_same(folder, size, image, generator, volume, colour, seed=3):
    """Every volume, statistic and label of a shard, made again from its images."""
    images = scene(*size, colour)
    if "kind" not in generator:
        generator = {"precision": "auto", **generator}  # what Python takes, and the program does not
    keys = dict(image)
    if "size" in keys:
        keys["height"], keys["width"] = keys.pop("size")
    shards = write_job(folder, images, keys, generator, volume, seed)
    maker = eventgan.Generator(**image, **generator, **volume, seed=seed)
    assert maker.description == shards._files[shards.paths[0]].file.attrs["generator"]
    assert maker.weights_hash == shards._files[shards.paths[0]].file.attrs["weights_hash"]
    assert len(shards) == FRAMES - 1
    for sample in shards:
        last = sample["pair"]["next_index"]
        pair = images[last - 1], images[last]
        made = maker.sample(*pair, boxes=boxes_of(*size))
        np.testing.assert_array_equal(made["volume"], sample["volume"])
        if "labels" not in generator.get("scope", ""):
            np.testing.assert_array_equal(maker(*pair), sample["volume"])
        np.testing.assert_array_equal(made["source_to_volume"], sample["pair"]["source_to_volume"])
        assert made["statistics"].keys() == sample["statistics"].keys()
        for key, value in made["statistics"].items():
            np.testing.assert_array_equal(value, sample["statistics"][key], key)
        for key in ("xyxy", "xyxy_unclipped"):
            np.testing.assert_array_equal(made["boxes"][key], sample["boxes"][key], key)
    assert any(sample["volume"].any() for sample in shards)
    if "labels" in generator.get("scope", "") or generator.get("scope") == "motion":
        assert 0 < np.mean([sample["statistics"]["tiles"] for sample in shards]) < 1


@pytest.mark.parametrize("case", CASES)
def test_volumes_are_those_of_shards(tmp_path, case):
    size, image, generator, volume = CASES[case]
    for precision in precisions():
        for colour in (False, True):
            check_same(tmp_path / f"{precision}{colour}", size, image,
                       {"weights": "shipped:8", "precision": precision, **generator}, volume, colour)


@pytest.mark.parametrize("weights", ["shipped:16", "untrained:5"])
def test_other_weights(tmp_path, weights):
    check_same(tmp_path, (37, 53), {}, {"weights": weights}, {}, False)


@pytest.mark.parametrize("model", MODELS)
def test_models_volumes_are_those_of_shards(tmp_path, model):
    check_same(tmp_path, (37, 53), {"size": (40, 40), "fit": "letterbox"}, MODELS[model], {"bins": 4}, True)


# ---- Images of all kinds


@pytest.fixture(scope="module")
def generator():
    return eventgan.Generator("shipped:8")


@pytest.fixture(scope="module")
def images():
    return scene(37, 53, True)


def test_floating_point_images_are_rounded_to_levels(generator, images):
    expected = generator(images[0], images[1])
    for dtype in (np.float16, np.float32, np.float64, ">f4"):
        levels = np.round(np.asarray(images[0] / 255, dtype).astype(float) * 255)
        np.testing.assert_array_equal(levels, images[0])  # else the next line would not have to hold
        np.testing.assert_array_equal(generator((images[0] / 255).astype(dtype), (images[1] / 255).astype(dtype)),
                                      expected)


def test_memory_of_all_layouts(generator, images):
    first, second = images[:2]
    expected = generator(first, second)
    wide = np.zeros((40, 120, 4), np.uint8)
    wide[2:39, 10:116:2, :3] = first
    unaligned = np.frombuffer(b"x" + (second / 255).tobytes(),
                              np.uint8, offset=1).view(np.float64).reshape(second.shape)
    for previous in (first[::-1][::-1], np.asfortranarray(first), first[..., ::-1].copy()[..., ::-1],
                     wide[2:39, 10:116:2, :3], PIL.Image.fromarray(first), memoryview(first)):
        for following in (second, unaligned):
            np.testing.assert_array_equal(generator(previous, following), expected)
    read_only = first.copy()
    read_only.flags.writeable = False
    np.testing.assert_array_equal(generator(read_only, second), expected)


def test_blue_green_red_reversed(generator, images):
    bgr = [np.ascontiguousarray(image[..., ::-1]) for image in images[:2]]
    np.testing.assert_array_equal(generator(*(image[..., ::-1] for image in bgr)), generator(*images[:2]))


def test_results_are_the_callers_own(generator, images):
    """The memory of a volume that was let go is used again, that of one that somebody holds never."""
    held = generator(images[0], images[1])
    copy, part = held.copy(), generator(images[1], images[2])[3]
    part_copy = part.copy()
    for _ in range(5):
        generator(images[2], images[3])[:] = -1
    np.testing.assert_array_equal(held, copy)
    np.testing.assert_array_equal(part, part_copy)
    held[:] = 7  # writable
    np.testing.assert_array_equal(generator(images[0], images[1]), copy)


def test_many(generator, images):
    previous, following = np.stack(images[:3]), np.stack(images[1:])
    expected = np.stack([generator(*pair) for pair in zip(previous, following)])
    for threads in (1, 2, 7):
        np.testing.assert_array_equal(generator.many(previous, following, threads=threads), expected)
    np.testing.assert_array_equal(generator.many(previous[::-1], following[::-1]), expected[::-1])
    assert generator.many(previous[:0], following[:0]).shape == (0, *expected.shape[1:])
    grey = previous[..., 1]
    np.testing.assert_array_equal(generator.many(grey, grey)[2], generator(grey[2], grey[2]))
    broken = previous / 255
    broken[2, 4, 5, 1] = np.nan
    for threads in (1, 3):
        with pytest.raises(ValueError, match="got nan at row 4, column 5 of previous"):
            generator.many(broken, following, threads=threads)


@pytest.mark.parametrize("path", ["a.png", pathlib.Path("a.png"), b"a.png"])
def test_a_path_is_to_be_read_first(generator, path):
    for call in (generator, generator.sample, generator.many, lambda image, _: generator.prepare(image)):
        with pytest.raises(ValueError, match="expected an image array, got a path for (previous|image): read it first"):
            call(path, path)


def test_static_black_and_saturated_pairs(generator):
    for level in (0, 255):
        flat = np.full((40, 30), level, np.uint8)
        volume = generator(flat, flat)
        assert np.isfinite(volume).all() and (volume >= 0).all()
    assert (generator.sample(flat, flat)["statistics"]["nonzero_fraction"]
            == np.count_nonzero(volume) / np.float32(volume.size))


def test_one_pixel_and_very_wide(generator):
    for shape in ((1, 1), (1, 100_000), (20_000, 3)):
        image = np.full(shape, 90, np.uint8)
        assert generator(image, image).shape == (18, *shape)


# ---- The sensor


def test_noise_is_added_and_follows_from_seed_and_images(images):
    """Over 0.1 s 100 Hz are 10 events a pixel, of which a standard deviation is 1 / sqrt(pixels) of them."""
    pixels, sensor = images[0].shape[0] * images[0].shape[1], {"noise": {"shot_hz": 100}}
    noisy = eventgan.Generator(kind="difference", sensor=sensor)
    still = noisy.sample(images[0], images[0])
    assert still["statistics"]["flags"] == 32 and "threshold" not in still
    assert abs(still["volume"].sum() / pixels - 10) < 5 * (10 / pixels) ** 0.5
    np.testing.assert_array_equal(noisy(images[0], images[0]), still["volume"])
    assert (noisy(images[1], images[1]) != still["volume"]).any()
    assert (eventgan.Generator(kind="difference", sensor=sensor, seed=1)(images[0], images[0]) != still["volume"]).any()
    clean, network = (eventgan.Generator("shipped:8", sensor=given) for given in (None, sensor))
    noise = network(*images[:2]) - clean(*images[:2])
    np.testing.assert_allclose(noise, np.round(noise), atol=1e-5)
    assert abs(noise.sum() / pixels - 10) < 5 * (10 / pixels) ** 0.5


def test_a_threshold_is_drawn_for_each_pair(images):
    generator = eventgan.Generator(kind="difference", sensor={"threshold": [0.1, 0.9]})
    samples = [generator.sample(images[i], images[i + 1]) for i in range(3)]
    thresholds = [sample["threshold"] for sample in samples]
    assert len(set(thresholds)) == 3 and all(0.1 <= threshold <= 0.9 for threshold in thresholds)
    for i in range(3):
        one = eventgan.Generator(kind="difference", sensor={"threshold": thresholds[i]})
        np.testing.assert_array_equal(one(images[i], images[i + 1]), samples[i]["volume"])
    with pytest.raises(ValueError, match="sensor.positive_threshold: expected no such key together with threshold"):
        eventgan.Generator(kind="difference", sensor={"threshold": 1, "positive_threshold": 1})


def test_rates_are_given_where_no_events_are_drawn_of_them(images):
    drawn, rates = (eventgan.Generator("shipped:sensor",
                                       sensor={"threshold": 0.3}, sample=sample)(*images[:2]).reshape(2, 9, -1).sum(1)
                    for sample in (True, False))
    np.testing.assert_allclose(drawn, drawn.round(), atol=1e-4)
    assert (np.abs(rates - rates.round()) > 0.01).mean() > 0.1
    assert np.abs(drawn - rates).max() < 1 + 1e-4


# ---- Labels


def test_labels_and_gap(images):
    # twice as large: 74 x 106, 3 rows above
    generator = eventgan.Generator("shipped:8", size=(80, 106), fit="letterbox")
    joints = [[[0, 0], [10, 5.5], [np.nan, 1]]]
    sample = generator.sample(images[0], images[1], boxes=[[0, 0, 53, 37], [-5, 2, 20, 30]], joints=joints, gap=9)
    np.testing.assert_array_equal(sample["source_to_volume"], [[2, 0, 0.5], [0, 2, 3.5]])
    np.testing.assert_array_equal(sample["boxes"]["xyxy"], [[0, 3, 106, 77], [0, 7, 40, 63]])
    np.testing.assert_array_equal(sample["boxes"]["xyxy_unclipped"][1], [-10, 7, 40, 63])
    np.testing.assert_array_equal(sample["joints"], [[[0.5, 3.5], [20.5, 14.5], [np.nan, np.nan]]])
    np.testing.assert_array_equal(generator.source_to_volume(37, 53), sample["source_to_volume"])
    extrapolated = 2
    assert sample["statistics"]["flags"] & extrapolated and generator.training_gaps == (1, 6)
    assert not generator.sample(images[0], images[1])["statistics"]["flags"] & extrapolated
    for none in (np.empty((0, 4)), []):  # what a reader of labels gives for an image without objects
        assert generator.sample(images[0], images[1], boxes=none)["boxes"]["xyxy"].shape == (0, 4)
    assert generator.sample(images[0], images[1], joints=[])["joints"].shape == (0, 0, 2)
    for boxes in ([[0, 0, 5]], [[5, 5, 2, 9]], [[500, 500, 600, 600]], [[np.nan, 0, 1, 1]], "text"):
        with pytest.raises(ValueError, match="expected"):
            generator.sample(images[0], images[1], boxes=boxes)
    for more in ({"joints": [[1, 2]]}, {"gap": 0}, {"gap": 1.5}):
        with pytest.raises(ValueError, match="expected"):
            generator.sample(images[0], images[1], **more)


@pytest.mark.parametrize("scope", ["labels", "labels_only"])
def test_a_scope_of_labels_needs_them(images, scope):
    generator = eventgan.Generator("shipped:8", scope=scope)
    batches = np.stack(images[:1]), np.stack(images[1:2])
    for call in (lambda: generator(*images[:2]), lambda: generator.sample(*images[:2]),
                 lambda: generator.many(*batches)):
        with pytest.raises(ValueError, match=f'expected boxes or joints, .*scope is "{scope}", got none'):
            call()
    still = generator.sample(images[0], images[0], boxes=np.empty((0, 4)))  # an image without objects has labels
    assert not still["statistics"]["tiles"].any() and not still["volume"].any()


def test_prepare(images):
    grey = images[0][..., 0]
    np.testing.assert_array_equal(eventgan.Generator("shipped:8").prepare(grey), grey)
    r, g, b = (images[0][..., channel].astype(float) for channel in range(3))
    mixed = eventgan.Generator("shipped:8").prepare(images[0])
    assert np.abs(mixed - (0.299 * r + 0.587 * g + 0.114 * b)).max() <= 0.51  # ITU-R BT.601
    boxed = eventgan.Generator("shipped:8", size=(57, 53), fit="letterbox").prepare(grey)
    np.testing.assert_array_equal(boxed[10:47], grey)
    assert not boxed[:10].any() and not boxed[47:].any()
    cropped = eventgan.Generator("shipped:8", size=(37, 31), fit="crop").prepare(grey)
    np.testing.assert_array_equal(cropped, grey[:, 11:42])


def test_the_default_precision_is_what_the_processor_does_well(images):
    flags = set(re.search(r"flags\s*: (.*)", pathlib.Path("/proc/cpuinfo").read_text())[1].split())
    if "ONEDNN_MAX_CPU_ISA" in os.environ or "onednn" not in eventgan.Generator("shipped:8").description:
        pytest.skip("not what the processor says")
    best = "bfloat16" if flags & {"avx512_bf16", "amx_bf16"} and "avx512bw" in flags else "float32"
    for given in ({}, {"precision": "auto"}):
        generator = eventgan.Generator("shipped:8", **given)
        assert best in generator.description and f" {best}" in repr(generator)
        np.testing.assert_array_equal(generator(*images[:2]),
                                      eventgan.Generator("shipped:8", precision=best)(*images[:2]))


def test_processors_without_avx_512_take_float32():
    """Those of most laptops."""
    code = ("import eventgan, numpy as np\ngenerator = eventgan.Generator('shipped:8')\n"
            "print(generator.description, generator(*np.random.default_rng(1).random((2, 20, 30))).any())")
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True,
                          env={**os.environ, "ONEDNN_MAX_CPU_ISA": "AVX2"})
    assert done.returncode == 0 and "float32" in done.stdout and done.stdout.endswith("True\n"), done


def test_float32_stays_float32_whatever_the_environment_says():
    """ONEDNN_DEFAULT_FPMATH_MODE lets oneDNN compute float32 in bfloat16 where the processor has it."""
    code = ("import eventgan, hashlib, numpy as np\ngenerator = eventgan.Generator('shipped:8', precision='float32')\n"
            "volume = generator(*np.random.default_rng(1).random((2, 40, 60)))\n"
            "print(hashlib.sha256(volume.tobytes()).hexdigest())")
    made = {subprocess.run([sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, check=True,
                           env={**os.environ, "ONEDNN_DEFAULT_FPMATH_MODE": mode}).stdout
            for mode in ("STRICT", "BF16", "ANY")}
    assert len(made) == 1, made


# ---- Threads and workers


def test_threads(generator, images):
    pairs = [(images[k % 4], images[(k + 1) % 4]) for k in range(24)]
    expected = [generator(*pair) for pair in pairs]
    with concurrent.futures.ThreadPoolExecutor(6) as pool:
        for made, wanted in zip(pool.map(lambda pair: generator(*pair), pairs), expected):
            np.testing.assert_array_equal(made, wanted)


def test_pickling_keeps_settings(images, tmp_path, monkeypatch):
    weights = tmp_path / "own.safetensors"
    weights.write_bytes(
        next((pathlib.Path(__file__).parents[3] / "manifests" / "weights").glob("eventgan-*.safetensors")).read_bytes())
    monkeypatch.chdir(tmp_path)
    generator = eventgan.Generator("own.safetensors", size=(32, 48), fit="crop", preset="kitti", scope="motion",
                                   normalize="eta98", seed=4)
    monkeypatch.chdir("/")
    again = pickle.loads(pickle.dumps(generator))
    np.testing.assert_array_equal(again(images[0], images[1]), generator(images[0], images[1]))
    weights.unlink()
    with pytest.raises(FileNotFoundError, match="own.safetensors"):
        pickle.loads(pickle.dumps(generator))


WORKERS = """
import sys
import numpy as np
import torch
from torch.utils.data import DataLoader, Dataset
import eventgan

class Pairs(Dataset):
    def __init__(self):
        self.generator = eventgan.Generator("shipped:8")
        self.images = np.random.default_rng(1).integers(0, 256, (7, 300, 250, 3), dtype=np.uint8)
    def __len__(self):
        return 6
    def __getitem__(self, index):
        return torch.from_numpy(self.generator(self.images[index], self.images[index + 1]))

if __name__ == "__main__":
    pairs = Pairs()
    torch.ones(2000, 2000) @ torch.ones(2000, 2000)  # PyTorch has its threads now
    here = torch.stack([pairs[k] for k in range(6)])
    before = torch.get_num_threads()
    pairs.generator.many(pairs.images[:-1], pairs.images[1:], threads=2)
    assert torch.get_num_threads() == before
    loader = DataLoader(pairs, 2, num_workers=2, multiprocessing_context=sys.argv[1], timeout=120)
    for _ in range(2):
        assert torch.equal(torch.cat(list(loader)), here)
"""


@pytest.mark.parametrize("start", ["fork", "spawn"])
def test_workers(tmp_path, start):
    pytest.importorskip("torch")
    script = tmp_path / "workers.py"
    script.write_text(WORKERS)
    environment = {name: value for name, value in os.environ.items() if name != "OMP_NUM_THREADS"}
    environment["PYTHONPATH"] = os.pathsep.join(sys.path)
    done = subprocess.run([sys.executable, "-W", "ignore", script, start], env=environment, capture_output=True,
                          text=True, timeout=200)
    assert done.returncode == 0, done.stderr


# ---- Events


def test_sampled_events():
    volume = np.zeros((6, 4, 5), np.float32)
    # positive at the start and the end, negative in the middle
    volume[0, 1, 2], volume[2, 1, 2], volume[4, 3, 0] = 2, 1, 3
    events = eventgan.sample_events(volume, duration_s=0.5, counts="rounded")
    assert events.dtype.names == ("t", "x", "y", "p")
    assert events.tolist() == [(0.0, 2, 1, 1)] * 2 + [(0.25, 0, 3, 0)] * 3 + [(0.5, 2, 1, 1)]
    events["t"] *= 1e6  # tonic's events, as python.md makes them
    tonic = events[["x", "y", "t", "p"]].astype([("x", np.int16), ("y", np.int16), ("t", np.int64), ("p", bool)])
    assert tonic.tolist() == [(2, 1, 0, True)] * 2 + [(0, 3, 250_000, False)] * 3 + [(2, 1, 500_000, True)]
    assert len(eventgan.sample_events(np.zeros((2, 3, 3)))) == 0
    drawn = eventgan.sample_events(np.full((18, 60, 80), 0.5, np.float32), seed=3)
    assert abs(len(drawn) - 0.5 * 18 * 60 * 80) < 5 * np.sqrt(0.5 * 18 * 60 * 80)  # Poisson's deviation
    assert (np.diff(drawn["t"]) >= 0).all()
    np.testing.assert_array_equal(drawn, eventgan.sample_events(np.full((18, 60, 80), 0.5, np.float32), seed=3))
    assert not np.array_equal(drawn,
                              eventgan.sample_events(np.full((18, 60, 80), 0.5, np.float32), seed=4)[: len(drawn)])
    for bad in (np.zeros((3, 4, 4)), np.zeros((2, 4)), np.full((2, 1, 1), np.nan), np.full((2, 1, 1), -1.0),
                np.full((2, 1, 1), np.inf), "volume"):
        with pytest.raises(ValueError, match="expected"):
            eventgan.sample_events(bad)
    for settings in ({"duration_s": 0}, {"duration_s": np.nan}, {"seed": -1}, {"seed": 1.5}, {"seed": 2**63},
                     {"counts": "exact"}):
        with pytest.raises(ValueError, match="expected"):
            eventgan.sample_events(volume, **settings)
    assert len(eventgan.sample_events(volume, seed=2**63 - 1)) > 0  # as far as the manifest's go


@pytest.mark.parametrize("counts", ["poisson", "rounded"])
def test_more_events_than_can_be_made_are_refused(counts):
    for value in (1e30, 8.6e9, 2.0**31, 1.1e9):
        with pytest.raises(ValueError, match=r"expected values of at most 1e\+09 events altogether, got"):
            eventgan.sample_events(np.full((2, 1, 1), [[[0]], [[value]]]), counts=counts)
    memory = 1000 * int(re.search(r"MemTotal: *(\d+) kB", pathlib.Path("/proc/meminfo").read_text())[1])
    if 9e8 * 96 > memory:
        with pytest.raises(MemoryError):
            eventgan.sample_events(np.full((2, 1, 1), 4.5e8), counts=counts)


# ---- What is refused

IMAGE = np.zeros((20, 30), np.uint8)


@pytest.mark.parametrize("previous, following, got", [
    (IMAGE, IMAGE[:-1], r"shapes \(20, 30\) and \(19, 30\)"),
    (IMAGE, IMAGE.astype(int), "int64 for following"),
    (IMAGE.astype(bool), IMAGE, "bool for previous"),
    (IMAGE.astype(np.int8), IMAGE, "int8 for previous"),
    (IMAGE.astype(complex), IMAGE, "complex128"),
    (IMAGE[None], IMAGE, r"\(1, 20, 30\)"),
    (IMAGE[0], IMAGE, r"\(30\)"),
    (7, IMAGE, r"\(\)"),
    (np.zeros((20, 30, 4), np.uint8), IMAGE, r"\(20, 30, 4\)"),
    (np.zeros((20, 30, 1), np.uint8), IMAGE, r"\(20, 30, 1\)"),
    (IMAGE[:0], IMAGE[:0], r"\(0, 30\)"),
    (np.full((20, 30), np.nan), IMAGE, "nan at row 0, column 0 of previous"),
    (IMAGE, np.full((20, 30), 1.5, np.float32), "1.5.* of following"),
    (IMAGE, np.full((20, 30), np.inf, np.float16), "inf.* of following"),
    (None, IMAGE, r"\(\) for previous"),
    (np.full((4, 4), None), IMAGE, "object for previous"),
    ("image.png", IMAGE, "for previous"),
    ([[1, 2], [3]], IMAGE, "list for previous"),
    (np.broadcast_to(np.uint8(1), (1 << 14, 1 << 14)), np.broadcast_to(np.uint8(1), (1 << 14, 1 << 14)),
     "16384, 16384"),
])
def test_wrong_images(generator, previous, following, got):
    with pytest.raises(ValueError, match=f"expected .*{got}"):
        generator(previous, following)


def test_too_large_for_the_memory(generator):
    image = np.broadcast_to(np.uint8(1), (4096, 16384))
    with pytest.raises(MemoryError):
        generator.many(np.broadcast_to(image, (10_000, *image.shape)), np.broadcast_to(image, (10_000, *image.shape)))


@pytest.mark.parametrize("settings, got", [
    ({"precision": "int9"}, 'precision: expected "float32".*"auto".*"int9"'),
    ({"precision": "int8", "weights": "untrained:8"}, "calibrat"),
    ({"weights": "shipped:7"}, "weights"),
    ({"weights": __file__}, "generator_test.py"),
    ({"kind": "events"}, "kind: expected"),
    ({"size": (15, 64)}, "height: expected an integer 16..8192, got 15"),
    ({"size": 64}, "size"),
    ({"size": (64, 64, 3)}, "size"),
    ({"size": (64.5, 64)}, "height: expected an integer"),
    ({"preset": "kitti", "blur": 3}, "no such key together with preset"),
    ({"blur": 3}, "grey"),
    ({"seed": -1}, "seed"),
    ({"colour": "bgr"}, "expected settings of .*got colour"),
    ({"sensor": {"leak": 1}, "kind": "esim"}, "leak"),
    ({"scope": "motion", "kind": "difference"}, "no such key for kind"),
    ({"bins": 5, "weights": "shipped:8"}, "bins: expected 9"),
    ({"motion_threshold": object()}, "motion_threshold"),
    ({"motion_threshold": np.nan}, "expected"),
])
def test_wrong_settings(settings, got):
    with pytest.raises(ValueError, match=f"(?s){got}"):
        eventgan.Generator(**settings)


def test_missing_weights():
    with pytest.raises(FileNotFoundError, match="nowhere.safetensors"):
        eventgan.Generator("nowhere.safetensors")


def test_all_faults_of_settings_at_once():
    with pytest.raises(ValueError) as fault:
        eventgan.Generator(precision="int9", fit="wide", normalize=3)
    assert [word in str(fault.value) for word in ("precision", "fit", "normalize")] == [True] * 3


def test_warnings_say_what_the_volumes_are_worth():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        eventgan.Generator("untrained:4")
    assert "untrained:4" in str(caught[0].message) and caught[0].filename == __file__

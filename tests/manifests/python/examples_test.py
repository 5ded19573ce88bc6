"""manifests/python/examples: a few steps of each on the demo dataset, and going on where they ended."""

import argparse
import json
import math
import os
import pathlib
import re
import shutil
import subprocess
import sys
import time
import types

import numpy as np
import pytest
from conftest import SOURCE, run_script

from eventgan import Shards

torch = pytest.importorskip("torch")
pytest.importorskip("torchvision")
cv2 = pytest.importorskip("cv2")

PROGRAM = os.environ["EVENTGAN_PROGRAM"]
EXAMPLES = SOURCE / "manifests" / "python" / "examples"
ONE_THREAD = {**os.environ, "OMP_NUM_THREADS": "1"}
TRAINERS = pathlib.Path(os.environ.get("EVENTGAN_TEST_TRAINERS", SOURCE.parent / "shared" / "trainers"))


def line(example, data, out, *more):
    return [EXAMPLES / f"{example}.py", "--data", data, "--out", out, "--threads", "1", *more]


def train(example, data, out, *more, expect=0):
    """What the example says, on one thread of the processor."""
    said, code = run_script(*line(example, data, out, *more))
    assert code == expect, said
    return said


def history(out):
    return json.loads((out / "metrics.json").read_text())["history"]


def need_trainer(name, *modules):
    if not (TRAINERS / name).is_dir():
        pytest.skip(f"no ../shared/trainers/{name}")
    for module in modules:
        pytest.importorskip(module)
    return TRAINERS / name


@pytest.fixture(scope="module")
def few_bins(data, tmp_path_factory):
    """The demo's cars and poses as volumes of 5 bins, half as large."""
    job = json.loads(re.sub("(?m)^ *//.*", "", (data.parent / "manifest.json").read_text()))
    sources = [{**source, "root": str(data.parent / source["root"])} for source in job["sources"]
               if source["dataset"] != "human36m"]
    return convert(tmp_path_factory.mktemp("few"), **{**job, "name": "bins", "sources": sources, "volume": {"bins": 5},
                                                      "generator": {"kind": "esim"}, "output": {"directory": "bins"}})


def scores(said):
    """Those of the line that an example has printed to score what it found."""
    (line,) = re.findall("^to score what was found in .*: (.* -m eventgan.evaluate .*)$", said, re.MULTILINE)
    done = subprocess.run(f"{line} --json", shell=True, capture_output=True, text=True, env=ONE_THREAD)
    assert done.returncode == 0, line + done.stderr
    return json.loads(done.stdout)


def assert_trained(out, steps, images):
    assert [row["step"] for row in history(out)] == steps
    assert all(np.isfinite(row["loss"]) for row in history(out)[1:])
    assert len(list((out / "images").glob("*.png"))) == images
    assert torch.load(out / "weights.pt", weights_only=True)
    assert not list(out.glob("*.new"))


def test_faster_rcnn_learns_and_goes_on(data, tmp_path):
    options = ["--dataset", "kitti_object", "--batch", "2", "--scale", "0.5", "--regions", "16", "--every", "9"]
    said = train("train_torchvision", data, tmp_path / "parts", "--steps", "1", *options)
    assert "10 samples for training, 2 for validation, of other images" in said and "(untrained)" in said
    said = train("train_torchvision", data, tmp_path / "parts", "--steps", "2", *options)
    assert "resuming after epoch 1" in said
    assert_trained(tmp_path / "parts", [0, 1, 2], images=2)
    assert {"AP50 Car", "AP50 Van"} <= history(tmp_path / "parts")[0].keys()
    cars = scores(said)["classes"]["Car"]
    assert cars["ap_voc"] == pytest.approx(history(tmp_path / "parts")[-1]["AP50 Car"], abs=1e-4)
    said = train("train_torchvision", data, tmp_path / "parts", "--steps", "4", *options, "--lr", "0.5", expect=1)
    assert "expected --lr 0.0002, as when this run started, got 0.5, in" in said


def test_keypoint_rcnn_learns(few_bins, tmp_path):
    train("train_torchvision", few_bins, tmp_path / "out", "--task", "keypoints", "--dataset", "mpii", "--steps", "1",
          "--batch", "1", "--scale", "0.5", "--regions", "8", "--every", "9")
    assert_trained(tmp_path / "out", [0, 1], images=1)
    assert {"AP50 person", "PCK@0.2"} <= history(tmp_path / "out")[0].keys()


def convert_persons(folder, joints, limit):
    """Five random images with the same person; `joints`: places by name. The folder of the shards."""
    random, images = np.random.default_rng(0), folder / "photos" / "images"
    images.mkdir(parents=True)
    for i in range(5):
        cv2.imwrite(str(images / f"{i}.png"), random.integers(0, 256, (64, 64), np.uint8))
    annotations = [{"id": i + 1, "image_id": i + 1, "category_id": 1, "iscrowd": 0, "bbox": [20, 4, 24, 56],
                    "num_keypoints": 5, "keypoints": [value for place in joints.values() for value in (*place, 2)]}
                   for i in range(5)]
    (folder / "photos" / "person_keypoints.json").write_text(json.dumps(
        {"images": [{"id": i + 1, "file_name": f"{i}.png", "width": 64, "height": 64} for i in range(5)],
         "annotations": annotations,
         "categories": [{"id": 1, "name": "person", "keypoints": list(joints), "skeleton": []}]}))
    subprocess.run([PROGRAM, "convert", folder / "photos", "--output", folder / "out", "--limit", str(limit),
                    "--progress", "none"], check=True, capture_output=True)
    return folder / "out"


def test_pose_resnet_learns_persons_without_head_boxes(tmp_path, monkeypatch):
    """Of COCO's files, as LSP's: PCKh is of the heads' joints, or there is none."""
    trainer = need_trainer("pose_resnet", "easydict", "yaml")
    joints = {"head_top": [32, 8], "left_shoulder": [24, 20], "right_shoulder": [40, 20], "left_hip": [26, 44],
              "right_hip": [38, 44]}
    data, one = (convert_persons(tmp_path / str(limit), joints, limit) for limit in (5, 1))
    options = ["--trainer", trainer, "--batch", "4", "--size", "64", "--filters", "16", "--steps", "1"]
    said = train("train_pose", data, tmp_path / "poses", *options)
    assert "4 samples for training, 1 for validation, of other images" in said
    assert f"warning: {data} is a trial of its job (--limit 5)" in said
    noses = convert_persons(tmp_path / "noses", {"nose": joints["head_top"], **dict([*joints.items()][1:])}, 5)
    train("train_pose", noses, tmp_path / "of noses", *options)
    for out, measured in (("poses", {"PCKh@0.5", "MPJPE"}), ("of noses", {"MPJPE"})):
        last = history(tmp_path / out)[-1]
        assert {"PCKh@0.5", "MPJPE"} & last.keys() == measured and all(np.isfinite(last[name]) for name in measured)
    # Whatever the order of a test's joints, and no others.
    other_way = convert_persons(tmp_path / "other way", dict(reversed(joints.items())), 5)
    errors = [{name: row["mpjpe_volume"] for name, row in scores(said)["joints"].items()}
              for said in (train("train_pose", data, tmp_path / "poses", *options, "--test", test)
                           for test in (data, other_way))]
    assert errors[0] == pytest.approx(errors[1]) and set(joints) < errors[0].keys()
    monkeypatch.syspath_prepend(EXAMPLES)
    import training
    monkeypatch.setattr(training, "TUNING_STEPS", 2)
    said = train("train_pose", data, tmp_path / "poses", *options, "--tune", other_way, "--test", data)
    assert "resuming after epoch 1" in said and "of other recordings" not in said
    assert [row["step"] for row in history(tmp_path / "poses" / "tuned")] == [0, 2]
    assert scores(said)["joints"].keys() == errors[0].keys()
    more = convert_persons(tmp_path / "more", {**joints, "neck": [32, 18]}, 5)
    said = train("train_pose", data, tmp_path / "poses", *options, "--test", more, expect=1)
    assert f"expected the trained joints {', '.join(joints)}, got {', '.join(joints)}, neck, in {more}" in said
    said = train("train_pose", one, tmp_path / "none", "--trainer", trainer, expect=1)
    assert f"got one, in {one} (--overfit validates on the training samples)" in said


def test_pose_resnet_killed_and_begun_again_learns_the_same(few_bins, tmp_path):
    # nothing beside it
    trainer = shutil.copytree(need_trainer("pose_resnet", "easydict", "yaml"), tmp_path / "trainer")
    options = ["--trainer", trainer, "--dataset", "mpii", "--batch", "3", "--size", "64", "--filters", "16",
               "--epochs", "2"]
    train("train_pose", few_bins, tmp_path / "whole", *options)
    assert_trained(tmp_path / "whole", [0, 2, 4], images=1)
    with subprocess.Popen([sys.executable, *line("train_pose", few_bins, tmp_path / "killed", *options)],
                          stdout=subprocess.DEVNULL, env=ONE_THREAD) as process:
        while not (tmp_path / "killed" / "checkpoint.pt").exists() and process.poll() is None:
            time.sleep(0.01)
        process.kill()
    said = train("train_pose", few_bins, tmp_path / "killed", *options)
    assert "resuming after epoch" in said
    assert scores(said)["joints"]["all"]["pckh_mpii"] == history(tmp_path / "killed")[-1]["PCKh@0.5"]
    weights = torch.load(tmp_path / "whole" / "weights.pt")
    train("train_pose", few_bins, tmp_path / "tuned", *options, "--pretrained", tmp_path / "whole" / "weights.pt",
          "--last-layer")
    tuned = torch.load(tmp_path / "tuned" / "weights.pt")
    assert {name.split(".")[0] for name in weights if not torch.equal(weights[name], tuned[name])} == {"final_layer"}
    whole, killed = ([{**row, "minutes": 0} for row in history(tmp_path / out)] for out in ("whole", "killed"))
    assert whole == killed


def convert(folder, **job):
    """The folder of the shards of a source whose manifest is `job`."""
    (folder / f"{job['name']}.json").write_text(json.dumps({"format": "eventgan-manifest", "version": 1,
                                                           "output": {"directory": job["name"]}, **job}))
    subprocess.run([PROGRAM, "convert", folder / f"{job['name']}.json", "--progress", "none"], check=True,
                   capture_output=True)
    return folder / job["name"]


def test_flow_network_learns_and_goes_on(tmp_path):
    """Of moved photographs, tested on these and on a recording of a pattern that goes to the right by a pixel."""
    h5py = pytest.importorskip("h5py")
    pattern = np.kron(np.random.default_rng(0).integers(0, 256, (12, 20)), np.ones((8, 8))).astype(np.uint8)
    (tmp_path / "photos").mkdir()
    for i in range(5):
        cv2.imwrite(str(tmp_path / "photos" / f"{i}.png"), np.roll(pattern, 9 * i, 1))
    source = {"dataset": "frames", "root": "photos", "flow": True,
              "pairs": {"from": "stills", "motion": {"translation_px": [2, 4]}}}
    options = {"name": "out", "image": {"width": 96, "height": 64, "fit": "crop"}, "generator": {"kind": "esim"}}
    data = convert(tmp_path, sources=[source], **options)
    frames = np.stack([pattern[:, 10 - shift:][:, :128] for shift in range(3)])
    rows, columns = np.nonzero(frames[0] != frames[1])
    events = np.concatenate([np.stack([columns, rows, np.full(len(rows), time), np.ones(len(rows))], 1)
                             for time in (0.01, 0.02, 0.05, 0.06)])
    with h5py.File(tmp_path / "scene.hdf5", "w") as file:
        camera = file.create_group("davis/left")
        camera["events"], camera["image_raw"], camera["image_raw_ts"] = events, frames, [0, 0.04, 0.08]
        camera["image_raw_event_inds"] = [0, 2 * len(rows), 4 * len(rows) - 1]
    test = convert(tmp_path, name="scene", image={}, generator={"kind": "events"},
                   sources=[{"dataset": "recording", "root": "scene.hdf5", "split": "test"}])

    said = train("train_flow", data, tmp_path / "parts", "--steps", "1", "--images", "1", "--every", "9")
    assert "4 samples for training, 1 for validation, of other images" in said and "(untrained)" in said
    said = train("train_flow", data, tmp_path / "parts", "--steps", "2", "--images", "1", "--every", "9")
    assert "resuming after epoch 1" in said
    assert_trained(tmp_path / "parts", [0, 1, 2], images=1)
    dense = json.loads((tmp_path / "parts" / "scores.json").read_text())["dense"]
    assert scores(said)["flow"]["dense"] == pytest.approx(dense) and dense["aee"] < 10
    assert history(tmp_path / "parts")[-1]["AEE"] == pytest.approx(dense["aee"], abs=1e-4)

    said = train("train_flow", data, tmp_path / "parts", "--steps", "2", "--every", "9", "--test", test)
    left = json.loads((tmp_path / "parts" / "scores.json").read_text())
    assert set(left) == {"error of the moved frame"} and set(left["error of the moved frame"]) == {"scene", "mean"}
    assert "error of the moved frame: scene " in said
    (tmp_path / "scene.hdf5").unlink()
    said = train("train_flow", data, tmp_path / "none", "--test", test, expect=1)
    assert f"expected samples with flow, or of recordings whose frames are still there, got none, in {test}" in said
    assert "untrained" not in said
    after = convert(tmp_path, sources=[source, {**source, "pairs": {**source["pairs"], "side": "after"}}],
                    **{**options, "name": "both"})
    train("train_flow", data, tmp_path / "voxel", "--channels", "voxel", "--steps", "1", "--every", "9")
    said = train("train_flow", data, tmp_path / "none", "--test", after, expect=1)
    assert ("expected flow at the pixels of the next image (side before), as it is learnt, got other flow, in "
            f"{after}") in said
    said = train("train_flow", after, tmp_path / "of both", "--steps", "1", expect=1)
    assert f"expected flow at the pixels of the next image, or of the previous one (side), got both, in {after}" in said


def test_a_voxel_grid_tells_by_how_much_one_polarity_has_more_events(monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import train_flow

    volume = np.array([3, 0, 1, 4, 0, 1, 3, 2], np.float32).reshape(4, 1, 2)  # [2 bins, 1, 2] of each polarity
    percentile = np.percentile([3, 1, 4, 1, 3, 2], 98)
    shares = np.minimum(volume / percentile, 1)
    expected = np.maximum([*(shares[:2] - shares[2:]), *(shares[2:] - shares[:2])], 0)
    np.testing.assert_allclose(train_flow.in_voxels({"volume": volume}), expected)


@pytest.mark.parametrize("axis, sign", [(2, 1), (2, -1), (1, 1), (1, -1)])
def test_planes_find_the_way_of_an_edge(monkeypatch, axis, sign):
    """It goes over 256 pixels from time -1 to 1: an event a pixel, shared between two bins."""
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import train_flow

    at = torch.linspace(0, 8, 256)
    shares = (1 - (at - torch.arange(9)[:, None]).abs()).clamp(min=0)  # [bin, x]
    volume = torch.zeros(18, 256, 256)
    volume[:9] = shares[:, None]
    volume = volume if axis == 2 else volume.transpose(1, 2)
    slopes, flows = train_flow.planes((volume if sign == 1 else volume.flip(axis))[None])
    slope, weight = 2 / 255 / 1.02, 1 / 1.1
    expected = torch.zeros(2)
    expected[2 - axis] = sign * 2 * weight * slope / (weight * slope**2 + train_flow.RESTING)
    for flow in flows:
        found = flow[0, :, 126:130, 126:130]
        torch.testing.assert_close(found, expected[:, None, None].expand_as(found), rtol=1e-4, atol=1e-4)
    assert slopes[0, 2 * (2 - axis), 128, 128] == pytest.approx(sign * weight * slope, rel=1e-4)
    torch.manual_seed(0)
    network = train_flow.FlowNetwork(18)
    for training in (True, False):  # it has learnt nothing, and has no statistics of batches
        expected = train_flow.step_by_gradients(volume[None], train_flow.planes(volume[None])[1][-1], 1)
        assert torch.equal(train_flow.predict(network.train(training), volume), expected[0])
    torch.nn.init.ones_(network.unet.pred_layers[-1].conv2d.weight)
    pair = torch.stack([volume, volume.roll(5, 1)])
    torch.testing.assert_close(network.train()(pair)[-1][0], train_flow.predict(network.eval(), volume))
    assert not torch.equal(train_flow.predict(network, volume), expected[0])
    with torch.autocast("cpu", torch.bfloat16):
        flow = network.train()(pair)[-1]
    whole = train_flow.predict(network, volume)
    assert (flow[0] - whole).abs().mean() < 0.15 * whole.abs().mean()  # AVX2 rounds sums to bfloat16, too
    flow.mean().backward()
    assert all(parameter.grad.isfinite().all() for parameter in network.parameters() if parameter.grad is not None)


@pytest.mark.parametrize("lacks", [(0, 0), (0.5, -0.5)])
@pytest.mark.parametrize("position, rate", [(0, 0.1), (1, 0.1 / 1.1)])
def test_a_step_by_gradients_finds_what_flow_lacks(monkeypatch, position, rate, lacks):
    """A smooth pattern grows along x by a tenth: by x / 10 from the first pixels, by x / 11 to the last ones."""
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import train_flow

    y, x = torch.meshgrid(torch.arange(96.0), torch.arange(128.0), indexing="ij")
    volume = torch.stack([1 + torch.sin(x / (1 + 0.1 * t) / 4) * torch.cos(y / 5)
                          for t in torch.linspace(0, 1, 9)]).repeat(2, 1, 1)[None]
    flow = torch.stack([rate * x, 0 * y])
    before = flow - torch.tensor(lacks)[:, None, None]
    found = train_flow.step_by_gradients(volume, before[None], position)[0]
    torch.testing.assert_close(found[:, 24:72, 24:96], flow[:, 24:72, 24:96], rtol=0, atol=0.1)
    for nothing in (torch.zeros(1, 18, 96, 128), volume[:, :2]):  # no events; one bin
        assert torch.equal(train_flow.step_by_gradients(nothing, before[None], position)[0], before)


def test_flow_is_true_of_its_crop_and_moves_the_frames(monkeypatch):
    """A square of events is at a place that the flow names: so it is in every mirrored and turned crop."""
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import train_flow

    monkeypatch.setattr(train_flow, "AUGMENTATION", train_flow.EventAugmentation(flip=0))
    here = torch.stack(torch.meshgrid(torch.arange(120.0), torch.arange(100.0), indexing="ij")[::-1])
    item = {"volume": torch.zeros(2, 120, 100), "flow": torch.tensor([40.0, 60.0])[:, None, None] - here,
            "valid": torch.ones(120, 100, dtype=torch.bool)}
    item["volume"][0, 60, 40] = 1
    seen = set()
    for _ in range(40):
        volume, flow, valid = train_flow.Crops([item])[0]
        assert volume.shape == (2, 96, 96) and valid.shape == (1, 96, 96)
        (y,), (x,) = np.nonzero(volume[0].numpy())
        assert flow[:, y, x].tolist() == [0, 0] and flow[:, y - 2, x - 1].tolist() == [1, 2]
        seen.add((y < 48, x < 48))
    assert len(seen) > 1

    previous, volume = torch.rand(1, 1, 20, 30), torch.zeros(1, 18, 20, 30)
    following, volume[0, 3, 5:15, 5:25] = previous.roll((2, -3), (2, 3)), 1
    flow = torch.tensor([-3.0, 2.0])[:, None, None].expand(2, 20, 30)
    for position in (0, 1):
        after, before = train_flow.errors_of_frames(flow, position, previous, following, volume)
        assert after < 1e-5 and before > 0.1


def test_yolov3_learns(few_bins, tmp_path):
    trainer = shutil.copytree(need_trainer("yolov3", "matplotlib", "tqdm"), tmp_path / "trainer")  # nothing beside it
    options = ["--trainer", trainer, "--dataset", "kitti_object"]
    said = train("train_yolov3", few_bins, tmp_path / "out", *options, "--steps", "2", "--batch", "2", "--scale", "1",
                 "--every", "9", "--classes", "Car,Van", "--test", few_bins)
    counts = scores(said)["counts"]
    assert counts["samples"] == 12 and counts["not_of_these_samples"] == 0
    assert_trained(tmp_path / "out", [0, 2], images=2)
    assert "channels=10" in (tmp_path / "out" / "model.cfg").read_text()
    said = train("train_yolov3", few_bins, tmp_path / "bus", *options, "--classes", "Bus", expect=1)
    assert "got Bus" in said and str(few_bins) in said


def test_faster_rcnn_learns_on_the_fly(tmp_path):
    pytest.importorskip("eventgan._engine")
    import cv2

    (tmp_path / "road" / "images").mkdir(parents=True)
    ground = np.random.default_rng(1).integers(0, 256, (60, 100, 3), np.uint8)
    boxes, frames = ["image,class,left,top,right,bottom"], ["image,width,height,sequence,index"]
    for number in range(10):
        image = ground.copy()
        image[20:40, 5 * number:5 * number + 30] = 200
        assert cv2.imwrite(str(tmp_path / "road" / "images" / f"{number}.png"), image)
        boxes.append(f"{number}.png," + (f"car,{5 * number},20,{5 * number + 30},40" if number else ",,,,"))
        frames.append(f"{number}.png,100,60,{'drive' if number < 7 else ''},{2 * number}")
    (tmp_path / "road" / "boxes.csv").write_text("\n".join(boxes))
    (tmp_path / "road" / "frames.csv").write_text("\n".join(frames))
    options = ["--weights", "untrained:4", "--size", "64", "96", "--batch", "4", "--regions", "8", "--images", "1",
               "--workers", "1", "--epochs", "1"]
    said = train("train_on_the_fly", tmp_path, tmp_path / "out", *options)
    assert "8 images for training, 2 for validation, of 1 folder\n" in said and "input 96x64, classes car" in said
    assert_trained(tmp_path / "out", [0, 2], images=1)
    assert "AP50 car" in history(tmp_path / "out")[1] and "predictions" not in said
    said = train("train_on_the_fly", tmp_path, tmp_path / "out", *options, "--classes", "bus", expect=1)
    assert "expected images with boxes of bus, got 8 for training and 2 for validation, with car, in" in said


def test_pairs_on_the_fly_are_of_a_sequence_or_moved(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import cv2
    import train_on_the_fly

    (tmp_path / "images").mkdir()
    image = np.zeros((40, 60), np.uint8)
    image[20:22, 30:33] = 255
    assert cv2.imwrite(str(tmp_path / "images" / "still.png"), image)
    (tmp_path / "boxes.csv").write_text("image,class,left,top,right,bottom,track,note\n"
                                        + "".join(f"{n}.png,car,1,2,3,4,1,\n{n}.png,dog,5,6,7.5,8,,\n"
                                                  for n in (19, 21, 31, "still"))
                                        + "none.png,,,,,,,\n")
    (tmp_path / "frames.csv").write_text("image,width,height,sequence,index\n" + "".join(
        f"{n}.png,60,40,drive,{n}\n" for n in (13, 15, 17, 19, 21, 27, 29, 31))
                                         + "still.png,60,40,,train\n")
    clips = train_on_the_fly.labelled_clips(tmp_path, seed=1)
    assert [clip if isinstance(clip, train_on_the_fly.Moved) else [pathlib.Path(path).stem for path in clip]
            for clip, _ in clips[:2]] == [
        ["13", "15", "17", "19"], ["15", "17", "19", "21"]]
    assert all(isinstance(clip, train_on_the_fly.Moved) for clip, _ in clips[2:])  # 25.png is missing before 31.png
    assert clips[0][1] == {"boxes": [[1, 2, 3, 4], [5, 6, 7.5, 8]], "labels": ["car", "dog"],
                           "id": f"{tmp_path.name}/19.png"}
    assert clips[4][1]["boxes"] == clips[4][1]["labels"] == []
    still = clips[3][0]
    assert still[3] == str(tmp_path / "images" / "still.png") and len(still) == 4

    def middle(image):
        return np.array([np.average(np.arange(length), weights=image[..., 0].sum(axis, dtype=float))
                         for axis, length in ((0, 60), (1, 40))])

    moved = [np.linalg.norm(middle(still[t]) - [31, 20.5]) for t in (2, 1, 0)]
    # 1 to 4 px a step, and at most 1.6 px from the centre (29.5, 19.5) turned and zoomed: 0.03 px a step
    assert 0.9 < moved[0] < 4.1 and np.allclose(moved, np.array([1, 2, 3]) * moved[0], atol=0.3)
    assert (still[0] == train_on_the_fly.labelled_clips(tmp_path, seed=1)[3][0][0]).all()
    assert (still[0] != train_on_the_fly.labelled_clips(tmp_path, seed=2)[3][0][0]).any()


def test_volumes_are_changed_as_they_are_read(folder, tmp_path, monkeypatch):
    """As bright, without noise, frames: what predictions.json is of, from the stored volumes,
    which stay as they are."""
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import cv2
    import training

    def tested(shards, train_shards=None, **options):
        args = argparse.Namespace(**{"test": None, "data": "data", "as_bright": False, "without_noise": False,
                                     **options})
        return training.tested(args, train_shards, shards, None)

    shards, before = Shards(folder), {path: path.read_bytes() for path in folder.iterdir()}
    assert [sample["volume"].tolist() for sample in tested(shards)] == [sample["volume"].tolist() for sample in shards]
    mean = np.mean([sample["volume"].mean() for sample in shards])
    top = max(sample["volume"].max() for sample in shards)
    train_shards = shards.changed(lambda sample: np.full_like(sample["volume"], 2 * mean / top))
    bright = tested(shards.changed(lambda sample: sample["volume"] / top), train_shards, as_bright=True)
    for i in range(len(shards)):
        np.testing.assert_allclose(bright[i]["volume"], np.minimum(2 * shards[i]["volume"] / top, 1), rtol=1e-6)

    events = np.zeros(shards[0]["volume"].shape, np.float32)
    events[0, 0, 0] = events[1, 0, 1] = 0.5  # a pair
    events[[0, 1, 0], [3, 3, 4], [4, 5, 4]] = 0.25  # three, each beside the two others
    quiet = np.where(events == 0.25, events, 0)
    np.testing.assert_array_equal(tested(shards.changed(lambda sample: events), without_noise=True)[0]["volume"], quiet)

    path = tmp_path / "inputs" / shards[0]["pair"]["next_path"]
    path.parent.mkdir(parents=True)
    (folder / "run.json").write_text(json.dumps({"manifest_folder": str(tmp_path / "inputs")}))
    canvas = np.arange(12 * 16, dtype=np.uint8).reshape(12, 16)
    assert cv2.imwrite(str(path), canvas)
    volume = shards.changed(training.labelled_frame)[0]["volume"]  # of half its size
    np.testing.assert_allclose(volume[0], canvas.reshape(6, 2, 8, 2).mean((1, 3)) / 255, atol=0.6 / 255)
    assert not volume[1:].any()
    (folder / "run.json").unlink()
    nowhere = folder / shards[0]["pair"]["next_path"]
    with pytest.raises(ValueError, match=f"expected an image, .* got none, in {nowhere} "):
        shards.changed(training.labelled_frame)[0]
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


@pytest.mark.parametrize("run, base", [({"manifest_folder": "/inputs"}, "/inputs"), (None, "/out"), ([], "/out"),
                                       ({"manifest_folder_bytes": [*b"/in\xff"]}, "/in\udcff")])
def test_paths_of_frames_begin_where_the_manifest_was(tmp_path, monkeypatch, run, base):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import training

    if run is not None:
        (tmp_path / "run.json").write_text(json.dumps(run))
    sample = {"shard": str(tmp_path / "a.h5"), "pair": {"prev_path": "a/0.png", "next_path": "/b/1.png"}}
    assert training.frame_path(sample, "prev") == f"{tmp_path if base == '/out' else base}/a/0.png"
    assert training.frame_path(sample) == "/b/1.png"


def test_flows_of_ids_that_two_have_are_refused(two_shards, monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import training

    args = argparse.Namespace(data=str(two_shards), test=None)
    with pytest.raises(SystemExit, match=f"ids of their own, got '000000', which two samples have, in {two_shards}"):
        training.require_own_ids(args, Shards(two_shards))
    training.require_own_ids(args, Shards(two_shards)[[0, 1]])


def test_minutes_are_those_of_the_steps(tmp_path, monkeypatch, capsys):
    """A step takes 10 seconds, a check 1000: 6 steps are a minute, however long the checks and wherever it is broken
    off."""
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import training

    clock = [0.0]
    monkeypatch.setattr(training, "time", types.SimpleNamespace(monotonic=lambda: clock[0]))
    model = torch.nn.Linear(1, 1)

    def loss_of(batch, progress):
        clock[0] += 10
        return model(batch).sum()

    def check():
        clock[0] += 1000
        return {"score": 2 / 3 if clock[0] < 4000 else math.nan}

    def fit(minutes):
        args = argparse.Namespace(out=str(tmp_path), device="cpu", seed=0, every=1, epochs=None, steps=None,
                                  minutes=minutes)
        training.fit(args, model, torch.optim.SGD(model.parameters(), 0.1), 4 * [torch.ones(1, 1)], loss_of, check,
                     "score")
        return [(row["step"], row["minutes"]) for row in history(tmp_path)]

    assert fit(1.0) == [(0, 0), (4, 0.67), (6, 1)]
    assert "\nscore 0.6667 after 1.0 minutes, untrained 0.6667; " in capsys.readouterr().out
    assert fit(2.0)[3:] == [(10, 1.67), (12, 2)]
    assert "\nscore none after 2.0 minutes, untrained 0.6667; " in capsys.readouterr().out


@pytest.mark.parametrize("damaged", [lambda whole: whole[:len(whole) // 2], lambda _: b"", lambda _: b"hello\n",
                                     lambda _: b"train\n"])
def test_files_of_weights_that_cannot_be_read_are_named_in_a_line(tmp_path, monkeypatch, damaged):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import training

    model, args = torch.nn.Linear(1, 1), argparse.Namespace(out=str(tmp_path), device="cpu")
    paths = [tmp_path / "checkpoint.pt", tmp_path / "tuned" / "checkpoint.pt"]
    paths[1].parent.mkdir()
    (tmp_path / "weights.pt").write_bytes(b"any")
    for path in paths:
        torch.save({"settings": {}, "model": model.state_dict()}, path)
        path.write_bytes(damaged(path.read_bytes()))
    for path, load in zip(paths, (lambda: training.fit(args, model, None, (), None, None, "score"),
                                  lambda: training.tuning(args, 1))):
        with pytest.raises(SystemExit, match=rf"^expected a whole checkpoint, got .+, in {path} \(remove it to start "):
            load()
    with pytest.raises(SystemExit, match=f"^expected a .pt file that contains only tensors, got .+, in {paths[0]}$"):
        training.load_fitting(model, paths[0])


@pytest.mark.parametrize("options, reason", [
    ({"steps": 0}, "expected --out without a training, since --steps is 0, got 3 steps"),
    ({"steps": 9, "channels": "voxel", "defaults": {"channels": "volume"}},
     "expected --channels volume, as when this run started, got voxel"),  # an option that there was not
    ({"steps": 9, "pretrained": "a.pt"}, "expected no --pretrained, as when this run started, got a.pt")])
def test_a_training_goes_on_with_its_own_options(tmp_path, monkeypatch, options, reason):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import training

    model, args = torch.nn.Linear(1, 1), argparse.Namespace(out=str(tmp_path), **options)
    optimizer = torch.optim.SGD(model.parameters(), 1)
    torch.save({"settings": {}, "step": 3, "epoch": 1, "model": model.state_dict(),
                "optimizer": optimizer.state_dict()}, tmp_path / "checkpoint.pt")
    with pytest.raises(SystemExit, match=f"^{reason}, in {tmp_path / 'checkpoint.pt'}$"):
        training.fit(args, model, optimizer, (), None, None, "score")


def test_a_file_of_something_else_has_no_weights_that_fit(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import training

    for other in ([torch.ones(1)], torch.ones(1), {"weight": torch.ones(2)}):
        torch.save(other, tmp_path / "other.pt")
        with pytest.raises(SystemExit, match=f"such as weight, got none, in {tmp_path / 'other.pt'}"):
            training.load_fitting(torch.nn.Linear(1, 1), tmp_path / "other.pt")


def test_what_weights_do_not_fit_begins_anew_and_is_named(tmp_path, monkeypatch, capsys):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import training

    other, model = torch.nn.Linear(3, 2), torch.nn.Linear(4, 2)
    torch.save(other.state_dict(), tmp_path / "w.pt")
    training.load_fitting(model, tmp_path / "w.pt")
    assert torch.equal(model.bias, other.bias)
    training.load_fitting(other, tmp_path / "w.pt")
    assert capsys.readouterr().out.splitlines() == [
        f"1 of the model's 2 tensors loaded from {tmp_path / 'w.pt'}, others begin anew, such as weight",
        f"2 of the model's 2 tensors loaded from {tmp_path / 'w.pt'}"]


def test_what_is_to_be_run_can_be_run():
    for path in (*EXAMPLES.glob("*.py"), *(SOURCE / "tests" / "experiments").glob("*.py")):
        text = path.read_text()
        runs = '__name__ == "__main__"' in text
        assert os.access(path, os.X_OK) == text.startswith("#!/usr/bin/python3\n") == runs, path
    assert "USE_SOURCE_PERMISSIONS" in (SOURCE / "docker" / "CMakeLists.txt").read_text().partition(
        "manifests/python/examples ")[2].partition(")")[0]


def test_what_cannot_be_trained_with_is_named(data, tmp_path):
    said = train("train_torchvision", tmp_path, tmp_path / "out", expect=1)
    assert f"got no {tmp_path / 'dataset.json'}" in said and "Traceback" not in said
    said = train("train_torchvision", data, tmp_path / "out", "--dataset", "kitti_raw", expect=1)
    assert ("('human36m', 'kitti_object', 'mpii'), got 1 that it does not have ('kitti_raw')" in said
            and "Traceback" not in said)
    said = train("train_torchvision", data, tmp_path / "out", "--task", "keypoints", "--dataset", "kitti_object",
                 expect=1)
    assert f"got 0 and 0, in {data} (--dataset kitti_object; it has samples of " in said
    for option in ("--as-bright", "--without-noise", f"--test={data}"):
        said = train("train_torchvision", data, tmp_path / "out", "--task", "keypoints", option, expect=1)
        assert said == (f"expected {option.split('=')[0]} with --task detection only: keypoints have no "
                        "predictions.json\n")
    for limit, value in (("--epochs", "0"), ("--steps", "-1"), ("--minutes", "0"), ("--every", "0")):
        said = train("train_torchvision", data, tmp_path / "out", limit, value, expect=1)
        assert f"expected {limit} " in said and f"got {value}" in said
    for option, value, error in (
            ("--lr", "nan", "above 0 and finite"), ("--minutes", "nan", "above 0 and finite"),
            ("--minutes", "inf", "above 0 and finite"), ("--scale", "0", "above 0 and finite"),
            ("--scale", "-1", "above 0 and finite"), ("--scale", "nan", "above 0 and finite"),
            ("--scale", "1e+09", "of at most 16"), ("--images", "-1", "of at least 0"),
            ("--workers", "-1", "of at least 0")):
        said = train("train_detector", data, tmp_path / "out", "--steps", "1", option, value, expect=1)
        assert said == f"expected {option} {error}, got {value}\n"
    said = train("train_detector", data, tmp_path / "out", "--steps", "1", "--classes", "Car,Van,Car", expect=1)
    assert said == "expected different names in --classes, got Car twice\n"
    for name in ("plan.json", "dataset.json"):
        shards = tmp_path / f"shards with {name}"
        shards.mkdir()
        (shards / name).write_text("{}")
        said = train("train_detector", data, shards, "--steps", "1", expect=1)
        assert said == f"expected a folder of its own for --out, got one of shards, with {name}, in {shards}\n"
        assert [path.name for path in shards.iterdir()] == [name]
    said = train("train_pose", data, tmp_path / "out", "--trainer", tmp_path, "--rotation", "nan", expect=1)
    assert said == "expected --rotation of at least 0, got nan\n"
    said = train("train_pose", data, tmp_path / "out", "--trainer", tmp_path, expect=1)
    assert f"expected the trainer's lib/models, got none, in {tmp_path}" in said

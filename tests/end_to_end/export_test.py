"""Exports of a finalized folder, each read from outside: with numpy, h5py, scipy and tarfile,
and by the trainers that it is for."""

import collections
import io
import json
import pathlib
import shutil
import subprocess
import sys
import tarfile
import textwrap

import h5py
import numpy as np
import PIL.Image
import scipy.io
import yaml

import exported_demo as demo
import program
import small_job
from exported_demo import BROKEN, Export, name_of, of
from program import run, text

TRAINERS = program.SHARED.parent / "trainers"
PIXELS = 0.01  # the largest error of a label that is mapped back
BY_POINT = ("joints", "joints_source", "joints3d_mm", "visible")  # null is said of each joint
PAIR_UNKNOWN = {"prev_video_frame": -1, "next_video_frame": -1}
LABEL_UNKNOWN = {"truncation": -1, "occlusion": -1, "alpha": -10, "box3d": [-1, -1, -1, -1000, -1000, -1000, -10],
                 "track_id": -1, "difficulty": -1, "visible": -1, **{name + source: -1 for source in ("", "_source")
                                                     for name in ("joints", "center", "head_box")}, "scale": -1,
                 "scale_volume": -1}

setUpModule, tearDownModule = demo.set_up, demo.tear_down


def edges_to_source(sample, boxes):
    """Left, top, right, bottom in volume pixels as source pixels: edges lie between pixels."""
    matrix = sample["source_to_volume"]
    scale = np.array([matrix[0, 0], matrix[1, 1]] * 2)
    shift = np.array([matrix[0, 2], matrix[1, 2]] * 2) + 0.5 - 0.5 * scale
    return (np.asarray(boxes) - shift) / scale


def points_to_source(sample, points):
    matrix = sample["source_to_volume"]
    return (np.asarray(points) - matrix[:, 2]) / np.array([matrix[0, 0], matrix[1, 1]])


def events_volume(rows, shape, gap):
    """The volume [18, H, W] of events t, x, y, p, with times from 0 to `gap`."""
    volume = np.zeros(shape)
    bins = shape[0] // 2
    for t, x, y, p in rows:
        star = (bins - 1) * t / gap
        low = min(int(star), bins - 2)
        channel = (0 if p > 0 else bins) + low
        volume[channel, int(y), int(x)] += 1 - (star - low)
        volume[channel + 1, int(y), int(x)] += star - low
    return volume


class Formats(Export):
    def test_export_json_names_every_sample(self):
        self.out, out = demo.exported("webdataset")
        described = self.described()
        self.assertEqual({(entry["split"], entry["sample_id"], entry["name"]) for entry in described["samples"]},
                         {(key[0], key[2], name_of(key)) for key in demo.samples})
        self.assertEqual([entry["sample_id"] for entry in described["quarantined"]], [BROKEN, BROKEN])
        self.assertIn(f"{BROKEN}.png", described["quarantined"][0]["reason"])
        self.assertIn("2 quarantined", out)

    def test_yolo(self):
        self.out, _ = demo.exported("yolo")
        data = yaml.safe_load((self.out / "data.yaml").read_text())
        self.assertEqual(data["nc"], 8)
        self.assertEqual(data["channels"], 18)
        self.assertNotIn("DontCare", data["names"])
        self.assertNotIn("path", data)  # Ultralytics begins at the file's folder then
        self.assertFalse([note for note in self.described()["notes"] if not note.startswith(("pose", "values above"))])
        for split in ("train", "val"):
            lines = (self.out / data[split]).read_text().split()
            self.assertEqual(lines, [f"./images/{split}/{name_of(key)}.png" for key in of(split, "kitti_object")])
        boxes = 0
        for key, sample in of(dataset="kitti_object").items():
            stem = f"{key[0]}/{name_of(key)}"
            codes = np.load(self.out / "images" / f"{stem}.npy")
            self.assertEqual(codes.dtype, np.uint8)
            expected = np.round(np.minimum(sample["volume"].astype(float), 1) * 255)
            np.testing.assert_array_equal(codes, expected.transpose(1, 2, 0))
            with PIL.Image.open(self.out / "images" / f"{stem}.png") as image:
                self.assertEqual((image.height, image.width), codes.shape[:2])
            found = np.loadtxt(self.out / "labels" / f"{stem}.txt", ndmin=2).reshape(-1, 5)
            # What Ultralytics' verify_image_label asks for; it drops a row that comes again.
            self.assertTrue(((found[:, 1:] >= 0) & (found[:, 1:] <= 1)).all() and (found[:, 0] < data["nc"]).all())
            self.assertEqual(len(np.unique(found, axis=0)), len(found))
            kept = np.flatnonzero(sample["boxes"]["ignore"] == 0)
            self.assertEqual([data["names"][int(row[0])] for row in found],
                             [sample["classes"][sample["boxes"]["class_id"][i]] for i in kept])
            size = np.array([codes.shape[1], codes.shape[0]])
            centre, extent = found[:, 1:3] * size, found[:, 3:5] * size
            in_volume = np.hstack([centre - extent / 2, centre + extent / 2])
            np.testing.assert_allclose(in_volume, sample["boxes"]["xyxy"][kept], atol=1e-4)
            whole = (sample["boxes"]["xyxy"] == sample["boxes"]["xyxy_unclipped"]).all(axis=1)[kept]
            np.testing.assert_allclose(edges_to_source(sample, in_volume)[whole],
                                       sample["boxes"]["xyxy_source"][kept][whole], atol=PIXELS)
            boxes += whole.sum()
        self.assertGreater(boxes, 20)
        self.assertFalse([what for what in self.described()["left_out"] if what.startswith("samples of ")])
        self.assertFalse(list((self.out / "images").rglob("human36m*")))

    def test_yolo_poses(self):
        """Persons in folders of their own, a line of the same length for each, as Ultralytics' pose task reads them."""
        own, (self.out, _) = self.out.parent, demo.exported("yolo")
        outside = 0
        for folder_, dataset, swap in (("pose", "mpii", ("l_", "r_")), ("pose-2", "human36m", ("left_", "right_"))):
            data = yaml.safe_load((self.out / folder_ / "data.yaml").read_text())
            self.assertEqual((data["nc"], data["names"], data["channels"]), (1, ["person"], 18))
            self.assertEqual((self.out / folder_ / "train.txt").read_text().split(),
                             [f"./images/train/{name_of(key)}.png" for key in of("train", dataset)])
            names = data["kpt_names"][0]
            self.assertEqual(data["kpt_shape"], [len(names), 3])
            left, right = swap
            self.assertEqual([names[i] for i in data["flip_idx"]],
                             [right + name.removeprefix(left) if name.startswith(left) else
                              left + name.removeprefix(right) if name.startswith(right) else name for name in names])
            for key, sample in of("train", dataset).items():
                stem = f"train/{name_of(key)}"
                codes = np.load(self.out / folder_ / "images" / f"{stem}.npy")
                size = np.array([codes.shape[1], codes.shape[0]])
                np.testing.assert_array_equal(
                    codes, np.round(np.minimum(sample["volume"].astype(float), 1) * 255).transpose(1, 2, 0))
                rows = np.loadtxt(self.out / folder_ / "labels" / f"{stem}.txt", ndmin=2)
                poses, chosen = sample["poses"], sample["joints"]
                self.assertEqual(rows.shape, (len(poses["joints"]), 5 + 3 * len(names)))
                joints = rows[:, 5:].reshape(len(rows), -1, 3)
                self.assertTrue((rows[:, 0] == 0).all() and (rows[:, 1:5] <= 1).all() and (joints[..., :2] <= 1).all()
                                and (rows >= 0).all())
                for found, box, all_joints, visible in zip(joints, rows[:, 1:5], poses["joints"], poses["visible"]):
                    at, seen = all_joints[chosen], visible[chosen]
                    annotated = (at != -1).any(axis=1)
                    there = annotated & ((at + 0.5 >= 0) & (at + 0.5 <= size)).all(axis=1)
                    outside += (annotated & ~there).sum()
                    np.testing.assert_array_equal(found[:, 2], np.where(there, np.where(seen == 0, 1, 2), 0))
                    np.testing.assert_allclose(found[:, :2] * size, np.where(there[:, None], at + 0.5, 0), atol=1e-6)
                    corners = np.concatenate([box[:2] - box[2:] / 2, box[:2] + box[2:] / 2]) * np.tile(size, 2)
                    self.assertTrue((corners[:2] <= (at[there] + 0.5).min(axis=0) + 1e-6).all()
                                    or dataset == "human36m")
                    self.assertTrue((corners[2:] >= (at[there] + 0.5).max(axis=0) - 1e-6).all()
                                    or dataset == "human36m")
        self.assertEqual(self.described()["left_out"].get("joints outside the volume (as not annotated)", 0), outside)
        alone, out = demo.exported("yolo", "--split", "val")
        self.assertFalse((alone / "pose").exists())
        self.assertIn("note: data.yaml has no split train, which Ultralytics needs", out)
        alone = own / "alone"
        out, _ = self.export("yolo", "--split", "train", out=alone)
        for folder in ("", "pose/", "pose-2/"):
            self.assertIn(f"note: {folder}data.yaml has val: train.txt, since there is no split val", out)
            self.assertEqual(yaml.safe_load((alone / folder / "data.yaml").read_text())["val"], "train.txt")

    def test_images_of_three_channels(self):
        def expected(sample, full_scale):
            bins = len(sample["volume"]) // 2
            positive, negative = (part.astype(float).sum(axis=0) / full_scale
                                  for part in (sample["volume"][:bins], sample["volume"][bins:]))
            channels = np.stack([positive, 0.5 + (positive - negative) / 2, negative], axis=-1)
            return 255 * np.clip(channels, 0, 1)

        self.export("yolo", "--split", "val", "--images", "png", "--full-scale", "3")
        self.assertFalse(list(self.out.rglob("*.npy")))
        self.assertEqual(yaml.safe_load((self.out / "data.yaml").read_text())["channels"], 3)
        coco = self.out.parent / "coco"
        self.export("coco", "--split", "val", "--images", "png", out=coco)
        listed = {image["sample_id"]: image["file_name"]
                  for name in ("instances", "person_keypoints") if (coco / f"{name}_val.json").exists()
                  for image in json.loads((coco / f"{name}_val.json").read_text())["images"]}
        for key, sample in of("val").items():
            name = f"images/val/{name_of(key)}.png"
            self.assertEqual(listed[key[2]], name)
            for folder, full_scale in ((self.out, 3), (coco, 1)):
                with PIL.Image.open(folder / name) as image:
                    self.assertEqual(image.mode, "RGB")
                    self.assertLess(np.abs(np.asarray(image) - expected(sample, full_scale)).max(), 0.502)
        _, err = self.export("coco", "--full-scale", "2", out=self.out.parent / "none", expect=64)
        self.assertIn("--full-scale: expected --images png with --to coco", err)

    def test_yolo_classes_and_ignored(self):
        classes = demo.folder / "classes.json"
        classes.write_text(json.dumps({"Car": 0, "Van": 0, "Pedestrian": 1, "Truck": None}))
        out, _ = self.export("yolo", "--classes", classes, "--ignored", "keep", "--split", "val")
        data = yaml.safe_load((self.out / "data.yaml").read_text())
        self.assertEqual(data["names"], ["Car/Van", "Pedestrian", "ignored"])
        self.assertNotIn("train", data)
        expected, found = collections.Counter(), collections.Counter()
        for key, sample in of("val").items():
            for class_id, ignore in zip(sample["boxes"]["class_id"], sample["boxes"]["ignore"]):
                name = sample["classes"][class_id]
                expected["ignored" if ignore else "Car/Van" if name in ("Car", "Van") else name] += 1
            for line in (self.out / "labels" / "val" / f"{name_of(key)}.txt").read_text().splitlines():
                found[data["names"][int(line.split()[0])]] += 1
        left_out = {name: count for name, count in expected.items() if name not in data["names"]}
        self.assertEqual(found, {name: expected[name] for name in data["names"] if expected[name]})
        described = self.described()["left_out"]
        for name, count in left_out.items():
            self.assertEqual(described[f"boxes of class {name}"], count)
            self.assertIn(f"left out: boxes of class {name}: {count}\n", out)

    def test_yolo_full_scale(self):
        self.export("yolo", "--split", "val", "--full-scale", "0.5")
        beyond = sum(sample["volume"].max() > 0.5 for sample in of("val").values())
        told = [note for note in self.described()["notes"] if note.startswith("values above the full scale of 0.5 ")]
        self.assertGreater(beyond, 0)
        self.assertEqual([f"in {beyond} sample" in note for note in told], [True])
        for key, sample in of("val").items():
            codes = np.load(self.out / "images" / "val" / f"{name_of(key)}.npy")
            values = np.minimum(sample["volume"].astype(float), 0.5)
            np.testing.assert_allclose(codes.transpose(2, 0, 1) / 255 * 0.5, values, atol=0.5 / 510 + 1e-6)

    def test_coco(self):
        self.out, _ = demo.exported("coco")
        for split in ("train", "val"):
            coco = json.loads((self.out / f"instances_{split}.json").read_text())
            names = {category["id"]: category["name"] for category in coco["categories"]}
            self.assertEqual(sorted(names), list(range(1, 9)))
            self.assertEqual([image["sample_id"] for image in coco["images"]],
                             [key[2] for key in of(split, "kitti_object")])
            self.assertEqual([one["id"] for one in coco["annotations"]], list(range(1, len(coco["annotations"]) + 1)))
            of_image = collections.defaultdict(list)
            for one in coco["annotations"]:
                of_image[one["image_id"]].append(one)
            for image, sample in zip(coco["images"], of(split, "kitti_object").values()):
                volume = np.load(self.out / image["file_name"])
                np.testing.assert_array_equal(volume, sample["volume"])  # shards have float16 too
                self.assertEqual((18, image["height"], image["width"]), volume.shape)
                boxes = sample["boxes"]
                found = [one for one in of_image[image["id"]] if not one["iscrowd"]]
                kept = np.flatnonzero(boxes["ignore"] == 0)
                self.assertEqual([names[one["category_id"]] for one in found],
                                 [sample["classes"][i] for i in boxes["class_id"][kept]])
                xywh = np.array([one["bbox"] for one in found]).reshape(-1, 4)
                np.testing.assert_allclose(np.hstack([xywh[:, :2], xywh[:, :2] + xywh[:, 2:]]), boxes["xyxy"][kept],
                                           atol=1e-9)
                np.testing.assert_allclose([one["area"] for one in found], xywh[:, 2] * xywh[:, 3])
                # A region to ignore is a crowd of each class.
                self.assertEqual(len(of_image[image["id"]]) - len(found), 8 * (boxes["ignore"] == 1).sum())
        self.assertFalse((self.out / "person_keypoints_val.json").exists())
        self.check_keypoints(json.loads((self.out / "person_keypoints_train.json").read_text()))

    def check_keypoints(self, coco):
        persons = {key: sample for key, sample in of("train").items() if key[1] != "kitti_object"}
        self.assertEqual([image["sample_id"] for image in coco["images"]], [key[2] for key in persons])
        self.assertEqual([category["name"] for category in coco["categories"]], ["person", "person-2"])
        self.assertEqual([len(category["keypoints"]) for category in coco["categories"]], [16, 17])
        for category in coco["categories"]:
            ends = np.array(category["skeleton"])
            self.assertGreater(len(ends), 9)
            self.assertTrue(1 <= ends.min() and ends.max() <= len(category["keypoints"]))
        images = {image["id"]: sample for image, sample in zip(coco["images"], persons.values())}
        for image_id, sample in images.items():
            found = [one for one in coco["annotations"] if one["image_id"] == image_id]
            poses = sample["poses"]
            self.assertEqual(len(found), len(poses["joints"]))
            for one, joints, source, visible in zip(found, poses["joints"], poses["joints_source"], poses["visible"]):
                keypoints = np.array(one["keypoints"]).reshape(-1, 3)
                chosen = sample["joints"]
                there = (joints[chosen] != -1).any(axis=1)
                np.testing.assert_array_equal(keypoints[:, 2] > 0, there)
                np.testing.assert_array_equal(keypoints[there, 2] == 1, visible[chosen][there] == 0)
                np.testing.assert_allclose(points_to_source(sample, keypoints[there, :2] - 0.5), source[chosen][there],
                                           atol=PIXELS)
                self.assertEqual(one["num_keypoints"], there.sum())

    def test_sources_with_the_same_ids_draw_events_of_their_own(self):
        folder = demo.folder / "twice"
        for root in ("a", "b", "c"):
            for number in range(3):
                small_job.save_image(folder / root / f"{number:03}.png", np.random.default_rng(number))
        sources = [{"dataset": "frames", "root": root, "split": split, "pairs": program.pairs([1])}
                   for root, split in (("a", "train"), ("b", "train"), ("c", "val"))]
        manifest = folder / "twice.json"
        manifest.write_text(json.dumps(program.manifest(sources, generator={"kind": "difference"},
                                                        output={"directory": "out"})))
        run("convert", manifest, "--progress", "none")
        self.export("events", source=folder / "out")
        drawn = {path.relative_to(self.out).as_posix(): path.read_bytes() for path in self.out.glob("events/*/*.txt")}
        self.assertEqual((len(drawn), len(set(drawn.values()))), (6, 6), sorted(drawn))

    def test_coco_categories_of_persons_are_the_same_in_all_splits(self):
        sources = [{"dataset": "mpii", "root": "mpii", "pairs": program.pairs([2], side="around"), "split": "val"},
                   {"dataset": "human36m", "root": "h36m", "layout": "fetch",
                    "pairs": program.pairs([1], side="after")}]
        manifest = demo.folder / "demo" / "persons.json"
        manifest.write_text(json.dumps(program.manifest(sources, generator={"kind": "difference"},
                                                        output={"directory": "persons", "samples_per_shard": 8})))
        run("convert", manifest, "--progress", "none")
        self.export("coco", source=demo.folder / "demo" / "persons")
        found = {split: json.loads((self.out / f"person_keypoints_{split}.json").read_text())
                 for split in ("val", "train")}
        self.assertEqual(found["val"]["categories"], found["train"]["categories"])
        self.assertEqual([len(category["keypoints"]) for category in found["val"]["categories"]], [16, 17])
        for split, category in (("val", 1), ("train", 2)):
            self.assertEqual({one["category_id"] for one in found[split]["annotations"]}, {category})
        alone = self.out.parent / "alone"
        self.export("coco", "--split", "train", source=demo.folder / "demo" / "persons", out=alone)
        self.assertEqual((alone / "person_keypoints_train.json").read_bytes(),
                         (self.out / "person_keypoints_train.json").read_bytes())

    def converted_photographs(self, name, labels, *others, **source):
        """Two photographs and the sources beside them, converted."""
        folder = demo.folder / name
        (folder / "images").mkdir(parents=True)
        for image in ("a.png", "b.png"):
            shutil.copy(demo.folder / "demo/kitti/training/image_2/000000.png", folder / "images" / image)
        (folder / labels[0]).write_text(labels[1])
        photographs = {"dataset": "frames", "root": "images", "pairs": {"from": "stills"}, "split": "val",
                       "labels": {"path": labels[0], "format": "csv" if labels[0].endswith(".csv") else "coco"},
                       **source}
        manifest = folder / "manifest.json"
        manifest.write_text(json.dumps(program.manifest([*others, photographs], generator={"kind": "difference"},
                                                        output={"directory": "out"}, errors={
                                                            "policy": "quarantine", "max_count": 1,
                                                            "max_fraction": 0.5})))
        run("convert", manifest, "--progress", "none")
        return folder / "out"

    def test_a_class_has_one_number_in_all_splits(self):
        labels = "boxes.csv", ("image,class,left,top,right,bottom\n"
                               "a.png,Zebra,290,80,330,110\nb.png,Zebra,300,80,330,100\n")
        kitti = {"dataset": "kitti_object", "root": "../demo/kitti/training", "pairs": program.pairs([1])}
        source = self.converted_photographs("zebras", labels, kitti)
        self.export("coco", source=source)
        both = json.loads((self.out / "instances_val.json").read_text())
        alone = self.out.parent / "alone"
        self.export("coco", "--split", "val", source=source, out=alone)
        self.assertEqual(json.loads((alone / "instances_val.json").read_text())["categories"], both["categories"])
        numbers = {category["name"]: category["id"] for category in both["categories"]}
        self.assertGreater(numbers["Zebra"], numbers["Car"])
        self.assertEqual({one["category_id"] for one in both["annotations"]}, {numbers["Zebra"]})

    def test_coco_ids_are_kept_where_it_is_clear_whose_they_are(self):
        annotations = [{"id": 7, "image_id": 1, "category_id": 2, "bbox": [290, 80, 30, 20], "area": 600, "iscrowd": 0},
                       {"id": 8, "image_id": 1, "category_id": 9, "bbox": [290, 80, 30, 20], "area": 600, "iscrowd": 0}]
        for rider, kept in (([290, 80, 30, 20], False), ([290, 80, 30, 21], True)):
            annotations[0]["bbox"] = rider
            labels = json.dumps({"images": [{"id": 1, "file_name": "a.png", "width": 621, "height": 188}],
                                 "annotations": annotations, "categories": [{"id": 2, "name": "rider"},
                                                                            {"id": 9, "name": "person"}]})
            source = self.converted_photographs(f"riders_{kept}", ("labels.json", labels), classes=["person"])
            out = self.out.parent / f"riders_{kept}"
            self.export("coco", source=source, out=out)
            found = json.loads((out / "instances_val.json").read_text())
            self.assertEqual([(one["id"], one["category_id"]) for one in found["annotations"]],
                             [(8, 9)] if kept else [(1, 1)])

    def test_coco_ids_are_kept_beside_sources_without(self):
        labels = "labels.json", json.dumps({
            "images": [{"id": 40, "file_name": "a.png", "width": 621, "height": 188}],
            "annotations": [{"id": 70, "image_id": 40, "category_id": 9, "bbox": [290, 80, 30, 20], "area": 600,
                             "iscrowd": 0}], "categories": [{"id": 9, "name": "person"}]})
        boxes = demo.folder / "boxes.csv"
        boxes.write_text("image,class,left,top,right,bottom\nb.png,Zebra,290,80,330,110\n")
        for name, more in (("bare", {}), ("labelled", {"labels": {"path": str(boxes), "format": "csv"}})):
            with self.subTest(name=name):
                other = {"dataset": "frames", "root": "images", "pairs": {"from": "stills"}, "split": "val", **more}
                source = self.converted_photographs(f"beside_{name}", labels, other)
                out = self.out.parent / f"beside_{name}"
                self.export("coco", source=source, out=out)
                found = json.loads((out / "instances_val.json").read_text())
                images = {image["id"] for image in found["images"]}
                self.assertEqual(len(images), len(found["images"]))
                self.assertIn(40, images)
                places = [(one["id"], one["image_id"], one["category_id"] == 9) for one in found["annotations"]]
                self.assertIn((70, 40, True), places)
                others = [place for place in places if not place[2]]
                self.assertEqual(len(places), 1 + len(others))
                self.assertEqual([place[0] for place in others], [71] if more else [])
                self.assertTrue(all(image > 40 and image in images for _, image, _ in others))

    def test_mpii(self):
        self.out, out = demo.exported("mpii")
        self.assertIn("for MMPose --to coco", out)
        self.assertEqual(sorted(path.name for path in (self.out / "annot").iterdir()),
                         ["gt_train-human36m.mat", "gt_train-mpii.mat", "train-human36m.json", "train-mpii.json"])
        for dataset, joints in (("mpii", 16), ("human36m", 17)):
            entries = json.loads((self.out / "annot" / f"train-{dataset}.json").read_text())
            truth = scipy.io.loadmat(self.out / "annot" / f"gt_train-{dataset}.mat")
            persons = [(key, sample, row) for key, sample in of("train", dataset).items()
                       for row in range(len(sample["poses"]["scale"])) if sample["poses"]["scale"][row] > 0]
            self.assertEqual(len(entries), len(persons))
            self.assertEqual(truth["pos_gt_src"].shape, (joints, 2, len(entries)))
            self.assertEqual(truth["headboxes_src"].shape, (2, 2, len(entries)))
            for n, (entry, (key, sample, row)) in enumerate(zip(entries, persons)):
                poses, chosen = sample["poses"], sample["joints"]
                self.assertEqual(entry["image"], f"train/{name_of(key)}.png")
                self.assertTrue((self.out / "images" / entry["image"]).exists())
                there = np.array(entry["joints_vis"]) == 1
                np.testing.assert_array_equal(there, (poses["joints"][row][chosen] != -1).any(axis=1))
                in_volume = np.array(entry["joints"]) - 1
                np.testing.assert_allclose(points_to_source(sample, in_volume[there]),
                                           poses["joints_source"][row][chosen][there], atol=PIXELS)
                np.testing.assert_allclose(np.array(entry["center"]) - 1, poses["center"][row])
                self.assertAlmostEqual(entry["scale"], poses["scale_volume"][row])
                np.testing.assert_array_equal(truth["jnt_missing"][:, n], ~there)
                np.testing.assert_allclose(truth["pos_gt_src"][there, :, n] - 1, in_volume[there])
                if dataset == "mpii":
                    np.testing.assert_allclose(truth["headboxes_src"][:, :, n].ravel() - 1, poses["head_box"][row])
            names = [text(cell[0]) for cell in truth["dataset_joints"][0]]
            self.assertLess({"head", "neck", "lsho", "rank", "pelv"}, set(names))

    def test_davis(self):
        self.out, _ = demo.exported("davis")
        kitti = of("train", "kitti_object")
        with h5py.File(self.out / "train-kitti_object.hdf5") as file:
            events, valid = file["davis/events"], file["davis/valid"][:]
            self.assertEqual(events.dtype, np.float16)
            self.assertEqual(events.chunks, (1, *events.shape[1:]))
            ids = {int(key[2]): sample for key, sample in kitti.items()}
            self.assertEqual(len(events), max(ids) + 1)
            np.testing.assert_array_equal(np.flatnonzero(valid), sorted(ids))
            for row in range(len(events)):
                expected = ids[row]["volume"].transpose(1, 2, 0) if row in ids else 0 * events[row]
                np.testing.assert_array_equal(events[row], expected)
            # The detector's list of ids: a line for each row that there is, and none for a missing frame.
            lines = (self.out / "train-kitti_object.txt").read_text().splitlines()
            self.assertEqual([int(line) for line in lines], list(np.flatnonzero(valid)))
            self.assertLess(len(lines), len(valid))
        self.assertEqual((self.out / "val.txt").read_text().split(), [key[2] for key in of("val")])
        for dataset in ("mpii", "human36m"):
            persons = [(key[2], sample, row) for key, sample in of("train", dataset).items()
                       for row in range(len(sample["poses"]["scale"])) if sample["poses"]["scale"][row] > 0]
            with np.load(self.out / f"train-{dataset}.npz") as entries, \
                    h5py.File(self.out / f"train-{dataset}.hdf5") as file:
                self.assertEqual(list(entries["imgname"]), [key for key, _, _ in persons])
                self.assertEqual(entries["views"].shape, (len(persons), 5))
                self.assertTrue((file["davis/valid"][:] == 1).all())
                for n, (_, sample, row) in enumerate(persons):
                    np.testing.assert_array_equal(file["davis/events"][n], sample["volume"].transpose(1, 2, 0))
                    self.assertEqual(entries["views"][n, 2], sample["label_index"])
                    np.testing.assert_allclose(entries["center"][n], sample["poses"]["center"][row])
                    self.assertAlmostEqual(entries["scale"][n], sample["poses"]["scale_volume"][row])
                    part = entries["part"][n]
                    there = part[:, 2] == 1
                    source = sample["poses"]["joints_source"][row][sample["joints"]]
                    np.testing.assert_allclose(points_to_source(sample, part[there, :2]), source[there], atol=PIXELS)

    def test_davis_in_float32(self):
        self.export("davis", "--dtype", "float32", "--split", "val")
        with h5py.File(self.out / "val.hdf5") as file:
            self.assertEqual(file["davis/events"].dtype, np.float32)
            for key, sample in of("val").items():
                np.testing.assert_array_equal(file["davis/events"][int(key[2])], sample["volume"].transpose(1, 2, 0))

    def test_davis_has_a_file_for_each_size_and_a_row_for_each_image(self):
        cars = self.out.parent / "cars"
        small_job.write_cars(cars, 4, np.random.default_rng(7))
        for path in [cars / "image_2" / "000002.png", *(cars / "prev_2").glob("000002_*.png")]:
            with PIL.Image.open(path) as image:
                image.resize((40, 30)).save(path)
        sources = [{"dataset": "kitti_object", "root": str(cars), "pairs": program.pairs(gaps, choose=choose),
                    "split": split}
                   for split, gaps, choose in (("one", [1, 2], "one"), ("all", [1, 2], "all"), ("two", [2], "all"))]
        manifest = self.out.parent / "manifest.json"
        manifest.write_text(json.dumps(program.manifest(sources, generator={"kind": "difference"})))
        run("convert", manifest, "--progress", "none")
        self.export("davis", "--split", "one", source=self.out.parent / "out")
        valid = {}
        for path in self.out.glob("*.hdf5"):
            with h5py.File(path) as file:
                valid[path.name] = (file["davis/events"].shape, list(file["davis/valid"][:]))
        self.assertEqual(valid, {"one-kitti_object-24x32.hdf5": ((4, 24, 32, 18), [1, 1, 0, 1]),
                                 "one-kitti_object-30x40.hdf5": ((3, 30, 40, 18), [0, 0, 1])})
        self.assertEqual((self.out / "one-kitti_object-24x32.txt").read_text(), "000000\n000001\n000003\n")
        two = self.out.parent / "two"
        self.export("davis", "--split", "two", source=self.out.parent / "out", out=two)
        # no 000000@before2
        self.assertEqual((two / "two-kitti_object-24x32.txt").read_text(), "000000\n000001\n000003\n")
        for splits in (["--split", "all"], []):
            _, err = self.export("davis", *splits, source=self.out.parent / "out", out=self.out.parent / "yolo",
                                 expect=64)
            self.assertIn("000000@before1 and 000000@before2", err)
            self.assertFalse((self.out.parent / "yolo").exists())
        self.export("yolo", "--split", "all", source=self.out.parent / "out", out=self.out.parent / "yolo")
        self.assertTrue((self.out.parent / "yolo" / "images" / "all" / "000002@before2.npy").exists())

    def test_webdataset(self):
        self.out, _ = demo.exported("webdataset")
        seen = 0
        for path in sorted(self.out.glob("*.tar")):
            shard = (demo.finalized / path.name).with_suffix(".h5")
            # Deflate without HDF5's shuffling is a little worse.
            self.assertLess(path.stat().st_size, 1.6 * shard.stat().st_size + 20000)
            with tarfile.open(path) as tar:
                members = tar.getmembers()
                self.assertTrue(all(member.mtime == 0 and member.uid == 0 for member in members))
                files = {member.name: tar.extractfile(member).read() for member in members}
            self.assertEqual(len({name.split(".")[0] for name in files}) * 2, len(files))  # webdataset's keys
            for name in [name for name in files if name.endswith(".json")]:
                labels = json.loads(files[name])
                sample = demo.samples[labels["split"], labels["dataset"], labels["sample_id"]]
                self.assertEqual(name, name_of((labels["split"], labels["dataset"], labels["sample_id"])) + ".json")
                with np.load(io.BytesIO(files[name.replace(".json", ".npz")])) as arrays:
                    np.testing.assert_array_equal(arrays["volume"], sample["volume"])
                    self.assertEqual(arrays["volume"].dtype, np.float16)
                    self.assertEqual(arrays["scale"], 1)
                self.check_columns(labels, sample["pairs"], PAIR_UNKNOWN)
                for key, kind in (("boxes", "boxes"), ("persons", "poses")):
                    self.assertEqual(len(labels.get(key, [])), len(next(iter(sample[kind].values()))))
                    for row, entry in enumerate(labels.get(key, [])):
                        self.check_columns(entry, {name: column[row] for name, column in sample[kind].items()},
                                           LABEL_UNKNOWN)
                np.testing.assert_allclose(np.array([box["xyxy"] for box in labels.get("boxes", [])]).reshape(-1, 4),
                                           sample["boxes"]["xyxy"])
                for person, joints in zip(labels.get("persons", []), sample["poses"]["joints"]):
                    found = np.array([joint or [-1, -1] for joint in person["joints"]])
                    np.testing.assert_allclose(found, joints)
                seen += 1
        self.assertEqual(seen, len(demo.samples))

    def check_columns(self, entry, columns, unknown):
        """Each column of a shard's row is in the JSON, in its shape, with null for what is unknown."""
        for name, value in columns.items():
            if isinstance(value, (bytes, str)):
                self.assertEqual(entry[name], text(value) or None, name)
                continue
            value = np.asarray(value, float)
            points = value[None] if value.ndim == 0 or name not in BY_POINT else value
            found = [entry[name]] if value.ndim == 0 or name not in BY_POINT else entry[name] or [None] * len(value)
            self.assertEqual(len(found), len(points), name)
            for one, expected in zip(found, points):
                if np.isnan(expected).all() or name in unknown and (expected == unknown[name]).all():
                    self.assertIsNone(one, name)
                else:
                    np.testing.assert_allclose(one, expected, err_msg=name)

    def test_events_as_text(self):
        self.export("events", "--counts", "rounded", "--split", "val")
        for key, sample in of("val").items():
            rows = np.loadtxt(self.out / "events" / "val" / f"{name_of(key)}.txt", ndmin=2)
            self.assertTrue((np.diff(rows[:, 0]) >= 0).all())
            again = events_volume(rows, sample["volume"].shape, sample["gap_s"])
            np.testing.assert_allclose(again, np.floor(sample["volume"].astype(float) + 0.5), atol=1e-4)
            self.assertLessEqual(np.abs(again - sample["volume"]).max(), 0.5 + 1e-4)

    def test_events_in_mvsecs_layout_follow_the_seed(self):
        self.export("events", "--layout", "mvsec", "--split", "val")
        seeded = self.out.parent / "seeded"
        self.export("events", "--layout", "mvsec", "--split", "val", "--seed", "5", out=seeded)
        expected = got = 0
        for key, sample in of("val").items():
            name = pathlib.Path("events") / "val" / f"{name_of(key)}.hdf5"
            with h5py.File(self.out / name) as file, h5py.File(seeded / name) as other:
                left = file["davis/left"]
                self.assertEqual(left["image_raw"].shape, (2, *sample["volume"].shape[1:]))
                np.testing.assert_allclose(left["image_raw_ts"][:], [0, sample["gap_s"]])
                self.assertEqual(left["image_raw_event_inds"][1], len(left["events"]) - 1)
                rows = left["events"][:][:, [2, 0, 1, 3]]
                self.assertFalse(len(rows) == len(other["davis/left/events"]) and
                                 (left["events"][:] == other["davis/left/events"][:]).all())
            expected += sample["volume"].sum(dtype=float)
            got += events_volume(rows, sample["volume"].shape, sample["gap_s"]).sum()
        self.assertLess(abs(got - expected), 5 * np.sqrt(expected))


class Trainers(Export):
    """The trainers' own readers."""

    def setUp(self):
        if not TRAINERS.is_dir():
            self.skipTest("no ../shared/trainers")
        super().setUp()

    def python(self, paths, code):
        environment = {"PYTHONPATH": ":".join(map(str, paths)), "PYTHONDONTWRITEBYTECODE": "1", "PATH": "/usr/bin:/bin",
                       "OMP_NUM_THREADS": "1"}
        done = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True,
                              cwd=self.out, env=environment)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

    def test_yolov3_reads_lists_and_labels(self):
        shutil.copytree(demo.exported("yolo")[0], self.out)
        counted = self.python([TRAINERS / "yolov3", TRAINERS / "stubs"], """
            from utils.datasets import LoadImagesAndLabels
            data = LoadImagesAndLabels("train.txt", img_size=160, batch_size=2, augment=False)
            image, labels, path, _ = data[0]
            print(len(data), sum(len(one) for one in data.labels), len(labels))
            """).split()[-3:]
        kitti = of("train", "kitti_object")
        boxes = [int((sample["boxes"]["ignore"] == 0).sum()) for sample in kitti.values()]
        self.assertEqual(counted, [str(len(kitti)), str(sum(boxes)), str(boxes[0])])

    def test_pose_resnet_reads_the_list_and_scores_the_truth(self):
        shutil.copytree(demo.exported("mpii")[0], self.out)
        score = self.python([TRAINERS / "pose_resnet" / "lib", TRAINERS / "stubs"], """
            import numpy as np
            from easydict import EasyDict
            from dataset.mpii import MPIIDataset
            cfg = EasyDict(OUTPUT_DIR="", DATASET=dict(ROOT=".", TEST_SET="train-mpii", DATA_FORMAT="png",
                           SCALE_FACTOR=0.25, ROT_FACTOR=30, FLIP=False, SELECT_DATA=False),
                           MODEL=dict(IMAGE_SIZE=np.array([256, 256]),
                                      EXTRA=dict(TARGET_TYPE="gaussian", HEATMAP_SIZE=np.array([64, 64]), SIGMA=2)))
            data = MPIIDataset(cfg, ".", "train-mpii", False)
            image, target, weight, meta = data[0]
            assert target.shape == (16, 64, 64) and weight.sum() > 8, target.shape
            truth = np.array([entry["joints_3d"] for entry in data.db])
            _, mean = data.evaluate(cfg, truth, "")
            _, off = data.evaluate(cfg, truth + [500, 0, 0], "")
            print(len(data), mean, off)
            """).split()[-3:]
        persons = sum(int((sample["poses"]["scale"] > 0).sum()) for sample in of("train", "mpii").values())
        self.assertEqual(int(score[0]), persons)
        self.assertAlmostEqual(float(score[1]), 100)
        self.assertAlmostEqual(float(score[2]), 0)


    def test_pose_resnet_changed_as_the_guide_says_reads_human36m(self):
        guide = (program.SOURCE / "manifests" / "guides" / "exports.md").read_text()
        shutil.copytree(demo.exported("mpii")[0], self.out)
        folders = [TRAINERS / "pose_resnet" / "lib", TRAINERS / "stubs"]
        score = self.python(folders, f"guide = {guide!r}\n" + textwrap.dedent("""
            import importlib
            import inspect
            import numpy as np
            from easydict import EasyDict
            mpii = importlib.import_module("dataset.mpii")
            code = inspect.getsource(mpii)
            for start in ("self.num_joints =", "self.flip_pairs =", "self.parent_ids =", "pckAll = np.zeros",
                          "PCKh.mask[", "jnt_count.mask["):
                old, new = ([line.split("#")[0].strip() for line in text.splitlines() if line.strip().startswith(start)]
                            for text in (code, guide))
                assert len(old) == len(new) == 1, (old, new)
                code = code.replace(old[0], new[0])
            exec(code, mpii.__dict__)
            cfg = EasyDict(OUTPUT_DIR="", DATASET=dict(ROOT=".", TEST_SET="train-human36m", DATA_FORMAT="png",
                           SCALE_FACTOR=0.25, ROT_FACTOR=30, FLIP=True, SELECT_DATA=False),
                           MODEL=dict(IMAGE_SIZE=np.array([256, 256]),
                                      EXTRA=dict(TARGET_TYPE="gaussian", HEATMAP_SIZE=np.array([64, 64]), SIGMA=2)))
            data = mpii.MPIIDataset(cfg, ".", "train-human36m", True)
            assert data[0][1].shape == (17, 64, 64)
            truth = np.array([entry["joints_3d"] for entry in data.db])
            _, mean = data.evaluate(cfg, truth, "")
            print(len(data), mean)
            """)).split()[-2:]
        persons = sum(int((sample["poses"]["scale"] > 0).sum()) for sample in of("train", "human36m").values())
        self.assertEqual(int(score[0]), persons)
        self.assertAlmostEqual(float(score[1]), 100)


if __name__ == "__main__":
    program.main()

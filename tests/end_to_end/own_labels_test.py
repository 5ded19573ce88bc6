"""Labels of one's own from file to shard and out again: the same boxes and ids, of synthetic images and of real ones;
and 100,000 images of COCO, planned in linear time."""

import csv
import json
import os
import shutil
import subprocess
import sys

import cv2
import h5py
import numpy as np
import PIL.Image
import yaml

import program
from folders import quarantined
from program import SHARED, manifest, pairs, run, text
from scale_test import MOST_LINKS, Measured, grey_png
from small_job import LENIENT

PIXELS = 1e-4
LABELLED = SHARED / "labelled_frames"
CATEGORIES = {1: "person", 3: "car", 2: "bicyclist", 8: "truck"}
JOINTS = ["nose", "left_hand", "right_hand"]
PLAN_LIMIT_BYTES = 1e9
PLAN_LIMIT_S = 120


class OwnLabels(program.InFolder):
    def job(self, labels, root="images", name="out", **image):
        """Converts the source; every sample of its shards by id: class and box of each object,
        and of each person the joints."""
        source = {"dataset": "frames", "root": str(root), "labels": labels, "pairs": pairs([1])}
        path = self.write_manifest(manifest([source], image={"preset": "mpii", **image},
                                            generator={"kind": "difference"},
                                            output={"directory": name, "samples_per_shard": 64, "dtype": "uint8"}),
                                   f"{name}.json")
        out, _ = run("convert", path, "--progress", "none")
        deep, _ = run("verify", "--deep", self.folder / name)
        self.samples = {}
        for shard in sorted((self.folder / name).glob("*-of-*.h5")):
            with h5py.File(shard) as file:
                self.read_shard(file)
        self.assertIn(f"labels of {len(self.samples)} samples compared with their sources", deep)
        self.assertTrue(self.samples)
        return out

    def read_shard(self, file):
        boxes, classes = file["labels/boxes"], file["labels/boxes/class_id"].attrs["class_names"]
        for i, sample_id in enumerate(file["pairs/sample_id"]):
            rows = range(*boxes["offsets"][i:i + 2])
            matrix = file["pairs/source_to_volume"][i]
            self.samples[text(sample_id)] = {
                "boxes": [(text(classes[boxes["class_id"][row]]), boxes["xyxy_unclipped"][row],
                           bool(boxes["ignore"][row])) for row in rows],
                "tracks": [int(boxes["track_id"][row]) for row in rows],
                "original": bytes(file["labels/original"][i]), "matrix": matrix}

    def assert_boxes(self, expected, tolerance=PIXELS):
        """`expected`: of each sample the class, left, top, right, bottom in pixels of the image,
        in the labels' order."""
        for sample_id, sample in self.samples.items():
            self.assertEqual([box[0] for box in sample["boxes"]], [box[0] for box in expected[sample_id]], sample_id)
            scale = np.array([sample["matrix"][0, 0], sample["matrix"][1, 1]] * 2)
            shift = np.array([sample["matrix"][0, 2], sample["matrix"][1, 2]] * 2) + 0.5 - 0.5 * scale
            for (_, got, _), (_, *edges) in zip(sample["boxes"], expected[sample_id]):
                np.testing.assert_allclose(got, np.array(edges) * scale + shift, atol=tolerance)

    def export(self, kind, name="out", *options):
        folder = self.folder / f"{name}_{kind}"
        run("export", "--to", kind, self.folder / name, "--out", folder, *options)
        return folder

    def make_images(self, count=6, width=64, height=48):
        """A bright square that moves over noise; the square's edges in each."""
        generator = np.random.default_rng(3)
        noise = generator.integers(0, 80, (height, width, 3), np.uint8)
        (self.folder / "images").mkdir()
        for i in range(count):
            image = noise.copy()
            image[10:20, 5 + 3 * i:15 + 3 * i] = 250
            PIL.Image.fromarray(image).save(self.folder / "images" / f"{i:06d}.png")
        return {f"{i:06d}": [5 + 3 * i, 10, 15 + 3 * i, 20] for i in range(count)}

    def coco(self, sizes, boxes, more=lambda i: {}, category=None):
        """A COCO file: ids are neither dense nor in order. `boxes`: name and class, left, top, right, bottom."""
        numbers = {name: number for number, name in CATEGORIES.items()}
        ids = {name: 1_000_003 - 7 * i for i, name in enumerate(sorted(sizes))}
        images = [{"id": ids[name], "file_name": name, "width": size[0], "height": size[1]}
                  for name, size in sizes.items()]
        annotations = []
        for i, (name, label, left, top, right, bottom) in enumerate(boxes):
            annotations.append({"id": 90_001 + 11 * i, "image_id": ids[name], "category_id": numbers[label],
                                "bbox": [left, top, right - left, bottom - top],
                                "area": (right - left) * (bottom - top), "iscrowd": 0, **more(i)})
        categories = [{"id": number, "name": name, **((category or {}) if name == "person" else {})}
                      for number, name in CATEGORIES.items()]
        document = {"info": {"year": 2026}, "licenses": [], "images": images, "annotations": annotations,
                    "categories": categories}
        (self.folder / "instances.json").write_text(json.dumps(document))
        return document

    def test_coco_comes_out_as_it_went_in(self):
        squares = self.make_images()
        boxes = [(f"{name}.png", label, *edges) for name, edges in squares.items() for label in ("person", "car")]
        keypoints = [7, 12, 2, 0, 0, 0, 13.5, 19, 1]
        given = self.coco({f"{name}.png": (64, 48) for name in squares}, boxes,
                          lambda i: {"iscrowd": int(i in (3, 4)), "instance_id": 11 + i % 2,
                                     **({"keypoints": keypoints, "num_keypoints": 2} if i % 2 == 0 else {})},
                          {"keypoints": JOINTS, "skeleton": [[1, 2]]})
        self.job({"format": "coco", "path": "instances.json"})
        self.assertEqual(len(self.samples), 5)  # the first has no frame before it
        self.assert_boxes({name: [(label, *edges) for label in ("person", "car")] for name, edges in squares.items()})
        for name, sample in self.samples.items():
            original = json.loads(sample["original"])
            image, = [entry for entry in given["images"] if entry["file_name"] == f"{name}.png"]
            self.assertEqual(original,
                             {"image": image,
                              "annotations": [a for a in given["annotations"] if a["image_id"] == image["id"]]})
        folder = self.export("coco")
        instances = json.loads((folder / "instances_train.json").read_text())
        self.assert_same_coco(given, instances)
        people = json.loads((folder / "person_keypoints_train.json").read_text())
        originals = {entry["id"]: entry for entry in given["annotations"]}
        self.assertEqual([(entry["id"], entry["name"], entry["keypoints"]) for entry in people["categories"]],
                         [(number, name, JOINTS) for number, name in CATEGORIES.items() if name == "person"])
        self.assertEqual(len(people["annotations"]), 5)
        for person in people["annotations"]:
            np.testing.assert_allclose(person["keypoints"], keypoints, atol=PIXELS)
            self.assertEqual(person["num_keypoints"], 2)
            for key in ("image_id", "category_id", "iscrowd"):
                self.assertEqual(person[key], originals[person["id"]][key])
        self.assertEqual(sum(person["iscrowd"] for person in people["annotations"]), 1)
        self.assertEqual([sample["tracks"] for sample in self.samples.values()], [[11, 12]] * 5)
        tracks = [np.load(path) for path in self.export("dsec").rglob("tracks.npy")]
        self.assertEqual(set(np.concatenate(tracks)["track_id"]), {11, 12})

    def assert_same_coco(self, given, exported, scale=1.0, shift=(0, 0)):
        images = {entry["id"]: entry for entry in given["images"]}
        originals = {entry["id"]: entry for entry in given["annotations"]}
        names = {entry["id"]: entry["name"] for entry in given["categories"]}
        self.assertEqual({entry["id"]: entry["name"] for entry in exported["categories"]
                          if entry["id"] in {a["category_id"] for a in exported["annotations"]}},
                         {number: names[number] for number in {a["category_id"] for a in exported["annotations"]}})
        self.assertEqual(len(exported["images"]), len(self.samples))
        for image in exported["images"]:
            self.assertEqual(images[image["id"]]["file_name"].rsplit(".", 1)[0], image["sample_id"])
        kept = {entry["id"] for entry in exported["images"]}
        self.assertEqual({entry["id"] for entry in exported["annotations"]},
                         {entry["id"] for entry in given["annotations"] if entry["image_id"] in kept})
        for annotation in exported["annotations"]:
            original = originals[annotation["id"]]
            for key in ("image_id", "category_id", "iscrowd"):
                self.assertEqual(annotation[key], original[key])
            expected = np.array(original["bbox"], float) * scale + np.array([*shift, 0, 0])
            np.testing.assert_allclose(annotation["bbox"], expected, atol=PIXELS)

    def test_coco_through_a_letterbox_goes_out_and_scores_1(self):
        squares = self.make_images()
        boxes = [(f"{name}.png", label, *edges) for name, edges in squares.items() for label in ("person", "car")]
        given = self.coco({f"{name}.png": (64, 48) for name in squares}, boxes, lambda i: {"iscrowd": int(i == 3)})
        self.job({"format": "coco", "path": "instances.json"}, width=128, height=112, fit="letterbox")
        self.assert_boxes({name: [(label, *edges) for label in ("person", "car")] for name, edges in squares.items()})
        exported = json.loads((self.export("coco") / "instances_train.json").read_text())
        matrix = next(iter(self.samples.values()))["matrix"]
        scale = matrix[0, 0]
        self.assertEqual(scale, 2)
        self.assert_same_coco(given, exported, scale, matrix[:, 2] + 0.5 - 0.5 * scale)

        found = [{"image_id": name, "category_id": label, "bbox": [left, top, right - left, bottom - top], "score": 0.9}
                 for name, sample in self.samples.items()
                 for label, (left, top, right, bottom), ignore in sample["boxes"] if not ignore]
        self.assertEqual(len(found), 9)  # 5 samples of 2 boxes, one of them a crowd
        self.assertEqual(self.average_precisions(found), {"car": "1.000", "person": "1.000", "all": "1.000"})
        wrong = [{**one, "bbox": [0, 100, 9, 9]} if one["category_id"] == "car" else one for one in found]
        self.assertEqual(self.average_precisions(wrong)["car"], "0.000")

    def average_precisions(self, found):
        """COCO's AP@[.5:.95] of each class, as eventgan.evaluate prints it."""
        (self.folder / "found.json").write_text(
            json.dumps([{**one, "bbox": [float(edge) for edge in one["bbox"]]} for one in found]))
        done = subprocess.run([sys.executable, "-m", "eventgan.evaluate", "detections", self.folder / "found.json",
                               "--truth", self.folder / "out"],
                              capture_output=True, text=True, check=True,
                              env={**os.environ, "PYTHONPATH": str(program.SOURCE / "manifests" / "python")})
        lines = [line.split() for line in done.stdout.partition("average precision ")[2].splitlines()[1:]]
        return {line[0]: line[-1] for line in lines if line}

    def rows(self, folder):
        """Of every sample all that its shard has in its row, the volume included."""
        found = {}
        for shard in sorted(folder.glob("*-of-*.h5")):
            with h5py.File(shard) as file:
                groups = {name: file[name] for name in ("events", "pairs")}
                columns = {f"{name}/{key}": item for name, group in groups.items() for key, item in group.items()
                           if isinstance(item, h5py.Dataset)}
                columns["original"] = file["labels/original"]
                for i, sample_id in enumerate(file["pairs/sample_id"]):
                    found[text(sample_id)] = {key: item[i].tobytes() if isinstance(item[i], (np.generic, np.ndarray))
                                              else item[i]
                                              for key, item in columns.items()
                                              if len(item) == len(file["pairs/sample_id"])}
        return found

    def test_retry_redoes_what_was_mended_and_nothing_else(self):
        squares = self.make_images(8)
        images = {name: self.folder / "images" / f"{name}.png" for name in squares}
        self.coco({f"{name}.png": (64, 48) for name in squares},
                  [(f"{name}.png", "car", *edges) for name, edges in squares.items()])
        whole = {name: path.read_bytes() for name, path in images.items()}
        images["000003"].write_bytes(whole["000003"][:100])
        images["000007"].unlink()  # the labels name it
        source = {"dataset": "frames", "root": "images", "labels": {"format": "coco", "path": "instances.json"},
                  "pairs": pairs([1])}
        path = self.write_manifest(manifest([source], generator={"kind": "difference"}, errors=LENIENT))
        out = self.folder / "out"
        run("convert", path, "--progress", "none")
        spoiled = {"000003", "000004", "000007"}
        self.assertEqual(quarantined(out).keys(), spoiled)
        before = self.rows(out)
        for name, path_of_image in images.items():
            path_of_image.write_bytes(whole[name])
        done, _ = run("retry", out, "--progress", "json")
        report = json.loads(done.splitlines()[-1])
        self.assertEqual((report["tried"], report["mended"], report["quarantined"]), (3, 3, 0))
        deep, _ = run("verify", "--deep", out)
        self.assertIn("7 samples, 0 of them quarantined", deep)
        self.assertIn("labels of 7 samples compared with their sources", deep)
        after = self.rows(out)
        self.assertLess({"events/volume", "original", "pairs/source_to_volume"}, after["000001"].keys())
        run("convert", path, "--output", self.folder / "fresh", "--progress", "none")
        self.assertEqual(after, self.rows(self.folder / "fresh"))
        self.assertEqual({name for name in after if after[name] != before[name]}, spoiled)

    def test_a_folder_of_splits_becomes_a_source_for_each(self):
        squares = self.make_images(8)
        drive = self.folder / "drive"
        for i, (name, (left, top, right, bottom)) in enumerate(squares.items()):
            split = "train" if i < 5 else "val"
            for kind in ("images", "labels"):
                (drive / kind / split).mkdir(parents=True, exist_ok=True)
            (self.folder / "images" / f"{name}.png").rename(drive / "images" / split / f"{name}.png")
            (drive / "labels" / split / f"{name}.txt").write_text(f"0 {(left + right) / 128} {(top + bottom) / 96} "
                                                                  f"{(right - left) / 64} {(bottom - top) / 48}\n")
        (drive / "data.yaml").write_text("names: [car]\n")
        out, _ = run("init", drive, "--out", self.folder / "drive.json")
        self.assertNotIn("warning", out)
        planned = json.loads(run("plan", "--json", self.folder / "drive.json")[0])
        self.assertEqual([(source["split"], source["labelled_frames"]) for source in planned["sources"]],
                         [("train", 5), ("val", 3)])
        for _ in range(2):  # the second time by the manifest that was kept
            run("convert", drive, "--output", self.folder / "out", "--progress", "none")
        deep, _ = run("verify", "--deep", self.folder / "out")
        self.assertIn("labels of 6 samples compared with their sources", deep)
        self.assertEqual({shard.name.split("-")[-4] for shard in (self.folder / "out").glob("*-of-*.h5")},
                         {"train", "val"})

    def test_yolo_comes_out_as_it_went_in(self):
        squares = self.make_images()
        (self.folder / "labels").mkdir()
        (self.folder / "data.yaml").write_text("names: {0: car, 1: person}\nkpt_shape: [3, 3]\n")
        lines = {}
        for i, (name, (left, top, right, bottom)) in enumerate(squares.items()):
            box = [(left + right) / 128, (top + bottom) / 96, (right - left) / 64, (bottom - top) / 48]
            lines[name] = [[i % 2, *box, 0.25, 0.5, 2, 0, 0, 0, 0.125, 0.75, 1]]
            (self.folder / "labels" / f"{name}.txt").write_text(
                "".join(" ".join(f"{value:.9g}" for value in line) + "\n" for line in lines[name]))
        self.job({"format": "yolo", "path": "."})
        self.assert_boxes({name: [(["car", "person"][i % 2], *edges)]
                           for i, (name, edges) in enumerate(squares.items())})
        folder = self.export("yolo")
        self.assertEqual(list(dict(enumerate(yaml.safe_load((folder / "data.yaml").read_text())["names"]))), [0, 1])
        for name in self.samples:
            got = [[float(value) for value in line.split()]
                   for line in (folder / "labels" / "train" / f"{name}.txt").read_text().splitlines()]
            np.testing.assert_allclose(np.array(got)[:, :5], np.array(lines[name])[:, :5], atol=PIXELS / 64)
        for annotation in json.loads((self.export("coco") / "person_keypoints_train.json").read_text())["annotations"]:
            np.testing.assert_allclose(annotation["keypoints"], [16, 24, 2, 0, 0, 0, 8, 36, 1], atol=PIXELS)

    def test_tables_and_texts_of_other_formats(self):
        """As other programs write them: VOC from 0 without sizes, MOT with classes of its own, a table."""
        squares = self.make_images()
        squares["000004"][0] = 0  # one in the image's corner
        names = ["tram", "dog", "car"]
        classes = {name: names[i % 3] for i, name in enumerate(squares)}
        (self.folder / "xml").mkdir()
        for name, (left, top, right, bottom) in squares.items():
            (self.folder / "xml" / f"{name}.xml").write_text(
                f"<annotation><object><name>{classes[name]}</name><truncated>0.06</truncated>"
                f"<difficult>Unspecified</difficult><bndbox><xmin>{left}</xmin><ymin>{top}</ymin><xmax>{right}</xmax>"
                f"<ymax>{bottom}</ymax></bndbox></object></annotation>")
        (self.folder / "mot" / "gt").mkdir(parents=True)
        (self.folder / "mot" / "gt" / "gt.txt").write_text("".join(
            f"{i + 1}.0,{i - 1},{left},{top},{right - left},{bottom - top},1,{i % 3 + 1},1.0\n"
            for i, (left, top, right, bottom) in enumerate(squares.values())))
        (self.folder / "mot" / "gt" / "labels.txt").write_text("\ufeff" + "\n".join(names))
        (self.folder / "mot" / "seqinfo.ini").write_text("[Sequence]\nname=a\nseqLength=6\n")
        (self.folder / "boxes.csv").write_text("image,class,left,top,right,bottom\n" + "".join(
            f"{name}.png,{classes[name]},{','.join(map(str, edges))}\n" for name, edges in squares.items()))
        for labels, path, notes in [
                ("voc", "xml", ["edges count from 0 in xml, since one is at 0 in xml/000004.xml",
                                "<difficult> that is no 0 or 1 taken for unknown: 6 times, first in xml/000000.xml"]),
                ("mot", "mot", ["with the classes of labels.txt", "id 0 taken as it is: 1 time, first in"]),
                ("csv", "boxes.csv", [])]:
            with self.subTest(labels):
                out = self.job({"format": labels, "path": path}, name=f"out_{labels}")
                self.assert_boxes({name: [(classes[name], *edges)] for name, edges in squares.items()})
                for note in notes:
                    self.assertIn(note, out)
                if labels == "mot":
                    self.assertEqual([sample["tracks"] for sample in self.samples.values()], [[0], [1], [2], [3], [4]])

    def test_a_box_left_out_ends_the_run_where_the_first_fault_does(self):
        self.make_images(2)
        (self.folder / "labels").mkdir()
        (self.folder / "labels" / "classes.txt").write_text("car\n")
        (self.folder / "labels" / "000001.txt").write_text("0 1.009 0.5 0.001 0.5\n")
        source = {"dataset": "frames", "root": "images", "labels": {"format": "yolo", "path": "labels"},
                  "pairs": pairs([1])}
        path = self.write_manifest(manifest([source], generator={"kind": "difference"}, errors={"policy": "fail"}))
        _, errors = run("convert", path, "--progress", "none", expect=65)
        self.assertIn("expected a box within the image of 64x48, got one from (64.", errors)

    def test_tables_of_different_images_are_splits(self):
        squares = self.make_images()
        for split, names in (("train", sorted(squares)[:4]), ("val", sorted(squares)[4:])):
            rows = [f"{name}.png,square,{','.join(map(str, squares[name]))}" for name in names]
            (self.folder / f"{split}.csv").write_text("\n".join(["image,class,left,top,right,bottom", *rows]))
        run("convert", self.folder, "--output", self.folder / "out", "--progress", "none")
        for split, expected in (("train", ["000001", "000002", "000003"]), ("val", ["000004", "000005"])):
            self.samples = {}
            for shard in (self.folder / "out").glob(f"*-{split}-*.h5"):
                with h5py.File(shard) as file:
                    self.read_shard(file)
            self.assertEqual(sorted({sample.split("+")[0].split("@")[0] for sample in self.samples}), expected)
            self.assertTrue(all(len(sample["boxes"]) == 1 for sample in self.samples.values()))
        (self.folder / "again.csv").write_text((self.folder / "val.csv").read_text())
        _, errors = run("convert", self.folder, "--output", self.folder / "other", expect=66)
        self.assertIn("labels images that again.csv labels, too", errors)

    # ---- Real frames

    def test_real_frames_with_coco(self):
        folder = LABELLED / "davis_tennis"
        if not folder.is_dir():
            self.skipTest(f"no {folder}")
        with open(folder / "frames.csv", newline="") as file:
            sizes = {row["image"]: (int(row["width"]), int(row["height"])) for row in list(csv.DictReader(file))[:12]}
        for image in sizes:
            (self.folder / "images" / image).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(folder / "images" / image, self.folder / "images" / image)
        with open(folder / "boxes.csv", newline="") as file:
            boxes = [(row["image"], row["class"], *(float(row[edge]) for edge in ("x1", "y1", "x2", "y2")))
                     for row in csv.DictReader(file) if row["image"] in sizes]
        expected = {image.rsplit(".", 1)[0]: [box for name, *box in boxes if name == image] for image in sizes}
        given = self.coco(sizes, boxes)
        self.job({"format": "coco", "path": "instances.json"})
        self.assertGreaterEqual(len(self.samples), 11)
        self.assert_boxes(expected, 1e-3)  # float32 of a thousand pixels
        self.assert_same_coco(given, json.loads((self.export("coco") / "instances_train.json").read_text()))

    # ---- Scale

    def assert_linear(self, seconds):
        """`seconds` by the number of inputs, of two numbers of which one is eight times the other:
        a square would be 64 times as long."""
        few, many = sorted(seconds)
        self.assertEqual(many, 8 * few)
        self.assertLess(seconds[many], 20 * max(seconds[few], 0.3))

    def test_init_of_thousands_of_sequences(self):
        seconds = {}
        (self.folder / "0.png").write_bytes(grey_png(0))
        for count in (500, 4000):
            for i in range(count):
                sequence = self.folder / str(count) / f"{i:05d}"
                sequence.mkdir(parents=True)
                os.link(self.folder / "0.png", sequence / "0.png")
                os.link(self.folder / "0.png", sequence / "1.png")
            seconds[count] = Measured("init", self.folder / str(count), "--out", self.folder / f"{count}.json").seconds
        self.assert_linear(seconds)

    def test_thousands_of_label_texts_beside_a_video(self):
        seconds = {}
        for count in (2000, 16000):
            folder = self.folder / str(count)
            folder.mkdir()
            (folder / "classes.txt").write_text("car\n")
            writer = cv2.VideoWriter(str(folder / "clip.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 25, (64, 48))
            for _ in range(3):
                writer.write(np.zeros((48, 64, 3), np.uint8))
            writer.release()
            for i in range(count):
                (folder / f"clip_{i:06d}.txt").write_text("0 0.5 0.5 0.25 0.25\n")
            source = {"dataset": "frames", "root": folder.name, "labels": {"format": "yolo", "path": folder.name},
                      "pairs": pairs([1])}
            path = self.write_manifest(manifest([source], generator={"kind": "difference"}), f"{count}.json")
            done = Measured("plan", "--json", path)
            self.assertEqual(json.loads(done.out)["pairs"], count - 1)  # most of frames that the video does not have
            seconds[count] = done.seconds
        self.assert_linear(seconds)

    def test_a_hundred_thousand_images_of_coco(self):
        seconds = {}
        for count in (10_000, 100_000):
            folder = self.folder / f"images{count}"
            folder.mkdir()
            for i in range(count):
                original = self.folder / f"{i // MOST_LINKS}.png"
                if not original.exists():
                    original.write_bytes(grey_png(i // MOST_LINKS))
                os.link(original, folder / f"{i:012d}.jpg")
            polygon = ", ".join(str(1.25 + i / 7) for i in range(40))
            with open(self.folder / f"{count}.json", "w") as file:
                file.write('{"images": [' + ",".join(
                    f'{{"id": {17 * i + 3}, "width": 16, "height": 16, "file_name": "{i:012d}.jpg"}}'
                    for i in range(count)) + '], "annotations": [')
                for i in range(3 * count):
                    file.write(f'{"," if i else ""}{{"id": {i}, "image_id": {17 * (i * 7919 % count) + 3}, '
                               f'"category_id": 1, "iscrowd": 0, "area": 4, "bbox": [1, 2, 2, 2], '
                               f'"segmentation": [[{polygon}]]}}')
                file.write('], "categories": [{"id": 1, "name": "person"}]}')
            source = {"dataset": "frames", "root": folder.name, "labels": {"format": "coco", "path": f"{count}.json"},
                      "pairs": pairs([1])}
            path = self.write_manifest(manifest([source], image={"preset": "mpii", "height": 16, "width": 16},
                                                generator={"kind": "difference"},
                                                output={"directory": f"out{count}", "samples_per_shard": 250}))
            done = Measured("plan", "--freeze", "--json", path)
            self.assertEqual(json.loads(done.out)["samples"], count - 1)
            self.assertLess(done.peak_bytes, PLAN_LIMIT_BYTES)
            self.assertLess(done.seconds, PLAN_LIMIT_S)
            seconds[count] = done.seconds
        self.assertLess(seconds[100_000], 30 * max(seconds[10_000], 0.3))  # a square would be 100 times


if __name__ == "__main__":
    program.main()

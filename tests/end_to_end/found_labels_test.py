"""Labels as tools write them beside images: `convert FOLDER` finds them, or stops and says why not."""

import io
import json
import struct
import unicodedata
import urllib.parse
import zlib

import h5py
import numpy as np

import program
from moving_texture import write_images, write_video
from program import run, text

SIZE = (96, 128)  # height, width
NAMES = [f"frame_{i:02d}.png" for i in range(3)]
CATEGORIES = [{"id": 1, "name": "car"}, {"id": 3, "name": "person"}]
EXPECTED = [("car", [10, 20, 40, 60]), ("person", [50.5, 20.25, 81, 60.25])]  # left, top, right, bottom of each image


class FoundLabels(program.InFolder):
    def write(self, name, content):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())

    def images(self, folder, rename=str):
        write_images(self.folder / folder, [0, 3, 6], *SIZE, seed=7)
        for name in NAMES:
            (self.folder / folder / name).rename(self.folder / folder / rename(name))

    def coco(self, name_of=str, images=NAMES, **changes):
        entries = [{"id": i, "file_name": name_of(name), "height": SIZE[0], "width": SIZE[1]}
                   for i, name in enumerate(images, 1)]
        annotations = [{"id": 10 * i + k, "image_id": i, "category_id": CATEGORIES[k]["id"], "area": 1, "iscrowd": 0,
                        "bbox": [left, top, right - left, bottom - top]}
                       for i, name in enumerate(images, 1) if name in NAMES
                       for k, (_, (left, top, right, bottom)) in enumerate(EXPECTED)]
        return {"images": entries, "annotations": annotations, "categories": CATEGORIES, **changes}

    def convert(self, expect=0):
        return run("convert", self.folder, "--output", self.folder / "out", "--progress", "none", expect=expect)

    def assert_found(self, expected=None, samples=2, splits=("train",)):
        """The boxes of every sample of each split; the first image of a sequence makes no pair."""
        expected = EXPECTED if expected is None else expected
        told, _ = self.convert()
        counts = {name: sum(1 for label, _ in expected if label == name) * samples * len(splits)
                  for name, _ in sorted(expected)}
        self.assertIn("\nboxes: " + ", ".join(f"{count} {name}" for name, count in counts.items()) + "\n", told)
        found = {}
        for shard in (self.folder / "out").glob("*-of-*.h5"):
            split = shard.name.split("-")[-4]
            with h5py.File(shard) as file:
                boxes, classes = file["labels/boxes"], file["labels/boxes/class_id"].attrs["class_names"]
                for i in range(len(file["pairs/sample_id"])):
                    rows = range(*boxes["offsets"][i:i + 2])
                    found[split] = found.get(split, 0) + 1
                    names, edges = zip(*expected)
                    self.assertEqual([text(classes[boxes["class_id"][row]]) for row in rows], list(names))
                    np.testing.assert_allclose([boxes["xyxy_source"][row] for row in rows], edges, atol=1e-3)
        self.assertEqual(found, {split: samples for split in splits})
        return told

    def test_coco_as_tools_write_it(self):
        cases = {
            "byte order mark": ("images", lambda: b"\xef\xbb\xbf" + json.dumps(self.coco()).encode()),
            "line break": ("images", lambda: "\r\n\n  " + json.dumps(self.coco())),
            "sorted keys": ("images", lambda: json.dumps(self.coco(info="." * (1 << 17)), sort_keys=True)),
            "escaped slash": ("images", lambda: json.dumps(self.coco("images/{}".format)).replace("/", "\\/")),
            "folders": ("images", lambda: json.dumps(self.coco("images/1/{}".format))),
            "Windows": ("images", lambda: json.dumps(self.coco("images\\{}".format))),
            "other letters": ("images", lambda: json.dumps(self.coco(lambda name: name.replace(".png", ".PNG")))),
            "floats": ("images", lambda: json.dumps(self.coco()).replace('_id": 1,', '_id": 1.0,')
                       .replace("96", "96.0")),
            "nulls": ("images", lambda: json.dumps(self.coco()).replace('"iscrowd": 0', '"iscrowd": null')),
            "root category": ("images", lambda: json.dumps(
                self.coco(categories=[{"id": 0, "name": "car"}, *CATEGORIES]))),
            "default": ("images/default", lambda: json.dumps(self.coco())),
            "capitals": ("Images", lambda: json.dumps(self.coco())),
            "subset": ("images", lambda: json.dumps(self.coco(images=[f"{i}.png" for i in range(3000)] + NAMES))),
        }
        for title, (folder, content) in cases.items():
            with self.subTest(title):
                self.setUp()
                self.images(folder)
                self.write("annotations/instances_default.json", content())
                self.assert_found()

    def test_coco_with_names_of_other_letters(self):
        for title, on_disk, listed in [
                ("escaped", lambda name: "거리 " + name, lambda name: "거리 " + name),
                ("percent", lambda name: "a b " + name, lambda name: urllib.parse.quote("a b " + name)),
                ("NFD", "été 거 {}".format, lambda name: unicodedata.normalize("NFD", "été 거 " + name)),
                ("NFC", lambda name: unicodedata.normalize("NFD", "ệ ガ " + name), "ệ ガ {}".format)]:
            with self.subTest(title):
                self.setUp()
                self.images("train", on_disk)
                self.write("train.json", json.dumps(self.coco(listed)))
                self.assert_found()

    def test_coco_by_splits(self):
        """Of the same names of images in both; and of val alone."""
        for splits in [("train", "val"), ("val",)]:
            with self.subTest(splits):
                self.setUp()
                for split in splits:
                    self.images(f"images/{split}2017")
                    self.write(f"annotations/instances_{split}2017.json", json.dumps(self.coco()))
                self.assert_found(splits=splits)

    def test_a_bad_box_does_not_lose_the_others(self):
        self.images("images")
        given = self.coco()
        for image in (1, 2, 3):
            for bbox in ([200, 10, 5, 5], [3, 4, 0, 7]):
                given["annotations"].append({"id": 1, "image_id": image, "category_id": 1, "bbox": bbox})
        self.write("labels.json", json.dumps(given))
        self.assert_found()

    def test_texts_of_yolo(self):
        lines = "".join(f"{number} {(left + right) / 256} {(top + bottom) / 192} {(right - left) / 128} "
                        f"{(bottom - top) / 96}\n" for number, (_, (left, top, right, bottom)) in enumerate(EXPECTED))
        numbered = [(str(number), edges) for number, (_, edges) in enumerate(EXPECTED)]
        for images, labels, names, expected in [
                ("images", "labels", None, numbered), ("Images", "Labels", "data.yaml", EXPECTED),
                ("obj_train_data", "obj_train_data", "obj.names", EXPECTED),
                ("train", "train", "classes.txt", EXPECTED), ("imgs", "labels", "labels/classes.txt", EXPECTED)]:
            with self.subTest(images=images, names=names):
                self.setUp()
                self.images(images)
                for name in NAMES:
                    self.write(f"{labels}/{name[:-4]}.txt", lines)
                self.write(f"{labels}/._frame_00.txt", b"\0\5\x16\7")
                if names:
                    self.write(names, "names: [car, person]\n" if names == "data.yaml" else "car\nperson\n")
                self.write("train.txt", "\n".join(NAMES))
                told = self.assert_found(expected)
                self.assertEqual("classes are named by their numbers" in told, names is None)

    def test_tables(self):
        for header, row in [("filename,width,height,class,xmin,ymin,xmax,ymax", "{0},128,96,{1},{2},{3},{4},{5}"),
                            ("image,class,x1,y1,x2,y2,track,note", "{0},{1},{2},{3},{4},{5},,seen"),
                            ("frame;label;left;top;width;height", "{0};{1};{2};{3};{6};{7}")]:
            with self.subTest(header):
                self.setUp()
                self.images("images")
                rows = [row.format(name, label, *edges, edges[2] - edges[0], edges[3] - edges[1])
                        for name in NAMES for label, edges in EXPECTED]
                self.write("boxes.csv", "\n".join([header, *rows]) + "\n")
                self.assert_found()

    def test_labels_of_videos(self):
        mot = "".join(f"{frame},1,11,21,30,40,1,3,1\n" for frame in range(1, 5))
        for label, content in [("clip/gt/gt.txt", mot), ("clip.txt", mot),
                               ("boxes.csv", "frame,label,x1,y1,x2,y2\n" +
                                "".join(f"clip.mp4/{frame},car,10,20,40,60\n" for frame in range(4)))]:
            with self.subTest(label):
                self.setUp()
                write_video(self.folder / "clip.mp4", 4, *SIZE)
                self.write(label, content)
                self.assert_found(EXPECTED[:1], samples=3)

    def test_what_is_not_read_stops_and_is_named(self):
        box = {"label": "car", "coordinates": {"x": 50, "y": 40, "width": 20, "height": 10}}
        cases = {
            "annotations.xml": ("CVAT's XML", '<annotations><image id="0" name="frame_00.png"/></annotations>'),
            "images/frame_00.json": ("labelme's", '{"version": "5.0.1", "shapes": [], "imagePath": "frame_00.png"}'),
            "images/_annotations.createml.json": ("CreateML's",
                                                  json.dumps([{"image": NAMES[0], "annotations": [box]}])),
            "project.json": ("Label Studio's", '[{"id": 1, "data": {"image": "frame_00.png"}, "annotations": []}]'),
            "annotations/frame_00.txt": ("VisDrone's", "684,8,273,116,0,0,0,0\n"),
            "labels.json": ("COCO", json.dumps(self.coco("{}.jpg".format))),
        }
        for name, (title, content) in cases.items():
            with self.subTest(name):
                self.setUp()
                self.images("images")
                self.write(name, content)
                looks = f"{self.folder}/{name} looks like {title} labels of these images and is not read: "
                self.assertIn(f"error: expected labels that can be read, or none, got: {looks}",
                              self.convert(expect=66)[1])
                self.assertFalse((self.folder / "out").exists())
                manifest = self.folder / "job.json"
                told, _ = run("init", self.folder, "--out", manifest)
                self.assertIn(f"warning: {looks}", told)
                self.assertNotIn("labelled frames", told)
                told, _ = run("convert", manifest, "--output", self.folder / "out", "--progress", "none")
                self.assertIn("\nNO LABELS: no boxes and no persons with joints\n", told)

    def test_what_is_compressed_is_looked_into(self):
        """A MAT file as MATLAB saves it by default, and NumPy's archives."""
        names = ["frame_00.png", "frame_01.png"]

        def element(kind, data):
            return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)

        text = element(14, element(6, struct.pack("<II", 4, 0)) + element(5, struct.pack("<ii", 1, len(names[0])))
                       + element(1, b"name") + element(17, names[0].encode("utf-16-le")))
        packed = zlib.compress(text)
        mat = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + struct.pack("<II", 15, len(packed)) + packed
        arrays = {}
        for kind, values in {"U": names, "S": [name.encode() for name in names]}.items():
            stream = io.BytesIO()
            np.savez_compressed(stream, boxes=np.ones((2, 4)), names=np.array(values))
            arrays[f"boxes_{kind}.npz"] = stream.getvalue()
        for name, content in {"boxes.mat": mat, **arrays}.items():
            with self.subTest(name):
                self.setUp()
                self.images("images")
                self.write(name, content)
                self.assertNotIn(names[0].encode(), content)
                self.assertIn(f"{self.folder}/{name} names these images and is not read: no reader of its format",
                              self.convert(expect=66)[1])

    def test_going_without_labels_is_said(self):
        self.images("images")
        self.write("labels.bin.json", '[{"of": "frame_00.png", "at": [1, 2, 3, 4]}]')
        names = f"{self.folder}/labels.bin.json names these images and is not read: no reader of its format"
        self.assertIn(names, self.convert(expect=66)[1])
        self.assertIn("(--no-labels goes on without labels)", self.convert(expect=66)[1])
        manifest = self.folder / "job.json"
        told, _ = run("init", self.folder, "--no-labels", "--out", manifest)
        self.assertNotIn("warning", told)
        self.assertIn('"labels": "none"', manifest.read_text())
        told, err = run("convert", self.folder, "--no-labels", "--output", self.folder / "out", "--progress", "none")
        self.assertIn("\nNO LABELS: no boxes and no persons with joints\n", told)
        _, err = run("convert", manifest, "--no-labels", expect=64)
        self.assertIn("--no-labels: expected a folder, video or recording, got a manifest, whose keys count", err)

    def test_lists_make_splits(self):
        self.images("images")
        self.write("data.yaml", "train: autosplit_train.txt\nval: autosplit_val.txt\nnames: [car]\n")
        for split, names in (("train", NAMES[:2]), ("val", NAMES[2:])):
            self.write(f"autosplit_{split}.txt", "".join(f"./images/{name}\n" for name in names))
        for name in NAMES:
            self.write(f"labels/{name[:-4]}.txt", "0 0.5 0.5 0.25 0.5\n")
        _, err = self.convert()
        self.assertIn("warning: a list takes labelled frames alone", err)
        with h5py.File(next((self.folder / "out").glob("*-val-*.h5"))) as file:
            self.assertEqual([text(name) for name in file["pairs/sample_id"]], ["frame_02"])

    def test_images_alone_have_no_labels(self):
        self.images("images")
        self.write("captions.json", json.dumps([{"image": name, "caption": "a street"} for name in NAMES]))
        told, err = self.convert()
        self.assertIn("images or videos: 3 frames of 1 sequence, NO LABELS\n", err)
        self.assertIn("\nNO LABELS: no boxes and no persons with joints\n", told)
        self.assertNotIn("labelled frame", told + err)

    def test_names_that_are_not_below_the_root(self):
        self.images("images")
        self.images("other")
        self.write("labels.json", json.dumps(self.coco(lambda name: "../other/" + name)))
        source = {"dataset": "frames", "root": "images", "labels": {"format": "coco", "path": "labels.json"},
                  "pairs": program.pairs([1])}
        told, _ = run("convert", self.write_manifest(program.manifest([source])), "--progress", "none", expect=65)
        self.assertIn("quarantined: expected an image below images, got ../other/frame_00.png, which lies elsewhere",
                      told)


if __name__ == "__main__":
    program.main()

"""Labels as tools write them beside images: `convert FOLDER` finds them, or stops and says why not."""

import io
import json
import struct
import unicodedata
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
        for title, folder, rename, content in [
                ("CVAT", "images/default", str, lambda: b"\xef\xbb\xbf" + json.dumps(self.coco()).encode()),
                ("subset", "images", str, lambda: json.dumps(
                    self.coco(images=[f"{i}.png" for i in range(3000)] + NAMES))),
                ("NFD", "images", "été 거 {}".format,
                 lambda: json.dumps(self.coco(lambda name: unicodedata.normalize("NFD", "été 거 " + name))))]:
            with self.subTest(title):
                self.setUp()
                self.images(folder, rename)
                self.write("annotations/instances_default.json", content())
                self.assert_found()

    def test_coco_by_splits(self):
        """Of the same names of images in both."""
        for split in ("train", "val"):
            self.images(f"images/{split}2017")
            self.write(f"annotations/instances_{split}2017.json", json.dumps(self.coco()))
        self.assert_found(splits=("train", "val"))

    def test_texts_of_yolo(self):
        self.images("images")
        for name in NAMES:
            self.write(f"labels/{name[:-4]}.txt", "".join(
                f"{number} {(left + right) / 256} {(top + bottom) / 192} {(right - left) / 128} {(bottom - top) / 96}\n"
                for number, (_, (left, top, right, bottom)) in enumerate(EXPECTED)))
        self.write("data.yaml", "names: [car, person]\n")
        self.write("train.txt", "\n".join(NAMES))
        self.assertNotIn("classes are named by their numbers", self.assert_found())

    def test_a_table(self):
        self.images("images")
        rows = [f"{name};{label};{left};{top};{right - left};{bottom - top}\n"
                for name in NAMES for label, (left, top, right, bottom) in EXPECTED]
        self.write("boxes.csv", "frame;label;left;top;width;height\n" + "".join(rows))
        self.assert_found()

    def test_labels_of_videos(self):
        for label, content in [("clip.txt", "".join(f"{frame},1,11,21,30,40,1,3,1\n" for frame in range(1, 5))),
                               ("boxes.csv", "frame,label,x1,y1,x2,y2\n" +
                                "".join(f"clip.mp4/{frame},car,10,20,40,60\n" for frame in range(4)))]:
            with self.subTest(label):
                self.setUp()
                write_video(self.folder / "clip.mp4", 4, *SIZE)
                self.write(label, content)
                self.assert_found(EXPECTED[:1], samples=3)

    def test_what_is_not_read_stops_and_is_named(self):
        cases = {
            "images/frame_00.json": ("labelme's", '{"version": "5.0.1", "shapes": [], "imagePath": "frame_00.png"}'),
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

    def test_images_without_objects_have_empty_labels(self):
        self.images("images")
        self.write("data.yaml", "names: [car]\n")
        for name in NAMES:
            self.write(f"labels/{name[:-4]}.txt", "")
        told, err = self.convert()
        self.assertNotIn("NO LABELS", told + err)
        self.assertIn("\nEMPTY LABELS: no boxes and no persons with joints\n", told)

    def test_images_alone_have_no_labels(self):
        self.images("images")
        self.write("captions.json", json.dumps([{"image": name, "caption": "a street"} for name in NAMES]))
        told, err = self.convert()
        self.assertIn("images or videos: 3 frames of 1 sequence, NO LABELS\n", err)
        self.assertIn("\nNO LABELS: no boxes and no persons with joints\n", told)
        self.assertNotIn("labelled frame", told + err)


if __name__ == "__main__":
    program.main()

"""Outlines from COCO's polygons and masks to shard, masks and exports, against rasterisations of this file's own."""

import json
import re
import sys
import tarfile

import cv2
import h5py
import numpy as np
import PIL.Image

import program
from program import manifest, pairs, run

sys.path.insert(0, str(program.PACKAGE if (program.PACKAGE / "eventgan").is_dir()
                       else program.SOURCE / "manifests" / "python"))
import eventgan  # noqa: E402

HEIGHT, WIDTH = 47, 61  # of the images, odd both
FITS = {"stretch": (30, 52), "letterbox": (40, 40), "crop": (31, 33)}  # height and width of the volumes


def winding(rings, x, y):
    """How often rings wind around places: the sum of the angles under which these see the edges."""
    angle = np.zeros(np.broadcast(x, y).shape)
    for ring in rings:
        for (ax, ay), (bx, by) in zip(ring, np.roll(ring, -1, axis=0)):
            ax, ay, bx, by = ax - x, ay - y, bx - x, by - y
            angle += np.arctan2(ax * by - ay * bx, ax * bx + ay * by)
    return np.rint(angle / (2 * np.pi)).astype(int)


def odd(ring, x, y):
    """Whether an odd number of edges lies right of places."""
    found = np.zeros(np.broadcast(x, y).shape, bool)
    for (ax, ay), (bx, by) in zip(ring, np.roll(ring, -1, axis=0)):
        if ay != by:
            found ^= ((ay > y) != (by > y)) & (ax + (y - ay) / (by - ay) * (bx - ax) > x)
    return found


def clockwise(ring):
    x, y = np.transpose(ring)
    return ring if (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() > 0 else ring[::-1]


def runs_of(mask):
    """COCO's counts: down the columns, how many are 0, how many 1..."""
    flat = mask.T.ravel()
    ends = np.flatnonzero(np.diff(np.concatenate([[0], flat.astype(int), [2]])) != 0)
    return np.diff(np.concatenate([[0], ends])).tolist()


def mask_of_runs(counts, size):
    """The mask of compressed counts, as pycocotools' rleFrString reads them."""
    numbers, at = [], 0
    while at < len(counts):
        number, shift, more = 0, 0, True
        while more:
            code = ord(counts[at]) - 48
            number |= (code & 0x1f) << shift
            more = bool(code & 0x20)
            at, shift = at + 1, shift + 5
            if not more and code & 0x10:
                number |= -1 << shift
        numbers.append(number + (numbers[-2] if len(numbers) > 2 else 0))
    height, width = size
    return np.repeat(np.arange(len(numbers)) % 2 == 1, numbers).reshape(width, height).T


class Outlines(program.InFolder):
    def setUp(self):
        super().setUp()
        random = np.random.default_rng(9)
        (self.folder / "images").mkdir()
        for i in range(4):
            PIL.Image.fromarray(random.integers(0, 250, (HEIGHT, WIDTH), np.uint8)).save(
                self.folder / "images" / f"{i:06d}.png")
        y, x = np.mgrid[:HEIGHT, :WIDTH]
        self.donut = (np.hypot(x - 30, y - 24) < 15) & (np.hypot(x - 27, y - 25) > 6)
        speckled = random.random((HEIGHT, WIDTH)) < 0.4
        self.region = speckled & (x > 40)
        triangle = [(3.25, 5.5), (30.75, 12.5), (9.5, 40.25)]
        # They overlap, and the second one runs the other way.
        parts = [[(5, 5), (20, 5), (20, 18), (5, 18)], [(12, 10), (12, 30), (33, 30), (33, 10)]]
        beyond = [(-8, -6), (25.5, -3), (70, 20), (55, 60), (40, 20), (20, 30)]
        corner = [(0, 0), (4, 0), (4, 4), (0, 4)]
        # Of each object: rings, or a mask.
        self.objects = {"triangle": [triangle], "parts": parts, "beyond": [beyond], "corner": [corner],
                        "donut": self.donut, "region": self.region, "plain": None}
        self.annotate()

    def annotate(self):
        annotations = []
        for number, (name, shape) in enumerate(self.objects.items(), 1):
            if isinstance(shape, np.ndarray):
                rows, columns = np.flatnonzero(shape.any(1)), np.flatnonzero(shape.any(0))
                edges = columns[0], rows[0], columns[-1] + 1, rows[-1] + 1
                segmentation = {"size": [HEIGHT, WIDTH], "counts": runs_of(shape)}
            else:
                corners = np.concatenate(shape) if shape else np.array([(2, 2), (9, 8)])
                edges = *np.maximum(corners.min(0), 0), *np.minimum(corners.max(0), (WIDTH, HEIGHT))
                segmentation = [np.ravel(ring).tolist() for ring in shape or []]
            left, top, right, bottom = map(float, edges)
            annotations.append({"id": number, "category_id": number, "bbox": [left, top, right - left, bottom - top],
                                "iscrowd": int(name == "region"), "area": 1, "segmentation": segmentation})
            if shape is None:
                del annotations[-1]["segmentation"]
        images = [{"id": i + 1, "file_name": f"{i:06d}.png", "width": WIDTH, "height": HEIGHT} for i in range(4)]
        every = [{**each, "id": 100 * image["id"] + each["id"], "image_id": image["id"]}
                 for image in images for each in annotations]
        (self.folder / "labels.json").write_text(json.dumps(
            {"images": images, "annotations": every,
             "categories": [{"id": i, "name": name} for i, name in enumerate(self.objects, 1)]}))

    def convert(self, fit, name="out", **changes):
        height, width = FITS[fit]
        source = {"dataset": "frames", "root": "images", "labels": {"format": "coco", "path": "labels.json"},
                  "pairs": pairs([1]), **changes}
        job = manifest([source], image={"preset": "mpii", "width": width, "height": height, "fit": fit},
                       generator={"kind": "difference"}, output={"directory": name, "samples_per_shard": 2})
        run("convert", self.write_manifest(job, f"{name}.json"), "--progress", "none")
        deep, _ = run("verify", "--deep", self.folder / name)
        self.assertIn("labels of", deep)
        run("finalize", self.folder / name)
        return eventgan.Shards(self.folder / name)

    def places(self, sample):
        """The pixels of the volume: x and y of their centres in the source, counted from its edge, and whether the
        image is there."""
        matrix = sample["pair"]["source_to_volume"]
        height, width = sample["volume"].shape[1:]
        y, x = np.mgrid[:height, :width].astype(float)
        x, y = (x - matrix[0, 2]) / matrix[0, 0] + 0.5, (y - matrix[1, 2]) / matrix[1, 1] + 0.5
        return x, y, (x >= 0) & (y >= 0) & (x < WIDTH) & (y < HEIGHT)

    def expected(self, sample):
        """Of each object its mask in the volume, by what covers a pixel's centre in the source."""
        x, y, shown = self.places(sample)
        for name, shape in self.objects.items():
            if shape is None:
                yield name, np.zeros(shown.shape, bool)
            elif isinstance(shape, np.ndarray):
                rows, columns = np.floor(np.where(shown, y, 0)).astype(int), np.floor(np.where(shown, x, 0)).astype(int)
                yield name, shape[rows, columns] & shown
            else:
                yield name, (winding([clockwise(ring) for ring in shape], x, y) != 0) & shown

    def test_masks_are_those_of_the_source_for_every_fit(self):
        for fit in FITS:
            shards = self.convert(fit, fit)
            self.assertEqual(len(shards), 3)
            for i, sample in enumerate(shards):
                masks = shards.masks(i)
                for k, (name, expected) in enumerate(self.expected(sample)):
                    with self.subTest(fit=fit, name=name):
                        # Centres may lie on an edge, within the last bits of float32.
                        self.assertLessEqual((masks[k] != expected).sum(), expected.size // 500)
                        self.assertEqual(bool(sample["boxes"]["outline"][k]), self.objects[name] is not None)
            with h5py.File(next((self.folder / fit).glob("*-of-*.h5"))) as file:
                self.assertIn("outlines", file.attrs["features"])
        corner = list(self.objects).index("corner")
        self.assertEqual(shards[0]["boxes"]["ignore"][corner], 1)  # the crop leaves nothing of it

    def test_a_volume_of_the_images_size_has_their_masks(self):
        source = {"dataset": "frames", "root": "images", "labels": {"format": "coco", "path": "labels.json"},
                  "pairs": pairs([1])}
        job = manifest([source], generator={"kind": "difference"}, image={"preset": "mpii"},
                       output={"directory": "same", "samples_per_shard": 2})
        run("convert", self.write_manifest(job), "--progress", "none")
        masks = eventgan.Shards(self.folder / "same").masks(0)
        names = list(self.objects)
        np.testing.assert_array_equal(masks[names.index("donut")], self.donut)
        np.testing.assert_array_equal(masks[names.index("region")], self.region)

    def test_shards_without_outlines_are_what_they_were(self):
        self.objects = {name: None for name in self.objects}
        self.annotate()
        shards = self.convert("stretch")
        self.assertNotIn("outline", shards[0]["boxes"])
        with h5py.File(next((self.folder / "out").glob("*-of-*.h5"))) as file:
            self.assertNotIn("outline", file["labels/boxes"])
            self.assertNotIn("outlines", file.attrs["features"])
        _, err = run("export", self.folder / "out", "--to", "yolo-seg", "--out", self.folder / "seg", expect=64)
        self.assertIn("expected boxes with outlines for --to yolo-seg, got none", err)
        self.assertFalse((self.folder / "seg").exists())

    def export(self, to, source, *options):
        out = self.folder / f"{source}-{to}"
        run("export", self.folder / source, "--to", to, "--out", out, *options)
        return out, json.loads((out / "export.json").read_text())

    def test_coco_comes_out_with_segmentation_and_area(self):
        for fit in FITS:
            shards = self.convert(fit, fit)
            out, _ = self.export("coco", fit)
            coco = json.loads((out / "instances_train.json").read_text())
            names = {category["id"]: category["name"] for category in coco["categories"]}
            for i, image in enumerate(coco["images"]):
                masks, size = shards.masks(i), FITS[fit]
                boxes = shards[i]["boxes"]
                self.assertEqual((image["height"], image["width"]), size)
                found = {names[each["category_id"]]: each for each in coco["annotations"]
                         if each["image_id"] == image["id"]}
                left_out = {"corner"} if fit == "crop" else set()
                self.assertEqual(set(found), set(self.objects) - left_out)
                for name, each in found.items():
                    k = list(self.objects).index(name)
                    with self.subTest(fit=fit, name=name):
                        if name == "plain":
                            self.assertNotIn("segmentation", each)
                            self.assertAlmostEqual(each["area"], np.prod(each["bbox"][2:]))
                            continue
                        self.assertEqual(each["iscrowd"], boxes["ignore"][k])
                        if isinstance(each["segmentation"], dict):
                            self.assertIn(name, ("donut", "region"))
                            self.assertEqual(each["segmentation"]["size"], list(size))
                            mask = mask_of_runs(each["segmentation"]["counts"], size)
                            np.testing.assert_array_equal(mask, masks[k])
                        else:
                            rings = [np.reshape(ring, (-1, 2)) for ring in each["segmentation"]]
                            corners = np.concatenate(rings)
                            self.assertTrue((corners >= 0).all() and (corners <= size[::-1]).all())
                            y, x = np.mgrid[:size[0], :size[1]] + 0.5
                            mask = winding(rings, x, y) != 0
                            self.assertLessEqual((mask != masks[k]).sum(), 1)  # a centre on an edge
                        self.assertLessEqual(abs(each["area"] - masks[k].sum()), 1)

    def test_yolo_seg_covers_the_same(self):
        for fit in FITS:
            shards = self.convert(fit, fit)
            out, description = self.export("yolo-seg", fit)
            height, width = FITS[fit]
            y, x = np.mgrid[:height, :width] + 0.5
            names = list(self.objects)
            self.assertEqual(description["left_out"]["outlines of boxes that have none (the box in place of it)"], 3)
            for i, entry in enumerate(description["samples"]):
                masks, sample = shards.masks(i), shards[i]
                lines = (out / "labels" / "train" / (entry["name"] + ".txt")).read_text().splitlines()
                expected = [k for k in range(len(names)) if not sample["boxes"]["ignore"][k]]
                self.assertEqual([int(line.split()[0]) for line in lines], expected)
                for k, line in zip(expected, lines):
                    corners = np.array(line.split()[1:], float).reshape(-1, 2)
                    self.assertTrue((corners >= 0).all() and (corners <= 1).all())
                    with self.subTest(fit=fit, name=names[k]):
                        ring = corners * [width, height]
                        if names[k] == "plain":
                            left, top, right, bottom = sample["boxes"]["xyxy"][k]
                            np.testing.assert_allclose(
                                ring, [(left, top), (right, top), (right, bottom), (left, bottom)], atol=1e-6)
                        else:
                            # nine decimals: centres on edges
                            self.assertLessEqual((odd(ring, x, y) != masks[k]).sum(), masks[k].size // 200)

    def test_webdataset_has_the_rings(self):
        shards = self.convert("letterbox")
        out, _ = self.export("webdataset", "out")
        found = {}
        for path in out.glob("*.tar"):
            with tarfile.open(path) as tar:
                for member in tar:
                    if member.name.endswith(".json"):
                        labels = json.load(tar.extractfile(member))
                        found[labels["sample_id"]] = labels
        for sample in shards:
            labels = found[sample["pair"]["sample_id"]]
            for box, outline in zip(labels["boxes"], sample["boxes"]["outline"]):
                self.assertEqual(box["outline"], json.loads(outline) if outline else None)

    def test_retry_keeps_the_outlines_of_the_other_samples(self):
        whole = self.convert("letterbox", "whole")
        image = self.folder / "images" / "000003.png"
        good = image.read_bytes()
        image.write_bytes(good[:len(good) // 2])
        source = {"dataset": "frames", "root": "images", "labels": {"format": "coco", "path": "labels.json"},
                  "pairs": pairs([1])}
        job = manifest([source], image={"preset": "mpii", "width": 40, "height": 40, "fit": "letterbox"},
                       generator={"kind": "difference"}, output={"directory": "out", "samples_per_shard": 4},
                       errors={"policy": "quarantine", "max_count": 3, "max_fraction": 1})
        run("convert", self.write_manifest(job), "--progress", "none")
        self.assertEqual(len(eventgan.Shards(self.folder / "out")), 2)
        image.write_bytes(good)
        run("retry", self.folder / "out", "--progress", "none")
        run("verify", "--deep", self.folder / "out")
        again = eventgan.Shards(self.folder / "out")
        self.assertEqual(len(again), len(whole))
        for one, other in zip(again, whole):
            self.assertEqual(list(one["boxes"]["outline"]), list(other["boxes"]["outline"]))

    def test_retry_counts_the_outlines_of_mended_stills(self):
        source = {"dataset": "frames", "root": "images", "labels": {"format": "coco", "path": "labels.json"},
                  "pairs": {"from": "stills",
                            "motion": {"translation_px": [1, 2], "objects": {"translation_px": [1, 2]}}}}
        job = self.write_manifest(manifest([source], image={"preset": "mpii"}, generator={"kind": "difference"},
                                           errors={"policy": "quarantine", "max_count": 3, "max_fraction": 1}))

        def counted(*command):
            told, = re.findall(r"outlines of objects that move on their own: (\d+) of labels", run(*command)[0])
            return int(told)

        whole = counted("convert", job, "--output", self.folder / "whole")
        image = self.folder / "images" / "000003.png"
        good = image.read_bytes()
        image.write_bytes(good[:len(good) // 2])
        without = counted("convert", job)
        image.write_bytes(good)
        self.assertEqual(counted("retry", self.folder / "out"), whole - without)
        self.assertGreater(whole, without)

    def test_stills_and_preview(self):
        shards = self.convert("letterbox", pairs={"from": "stills", "motion": {
            "translation_px": [2, 4], "rotation_deg": 1, "scale": 0.02}})
        for i, sample in enumerate(shards):
            area = shards[[i]].image_area()
            for k, mask in enumerate(shards.masks(i)):
                rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
                if len(rows):
                    self.assertTrue(columns[0] >= area[0] - 0.5 and rows[0] >= area[1] - 0.5)
                    self.assertTrue(columns[-1] < area[2] and rows[-1] < area[3])
        run("preview", self.folder / "out", "--out", self.folder / "images_out", "--count", "1")
        image, = (self.folder / "images_out").glob("*.png")
        self.assertIsNotNone(cv2.imread(str(image)))


if __name__ == "__main__":
    program.main()

"""Pairs of stills, from photographs to labels in the volume, against NumPy's and PIL's reading of the same."""

import json
import shutil
import tarfile

import h5py
import numpy as np
import PIL.Image

import program
from folders import quarantined
from program import SHARED, manifest, run, text
from rvt_sequence import RvtSequence
from small_job import LENIENT

PHOTOS = SHARED / "labelled_frames"


def stills(side="before", **motion):
    return {"from": "stills", "side": side, "motion": motion}


def moved_to_labelled(size, motion, label_position):
    """[3, 3]: from pixels of the moved frame to those of the labelled image, both (width, height);
    pixel centres are whole."""
    x, y, degrees, scale = motion
    angle = np.radians(degrees)
    middle = (np.array(size) - 1) / 2
    linear = scale * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    forward = np.eye(3)
    forward[:2, :2], forward[:2, 2] = linear, middle - linear @ middle + (x, y)
    return forward if label_position == 1 else np.linalg.inv(forward)


def borders(size, motion, label_position):
    """What both frames lose on either side: the least that shows nothing from outside, in the image's shape."""
    there, limit = moved_to_labelled(size, motion, label_position), np.array(size) - 1
    for n in range(min(size) // 4 + 1):
        cut = np.floor(n * np.array(size) / min(size) + 0.5)
        corners = np.array([[x, y, 1] for x in (cut[0], limit[0] - cut[0]) for y in (cut[1], limit[1] - cut[1])])
        at = corners @ there[:2].T
        if (at >= -1e-9).all() and (at <= limit + 1e-9).all():
            return cut
    raise AssertionError("expected a motion that leaves half of the image")


def moved(image, motion, label_position):
    """The moved frame, by PIL, whose coordinates are edges."""
    edges = np.eye(3)
    edges[:2, 2] = 0.5
    there = edges @ moved_to_labelled(image.size, motion, label_position) @ np.linalg.inv(edges)
    return image.transform(image.size, PIL.Image.AFFINE, there[:2].ravel(), PIL.Image.BICUBIC)


class Stills(program.InFolder):
    def photos(self, dataset, count, name="photos"):
        folder = self.folder / name
        folder.mkdir()
        for path in sorted((PHOTOS / dataset / "images").iterdir())[:count]:
            shutil.copy(path, folder)
        return folder

    def convert(self, job, *options):
        path = self.write_manifest(job)
        shutil.rmtree(self.folder / "out", ignore_errors=True)
        run("convert", path, "--progress", "none", *options)
        run("finalize", self.folder / "out")
        run("verify", "--deep", self.folder / "out")
        return sorted((self.folder / "out").glob("*-of-*.h5"))

    def test_photographs_and_what_moves_in_them(self):
        self.photos("voc100", 12)
        for side, position in (("before", 1), ("after", 0)):
            job = manifest([{"dataset": "frames", "root": "photos", "pairs": stills(side)}],
                           generator={"kind": "difference"}, image={"grey": "before_resize", "blur": 0})
            seen = 0
            for path in self.convert(job):
                with h5py.File(path) as shard:
                    pairs = {name: shard["pairs"][name][:] for name in shard["pairs"]}
                    for slot in range(len(shard["valid"])):
                        self.assert_still(pairs, slot, position, shard["events/volume"][slot].astype(float))
                        seen += 1
            self.assertEqual(seen, 12)

    def test_flow_is_that_of_the_motion(self):
        self.photos("voc100", 6)
        source = {"dataset": "frames", "root": "photos"}
        for side, position in (("before", 1), ("after", 0)):
            job = manifest([{**source, "pairs": stills(side)}], generator={"kind": "difference"},
                           image={"width": 160, "height": 120, "fit": "letterbox", "preset": "mpii"})
            without = []
            for path in self.convert(job):
                with h5py.File(path) as shard:
                    self.assertNotIn("flow", shard["labels"])
                    without.append(shard["events/volume"][:])
            job["sources"][0]["flow"] = True
            for path, volumes in zip(self.convert(job), without):
                with h5py.File(path) as shard:
                    self.assertIn("flow", shard.attrs["features"])
                    np.testing.assert_array_equal(shard["events/volume"][:], volumes)
                    pairs = {name: shard["pairs"][name][:] for name in shard["pairs"]}
                    flow, valid = shard["labels/flow"][:].astype(float), shard["labels/flow_valid"][:]
                    for slot in range(len(flow)):
                        self.assert_flow(pairs, slot, position, flow[slot], valid[slot])

    def assert_flow(self, pairs, slot, position, flow, valid):
        size = pairs["source_size"][slot][::-1]
        into = np.vstack([pairs["source_to_volume"][slot].reshape(2, 3), [0, 0, 1]])
        step = into @ np.linalg.inv(moved_to_labelled(size, pairs["motion"][slot], position)) @ np.linalg.inv(into)
        y, x = np.mgrid[: flow.shape[1], : flow.shape[2]]
        here = np.stack([x, y, np.ones_like(x)])
        there = np.tensordot(step, here, 1)
        expected = (there - here)[:2] * (1 if position == 0 else -1)
        moves = (flow != 0).any(0)
        shown = moves.any(1)[:, None] & moves.any(0)  # none in a letterbox's borders
        self.assertTrue((valid <= shown).all() and valid[shown].mean() > 0.7)
        np.testing.assert_allclose(flow[:, shown], expected[:, shown], atol=1 / 256 + 1e-9)
        columns, rows = there[0][valid == 1], there[1][valid == 1]
        inside = (columns > -0.01) & (columns < flow.shape[2] - 0.99) & (rows > -0.01) & (rows < flow.shape[1] - 0.99)
        self.assertTrue(inside.all())

    def assert_still(self, pairs, slot, position, volume):
        self.assertEqual(pairs["prev_path"][slot], pairs["next_path"][slot])
        self.assertEqual(pairs["label_position"][slot], position)
        self.assertTrue(np.isnan(pairs["gap_s"][slot]))
        image = PIL.Image.open(self.folder / text(pairs["next_path"][slot])).convert("RGB").convert("L")
        motion, size = pairs["motion"][slot], image.size
        self.assertTrue(2 <= np.hypot(*motion[:2]) <= 8 and abs(motion[2]) <= 2 and 0.97 <= motion[3] <= 1.03, motion)
        cut = borders(size, motion, position)
        scale = np.array(size) / (np.array(size) - 2 * cut)  # volumes are as large as the images
        np.testing.assert_allclose(pairs["source_to_volume"][slot],
                                   np.column_stack([np.diag(scale), (0.5 - cut) * scale - 0.5]), atol=1e-9)
        # The light that changes, after an independent motion of the image, is what the volume has.
        box = (*cut, *(np.array(size) - cut))
        bins = len(volume) // 2
        change = volume[:bins].sum(0) - volume[bins:].sum(0)

        def likeness(motion):
            frames = [image, moved(image, motion, position)][::-1 if position == 1 else 1]
            before, after = (np.log(np.asarray(frame.resize(size, PIL.Image.BILINEAR, box=box), float) + 20)
                             for frame in frames)
            return np.corrcoef(change.ravel(), (after - before).ravel())[0, 1]

        found = likeness(motion)
        self.assertGreater(found, 0.8)
        self.assertLess(likeness((*-motion[:2], *motion[2:])), found - 0.4)  # shifted the other way

    def test_boxes_of_kitti_stay_on_their_cars(self):
        for folder, name in (("images", "image_2"), ("label_2", "label_2")):
            shutil.copytree(PHOTOS / "kitti_mini" / folder, self.folder / "kitti" / "training" / name)
        for fit in ("stretch", "letterbox", "crop"):
            job = manifest([{"dataset": "kitti_object", "root": "kitti/training",
                             "pairs": stills(translation_px=[4, 9], frames=2)}],
                           generator={"kind": "difference"},
                           image={"width": 320, "height": 160, "fit": fit, "preset": "kitti"})
            for path in self.convert(job):
                with h5py.File(path) as shard:
                    boxes, offsets = shard["labels/boxes"], shard["labels/boxes/offsets"][:]
                    self.assertEqual(set(shard["pairs/gap_frames"][:]), {2})
                    for slot, motion in enumerate(shard["pairs/motion"][:]):
                        height, width = shard["pairs/source_size"][slot]
                        cut = borders((width, height), motion, 1)
                        s = np.array([320, 160]) / (width, height)
                        if fit != "stretch":
                            s[:] = s.min() if fit == "letterbox" else s.max()
                        scaled = np.floor(s * (width, height) + 0.5)
                        scale, offset = scaled / ((width, height) - 2 * cut), (np.array([320, 160]) - scaled) // 2
                        rows = slice(*offsets[slot:slot + 2])
                        expected = (boxes["xyxy_source"][rows]
                                    - np.tile(cut, 2)) * np.tile(scale, 2) + np.tile(offset, 2)
                        np.testing.assert_allclose(boxes["xyxy_unclipped"][rows], expected, atol=1e-9)
                        seen = np.maximum(offset, 0), np.minimum(offset + scaled, [320, 160])
                        inside = np.clip(expected, np.tile(seen[0], 2), np.tile(seen[1], 2))
                        np.testing.assert_allclose(boxes["xyxy"][rows], inside, atol=1e-9)
                        empty = (inside[:, 2:] <= inside[:, :2]).any(1)
                        np.testing.assert_array_equal(boxes["ignore"][rows], boxes["ignore_source"][rows] | empty)

    def test_bytes_depend_on_neither_threads_nor_further_sources(self):
        self.photos("voc100", 9)
        source = {"dataset": "frames", "root": "photos", "pairs": stills()}
        job = manifest([source], image={"width": 96, "height": 64, "fit": "letterbox", "preset": "mpii"})
        one = [path.read_bytes() for path in self.convert(job, "--threads", "1")]
        self.assertEqual([path.read_bytes() for path in self.convert(job, "--threads", "4")], one)
        with h5py.File(self.folder / "out" / "dataset.h5") as view:
            motions = view["pairs/motion"][:]
        self.assertEqual(len(np.unique(motions, axis=0)), 9)
        (self.folder / "sequence").mkdir()
        first = PIL.Image.open(next((self.folder / "photos").iterdir()))
        first.save(self.folder / "sequence" / "0.png")
        first.transpose(PIL.Image.FLIP_LEFT_RIGHT).save(self.folder / "sequence" / "1.png")
        job["sources"] = [source, {"dataset": "frames", "root": "sequence", "pairs": program.pairs([1])}]
        self.convert(job)
        with h5py.File(self.folder / "out" / "dataset.h5") as view:
            both, paths = view["pairs/motion"][:], view["pairs/prev_path"].asstr()[:]
        is_still = np.array([path.startswith("photos/") for path in paths])
        self.assertTrue(0 < is_still.sum() < len(is_still))
        self.assertTrue(np.isnan(both[~is_still]).all())
        np.testing.assert_array_equal(both[is_still], motions)

    def test_nothing_moves_where_nothing_may(self):
        self.photos("pennfudan", 2)
        job = manifest(
            [{"dataset": "frames", "root": "photos", "pairs": stills(translation_px=[0, 0], rotation_deg=0, scale=0)}],
            generator={"kind": "difference"})
        for path in self.convert(job):
            with h5py.File(path) as shard:
                self.assertFalse(shard["events/volume"][:].any())
                np.testing.assert_array_equal(shard["pairs/motion"][:], [[0, 0, 0, 1]] * len(shard["valid"]))
                np.testing.assert_array_equal(shard["pairs/source_to_volume"][:],
                                              [[[1, 0, 0], [0, 1, 0]]] * len(shard["valid"]))

    def test_tiny_odd_and_broken_images(self):
        folder = self.folder / "photos"
        folder.mkdir()
        noise = np.random.default_rng(1)
        for name, size in (("a16", (16, 16)), ("b", (33, 17)), ("c1", (1, 1)), ("d", (401, 31))):
            PIL.Image.fromarray(noise.integers(0, 256, (*size[::-1], 3), dtype=np.uint8)).save(folder / f"{name}.png")
        whole = (folder / "b.png").read_bytes()
        (folder / "b.png").write_bytes(whole[:-20])
        job = manifest([{"dataset": "frames", "root": "photos", "pairs": stills(translation_px=[5, 6])}],
                       errors=LENIENT, generator={"kind": "esim"})
        path = self.write_manifest(job)
        run("convert", path, "--progress", "none")
        reasons = quarantined(self.folder / "out")
        self.assertEqual(sorted(reasons), ["photos/a16", "photos/b", "photos/c1"] if "photos/b" in reasons
                         else ["a16", "b", "c1"])
        for sample, reason in reasons.items():
            if not sample.endswith("b"):
                self.assertIn("half of each side", reason)
        (folder / "b.png").write_bytes(whole)
        run("retry", self.folder / "out", "--manifest", path, "--progress", "none")
        run("verify", "--deep", self.folder / "out")

    def test_a_broken_image_that_was_to_rest_is_no_fault_of_the_folder(self):
        names = [path.name for path in self.photos("voc100", 2).iterdir()]
        (self.folder / "photos" / names[0]).write_bytes(b"")
        (self.folder / "boxes.csv").write_text("image,class,left,top,right,bottom\n"
                                               + "".join(f"{name},dog,9,9,99,99\n" for name in names))
        self.convert(manifest([{"dataset": "frames", "root": "photos", "labels": {"path": "boxes.csv", "format": "csv"},
                                "pairs": stills(rests=1, objects={"translation_px": [4, 8]})}], errors=LENIENT))
        self.assertEqual(len(quarantined(self.folder / "out")), 1)

    def test_other_commands_know_them(self):
        self.photos("voc100", 3)
        job = manifest([{"dataset": "frames", "root": "photos", "pairs": stills()}],
                       image={"width": 96, "height": 64, "fit": "letterbox", "preset": "mpii"})
        self.assertIn("  stills under a drawn motion: 3\n", run("plan", self.write_manifest(job))[0])
        shard, = self.convert(job)
        sample = json.loads(run("inspect", shard, "--sample", "1", "--json")[0])
        with h5py.File(shard) as file:
            stored = file["pairs/motion"][1].tolist()
        self.assertEqual(sample["motion"], stored)
        self.assertRegex(run("inspect", shard, "--sample", "1")[0], "\n  motion +[-0-9.e ]+ px, px, degrees, factor\n")
        run("export", self.folder / "out", "--to", "webdataset", "--out", self.folder / "web", "--progress", "none")
        with tarfile.open(next((self.folder / "web").rglob("*.tar"))) as tar:
            labels = [json.load(tar.extractfile(name)) for name in tar.getnames() if name.endswith(".json")]
        self.assertIn(stored, [one["motion"] for one in labels])
        _, warned = run("preview", self.folder / "out", "--out", self.folder / "preview")
        self.assertEqual(warned, "")  # both frames could be shown
        self.assertTrue(list((self.folder / "preview").rglob("*.png")))
        run("report", self.folder / "out", "--out", self.folder / "report.html")
        self.assertIn("stills of", (self.folder / "report.html").read_text())

    def test_rvt_reads_sequences_of_clips_with_labels_in_every_window(self):
        """As many windows as a sequence of RVT's has; with outlines, and from boxes alone."""
        windows = 21
        folder = self.photos("coco256", 256)
        coco = json.loads((PHOTOS / "coco256" / "instances.json").read_text())
        # Persons who fill a good part of the picture, and so do not leave it: RVT wants labels in each window.
        large = {}
        sizes = {image["id"]: image for image in coco["images"]}
        for one in coco["annotations"]:
            image, (x, _, w, h) = sizes[one["image_id"]], one["bbox"]
            centred = abs(x + w / 2 - image["width"] / 2) < image["width"] / 8
            if not one.get("iscrowd") and w * h > 0.1 * image["width"] * image["height"] and centred:
                large.setdefault(one["image_id"], []).append(one)
        chosen = [name for name in sorted(large) if (folder / sizes[name]["file_name"]).is_file()][:2]
        self.assertEqual(len(chosen), 2)
        kept = {sizes[name]["file_name"] for name in chosen}
        for path in folder.iterdir():
            if path.name not in kept:
                path.unlink()
        for outlines in (True, False):
            boxes = [{key: value for key, value in one.items() if outlines or key != "segmentation"}
                     for name in chosen for one in large[name]]
            (self.folder / "coco.json").write_text(json.dumps(
                {"images": [sizes[name] for name in chosen], "annotations": boxes,
                 "categories": coco["categories"]}))
            pairs = stills(objects={"translation_px": [1, 4]})
            job = manifest([{"dataset": "frames", "root": "photos", "pairs": {**pairs, "frames": windows},
                             "labels": {"format": "coco", "path": "coco.json"}}],
                           generator={"kind": "difference"}, image={"width": 304, "height": 240, "preset": "mpii"},
                           output={"directory": "out", "samples_per_shard": 64})
            self.convert(job)
            _, warned = run("preview", self.folder / "out", "--out", self.folder / "preview", "--count", "3")
            self.assertEqual(warned, "")  # their frames are made again
            shutil.rmtree(self.folder / "rvt", ignore_errors=True)
            run("export", self.folder / "out", "--to", "rvt", "--out", self.folder / "rvt",
                "--representation", "volume", "--progress", "none")
            sequences = sorted((self.folder / "rvt" / "preprocessed").glob("*/*"))
            self.assertEqual(len(sequences), len(chosen))
            for path in sequences:
                sequence = RvtSequence(path, "eventgan_nbins=9", (240, 304))
                self.assertEqual(len(sequence.data), windows)
                np.testing.assert_array_equal(np.diff(sequence.repr_times), 50000)
                np.testing.assert_array_equal(sequence.repr_idx, np.arange(windows))
                (data, labels), = sequence.random_access(windows)
                self.assertEqual(data.shape, (windows, 18, 240, 304))
                self.assertTrue((data.reshape(windows, -1).max(1) > 0).sum() > windows // 2)  # now and then all rests
                self.assertFalse(any(boxes is None for boxes in labels))
                self.assertGreater(len({tuple(boxes[0][["x", "y", "w", "h"]]) for boxes in labels}), windows // 2)
                for track in set(labels[0]["track_id"]):
                    seen = [boxes[boxes["track_id"] == track] for boxes in labels]
                    places = np.array([(box["x"] + box["w"] / 2, box["y"] + box["h"] / 2) for box in seen if len(box)])
                    self.assertLess(np.abs(np.diff(places[..., 0], axis=0)).max(), 40)
                self.assertEqual(len(sequence.random_access(5)), windows - 4)
                self.assertEqual([len(data) for data, _ in sequence.streams(5)], [5, 5, 5, 5, 1])

    def test_what_labels_of_clips_lose_counts_once_a_photograph(self):
        rows = [f"{path.name},{row}" for path in self.photos("voc100", 3).iterdir()
                for row in ("a,9,9,90,90", "b,9,9,90,90", "a,9,9,9,90")]
        (self.folder / "boxes.csv").write_text("\n".join(["image,class,left,top,right,bottom", *rows]) + "\n")
        self.convert(manifest([{"dataset": "frames", "root": "photos", "classes": ["a"],
                                "labels": {"format": "csv", "path": "boxes.csv"},
                                "pairs": {**stills(), "frames": 4}}],
                              generator={"kind": "difference"}, image={"width": 64, "height": 48}))
        described = json.loads((self.folder / "out" / "dataset.json").read_text())
        self.assertEqual(described["counts"]["total"]["boxes"], 12)
        self.assertEqual([note.split(":")[0] for note in described["sources"][0]["notes"] if "left out" in note],
                         ["3 boxes of labels left out", '3 boxes of other classes left out ("classes")'])

    def test_simulated_clips_have_the_scenes_and_the_labels_of_converted_ones(self):
        self.photos("pennfudan", 2)
        for path in (self.folder / "photos").iterdir():
            path.with_suffix(".txt").write_text("0 0.5 0.5 0.25 0.5\n")
        (self.folder / "labels").mkdir()
        for path in (self.folder / "photos").glob("*.txt"):
            path.rename(self.folder / "labels" / path.name)
        (self.folder / "labels" / "classes.txt").write_text("person\n")
        job = manifest([{"dataset": "frames", "root": "photos", "labels": {"format": "yolo", "path": "labels"},
                         "pairs": {**stills(objects={"translation_px": [2, 4]}), "frames": 5}}],
                       generator={"kind": "esim"}, image={"width": 120, "height": 100, "fit": "crop", "preset": "mpii"})
        path = self.write_manifest(job)
        run("convert", path, "--progress", "none")
        run("finalize", self.folder / "out")
        (self.folder / "simulate.json").write_text(json.dumps({
            "format": "eventgan-simulation", "version": 1, "name": "s", "size": {"width": 120, "height": 100},
            "sources": [{"path": "manifest.json", "method": "stills", "name": "clip"}],
            "output": {"directory": "recordings"}}))
        run("simulate", self.folder / "simulate.json", "--progress", "none", "--threads", "2")
        with h5py.File(self.folder / "out" / "dataset.h5") as view:
            ids, offsets = view["pairs/sample_id"].asstr()[:], view["labels/boxes/offsets"][:]
            xyxy = view["labels/boxes/xyxy"][:]
        for number, name in enumerate(sorted({one.rsplit("/", 1)[0] for one in ids})):
            labels = json.loads((self.folder / "recordings" / f"clip-{number:03}.json").read_text())["samples"]
            self.assertEqual([round(one["time_s"], 6) for one in labels], [0.05, 0.1, 0.15, 0.2])
            with h5py.File(self.folder / "recordings" / f"clip-{number:03}.hdf5") as file:
                self.assertEqual(file["davis/left/image_raw"].shape, (5, 100, 120))
                self.assertEqual(json.loads(file.attrs["simulation"])["still"], name)
            for k, one in enumerate(labels):
                row = list(ids).index(f"{name}/{k + 2:04}")
                np.testing.assert_allclose(
                    [[box[edge] for edge in ("left", "top", "right", "bottom")] for box in one["boxes"]],
                    xyxy[offsets[row]:offsets[row + 1]], atol=1e-6)
        # And as recordings with labels they are converted like any camera's.
        job = manifest([{"dataset": "recording", "root": "recordings", "window_s": 0.05}],
                       generator={"kind": "events"}, output={"directory": "windows", "samples_per_shard": 64}, image={})
        run("convert", self.write_manifest(job, "windows.json"), "--progress", "none")
        shard, = (self.folder / "windows").glob("*-of-*.h5")
        with h5py.File(shard) as file:
            self.assertEqual(len(file["valid"]), 8)
            self.assertTrue(file["valid"][:].all())
            self.assertEqual(set(file["labels/boxes/track_id"][:]), {0})
            self.assertTrue(file["events/volume"][:].any(axis=(1, 2, 3)).all())


if __name__ == "__main__":
    program.main(needs_shared_data=True)

"""`retry` redoes quarantined samples after their inputs were mended, and nothing else changes."""

import json
import shutil
import subprocess

import h5py
import numpy as np
import PIL.Image

import program
from folders import content, records, same_content, temporaries
from program import run
from small_job import LENIENT, save_image, small_job

BROKEN_CAR, MALFORMED_CAR, MISSING = "000001", "000002", "000000002"


class Retry(program.InFolder):
    def setUp(self):
        super().setUp()
        self.manifest = small_job(self.folder, errors=LENIENT)
        self.out = self.folder / "out"
        self.image = self.folder / "cars" / "image_2" / f"{BROKEN_CAR}.png"
        self.label = self.folder / "cars" / "label_2" / f"{MALFORMED_CAR}.txt"
        frames = self.folder / "people" / "sequences" / MISSING
        # Pairs of gap 2 and 4 around frame 5 both lose one of their frames.
        self.spoiled = {self.image: self.image.read_bytes(), self.label: self.label.read_bytes()}
        for name in ("00000004.jpg", "00000003.jpg"):
            self.spoiled[frames / name] = (frames / name).read_bytes()
            (frames / name).unlink()
        self.image.write_bytes(self.image.read_bytes()[:200])
        self.label.write_bytes(self.label.read_bytes().replace(b"12.50", b"twelve", 1))
        self.convert()

    def convert(self, output="out", expect=0):
        """Shards alone: a retry outdates the dataset, and finalize completes it again."""
        return run("convert", self.manifest, "--output", self.folder / output, "--progress", "json", "--no-finalize",
                   expect=expect)

    def retry(self, *more, expect=0):
        out, _ = run("retry", self.out, "--progress", "json", *more, expect=expect)
        return json.loads(out.splitlines()[-1])

    def mend(self):
        for path, content_before in self.spoiled.items():
            path.write_bytes(content_before)

    def quarantined(self):
        """Sample ids by shard."""
        return {shard: {sample["sample_id"] for sample in record["quarantined"]}
                for shard, record in records(self.out).items() if record["quarantined"]}

    def test_mended_samples_are_those_of_a_fresh_conversion(self):
        ids = set().union(*self.quarantined().values())
        self.assertEqual(len(ids), 3)
        self.assertTrue({BROKEN_CAR, MALFORMED_CAR} < ids)
        self.assertTrue(any(MISSING in sample for sample in ids))
        touched = set(self.quarantined())
        before = {name: shard(self.out / name) for name in records(self.out)}
        untouched = {name: (self.out / name).read_bytes() for name in before.keys() - touched}
        plan = (self.out / "plan.json").read_bytes()
        run("verify", self.out, "--deep")

        self.mend()
        report = self.retry()
        self.assertEqual((report["tried"], report["mended"], report["quarantined"]), (3, 3, 0))
        self.assertEqual(report["shards_rewritten"], len(touched))

        self.convert("fresh")
        for name, old in before.items():
            new = shard(self.out / name)
            self.assertEqual(new["attributes"], old["attributes"])
            if name in untouched:
                self.assertEqual((self.out / name).read_bytes(), untouched[name])
                continue
            for slot, sample in enumerate(old["ids"]):
                if sample not in ids:
                    self.assertEqual(new["chunks"][slot], old["chunks"][slot])
                self.assertTrue(new["chunks"][slot])
            fresh = shard(self.folder / "fresh" / name)
            self.assertEqual(new["chunks"], fresh["chunks"])
            self.assertEqual(new["columns"].keys(), fresh["columns"].keys())
            for column, rows in fresh["columns"].items():
                np.testing.assert_array_equal(new["columns"][column], rows, err_msg=f"{name}: {column}")
        self.assertEqual((self.out / "plan.json").read_bytes(), plan)
        self.assertEqual(temporaries(self.out), [])

        out, _ = run("verify", self.out, "--deep")
        self.assertIn("sound: 5 shards, 9 samples, 0 of them quarantined", out)
        self.assertIn("labels of 9 samples compared", out)
        mended = content(self.out)
        out, _ = self.convert()
        report = json.loads(out.splitlines()[-1])
        self.assertEqual((report["shards_done_before"], report["written"]), (5, 9))
        same_content(content(self.out), mended, self.out)

    def test_finalize_after_a_retry_gives_the_new_counts(self):
        run("finalize", self.out)
        before = json.loads((self.out / "dataset.json").read_text())
        self.mend()
        self.assertTrue(self.retry()["dataset_outdated"])
        for name in ("dataset.json", "dataset.h5"):  # its rows of boxes are those of the former shards
            self.assertFalse((self.out / name).exists(), name)
        run("verify", self.out)
        run("finalize", self.out)
        run("verify", self.out, "--deep")
        after = json.loads((self.out / "dataset.json").read_text())
        self.assertEqual(before["counts"]["total"]["quarantined"], 3)
        self.assertEqual(after["counts"]["total"]["quarantined"], 0)
        with h5py.File(self.out / "dataset.h5") as file:
            valid = [group["valid"][:] for group in file.values() if "valid" in group] or [file["valid"][:]]
        self.assertTrue(np.concatenate(valid).all())

    def test_a_shard_that_is_made_again_leaves_no_dataset_of_the_former_one(self):
        run("finalize", self.out)
        self.mend()
        shard = sorted(self.out.glob("*-of-*.h5"))[-1]
        shard.with_suffix(".json").unlink()
        shard.unlink()
        run("retry", self.out)
        run("finalize", self.out, "--partial")
        told = json.loads((self.out / "dataset.json").read_text())
        self.assertNotIn(shard.name, [each["name"] for each in told["shards"]])
        self.convert()  # a shard that it does not tell of is no reason to remove it
        self.assertEqual(json.loads((self.out / "dataset.json").read_text()), told)
        run("finalize", self.out)
        shard.with_suffix(".json").unlink()
        shard.unlink()
        self.convert()
        self.assertFalse((self.out / "dataset.json").exists() or (self.out / "dataset.h5").exists())
        run("finalize", self.out)
        run("verify", self.out, "--deep")

    def test_what_still_fails_stays_and_only_the_limits_decide(self):
        before = content(self.out)
        report = self.retry()
        self.assertEqual((report["tried"], report["mended"], report["quarantined"]), (3, 0, 3))
        self.assertEqual(report["shards_rewritten"], 0)
        same_content(content(self.out), before, self.out)

        self.label.write_bytes(self.spoiled[self.label])
        strict = self.folder / "strict.json"
        strict.write_text(self.manifest.read_text().replace('"max_count": 99', '"max_count": 1'))
        report = self.retry("--manifest", strict, expect=65)
        self.assertEqual((report["mended"], report["quarantined"]), (1, 2))
        self.assertTrue(report["too_many_faults"])
        self.assertEqual({row["sample_id"] for row in report["failed"]},
                         set().union(*self.quarantined().values()))
        run("verify", self.out, "--deep")

        self.mend()
        self.assertEqual(self.retry("--manifest", strict)["quarantined"], 0)
        out, _ = run("retry", self.out)
        self.assertIn("nothing to retry", out)
        run("verify", self.out, "--deep")

    def test_inputs_that_have_moved(self):
        self.mend()
        moved = self.folder / "moved"
        moved.mkdir()
        for name in ("cars", "people", "manifest.json"):
            shutil.move(self.folder / name, moved / name)
        run("retry", self.out, expect=66)
        report = self.retry("--manifest", moved / "manifest.json")
        self.assertEqual(report["mended"], 3)
        run("verify", self.out, "--deep")

    def test_another_job_is_refused(self):
        self.mend()
        before = content(self.out)
        other = self.folder / "other.json"
        other.write_text(self.manifest.read_text().replace('"seed": 7', '"seed": 8'))
        _, err = run("retry", self.out, "--manifest", other, expect=64)
        self.assertIn("seed: expected 7, got 8", err)
        run("retry", self.folder, expect=66)
        same_content(content(self.out), before, self.out)

    def test_a_label_that_changed_beside_the_mended_one_is_found(self):
        """Retry accepts changed inputs; samples that were good before are not made again, and `verify --deep` tells."""
        self.mend()
        other = self.folder / "cars" / "label_2" / "000004.txt"
        other.write_bytes(other.read_bytes().replace(b"12.50", b"13.50", 1))
        self.assertEqual(self.retry()["mended"], 3)
        run("verify", self.out)
        faults, _ = run("verify", self.out, "--deep", expect=1)
        self.assertIn("cars/label_2/000004.txt", faults)
        self.assertIn("000004)", faults)
        self.assertIn("1 fault", faults)


class ChangedInputs(program.InFolder):
    """A folder in which nothing is quarantined resumes with inputs that have changed, once `retry` has seen them."""

    def start(self, **settings):
        self.manifest = small_job(self.folder, **settings)
        self.out = self.folder / "out"
        self.image = self.folder / "cars" / "image_2" / "000001.png"
        self.sound = self.image.read_bytes()

    def test_policy_fail(self):
        self.start(errors={"policy": "fail"})
        self.image.write_bytes(self.sound[:200])
        run("convert", self.manifest, "--output", self.out, expect=65)
        self.goes_on_once_mended()

    def test_a_plan_that_was_only_frozen(self):
        self.start()
        self.image.write_bytes(self.sound[:200])
        run("plan", self.manifest, "--freeze", "--output", self.out)
        self.goes_on_once_mended()

    def test_a_part_of_the_shards(self):
        self.start(errors={"policy": "fail"})
        self.image.write_bytes(self.sound[:200])
        run("convert", self.manifest, "--output", self.out, "--shards", "4/5")
        self.goes_on_once_mended()

    def test_a_label_that_changed_in_a_complete_folder(self):
        self.start()
        run("convert", self.manifest, "--output", self.out)
        label = self.folder / "cars" / "label_2" / "000004.txt"
        label.write_bytes(label.read_bytes() + b"\n")
        run("convert", self.manifest, "--output", self.out, expect=64)
        out, _ = run("retry", self.out)
        self.assertIn("annotations): recorded", out)
        run("convert", self.manifest, "--output", self.out)

    def test_what_changes_the_plan_but_none_of_its_files(self):
        """A second folder, whose only image has no paired frame: counted, and in no pair.
        A file that is no UTF-8 is noted."""
        random = np.random.default_rng(9)
        for k in range(4):
            save_image(self.folder / "clips" / "a" / f"{k:03d}.png", random)
        foreign = self.folder / "clips" / "a" / "caf\udce9.txt"
        foreign.write_bytes(b"")
        manifest = self.folder / "manifest.json"
        manifest.write_text(
            json.dumps(program.manifest([{"dataset": "frames", "root": "clips", "pairs": program.pairs([1])}])))
        out = self.folder / "out"
        subprocess.run([program.PROGRAM, "convert", manifest, "--output", out], check=True, capture_output=True)
        self.assertIn("1 file left out in clips/a: caf\\xe9.txt", run("status", out)[0])
        foreign.unlink()
        save_image(self.folder / "clips" / "b" / "000.png", random)
        _, err = run("convert", manifest, "--output", out, expect=64)
        self.assertIn("eventgan retry", err)
        self.assertIn("(frames): recorded", run("retry", out)[0])
        run("convert", manifest, "--output", out)
        run("finalize", out)
        run("verify", out, "--deep")

    def goes_on_once_mended(self):
        self.image.write_bytes(self.sound)
        _, err = run("convert", self.manifest, "--output", self.out, expect=64)
        self.assertIn("eventgan retry", err)
        out, _ = run("retry", self.out)
        self.assertIn("inputs changed since the plan was frozen (frames): recorded", out)
        out, _ = run("retry", self.out)
        self.assertNotIn("inputs changed", out)
        run("convert", self.manifest, "--output", self.out)
        run("verify", self.out, "--deep")


class UnknownSizes(program.InFolder):
    """Images none of which could be read at planning; mended, they are of another size than the others."""

    def test_they_are_converted_in_the_end(self):
        manifest = small_job(self.folder, errors=LENIENT,
                             image={"preset": "kitti"})
        out = self.folder / "out"
        bad = sorted((self.folder / "cars").glob("*/00000[1-3]*.png"))
        for path in bad:
            path.write_bytes(b"version https://git-lfs.github.com/spec/v1\n")
        text, _ = run("plan", manifest)
        self.assertIn("3 samples without a readable image", text)
        text, _ = run("convert", manifest, "--output", out)
        self.assertIn("1 note on the inputs", text)
        self.assertIn("3 samples without a readable image", text)
        self.assertIn("3 samples without a readable image", run("status", out)[0])
        text, _ = run("finalize", out)
        self.assertIn("3 samples without a readable image", text)
        notes = json.loads((out / "dataset.json").read_text())["sources"][0]["notes"]
        self.assertEqual(len(notes), 1)
        run("verify", out, "--deep")

        random = np.random.default_rng(8)
        for path in bad:
            size = (60, 80) if path.name.startswith("000002") else (48, 64)
            PIL.Image.fromarray(random.integers(0, 256, size, dtype=np.uint8)).save(path)
        plan = (out / "plan.json").read_bytes()
        text, _ = run("retry", out)
        self.assertIn("3 of 3 quarantined samples fixed", text)
        self.assertEqual((out / "plan.json").read_bytes(), plan)
        run("convert", manifest, "--output", out)
        run("finalize", out)
        run("verify", out, "--deep")
        sizes = {}
        for name in records(out):
            with h5py.File(out / name) as file:
                for sample, valid in zip(file["pairs/sample_id"].asstr()[:], file["valid"][:]):
                    self.assertTrue(valid, sample)
                    sizes[sample] = file["events/volume"].shape[2:]
        self.assertEqual((sizes["000001"], sizes["000002"], sizes["000003"]), ((48, 64), (60, 80), (48, 64)))


class RetryOfClasses(program.InFolder):
    """Labels that are mended may have classes that no shard names yet: those that are stored keep their numbers."""

    def setUp(self):
        super().setUp()
        self.out = self.folder / "out"
        for number in range(1, 8):
            save_image(self.folder / f"images/{number:06}.png", np.random.default_rng(number))

    def convert(self, labels):
        source = {"dataset": "frames", "root": "images", "labels": labels, "pairs": program.pairs([1])}
        path = self.write_manifest(program.manifest(
            [source], generator={"kind": "difference"}, image={"preset": "mpii"},
            errors=LENIENT,
            output={"directory": "out", "samples_per_shard": 2}))
        return run("convert", path, "--output", self.out, "--progress", "none")

    def table(self, **classes):
        rows = [f"{number:06}.png,{classes.get(f'of_{number}', 'car')},1,1,9,9" for number in range(1, 8)]
        (self.folder / "boxes.csv").write_text("\n".join(["image,class,left,top,right,bottom", *rows]) + "\n")

    def spoil_row(self):
        path = self.folder / "boxes.csv"
        path.write_text(path.read_text().replace("bike,1,", "bike,one,"))

    def check(self, names, expected):
        """All shards have these names; the class of each sample's only box is as expected, or else a car."""
        found = {}
        for path in sorted(self.out.glob("*-of-*.h5")):
            with h5py.File(path) as file:
                ids = file["labels/boxes/class_id"]
                self.assertEqual(list(ids.attrs["class_names"]), names, path.name)
                for i, sample in enumerate(file["pairs/sample_id"].asstr()):
                    row, = ids[file["labels/boxes/offsets"][i]:file["labels/boxes/offsets"][i + 1]]
                    found[sample] = names[row]
        self.assertEqual(found, {f"{i:06}": expected.get(i, "car") for i in range(2, 8)})
        run("verify", "--deep", self.out)
        run("finalize", self.out)
        shutil.rmtree(self.folder / "yolo", ignore_errors=True)
        run("export", "--to", "yolo", self.out, "--out", self.folder / "yolo")

    def test_a_new_class_follows_those_that_are_stored(self):
        self.table(of_5="bike")
        self.spoil_row()
        self.convert({"format": "csv", "path": "boxes.csv"})
        self.table(of_5="bike")
        out, _ = run("retry", self.out)
        self.assertIn("classes were added: named in 3 shards", out)
        self.assertIn("1 of 1 quarantined sample fixed", out)
        self.check(["car", "bike"], {5: "bike"})
        out, _ = run("retry", self.out)
        self.assertIn("nothing to retry", out)
        self.assertNotIn("classes were added", out)

    def test_a_label_that_is_gone_is_no_fault_any_more(self):
        """The row named an image that is not there: once it names one that is, the sample has none."""
        self.table()
        table = self.folder / "boxes.csv"
        whole = table.read_text()
        table.write_text(whole + "000099.png,car,4,4,20,20\n")
        self.convert({"format": "csv", "path": "boxes.csv"})
        table.write_text(whole)
        out, _ = run("retry", self.out)
        self.assertIn("expected the labelled frame that was planned, got none any more", out)
        self.assertNotIn("got no file", out)

    def test_boxes_that_mended_labels_lose_are_counted(self):
        self.table(of_5="bike")
        self.spoil_row()
        self.convert({"format": "csv", "path": "boxes.csv"})
        self.table(of_5="bike")
        with (self.folder / "boxes.csv").open("a") as rows:
            rows.write("000005.png,car,90,90,99,99\n")
        out, _ = run("retry", self.out)
        self.assertIn("note: 1 box of labels left out: expected a box ", out)
        self.assertIn("boxes.csv#000005.png", out)
        self.check(["car", "bike"], {5: "bike"})

    def test_so_it_does_in_shards_that_are_made_later(self):
        self.table()
        self.convert({"format": "csv", "path": "boxes.csv"})
        for path in self.out.glob("*-00001-of-*"):
            path.unlink()
        self.table(of_4="ant", of_5="bike")
        out, _ = run("retry", self.out)  # nothing is quarantined; the labels are others
        self.assertIn("classes were added", out)
        self.assertNotIn("nothing to retry", out)
        run("convert", self.folder / "manifest.json", "--output", self.out, "--progress", "none")
        self.check(["car", "ant", "bike"], {4: "ant", 5: "bike"})

    def is_refused(self, *differences):
        """Of numbers that mean others, by `convert` as by `retry`, which touches nothing."""
        before = content(self.out)
        _, told = run("retry", self.out, expect=66)
        self.assertIn("expected labels whose numbers mean what they did when shards were made, got others, in ", told)
        for difference in differences:
            self.assertIn(difference, told)
        run("convert", self.folder / "manifest.json", "--output", self.out, expect=64)
        self.assertEqual(content(self.out), before)

    def write_texts(self, names, folder=".", of_5=2):
        for number in range(1, 8):
            path = self.folder / folder / f"labels/{number:06}.txt"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(f"{of_5 * (number == 5)} 0.5 0.5 0.5 0.5\n")
        (self.folder / folder / "data.yaml").write_text(f"names: [{', '.join(names)}]\n")

    def test_a_name_that_data_yaml_lacked_is_added(self):
        self.write_texts(["car", "person"])
        self.convert({"format": "yolo", "path": "."})
        self.write_texts(["car", "bike", "person"])  # what was 1 is 2 now
        self.is_refused("labels 0 class 1: expected person, got bike")
        self.write_texts(["person", "car"])
        self.is_refused("labels 0 class 0: expected car, got person", "labels 0 class 1: expected person, got car")
        self.write_texts(["car"])
        self.is_refused("labels 0 class 1: expected person, got nothing")
        (self.folder / "data.yaml").unlink()
        self.is_refused("labels 0 class 0: expected car, got 0")
        self.write_texts(["car", "person", "bike"])
        run("retry", self.out)
        self.check(["car", "person", "bike"], {5: "bike"})
        self.write_texts(["car", "person", "ant"])
        self.is_refused("labels 0 class 2: expected bike, got ant")

    def test_a_name_that_another_source_has_still_is_none_of_this_one(self):
        shutil.copytree(self.folder / "images", self.folder / "val")
        self.write_texts(["car", "person"], "a", of_5=1)
        self.write_texts(["person"], "b", of_5=0)
        sources = [{"dataset": "frames", "root": root, "split": split, "labels": {"format": "yolo", "path": path},
                    "pairs": program.pairs([1])}
                   for root, split, path in (("images", "train", "a"), ("val", "val", "b"))]
        path = self.write_manifest(program.manifest(sources, generator={"kind": "difference"}))
        run("convert", path, "--output", self.out, "--progress", "none")
        self.write_texts(["pedestrian"], "b", of_5=0)
        self.is_refused("labels 1 class 0: expected person, got pedestrian")

    def write_coco(self, categories, of_5=5):
        images = [{"id": i, "file_name": f"{i:06}.png", "width": 32, "height": 24} for i in range(1, 8)]
        boxes = [{"id": i, "image_id": i, "bbox": [1, 1, 8, 8], "category_id": of_5 if i == 5 else 1}
                 for i in range(1, 8)]
        (self.folder / "coco.json").write_text(json.dumps({
            "images": images, "annotations": boxes,
            "categories": [{"id": number, "name": name} for number, name in categories.items()]}))

    def test_a_category_that_coco_lacked_is_added(self):
        self.write_coco({1: "car", 3: "persn"})
        self.convert({"format": "coco", "path": "coco.json"})
        self.write_coco({1: "car", 3: "person", 5: "bike"})
        self.is_refused("labels 0 class 3: expected persn, got person")
        self.write_coco({1: "persn", 3: "car", 5: "bike"})
        self.is_refused("labels 0 class 1: expected car, got persn", "labels 0 class 3: expected persn, got car")
        self.write_coco({1: "car", 2: "bike", 3: "persn"}, of_5=2)  # its id is its own
        out, _ = run("retry", self.out)
        self.assertIn("1 of 1 quarantined sample fixed", out)
        self.check(["car", "persn", "bike"], {5: "bike"})

    def write_table(self, names):
        folder = self.folder / "gt"
        folder.mkdir(exist_ok=True)
        (folder / "labels.txt").unlink(missing_ok=True)
        if names:
            (folder / "labels.txt").write_text("\n".join(names) + "\n")
        (folder / "gt.txt").write_text("".join(
            f"{number},1,1,1,8,8,1,{3 if number == 5 else 1},1\n" for number in range(1, 8)))

    def test_a_name_that_mots_labels_txt_lacked_is_added(self):
        self.write_table(["car", "person"])
        self.convert({"format": "mot", "path": "."})
        self.write_table(["person", "car", "bike"])
        self.is_refused("labels 0 class 1 of ./gt/gt.txt: expected car, got person")
        self.write_table(["car", "man", "bike"])
        self.is_refused("labels 0 class 2 of ./gt/gt.txt: expected person, got man")
        self.write_table([])
        self.is_refused("labels 0 classes of ./gt/gt.txt: expected those of labels.txt, got MOT's")
        self.write_table(["car", "person", "bike"])
        out, _ = run("retry", self.out)
        self.assertIn("1 of 1 quarantined sample fixed", out)
        self.check(["car", "bike"], {5: "bike"})

    def test_edges_of_voc_count_from_where_they_did(self):
        """The only file with an edge at 0 was broken: what the shards have was counted from 1."""
        for number in range(1, 8):
            path = self.folder / f"Annotations/{number:06}.xml"
            path.parent.mkdir(exist_ok=True)
            path.write_text("<annotation><object><name>car</name><bndbox><xmin>1</xmin><ymin>1</ymin>"
                            "<xmax>9</xmax><ymax>9</ymax></bndbox></object></annotation>")
        sound = path.read_text().replace("<xmin>1<", "<xmin>0<")
        path.write_text(sound[:-20])
        self.convert({"format": "voc", "path": "."})
        path.write_text(sound)
        self.is_refused("labels 0 edges_from: expected 1, got 0")
        path.write_text(sound.replace("<xmin>0<", "<xmin>1<"))
        run("retry", self.out)
        self.check(["car"], {})

    def test_splits_have_one_list(self):
        """Validation has no car: its numbers are those of training."""
        self.table(of_3="person")
        shutil.copytree(self.folder / "images", self.folder / "val")
        (self.folder / "val.csv").write_text("image,class,left,top,right,bottom\n000002.png,person,1,1,9,9\n")
        sources = [{"dataset": "frames", "root": root, "split": split, "labels": {"format": "csv", "path": path},
                    "pairs": program.pairs([1])}
                   for root, split, path in (("images", "train", "boxes.csv"), ("val", "val", "val.csv"))]
        path = self.write_manifest(program.manifest(sources, generator={"kind": "difference"}))
        run("convert", path, "--output", self.out, "--progress", "none")
        for split, numbers in (("train", [0, 1, 0, 0, 0, 0]), ("val", [1])):
            shard, = self.out.glob(f"*-{split}-*.h5")
            with h5py.File(shard) as file:
                self.assertEqual(list(file["labels/boxes/class_id"].attrs["class_names"]), ["car", "person"])
                self.assertEqual(file["labels/boxes/class_id"][:].tolist(), numbers)
        run("verify", "--deep", self.out)


def shard(path):
    """What a shard holds, without decoding volumes."""
    with h5py.File(path) as file:
        volume = file["events/volume"]
        columns = {}

        def collect(name, item):
            if isinstance(item, h5py.Dataset) and name != "events/volume":
                rows = item[:]
                columns[name] = [bytes(row) for row in rows] if rows.dtype == object else rows
        file.visititems(collect)
        stored = {volume.id.get_chunk_info(i).chunk_offset[0] for i in range(volume.id.get_num_chunks())}
        chunks = [volume.id.read_direct_chunk((slot, 0, 0, 0))[1] if slot in stored else b""
                  for slot in range(volume.shape[0])]
        return {"ids": [program.text(value) for value in columns["pairs/sample_id"]], "columns": columns,
                "chunks": chunks, "attributes": {name: str(value) for name, value in file.attrs.items()}}


if __name__ == "__main__":
    program.main()

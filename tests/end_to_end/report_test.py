"""The report of a folder in a real browser: its numbers against the shards as h5py reads them;
and `preview` of folders."""

import contextlib
import html.parser
import io
import json
import pathlib
import re
import shutil
import subprocess

import h5py
import numpy as np
import PIL.Image

import program
from folders import records, shards
from program import run, text
from small_job import LENIENT, broken_cars, small_job

CHROMIUM = shutil.which("chromium")


class Page(html.parser.HTMLParser):
    """Numbers by data-key, texts by tag, links and images of a page."""

    def __init__(self, source):
        super().__init__()
        self.numbers, self.keys, self.links, self.sources, self.tags, self.texts = {}, [], [], [], set(), []
        self.feed(source)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.tags.add(tag)
        if "data-key" in attributes:
            self.keys.append(attributes["data-key"])
            if "data-value" in attributes:
                self.numbers[attributes["data-key"]] = float(attributes["data-value"])
        self.links += [attributes["href"]] if "href" in attributes else []
        self.sources += [attributes["src"]] if "src" in attributes else []

    def handle_data(self, data):
        self.texts.append(data)


class Report(program.InFolder):
    def setUp(self):
        super().setUp()
        # Its name, a class and a path try to be markup.
        self.job = self.folder / "<b>job"
        small_job(self.job, cars=7, people=4, errors=LENIENT)
        with broken_cars(self.job, [3]):
            run("convert", self.job / "manifest.json", "--progress", "none")
        self.out = self.job / "out"

    def browse(self, *options, page=None):
        """Runs Chromium on the page, with no network to reach; its standard output."""
        if CHROMIUM is None:
            self.skipTest("no chromium")
        done = subprocess.run(
            [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--no-first-run",
             "--proxy-server=127.0.0.1:9",
             f"--user-data-dir={self.folder / 'browser'}", *options, (page or self.out / "report.html").as_uri()],
            capture_output=True, text=True, timeout=300)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

    def counted(self):
        """What the page must say, from the shards."""
        numbers = dict.fromkeys(["samples", "quarantined", "boxes", "persons", "shards", "size_bytes"], 0)
        for name in shards(self.out):
            numbers["shards"] += 1
            numbers["size_bytes"] += (self.out / name).stat().st_size
            with h5py.File(self.out / name) as shard:
                numbers["samples"] += len(shard["valid"])
                numbers["quarantined"] += int((shard["valid"][:] == 0).sum())
                numbers["boxes"] += len(shard["labels/boxes/class_id"])
                numbers["persons"] += len(shard["labels/poses/scale"])
                for gap in shard["pairs/gap_frames"][:]:
                    numbers[f"gap.{gap}"] = numbers.get(f"gap.{gap}", 0) + 1
                names = [text(name) for name in shard["labels/boxes/class_id"].attrs["class_names"]]
                boxes = shard["labels/boxes"]
                for box, (left, top, right, bottom), ignore in zip(boxes["class_id"], boxes["xyxy"], boxes["ignore"]):
                    numbers[f"class.{names[box]}"] = numbers.get(f"class.{names[box]}", 0) + 1
                    narrow = not ignore and min(right - left, bottom - top) < 16
                    numbers[f"class.{names[box]}.narrow"] = numbers.get(f"class.{names[box]}.narrow", 0) + narrow
        return numbers

    def without_events(self):
        """Boxes of which less than a hundredth of the pixels sums to 0.1, by class: looked at, without."""
        found = {}
        for name in shards(self.out):
            with h5py.File(self.out / name) as shard:
                names = [text(name) for name in shard["labels/boxes/class_id"].attrs["class_names"]]
                boxes = shard["labels/boxes"]
                for sample, (first, last) in enumerate(zip(boxes["offsets"][:-1], boxes["offsets"][1:])):
                    if not shard["valid"][sample]:
                        continue
                    sums = shard["events/volume"][sample].astype(np.float32).sum(0) * shard["events/scale"][sample]
                    for box in range(first, last):
                        left, top, right, bottom = np.ceil(boxes["xyxy"][box] - 0.5).astype(int)
                        inside = sums[top:bottom, left:right] >= 0.1
                        if boxes["ignore"][box] or inside.size == 0:
                            continue
                        counts = found.setdefault(names[boxes["class_id"][box]], [0, 0])
                        counts[0] += 1
                        counts[1] += int(inside.mean() < 0.01)
        return found

    def test_the_numbers_in_a_browser_are_those_of_the_shards(self):
        run("report", self.out)
        page = Page(self.browse("--dump-dom"))
        expected = self.counted()
        self.assertEqual(expected["quarantined"], 1)
        self.assertGreater(expected["boxes"], 5)
        narrow = [number for key, number in expected.items() if key.endswith(".narrow")]
        self.assertGreater(sum(narrow), 0)
        self.assertIn("preset", page.texts)
        for key, number in expected.items():
            self.assertEqual(page.numbers[key], number, key)
        for name, (looked_at, without) in self.without_events().items():
            self.assertEqual(page.numbers[f"class.{name}.looked_at"], looked_at)
            self.assertEqual(page.numbers[f"class.{name}.without_events"], without)
        self.assertNotIn("warning", page.keys)  # a simulator has no weights
        self.assertIn("".join(page.texts).count("000003"), range(1, 9))  # in quarantine, with the reason
        for shard in shards(self.out):
            self.assertIn(shard, page.links)

    def test_an_image_of_it_in_the_browser_shows_light_dark_wide_and_narrow(self):
        run("report", self.out)
        paper = {}
        for name, options in {"light": [], "dark": ["--blink-settings=preferredColorScheme=0"]}.items():
            for width in (1280, 500):
                image = self.folder / f"{name}{width}.png"
                self.browse(f"--screenshot={image}", f"--window-size={width},2400", *options)
                pixels = np.asarray(PIL.Image.open(image).convert("RGB")).astype(int)
                self.assertEqual(pixels.shape[1], width)
                paper[name] = pixels[2, 2].mean()
                self.assertGreater(pixels.std(), 10, "there is something on it")
        self.assertGreater(paper["light"], 200)
        self.assertLess(paper["dark"], 60)

    def test_a_table_that_goes_on_beyond_its_box_glows_there(self):
        run("report", self.out)
        source = (self.out / "report.html").read_text(encoding="utf-8")
        page = self.folder / "boxes.html"
        for name, options in {"light": [], "dark": ["--blink-settings=preferredColorScheme=0"]}.items():
            for width, hides in ((2000, True), (100, False)):
                content = f'<div class=scroll><div style="width:{width}px;height:200px"></div></div>'
                page.write_text(source[:source.index("<body>")] + "<body>" + content, encoding="utf-8")
                image = self.folder / "boxes.png"
                self.browse(f"--screenshot={image}", "--window-size=400,300", *options, page=page)
                row = np.asarray(PIL.Image.open(image).convert("RGB")).astype(int)[124]
                inside = row[15:min(width, 370) + 10]  # of the box, which has a margin of 12 and a border
                glow = np.abs(inside - inside[0]).max(1) > 20
                self.assertEqual(glow[-6:].all(), hides, f"{name}, {width} wide")
                self.assertFalse(glow[:-30].any(), f"{name}, {width} wide")

    def test_inspect_takes_folder_view_shard_and_sample(self):
        run("finalize", self.out)
        first = shards(self.out)[0]
        whole = json.loads((self.out / "dataset.json").read_text())
        del whole["view"]
        for where in (self.out, self.out / "dataset.h5"):
            self.assertEqual(json.loads(run("inspect", where, "--json")[0]), whole)
            told, _ = run("inspect", where)
            self.assertIn("contents       11 samples, 1 of them quarantined", told)
            self.assertIn(first, told)
            told, _ = run("inspect", where, "--sample", "000002")
            self.assertIn("id             000002", told)
            _, err = run("inspect", where, "--sample", "1", expect=64)
            self.assertIn("expected the id of a sample", err)
        by_slot = run("inspect", self.out / first, "--sample", "1")
        self.assertIn("id             000001", by_slot[0])
        self.assertEqual(run("inspect", self.out / first, "--sample", "000001"), by_slot)
        self.assertEqual(run("inspect", self.out, "--sample", "000001"), by_slot)
        told, _ = run("preview", self.out / first, "--out", self.folder / "p", "--sample", "1", "--sample", "000001")
        self.assertEqual(pathlib.Path(told.strip()).name, first.removesuffix(".h5") + "_0001.png")
        run("preview", self.out / first, "--out", self.folder / "p", "--sample", "1", "--samples", "0", expect=64)
        for command in (["inspect"], ["preview", "--out", self.folder / "p"]):
            with self.subTest(command=command[0]):
                self.assertIn("a number that is an id", re.sub(r"\s+", " ", run(command[0], "--help")[0]).lower())
                _, err = run(command[0], self.out / first, *command[1:], "--sample", "01", expect=64)
                self.assertIn("slot in 0..1", err)

    def test_inspect_of_an_id_that_two_sources_have_asks_for_the_shard(self):
        job = self.folder / "twice"
        manifest = small_job(job, cars=2, people=0)
        document = json.loads(manifest.read_text())
        document["sources"] = [dict(document["sources"][0], split=split) for split in ("train", "val")]
        manifest.write_text(json.dumps(document))
        run("convert", manifest, "--progress", "none")
        _, err = run("inspect", job / "out", "--sample", "000000", expect=64)
        for shard in shards(job / "out"):
            self.assertIn(shard, err)
            self.assertIn("000000", run("inspect", job / "out" / shard, "--sample", "000000")[0])

    def test_the_page_is_one_small_file_without_script_or_foreign_markup(self):
        told, err = run("report", self.out, "--out", self.folder / "page.html")
        self.assertEqual(told.strip(), str(self.folder / "page.html"))
        source = (self.folder / "page.html").read_text(encoding="utf-8")
        self.assertLess(len(source.encode()), 5_000_000)
        page = Page(source)
        self.assertFalse(page.tags & {"script", "link", "iframe", "object"})
        self.assertNotIn("<b>job", source)
        self.assertTrue(page.sources)
        for address in page.sources:
            self.assertTrue(address.startswith("data:image/jpeg;base64,"))
        self.assertEqual(sorted(link.rsplit("/", 1)[-1] for link in set(page.links)), shards(self.out))
        for link in page.links:
            self.assertTrue((self.folder / link.replace("%3Cb%3E", "<b>")).exists(), link)
        run("report", self.out, "--out", self.folder / "again.html")
        self.assertEqual((self.folder / "again.html").read_text(encoding="utf-8"), source)
        run("verify", self.out)

    def test_the_stand_ins_warning_is_on_the_page(self):
        job = self.folder / "shipped"
        small_job(job, cars=2, people=0, generator={"weights": "shipped:8"})
        run("convert", job / "manifest.json", "--progress", "none")
        run("report", job / "out")
        source = (job / "out" / "report.html").read_text(encoding="utf-8")
        self.assertIn("data-key=warning", source)
        self.assertIn("shipped:8 are stand-in weights", source)
        run("convert", job / "manifest.json", "--overwrite", "--progress", "none")
        self.assertFalse((job / "out" / "report.html").exists(), "it told of other shards")

    def test_a_page_of_a_part_says_so_and_frames_may_be_gone(self):
        gone = shards(self.out)[-1]
        (self.out / gone).unlink()
        shutil.rmtree(self.job / "cars" / "image_2")
        _, err = run("report", self.out)
        self.assertIn("warning", err)
        source = (self.out / "report.html").read_text(encoding="utf-8")
        self.assertIn("Missing or damaged: 1 of 6 shards", source)
        self.assertEqual(Page(source).numbers["samples"], self.counted()["samples"])

    def test_what_cannot_be_looked_at_is_told_in_one_error(self):
        empty = self.folder / "empty"
        empty.mkdir()
        (self.folder / "foreign.h5").write_bytes(b"no HDF5" * 100)
        torn = self.folder / "torn"
        shutil.copytree(self.out, torn)
        for shard in shards(torn):
            data = bytearray((torn / shard).read_bytes())
            data[:] = bytes(len(data))  # of the commit record's size
            (torn / shard).write_bytes(data)
        planless = self.folder / "planless"
        shutil.copytree(self.out, planless)
        (planless / "plan.json").write_text('{"format":"eventgan-plan","version":99}\n')
        for command in (["report"], ["preview", "--out", self.folder / "p"],
                        ["preview", "--out", self.folder / "p", "--worst", "2"]):
            for where, code in [(empty, 66), (self.folder / "none", 66), (torn, 1), (planless, 1)]:
                with self.subTest(command=command[0], where=where.name):
                    _, err = run(command[0], where, *command[1:], expect=code)
                    self.assertRegex(err, r"\Aerror: [^\n]*\n(  because: [^\n]*\n)?\Z")
                    self.assertIn(str(where), err.splitlines()[0])
        _, err = run("preview", self.folder / "foreign.h5", "--out", self.folder / "p", expect=1)
        self.assertRegex(err, r"\Aerror: [^\n]*foreign.h5[^\n]*\n\Z")

    def test_preview_takes_folder_shard_and_view(self):
        run("finalize", self.out)
        for where in (self.out, self.out / "dataset.h5", self.out / shards(self.out)[0]):
            told, err = run("preview", where, "--out", self.folder / "p", "--count", "1")
            self.assertEqual(err, "")
            self.assertTrue(pathlib.Path(told.strip()).name.startswith(shards(self.out)[0].removesuffix(".h5")))
        told, _ = run("preview", self.out, "--out", self.folder / "p", "--class", "Car")
        for line in told.splitlines():
            name, slot = re.fullmatch(r".*/(.*)_(\d{4})\.png", line).groups()
            self.assertGreater(records(self.out)[name + ".h5"]["boxes"][int(slot)], 0)
        _, err = run("preview", self.out, "--out", self.folder / "p", "--class", "Unicorn", expect=64)
        self.assertIn("Car", err)
        _, err = run("preview", self.out, "--out", self.folder / "p", "--sample", "none", expect=64)
        told, _ = run("preview", self.out, "--out", self.folder / "p", "--sample", "000002", "--sample", "000001")
        self.assertEqual(len(told.splitlines()), 2)
        for more in (["--sheet"], ["--video"], ["--worst", "1", "--sheet"]):
            told, _ = run("preview", self.out, "--out", self.folder / "p", *more)
            self.assertGreater(pathlib.Path(told.strip()).stat().st_size, 500)
        with contextlib.closing(io.BytesIO((self.folder / "p" / "sheet.png").read_bytes())) as sheet:
            self.assertLessEqual(PIL.Image.open(sheet).width, 1200)


if __name__ == "__main__":
    program.main()

"""Every command on a folder that is absent, empty, foreign, broken or of a newer version: one line says so,
and nothing is changed."""

import hashlib
import json
import re
import shutil
import subprocess

import h5py

import program
from moving_texture import write_images
from program import run
from small_job import small_job

NEWER = 99
DAMAGED = {"cut": b'{"fingerprint":{"annotations":"433a', "empty": b"", "binary": bytes(range(256)),
           "foreign": b'{"format": "other", "version": 1}\n'}
# The commands that are given an output folder, with what they need besides.
ON_FOLDERS = {
    "status": [], "retry": [], "finalize": [], "verify": [], "report": [],
    "export": ["--to", "coco", "--out", "{scratch}/export"],
}
ON_SHARDS = {"inspect": [], "preview": ["--out", "{scratch}/images"]}
# Those that are given a document.
ON_DOCUMENTS = {"convert": [], "plan": [], "train": [], "simulate": [], "outline": ["--out", "{scratch}/masks"],
                "calibrate": ["--out", "{scratch}/w.safetensors"], "tradeoff": ["--out", "{scratch}/tradeoff"]}
OTHERS = {"init": ["--out", "{scratch}/manifest.json"], "realism": [], "fit": ["--out", "{scratch}/sensor.json"],
          "import-weights": ["{scratch}/weights.safetensors"]}
NOT_OF_FOLDERS = {"make-demo", "help"}


def commands():
    return set(re.findall(r"(?m)^  ([a-z-]+) {2,}", run("--help")[0].split("Subcommands:")[1]))


def snapshot(folder):
    return {path.relative_to(folder): path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


def set_version(path, version=NEWER):
    text, count = re.subn(r'("version": ?"?)\d+', rf'\g<1>{version}', path.read_text())
    assert count >= 1, path
    path.write_text(text)


class ForeignFolders(program.InFolder):
    @classmethod
    def setUpClass(cls):
        cls.keep = program.pathlib.Path(program.tempfile.mkdtemp(prefix="eventgan-"))
        cls.addClassCleanup(shutil.rmtree, cls.keep)
        cls.manifest = small_job(cls.keep / "job", cars=3, people=0)
        run("convert", cls.manifest)
        run("finalize", cls.keep / "job" / "out")

    def setUp(self):
        super().setUp()
        self.scratch = self.folder / "scratch"
        self.scratch.mkdir()
        self.out = self.folder / "job" / "out"
        shutil.copytree(self.keep / "job", self.folder / "job")
        (self.out / "run.json").write_text(json.dumps({"manifest_folder": str(self.folder / "job")}))

    def run_it(self, *arguments):
        filled = [str(argument).format(scratch=self.scratch) for argument in arguments]
        done = subprocess.run([program.PROGRAM, *filled], capture_output=True, text=True, timeout=100)
        return done, f"{' '.join(filled)}\n{done.stdout}\n{done.stderr}"

    def one_line(self, *arguments, codes=(1, 64, 66)):
        """Runs a command that must fail with one line of error; the line."""
        done, where = self.run_it(*arguments)
        self.assertIn(done.returncode, codes, where)
        lines = done.stderr.splitlines()
        self.assertTrue(lines and lines[-1].startswith("error: "), where)
        # Before it there may be which engine was chosen, and what is to be known of the weights.
        self.assertFalse([line for line in lines[:-1] if line.startswith("error: ")], where)
        self.assertEqual(done.stdout, "", where)
        return lines[-1]

    def reports(self, file, *arguments, code):
        """Runs a command that reports on the folder with one line for `file`; the line."""
        done, where = self.run_it(*arguments)
        self.assertEqual(done.returncode, code, where)
        lines = [line for line in (done.stdout + done.stderr).splitlines() if f"{file}:" in line and "expected" in line]
        self.assertEqual(len(lines), 1, where)
        return lines[0]

    def test_every_command_is_tried(self):
        self.assertEqual(commands(), {*ON_FOLDERS, *ON_SHARDS, *ON_DOCUMENTS, *OTHERS, *NOT_OF_FOLDERS})

    def test_absent_empty_and_foreign_folders(self):
        empty, foreign, file = (self.folder / name for name in ["empty", "foreign", "file"])
        empty.mkdir()
        (foreign / "below").mkdir(parents=True)
        (foreign / "notes.txt").write_text("mine")
        (foreign / "data.h5").write_bytes(b"not HDF5")
        (foreign / "plan.json").mkdir()
        file.write_text("a file")
        for folder in [self.folder / "absent", empty, foreign, file]:
            before = snapshot(self.folder)
            for command, rest in {**ON_FOLDERS, **ON_SHARDS, **ON_DOCUMENTS, **OTHERS}.items():
                with self.subTest(command=command, folder=folder.name):
                    line = self.one_line(command, folder, *rest)
                    self.assertIn(str(folder), line)
            self.assertEqual(snapshot(self.folder), before)

    def test_a_plan_that_is_broken_or_newer(self):
        on_plans = [[command, self.out, *rest] for command, rest in ON_FOLDERS.items()]
        on_plans += [["convert", self.folder / "job" / "manifest.json"],
                     ["plan", "--freeze", self.folder / "job" / "manifest.json"]]
        plan = self.out / "plan.json"
        whole = plan.read_bytes()
        for name, data in {**DAMAGED, "cut": whole[:60], "half": whole[:len(whole) // 2], "newer": None}.items():
            plan.write_bytes(whole if data is None else data)
            if data is None:
                set_version(plan)
            before = snapshot(self.out)
            for arguments in on_plans if name in ("cut", "newer") else on_plans[:1]:
                with self.subTest(plan=name, command=arguments[0]):
                    line = self.one_line(*arguments, codes=(1,))
                    self.assertIn(str(plan), line)
                    # Nobody who has an old program is told to throw a new one's work away.
                    self.assertEqual("another version of eventgan" in line, name == "newer")
                    self.assertEqual("--overwrite" in line, name != "newer")
            self.assertEqual(snapshot(self.out), before)

    def test_a_commit_record_that_is_broken_or_newer(self):
        record = sorted(self.out.glob("*-of-*.json"))[0]
        whole = record.read_text()
        for name, text in [("newer", None), ("torn", whole[:len(whole) // 2])]:
            record.write_text(whole if text is None else text)
            if text is None:
                set_version(record)
            for command, code in [("status", 0), ("verify", 1), ("finalize", 1), ("retry", 1)]:
                with self.subTest(record=name, command=command):
                    line = self.reports(record, command, self.out, code=code)
                    self.assertEqual('got "99.0"' in line, name == "newer")
            self.assertIn(str(record), self.one_line("export", self.out, *ON_FOLDERS["export"]))

    def test_a_shard_of_a_newer_format(self):
        shard = sorted(self.out.glob("*-of-*.h5"))[0]
        with h5py.File(shard, "r+") as file:
            file.attrs["format_version"] = f"{NEWER}.0"
        data = shard.read_bytes()
        record = shard.with_suffix(".json")
        said = json.loads(record.read_text())
        record.write_text(json.dumps({**said, "size_bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}))
        for command, rest in ON_SHARDS.items():
            self.assertRegex(self.one_line(command, shard, *rest), r'this program reads versions 1.x\), got "99.0"')
        for command in ["verify", "finalize"]:
            self.assertIn('this program reads versions 1.x), got "99.0"',
                          self.reports(shard, command, self.out, code=1))

    def test_a_shard_that_no_commit_record_vouches_for(self):
        shard = self.folder / "alone.h5"
        for name, data in {**DAMAGED, "half": sorted(self.out.glob("*-of-*.h5"))[0].read_bytes()[:3000]}.items():
            shard.write_bytes(data)
            for command, rest in ON_SHARDS.items():
                with self.subTest(shard=name, command=command):
                    self.assertIn(str(shard), self.one_line(command, shard, *rest, codes=(1,)))

    def test_a_description_or_amendments_of_a_newer_version(self):
        description = self.out / "dataset.json"
        whole = description.read_text()
        description.write_text(json.dumps({**json.loads(whole), "version": f"{NEWER}.0"}))
        self.assertRegex(self.one_line("export", self.out, *ON_FOLDERS["export"]),
                         r'reads versions 1.x\), got "99.0", in .*dataset.json')
        self.reports(description, "verify", self.out, code=1)
        description.write_text(whole)

        amendments = self.out / "amendments.json"
        amendments.write_text(json.dumps({"format": "eventgan-amendments", "version": NEWER}))
        manifest = self.folder / "job" / "manifest.json"
        for arguments in [["retry", self.out], ["finalize", self.out], ["convert", manifest],
                          ["plan", "--freeze", manifest]]:
            with self.subTest(command=arguments[0]):
                self.assertIn(f"{amendments}: $.version", self.one_line(*arguments, codes=(1,)))

    def test_documents_that_are_broken_or_newer(self):
        examples = {"train": "train.json", "simulate": "simulate.json"}
        for command, rest in ON_DOCUMENTS.items():
            whole = (program.SOURCE / "manifests" / "examples" / examples.get(command, "frames.json")).read_bytes()
            document = self.folder / "document.json"
            for name, data in {**DAMAGED, "newer": whole}.items() if command == "convert" else [("newer", whole)]:
                document.write_bytes(data)
                if name == "newer":
                    set_version(document)
                with self.subTest(command=command, document=name):
                    line = self.one_line(command, document, *rest, codes=(64,))
                    self.assertIn(str(document), line)
                    self.assertEqual("$.version" in line, name == "newer")

    def test_output_folders_of_others(self):
        mine = self.scratch / "notes.txt"
        mine.write_text("mine")
        taken = self.scratch / "file"
        taken.write_text("a file")
        manifest = self.folder / "job" / "manifest.json"
        for arguments in [["make-demo", self.scratch], ["convert", manifest, "--output", taken],
                          ["plan", "--freeze", manifest, "--output", taken],
                          ["export", self.out, "--to", "coco", "--out", self.scratch]]:
            with self.subTest(command=arguments[0]):
                self.assertIn(str(self.scratch), self.one_line(*arguments))
        self.assertEqual(snapshot(self.scratch),
                         {mine.relative_to(self.scratch): b"mine", taken.relative_to(self.scratch): b"a file"})

    def test_no_command_replaces_a_persons_file(self):
        """Each command that writes, where a person's files have the names of what it writes: it is refused, and neither
        a byte nor a time has changed."""
        job, taken = self.folder / "job" / "manifest.json", self.folder / "taken"
        weights = program.SOURCE / "manifests" / "weights" / "eventgan-8.safetensors"
        results = ["dataset.json", "dataset.h5", "run.json", "plan.json", "amendments.json", "report.html",
                   "plan.index"]
        shards = [path.name for path in sorted(self.out.glob("*-of-*"))]
        of_job = {name: [["convert", job, "--output", taken], ["convert", job, "--output", taken, "--overwrite"],
                         ["convert", job, "--output", taken, "--no-finalize"],
                         ["plan", "--freeze", job, "--output", taken]] for name in results}
        of_job.update({name: [["convert", job, "--output", taken]] for name in shards})
        of_job["page.html"] = [["report", self.out, "--out", taken / "page.html"]]
        of_job["plan.json"] += [["report", self.out, "--out", taken / "plan.json"]]
        of_job["w.safetensors"] = [["import-weights", weights, taken / "w.safetensors"]]
        of_job["sensor.json"] = [["fit", self.out, "--out", taken / "sensor.json"]]
        of_job["trace.json"] = [["convert", job, "--output", taken, "--profile", taken / "trace.json"]]
        of_job["sheet.png"] = [["preview", self.out, "--out", taken, "--sheet"]]
        of_job[shards[0].replace(".h5", "_0000.png").replace(".json", "_0000.png")] = [
            ["preview", self.out, "--out", taken, "--count", "99"]]
        for name in ["tradeoff.json", "tradeoff.md", "tradeoff.svg"]:
            of_job[name] = [["tradeoff", job, "--out", taken, "--methods", "difference,esim"]]
        for name, lines in of_job.items():
            for arguments in lines:
                with self.subTest(file=name, command=" ".join(map(str, arguments))):
                    taken.mkdir()
                    (taken / name).write_bytes(b'{"mine": [1, 2]}')
                    before = snapshot(taken), (taken / name).stat().st_mtime_ns
                    self.assertIn(str(taken / name), self.one_line(*arguments, codes=(64,)))
                    self.assertEqual((snapshot(taken), (taken / name).stat().st_mtime_ns), before)
                shutil.rmtree(taken, ignore_errors=True)
        for name in results[:2]:  # in the folder of a job that is done
            shutil.rmtree(taken, ignore_errors=True)
            shutil.copytree(self.out, taken)
            (taken / name).write_text("mine")
            before = snapshot(taken)
            for arguments in [["finalize", taken], ["retry", taken]]:
                self.assertIn(str(taken / name), self.one_line(*arguments, codes=(64,)))
                self.assertEqual(snapshot(taken), before)

    def test_what_is_written_among_images_is_not_read_as_such(self):
        """Into a folder of images, or one in it: the next search finds what it found before, or the command is refused
        before it writes."""
        images, out, manifest = self.folder / "images", self.folder / "images" / "out", self.scratch / "job.json"
        for name, seed in [("a", 1), ("b", 2)]:
            write_images(images / name, [0, 2, 4], 48, 64, seed)
        frames = [{"id": i, "file_name": f"{name}/frame_{i % 3:02d}.png", "height": 48, "width": 64}
                  for i, name in enumerate("aaabbb")]
        boxes = [{"id": i, "image_id": i, "category_id": 1, "area": 1, "iscrowd": 0, "bbox": [9, 9, 20, 20]}
                 for i in range(6)]
        (images / "labels.json").write_text(json.dumps(
            {"images": frames, "annotations": boxes, "categories": [{"id": 1, "name": "car"}]}))
        simulation = self.scratch / "simulation.json"
        simulation.write_text(json.dumps({
            "format": "eventgan-simulation", "version": 1, "name": "s", "seed": 1,
            "sources": [{"path": str(images / "a"), "name": "s"}], "output": {"directory": "s"}}))

        def found():
            told, _ = run("init", images, "--out", manifest)
            manifest.unlink()
            return [line for line in told.splitlines() if not line.startswith("note: ")]

        before = found()
        self.assertIn("6 labelled frames of 2 sequences", before[0])
        taken = [["convert", images, "--output", out], ["report", out],
                 ["preview", out, "--out", images / "previews"], ["preview", out, "--out", out / "drawn"],
                 ["export", out, "--to", "yolo", "--images", "png", "--out", images / "yolo"],
                 ["export", out, "--to", "coco", "--images", "png", "--out", images / "coco"],
                 ["export", out, "--to", "rvt", "--out", images / "rvt"],
                 ["export", out, "--to", "raw", "--out", images / "raw"],
                 ["simulate", simulation, "--output", images / "simulated"],
                 ["outline", out / "manifest.json", "--out", images / "a" / "masks"],
                 ["outline", out / "manifest.json", "--out", f"{images}/a/more_masks/"],
                 ["convert", images, "--output", images], ["preview", images, "--out", images / "more"]]
        refused = [["preview", out, "--out", images / "a"], ["preview", out, "--out", images / "b", "--sheet"],
                   ["preview", out, "--out", images / "a", "--video"],
                   ["outline", out / "manifest.json", "--out", images / "a"],
                   ["outline", out / "manifest.json", "--out", images / "masks"],
                   ["simulate", simulation, "--output", images / "a"],
                   ["export", out, "--to", "coco", "--out", images / "a"]]
        for arguments in taken:
            with self.subTest(taken=" ".join(map(str, arguments))):
                run(*arguments)
                self.assertEqual(found(), before)
        files = snapshot(images)
        for arguments in refused:
            with self.subTest(refused=" ".join(map(str, arguments))):
                self.assertIn(str(images), self.one_line(*arguments, codes=(64,)))
                self.assertEqual(snapshot(images), files)
        run("convert", out / "manifest.json")  # the plan is that of the first time


if __name__ == "__main__":
    program.main()

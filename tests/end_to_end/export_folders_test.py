"""The folders of exports: run again, killed and stopped, of shards that changed, with files that are not the
program's, and of input that is refused."""

import json
import re
import shutil
import signal
import subprocess
import time

import exported_demo as demo
import failing_files
import program
from exported_demo import Export
from folders import content, same_folder
from program import run

FORMATS = ["yolo", "coco", "mpii", "hpe", "davis", "webdataset", "events", "dsec", "rvt", "raw", "aedat4"]

setUpModule, tearDownModule = demo.set_up, demo.tear_down


def split_for(to):
    """A small one: of persons there is but train."""
    return "train" if to in ("mpii", "hpe") else "val"


class AgainAndAgain(Export):
    def stamps(self):
        return {path: path.stat().st_mtime_ns for path in self.out.rglob("*")}

    def whole(self, to):
        return demo.exported(to, "--split", split_for(to))

    def test_a_second_run_writes_nothing_and_threads_change_nothing(self):
        for to in FORMATS:
            with self.subTest(to=to):
                out, split = self.out / to, split_for(to)
                self.export(to, "--split", split, "--threads", "1", out=out)
                before = self.stamps()
                said, _ = self.export(to, "--split", split, out=out)
                self.assertEqual(self.stamps(), before)
                other, other_said = self.whole(to)
                self.assertEqual(other_said, said.replace(str(out), str(other)))
                same_folder(other, out)

    def test_what_was_removed_or_cut_is_made_again(self):
        for to in FORMATS:
            with self.subTest(to=to):
                whole, out = self.whole(to)[0], self.out / to
                shutil.copytree(whole, out)
                files = sorted(path for path in out.rglob("*") if path.is_file() and ".export" not in path.parts)
                for n, path in enumerate(files[::3]):
                    if n % 2:
                        path.unlink()
                    else:
                        path.write_bytes(path.read_bytes()[:-1])
                self.export(to, "--split", split_for(to), out=out)
                same_folder(out, whole)

    def test_a_killed_run_is_completed(self):
        for to in FORMATS:
            expected, _ = self.whole(to)
            arguments = ["export", demo.finalized, "--to", to, "--split", split_for(to), "--progress", "none"]
            # davis has six, the last one the receipt of export.json
            for number in (1, 3, 5) if to == "davis" else (3,):
                with self.subTest(to=to, number=number):
                    out = self.out.parent / f"{to}-{number}"
                    out.mkdir()
                    done = failing_files.run(out, f"kill-before rename {number}", *arguments, "--out", out)
                    self.assertEqual((done.code, done.struck), (-9, True))
                    self.assertFalse((out / "export.json").exists())
                    run(*arguments, "--out", out)
                    same_folder(out, expected)

    def test_a_damaged_description_is_made_again(self):
        self.export("webdataset", "--split", "val")
        description = self.out / "export.json"
        whole = description.read_bytes()
        for damaged in (whole[:-9].ljust(len(whole), b"\0"), whole.replace(b'"left_out"', b'"left_off"')):
            description.write_bytes(damaged)
            self.export("webdataset", "--split", "val")
            self.assertEqual(description.read_bytes(), whole)

    def test_a_killed_run_is_overwritten_by_another(self):
        expected, _ = self.whole("coco")
        for rule in ("kill-before rename 2", "kill-before rename 5", "kill-within write 4"):
            with self.subTest(rule=rule):
                out = self.out.parent / rule.replace(" ", "-")
                out.mkdir()
                done = failing_files.run(out, rule, "export", demo.finalized, "--to", "yolo", "--out", out,
                                         "--progress", "none")
                self.assertEqual(done.code, -9)
                (out / "a.txt").write_text("mine")
                before = sorted(path.name for path in out.iterdir())
                self.export("coco", "--split", "val", "--overwrite", out=out, expect=64)
                self.assertEqual(sorted(path.name for path in out.iterdir()), before)
                (out / "a.txt").unlink()
                self.export("coco", "--split", "val", "--overwrite", out=out)
                same_folder(out, expected)
                done = failing_files.run(out, rule, "export", demo.finalized, "--to", "yolo", "--overwrite", "--out",
                                         out)
                self.assertEqual(done.code, -9)
                self.export("yolo", "--split", "train", "--overwrite", out=out)

    def test_a_signal_stops_it_and_the_same_command_goes_on(self):
        expected, out = demo.exported("coco")[0], self.out / "stopped"
        running = subprocess.Popen([program.PROGRAM, "export", demo.finalized, "--to", "coco", "--out", out,
                                    "--threads", "1", "--progress", "none"], stderr=subprocess.PIPE, text=True)
        while running.poll() is None and not list(out.glob("volumes/*/*.npy")):
            time.sleep(0.001)
        running.send_signal(signal.SIGTERM)
        _, err = running.communicate()
        if running.returncode != 0:  # it may have been quicker than the signal
            self.assertEqual(running.returncode, 75, err)
            self.assertIn("to resume", err)
            self.assertFalse((out / "export.json").exists())
        self.export("coco", out=out)
        same_folder(out, expected)

    def test_a_full_disk_is_an_error_and_leaves_no_part_of_a_file(self):
        for to in FORMATS:
            with self.subTest(to=to):
                expected, _ = self.whole(to)
                out = self.out.parent / f"{to}-full"
                out.mkdir()
                arguments = ["export", demo.finalized, "--to", to, "--split", split_for(to), "--progress", "none",
                             "--out", out]
                done = failing_files.run(out, "ENOSPC write 5+", *arguments)
                self.assertEqual(done.code, 1)
                self.assertIn("No space left on device", done.err)
                whole = content(expected)
                written = {name: found for name, found in content(out).items() if not name.endswith(".begun")}
                self.assertEqual({name: whole.get(name) for name in written}, written)
                run(*arguments)
                same_folder(out, expected)

    def test_a_shard_that_changed_is_exported_again(self):
        source = self.out.parent / "source"
        shutil.copytree(demo.finalized, source)
        self.export("yolo", "--split", "val", source=source)
        receipts = sorted((self.out / ".export").glob("*-of-*.json"))
        receipts[0].write_text(receipts[0].read_text().replace('"input":"', '"input":"0'))
        stamps = self.stamps()
        self.export("yolo", "--split", "val", source=source)
        changed = {path.name for path, stamp in self.stamps().items() if path.is_file() and stamps.get(path) != stamp}
        self.assertIn("000000.npy", changed)
        self.assertNotIn("000011.npy", changed)


class ForeignNames(Export):
    """Names and links in a folder of an export that lead out of it: nothing there is touched,
    and the record is named."""

    NAMES = ["../victim.txt", "volumes/../../victim.txt", "{victim}", "./victim.txt", "volumes//a.npy", "volumes/", "",
             "/", ".export/export.txt", "volumes/val/.hidden.npy", "mine/a.npy", "volumes/val/below/a.npy", "notes.md",
             "volumes/a\0.npy", "a\n.txt", "\u00e4.txt"]

    def setUp(self):
        super().setUp()
        self.victim = self.out.parent / "victim.txt"
        self.victim.write_text("mine")
        self.elsewhere = self.out.parent / "elsewhere"
        self.elsewhere.mkdir()

    def refused(self, *named, to="coco", arguments=()):
        """The export must fail and change nothing; what is in its message."""
        before, outside = content(self.out), content(self.elsewhere)
        done = subprocess.run([program.PROGRAM, "export", demo.finalized, "--to", to, "--split", "val", "--out",
                               self.out, "--progress", "none", *arguments],
                              capture_output=True, text=True, timeout=100)
        self.assertEqual(done.returncode, 1, done.stderr)
        for part in named:
            self.assertIn(str(part), done.stderr)
        self.assertEqual(self.victim.read_text(), "mine")
        self.assertEqual(content(self.elsewhere), outside)
        self.assertEqual(content(self.out), before)

    def test_names_in_journals_and_receipts_are_not_believed(self):
        self.export("coco", "--split", "val")
        whole = content(self.out)
        receipt = sorted((self.out / ".export").glob("*-of-*.json"))[0]
        journal = receipt.with_suffix(".begun")
        text_ = receipt.read_text()
        overwrite = ["--full-scale", "2", "--overwrite"]
        cases = [(self.NAMES[0], journal, overwrite), (self.NAMES[0], receipt, [])]
        for name in self.NAMES:
            cases += [(name, journal, []), (name, receipt, overwrite)]
        for name, record, arguments in cases:
            name = name.format(victim=self.victim)
            with self.subTest(name=name, record=record.suffix, arguments=arguments):
                if record == journal:
                    journal.write_text("\n" + json.dumps(name))
                else:
                    described = json.loads(text_)
                    described["files"][name] = 4
                    receipt.write_text(json.dumps(described))
                self.refused(record, json.dumps(name), to="yolo" if arguments else "coco", arguments=arguments)
                journal.unlink(missing_ok=True)
                receipt.write_text(text_)
        self.export("coco", "--split", "val")
        self.assertEqual(content(self.out), whole)

    def test_links_are_not_followed(self):
        self.export("coco", "--split", "val")
        whole = content(self.out)
        for name in ("volumes", "volumes/val", ".export"):
            link, kept = self.out / name, self.elsewhere / "kept"
            link.rename(kept)
            link.symlink_to(kept, target_is_directory=True)
            volume = next(kept.rglob("*.npy" if name != ".export" else "*"))
            for cut in (False, True):
                if cut and name != ".export":
                    volume.write_bytes(b"other")
                for arguments in ([], ["--full-scale", "2", "--overwrite"]):
                    with self.subTest(link=name, cut=cut, arguments=arguments):
                        self.refused(link, to="yolo" if arguments else "coco", arguments=arguments)
            link.unlink()
            kept.rename(link)
        journal = next((self.out / ".export").glob("*-of-*.json")).with_suffix(".begun")
        journal.symlink_to(self.victim)
        self.refused(journal)
        journal.unlink()
        # A file of its own is made again in place of a link.
        volume = next(self.out.rglob("*.npy"))
        volume.rename(self.elsewhere / volume.name)
        volume.symlink_to(self.elsewhere / volume.name)
        self.export("coco", "--split", "val")
        self.assertFalse(volume.is_symlink())
        self.assertEqual(content(self.out), whole)
        # The folder itself may be one: its user has named it.
        linked = self.out.parent / "linked"
        linked.symlink_to(self.out, target_is_directory=True)
        self.export("coco", "--split", "val", out=linked)

    def test_sources_of_the_description_are_those_of_the_plan(self):
        source = self.out.parent / "source"
        shutil.copytree(demo.finalized, source)
        for key in ("split", "dataset"):
            for value in ("../../elsewhere/x", str(self.elsewhere), "val" if key == "split" else "mpii", None):
                with self.subTest(key=key, value=value):
                    description = json.loads((demo.finalized / "dataset.json").read_text())
                    description["sources"][0][key] = value
                    (source / "dataset.json").write_text(json.dumps(description))
                    _, err = self.export("yolo", source=source, expect=66)
                    self.assertIn("dataset.json", err)
                    self.assertIn("as source 0 of the plan", err)
                    self.assertFalse(self.out.exists())
        description["sources"] = description["sources"][:1]
        (source / "dataset.json").write_text(json.dumps(description))
        self.export("yolo", source=source, expect=66)
        self.assertEqual(list(self.elsewhere.iterdir()), [])


class BadInput(Export):
    def test_a_folder_that_is_not_finalized(self):
        source = self.out.parent / "source"
        shutil.copytree(demo.finalized, source)
        (source / "dataset.json").unlink()
        _, err = self.export("yolo", source=source, expect=66)
        self.assertIn("dataset.json", err)
        self.export("yolo", source=demo.folder / "none", expect=66)
        self.assertFalse(self.out.exists())

    def test_a_shard_that_is_missing_or_another_one(self):
        for change in ("remove", "bytes", "record", "plan"):
            with self.subTest(change=change):
                source = self.out.parent / change
                shutil.copytree(demo.finalized, source)
                shard = sorted(source.glob("*-val-*.h5"))[0]
                record = shard.with_suffix(".json")
                if change == "remove":
                    shard.unlink()
                elif change == "bytes":
                    data = bytearray(shard.read_bytes())
                    data[len(data) // 2] ^= 1
                    shard.write_bytes(data)
                elif change == "record":
                    edited = json.loads(record.read_text())
                    edited["sha256"] = edited["sha256"][::-1]
                    record.write_text(json.dumps(edited))
                else:
                    description = json.loads((source / "dataset.json").read_text())
                    description["plan_hash"] = description["plan_hash"][::-1]
                    (source / "dataset.json").write_text(json.dumps(description))
                _, err = self.export("coco", source=source, out=self.out / change, expect=66)
                self.assertIn("plan.json" if change == "plan" else shard.name, err)
                self.assertFalse((self.out / change / "export.json").exists())

    def test_a_partial_folder_says_so(self):
        source = self.out.parent / "source"
        shutil.copytree(demo.finalized, source)
        gone = sorted(source.glob("*-val-*.h5"))[0]
        gone.unlink()
        run("finalize", source, "--partial")
        out, _ = self.export("webdataset", source=source)
        self.assertIn("PARTIAL", out)
        self.assertEqual(self.described()["missing_shards"], [gone.name])
        shutil.copy(demo.finalized / gone.name, gone)
        run("finalize", source)
        self.export("webdataset", source=source)
        self.assertEqual(len(self.described()["samples"]), len(demo.samples))

    def test_wrong_usage(self):
        _, err = self.export("yolo", "--split", "test", expect=64)
        self.assertIn("train, val", err)
        self.export("voc", expect=64)
        for to, option, value in [("coco", "--dtype", "float32"), ("yolo", "--counts", "rounded"),
                                  ("davis", "--seed", "1"), ("mpii", "--classes", "x"), ("dsec", "--ignored", "keep"),
                                  ("rvt", "--full-scale", "2"), ("webdataset", "--full-scale", "2")]:
            _, err = self.export(to, option, value, expect=64)
            self.assertRegex(err, rf"{option}: expected --to [a-z0-9 ,-]+, got --to {to}\n")
        _, err = self.export("mpii", "--split", "val", expect=64)
        self.assertIn("can use", err)
        self.assertFalse(self.out.exists())

    def test_a_wrong_class_map(self):
        classes = demo.folder / "wrong.json"
        for content_, what in [('{"Car": 0, "Cat": 1}', "DontCare"), ('{"Car": 1}', "no 0"),
                               ('{"Car": "a"}', "whole number"), ('{"DontCare": 0, "Car": 1}', "--ignored keep"),
                               ('[1]', "class names"), ('{"Car": 0', "JSON"), ('{"Car": null}', "one class")]:
            with self.subTest(classes=content_):
                classes.write_text(content_)
                _, err = self.export("yolo", "--classes", classes, expect=64)
                self.assertIn(what, err)
        self.export("yolo", "--classes", demo.folder / "none.json", expect=66)

    def test_an_export_of_another_job_is_never_replaced(self):
        self.export("yolo", "--split", "val")
        identity = self.out / ".export" / "export.txt"
        text = identity.read_text()
        self.assertRegex(text, r"\njob job, sources [0-9a-f]{16}\n")
        for other in ("job other, sources 0123456789abcdef", "job job, sources 0123456789abcdef", "without one"):
            identity.write_text(re.sub(r"\njob .*\n", f"\n{other}\n", text))
            before = content(self.out)
            for arguments in ([], ["--overwrite"]):
                _, err = self.export("yolo", "--split", "val", *arguments, expect=64)
                self.assertIn(other, err)
                self.assertNotIn("--overwrite", err)
            self.assertEqual(content(self.out), before)

    def test_a_folder_with_something_else(self):
        self.export("yolo", "--split", "val")
        _, err = self.export("yolo", "--split", "val", "--full-scale", "2", expect=64)
        self.assertIn("--overwrite", err)
        self.export("coco", "--split", "val", "--overwrite")
        self.assertFalse((self.out / "data.yaml").exists())
        self.assertFalse((self.out / "images").exists())
        same = self.out.parent / "same"
        self.export("coco", "--split", "val", out=same)
        same_folder(self.out, same)
        other = self.out.parent / "other"
        other.mkdir()
        (other / "a.txt").write_text("mine")
        _, err = self.export("coco", "--overwrite", out=other, expect=64)
        self.assertEqual([path.name for path in other.iterdir()], ["a.txt"])


if __name__ == "__main__":
    program.main()

"""Exit codes, help and messages of the command line."""

import collections
import json
import os
import pathlib
import re
import shlex
import shutil
import struct
import subprocess
import sys

import numpy as np
import PIL.Image

import program
from moving_texture import write_video
from program import run
from small_job import LENIENT, small_job
from safetensors_rules import read_safetensors

sys.path.append(str(pathlib.Path(__file__).parents[1] / "fuzz"))
import make_corpus as checkpoint_seeds


def folded_network():
    """A generator of base width 1 and 9 bins that was folded elsewhere: weights 0.5, biases 0.25, no batch norm."""
    layers = {"head.conv2d": (1, 2, 3), "pred.conv2d": (18, 1, 1)}
    for level in range(4):
        layers[f"encoders.{level}.conv2d"] = (2 << level, 1 << level, 3)
        layers[f"decoders.{level}.conv2d"] = (8 >> level, 24 >> level, 3)
    for block in range(2):
        layers[f"resblocks.{block}.conv1"] = layers[f"resblocks.{block}.conv2"] = (16, 16, 3)
    state = collections.OrderedDict()
    for name, (out, into, side) in layers.items():
        for part, shape, value in [("weight", [out, into, side, side], 0.5), ("bias", [out], 0.25)]:
            count = out * into * side * side if part == "weight" else out
            storage = checkpoint_seeds.Storage(str(len(state)), "f", [value] * count)
            state[f"{name}.{part}"] = checkpoint_seeds.Tensor(storage, shape)
    return state


class CommandLine(program.InFolder):
    def test_every_command_has_help(self):
        out, _ = run("--help")
        for command in ["init", "convert", "plan", "status", "retry", "finalize", "verify", "inspect", "preview",
                        "make-demo", "import-weights", "calibrate", "simulate", "train", "realism", "fit", "tradeoff",
                        "export", "report", "outline"]:
            self.assertIn(command, out)
            self.assertIn("Usage", run(command, "--help")[0])

    def test_help_of_a_command_is_its_own(self):
        self.assertEqual(run("help", "verify"), run("verify", "--help"))
        self.assertEqual(run("help"), run("--help"))

    def test_help_cluster_says_where_the_scripts_are(self):
        page, _ = run("help", "cluster")
        paths = re.findall(r"(?:^  |: )(/\S+)", page, re.MULTILINE)
        self.assertEqual([pathlib.Path(path).name for path in paths], ["submit.sh", "kubernetes", "running.md"])
        for path in paths:
            self.assertTrue(pathlib.Path(path).exists(), path)

    def test_help_keys_lists_the_keys_of_all_documents(self):
        page, _ = run("help", "keys")
        for line in ["## eventgan job manifest, version 1", "| `sources[].root` | path | required | ",
                     "| `recordings[].path` | path | required | ", "## eventgan sensor, version 1"]:
            self.assertIn(f"\n{line}", page)

    def test_help_keys_lists_those_that_begin_with_a_word(self):
        whole, _ = run("help", "keys")
        for start, keys in {"pairs.motion": "sources[].pairs.motion", "sources.root": "sources[].root",
                            "sources[].root": "sources[].root"}.items():
            page, _ = run("help", "keys", start)
            rows = [line for line in page.splitlines() if line.startswith("| `")]
            self.assertEqual(rows, [line for line in whole.splitlines() if line.startswith(f"| `{keys}")])
            self.assertGreater(len(rows), 0)
            self.assertTrue(page.startswith("## eventgan job manifest, version 1\n\n| key | "), page)
        page, _ = run("help", "keys", "name")
        self.assertIn("\n\n## eventgan training manifest, version 1\n\n| key | ", page)
        _, err = run("help", "keys", "pairs.motoin", expect=64)
        self.assertIn("got pairs.motoin; did you mean pairs.motion?", err)
        _, err = run("help", "convert", "pairs", expect=64)
        self.assertIn("expected one command, got convert and pairs", err)

    def test_help_representations_has_a_row_for_each(self):
        page, _ = run("help", "representations")
        rows = re.findall(r"(?m)^(\w+)(?::([A-Z]+))?  (uint8|float32) (\[.*\])$", page)
        self.assertIn(("histogram", "T", "uint8", "[2 T, H, W]"), rows)
        self.assertEqual(len(rows), page.count("\n    for "))

    def test_version_names_the_libraries(self):
        version, libraries, engines, processor = run("--version")[0].splitlines()
        self.assertRegex(version, r"^eventgan \d+\.\d+\.\d+$")
        for name in ["HDF5", "OpenCV", "libtiff"]:
            self.assertRegex(libraries, rf"\b{name}\S* \S+")
        self.assertRegex(engines, r"libtbb\.so\.\d+\.\d+")
        self.assertIn("processor: ", processor)

    def test_what_loads_slowly_is_in_programs_of_their_own(self):
        """LibTorch takes twenty times as long as all that `eventgan` loads, FFmpeg as long."""
        libraries = subprocess.run(["ldd", program.PROGRAM], check=True, capture_output=True, text=True).stdout
        self.assertEqual(re.findall(r"(?m)^\s*(lib(?:torch|avcodec|opencv_imgcodecs|opencv_videoio)\w*)", libraries),
                         [])
        version = subprocess.run([program.PROGRAM + "-torch", "--version"], check=True,
                                 capture_output=True, text=True).stdout
        self.assertRegex(version, r"libtorch_cpu\.so\.\d+\.\d+")

    def test_what_needs_libtorch_is_handed_over(self):
        """Where a package has it, with the same arguments and messages;
        without the package one line says which it is."""
        installed = self.folder / "bin" / "eventgan"
        installed.parent.mkdir()
        shutil.copy(program.PROGRAM, installed)
        jobs = [["convert", small_job(self.folder, generator={"weights": "untrained:2", "engine": "torch"}),
                 "--progress", "none"],
                ["train", program.SOURCE / "manifests" / "examples" / "train.json"]]
        for arguments in jobs:
            done = subprocess.run([installed, *arguments], capture_output=True, text=True)
            self.assertEqual(done.returncode, 1, done.stderr)
            self.assertEqual(done.stderr, "error: expected eventgan-torch, got none in "
                             f"{self.folder}/libexec/eventgan: install the Debian package "
                             "eventgan-torch, take the image with LibTorch, or build it (docker/bootstrap.sh package, "
                             "docker build --target torch, docker/bootstrap.sh build)\n")
            self.assertEqual(done.stdout, "")
        self.assertFalse((self.folder / "out").exists())
        with_torch = self.folder / "libexec" / "eventgan" / "eventgan-torch"
        with_torch.parent.mkdir(parents=True)
        with_torch.symlink_to(program.PROGRAM + "-torch")
        linked = self.folder / "eventgan"
        linked.symlink_to(installed)
        done = subprocess.run([linked, *jobs[0]], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stderr, r"\Agenerator: torch float32 on .*\n")
        with_torch.unlink()
        with_torch.write_text("no program")
        done = subprocess.run([linked, *jobs[0]], capture_output=True, text=True)
        self.assertEqual((done.returncode, done.stderr),
                         (1, f"error: expected to run {with_torch}, got 'Permission denied'\n"))

    def test_videos_are_handed_over_and_everything_is_told_once(self):
        write_video(self.folder / "clip.mp4", 4)
        run("init", self.folder / "clip.mp4", "--out", self.folder / "m.json")
        out, err = run("convert", self.folder / "m.json", "--output", self.folder / "out")
        self.assertEqual((err.count("generator: "), err.count("warning: "), out.count("3 of 3 pairs written")),
                         (1, 1, 1), err)
        self.assertIn(", FFmpeg ",
                      json.loads((self.folder / "out" / "plan.json").read_text())["fingerprint"]["libraries"])
        alone = self.folder / "eventgan"
        shutil.copy(program.PROGRAM, alone)
        done = subprocess.run([alone, "plan", self.folder / "m.json"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertIn("error: expected eventgan-video, got none in ", done.stderr)
        for put in (shutil.copy, os.symlink, os.link):  # a program that would hand over to itself for ever
            other = self.folder / "eventgan-video"
            put(alone, other)
            done = subprocess.run([alone, "plan", self.folder / "m.json"], capture_output=True, text=True, timeout=60)
            self.assertEqual(done.returncode, 1)
            self.assertRegex(done.stderr, r"\Aerror: expected eventgan-video, got another program of its name, /.*\n\Z")
            other.unlink()
        without = ["unshare", "--mount", "sh", "-c", 'umount -l /proc && exec "$@"', "sh"]
        if subprocess.run([*without, "true"], capture_output=True).returncode == 0:
            done = subprocess.run([*without, alone, "plan", self.folder / "m.json"], capture_output=True, text=True)
            self.assertEqual(done.returncode, 1)
            self.assertIn("error: expected eventgan-video, got none in ", done.stderr)

    def test_mistyped_words_get_the_nearest(self):
        for arguments, got, meant in [
                (["conver"], "conver", "convert"), (["stauts"], "stauts", "status"),
                (["help", "inspct"], "inspct", "inspect"),
                (["convert", "a.json", "--thread", "3"], "--thread", "--threads"),
                (["convert", "a.json", "--thraeds=3"], "--thraeds", "--threads"),
                (["export", "out", "--too", "coco", "--out", "x"], "--too", "--to"),
                (["convert", "a.json", "--progress", "jsn"], "jsn", "json"),
                (["export", "out", "--to", "coc", "--out", "x"], "coc", "coco")]:
            with self.subTest(arguments=arguments):
                _, err = run(*arguments, expect=64)
                self.assertRegex(err, rf"^error: .*got {got}; did you mean {meant}\? \(eventgan[a-z ]* --help\)\n$")
        for arguments in [["frobnicate"], ["convert", "a.json", "--frobnicate"],
                          ["convert", "a.json", "--progress", "frobnicate"]]:
            _, err = run(*arguments, expect=64)
            self.assertIn("frobnicate", err)
            self.assertNotIn("did you mean", err)

    def test_words_are_listed_and_numbers_are_none(self):
        for arguments in [["convert", "a.json", "--progress", "3"], ["realism", "a.h5", "--with", "1"],
                          ["export", "out", "--to", "0", "--out", "x"]]:
            _, err = run(*arguments, expect=64)
            self.assertRegex(err, r"expected one of [a-z0-9-]+(, [a-z0-9-]+)+, got \d")
            self.assertNotRegex(err, r"->|\{")

    def test_after_quarantine_the_last_line_says_what_to_run(self):
        path = small_job(self.folder / "small", errors=LENIENT)
        (self.folder / "small" / "cars" / "image_2" / "000000.png").write_bytes(b"no image")
        out = run("convert", path)[0]
        last = out.splitlines()[-1]
        self.assertEqual(last, f"next, once the inputs are fixed:  eventgan retry {path.parent / 'out'}")
        run(*last.split("eventgan ")[1].split())  # which runs

    def test_no_name_steers_the_terminal(self):
        """Escape sequences in names of folders, images and labels, on both streams and of all kinds of commands."""
        folder = self.folder / "a\x1b]0;title\x07\x9bb\x7f"
        path = small_job(folder, errors=LENIENT)
        cars = folder / "cars"
        cars.rename(folder / "cars\x1b[31m")
        path.write_text(path.read_text().replace('"cars"', '"cars\\u001b[31m"'))
        (folder / "cars\x1b[31m" / "image_2" / "000000.png").write_bytes(b"no image")
        out = folder / "out"
        run("convert", path)
        shards = sorted(out.glob("*-of-*.h5"))
        shown = [*run("convert", path), *run("status", out), *run("verify", out), *run("finalize", out),
                 *run("report", out), *run("plan", path), *run("preview", out, "--out", folder / "p", "--count", 1),
                 *run("init", folder / "cars\x1b[31m", "--out", folder / "new.json"),
                 *run("init", folder / "none", expect=66), *run("inspect", shards[0], "--sample", 0)]
        shards[0].unlink()
        shown += [*run("verify", out, expect=1), *run("finalize", out, expect=1)]
        for text in shown:
            self.assertNotRegex(text, "[\x00-\x08\x0b-\x1f\x7f-\x9f]")
        self.assertIn("\\u001b]0;title\\u0007\\u009bb\\u007f/out", shown[0])

    def test_verify_tells_of_each_shard(self):
        path = small_job(self.folder / "small", errors=LENIENT)
        (self.folder / "small" / "cars" / "image_2" / "000000.png").write_bytes(b"no image")
        run("convert", path)
        folder = path.parent / "out"
        shards = sorted(folder.glob("*-of-*.h5"))
        lines = run("verify", folder, "--deep")[0].splitlines()
        told = [line for line in lines if line.startswith("small-train-")]
        self.assertEqual([line.split(":")[0] for line in told], [shard.name for shard in shards])
        self.assertEqual(sum(" 1 quarantined, " in line for line in told), 1)
        # 9 samples, 1 quarantined
        self.assertEqual(sum(int(line.split("labels of ")[1].split()[0]) for line in told), 8)

        shards[1].write_bytes(shards[1].read_bytes()[:-1])
        shards[2].unlink()
        shards[2].with_suffix(".json").unlink()
        report = json.loads(run("verify", folder, "--json", expect=1)[0])
        self.assertFalse(report["sound"])
        self.assertEqual([shard["condition"] for shard in report["shards"]],
                         ["done", "of another size", "missing", "done", "done"])
        self.assertEqual([len(shard["faults"]) for shard in report["shards"]], [0, 1, 1, 0, 0])
        self.assertEqual(len(report["faults"]), 3)  # and dataset.json tells of the others
        self.assertEqual(report["shards"][0]["size_bytes"], shards[0].stat().st_size)
        self.assertEqual(json.loads(run("verify", folder, "--progress", "json", expect=1)[0]), report)

    def test_wrong_usage_is_64(self):
        run(expect=64)
        run("nonsense", expect=64)
        run("convert", expect=64)
        run("convert", "a.json", "--threads", "0", expect=64)
        run("convert", "a.json", "--progress", "loud", expect=64)
        run("convert", "a.json", "--grace", "-1", expect=64)
        run("convert", "a.json", "--grace", "nan", expect=64)
        for command in ["status", "retry", "finalize", "verify"]:
            run(command, expect=64)
        run("make-demo", self.folder / "demo")
        run("convert", self.folder / "demo" / "manifest.json", "--output", "", expect=64)

    def test_a_value_that_is_empty_is_one_that_is_missing(self):
        """A script's unset variable, which meant neither the current folder nor the manifest's."""
        for arguments in [("convert", ""), ("finalize", ""), ("export", "a", "--to", "yolo", "--out", ""),
                          ("plan", "a.json", "--output", ""), ("outline", "a.json", "--out", "")]:
            _, err = run(*arguments, expect=64)
            self.assertIn(": expected a value, got nothing (", err)

    def test_two_dashes_hide_no_fault_before_them(self):
        _, err = run("convert", "--threads", "0", "--", "a.json", expect=64)
        self.assertIn("--threads: Value 0 not in range", err)
        _, err = run("convert", "--progress", "loud", "--", "a.json", expect=64)
        self.assertIn("got loud", err)

    def test_missing_inputs_are_66(self):
        run("convert", self.folder / "none.json", expect=66)
        for command in ["verify", "status", "retry", "finalize"]:
            _, err = run(command, self.folder, expect=66)
            self.assertIn(str(self.folder), err)
        path = self.write_manifest(
            program.manifest([{"dataset": "mpii", "root": "nowhere", "pairs": program.pairs([2])}]))
        _, err = run("convert", path, expect=66)
        self.assertIn("nowhere", err)
        run("inspect", self.folder / "none.h5", expect=66)
        run("export", self.folder, "--to", "yolo", "--out", self.folder / "export", expect=66)
        run("preview", self.folder / "none.h5", "--out", self.folder / "p", expect=66)
        run("import-weights", self.folder / "none.pt", self.folder / "w.safetensors", expect=66)
        run("simulate", self.folder / "none.json", expect=66)
        run("calibrate", self.folder / "none.json", expect=66)
        run("train", self.folder / "none.json", expect=66)
        run("realism", self.folder / "none.hdf5", "--with", "difference", expect=66)

    def test_a_bad_manifest_is_64_and_every_fault_is_told_at_once(self):
        bad = program.manifest([{"dataset": "mpii", "root": "x", "pairs": program.pairs([9.7])}], seed="x", colour=1)
        _, err = run("plan", self.write_manifest(bad), expect=64)
        for path in ["$.sources[0].pairs.gaps[0]", "$.seed", "$.colour"]:
            self.assertIn(path, err)

    def test_import_weights_reads_an_old_checkpoint_of_a_folded_network(self):
        old = self.folder / "old.pt"
        old.write_bytes(checkpoint_seeds.legacy_checkpoint({"gen": folded_network(), "epoch": 3}))
        weights = self.folder / "w.safetensors"
        out, _ = run("import-weights", old, weights)
        self.assertIn("base width 1, 9 bins", out)
        tensors, metadata = read_safetensors(weights)
        self.assertEqual(metadata["base_channels"], "1")
        self.assertEqual(metadata["training_gaps"], "1-5")  # what the authors' code draws from
        self.assertEqual(tensors["pred.bias"], ([18], struct.pack("<18f", *[0.25] * 18)))
        before = weights.read_bytes()
        run("import-weights", old, weights)
        self.assertEqual(weights.read_bytes(), before)

    def test_import_weights_says_what_is_there_instead_and_writes_nothing(self):
        old, weights = self.folder / "old.pt", self.folder / "w.safetensors"
        extra = checkpoint_seeds.Tensor(checkpoint_seeds.Storage("extra", "f", [0.5]), [1])
        for state, named in [({"flow": {}, "recons": {}, "epoch": 3}, "the keys flow, recons, epoch"),
                             ({"gen": {}}, "head.conv2d.weight"),
                             ({"gen": {**folded_network(), "resblocks.2.bias": extra}}, "resblocks.2.bias")]:
            old.write_bytes(checkpoint_seeds.legacy_checkpoint(state))
            self.assertIn(named, run("import-weights", old, weights, expect=66)[1])
        run("import-weights", old, self.folder / "w.pt", expect=64)
        self.assertFalse(weights.exists())
        others = {"dis": {"disc.model.0.weight": extra}, "optimizer_gen": {"state": {}}, "epoch": 3}
        old.write_bytes(checkpoint_seeds.legacy_checkpoint({"gen": folded_network(), **others}))
        run("import-weights", old, weights)

    def write_damaged_images(self, folder):
        """A good and a damaged image of each format in turn, as frames 0, 1, ... of one folder."""
        folder.mkdir()
        image = PIL.Image.fromarray(np.random.default_rng(3).integers(0, 256, (24, 32, 3), dtype=np.uint8))
        formats = [("bmp", {}), ("jpg", {}), ("png", {}), ("tif", {}), ("tif", {"compression": "tiff_lzw"}),
                   ("tif", {"compression": "jpeg"})]
        for index, (extension, options) in enumerate(formats):
            good, bad = [folder / f"{2 * index + k:04d}.{extension}" for k in range(2)]
            image.save(good, **options)
            data = good.read_bytes()
            bad.write_bytes(data[:len(data) // 2])
        # A header that claims more pixels than there can be.
        large = bytearray((folder / "0000.bmp").read_bytes())
        struct.pack_into("<i", large, 18, 1 << 27)
        (folder / f"{2 * len(formats):04d}.bmp").write_bytes(large)
        return len(formats) + 1

    def test_damaged_images_are_told_by_us_alone(self):
        damaged = self.write_damaged_images(self.folder / "frames")
        manifest = program.manifest(
            [{"dataset": "frames", "root": "frames", "pairs": program.pairs([1])}], errors=LENIENT,
            generator={"kind": "difference"}, image={"width": 32, "height": 24, "preset": "mpii"})
        path = self.write_manifest(manifest)
        for style in ["lines", "json"]:
            out, err = run("convert", path, "--progress", style, "--output", self.folder / style)
            self.assertNotRegex(out + err, r"(?i)opencv|imread|libpng|libtiff|\bwarn")
            if style == "json":
                for line in err.splitlines():
                    self.assertIn(json.loads(line)["event"], {"progress", "note", "warning"})
                self.assertGreaterEqual(len(json.loads(out)["quarantined"]), damaged)

    def test_every_line_of_json_progress_is_json(self):
        def events(*arguments, expect):
            _, err = run(*arguments, expect=expect)
            return [json.loads(line) for line in err.splitlines()]

        def only_error(*arguments, expect):
            (event,) = events(*arguments, expect=expect)
            self.assertEqual(set(event), {"event", "text"})
            self.assertEqual(event["event"], "error")
            return event["text"]

        self.assertIn("MANIFEST", only_error("convert", "--progress", "json", expect=64))
        self.assertIn("--threads", only_error("convert", "a.json", "--threads", "0", "--progress=json", expect=64))
        for command in ["convert", "calibrate", "train", "simulate"]:
            self.assertIn("none.json", only_error(command, self.folder / "none.json", "--progress", "json", expect=66))
        self.assertIn("none.h5", only_error("realism", self.folder / "none.h5", "--progress", "json", expect=66))
        self.assertIn("none", only_error("retry", self.folder / "none", "--progress", "json", expect=66))
        bad = self.write_manifest(program.manifest([], seed="x", colour=1), "bad.json")
        self.assertIn("\n", only_error("convert", bad, "--progress", "json", expect=64))  # all faults in one event

        (self.folder / "clip.mp4").write_bytes(bytes(range(256)) * 40)  # no video, although it is named so
        clip = self.write_manifest(program.manifest(
            [{"dataset": "frames", "root": "clip.mp4", "pairs": program.pairs([1])}]), "clip.json")
        self.assertIn("clip.mp4", events("convert", clip, "--progress", "json", expect=66)[-1]["text"])

        path = small_job(self.folder / "small", errors={"policy": "quarantine", "max_count": 0, "max_fraction": 0})
        (self.folder / "small" / "cars" / "image_2" / "000000.png").write_bytes(b"no image")
        self.assertEqual(events("convert", path, "--progress", "json", expect=65)[-1]["event"], "error")
        self.assertEqual(events("retry", path.parent / "out", "--progress", "json", expect=65)[-1]["event"], "error")

    def test_status_of_a_manifest_is_that_of_its_output(self):
        path = small_job(self.folder / "small", output={"directory": "shards/"})
        _, err = run("status", path, expect=66)  # nothing has begun
        self.assertIn("a trial run is in " + str(path.parent / "shards") + "-trial-N", err)
        run("convert", path)
        run("finalize", path.parent / "shards")
        told = run("status", path.parent / "shards")
        self.assertIn("and every shard is done", told[0])
        for where in (path, path.parent / "shards" / "dataset.h5"):
            self.assertEqual(run("status", where), told)
        self.assertTrue(json.loads(run("status", path, "--json")[0])["complete"])
        path.write_text("{}")
        self.assertIn(f"{path}: $", run("status", path, expect=64)[1])

    def run_with_output_to(self, redirection, *arguments):
        command = shlex.join(map(str, (program.PROGRAM, *arguments)))
        return subprocess.run(["sh", "-c", f"exec {command} {redirection}"], stderr=subprocess.PIPE, text=True)

    def test_output_that_cannot_be_written_is_1(self):
        path = small_job(self.folder / "small")
        folder = path.parent / "out"
        run("convert", path)
        shard = sorted(folder.glob("*-of-*.h5"))[0]
        before = program.shard_bytes(folder)
        for redirection in [">/dev/full", ">&-"]:
            for arguments in [["--help"], ["--version"], ["plan", "--help"], ["plan", path], ["plan", path, "--json"],
                              ["convert", path], ["retry", folder], ["status", folder], ["verify", folder],
                              ["inspect", shard], ["finalize", folder], ["report", folder],
                              ["preview", shard, "--out", self.folder / "p"]]:
                with self.subTest(redirection=redirection, arguments=arguments):
                    done = self.run_with_output_to(redirection, *arguments)
                    self.assertEqual(done.returncode, 1, done.stderr)
                    self.assertIn("standard output", done.stderr)
        self.assertEqual(self.run_with_output_to(">/dev/full", "convert").returncode, 64)  # nothing was to be written
        self.assertEqual(self.run_with_output_to(">/dev/null", "status", folder).returncode, 0)
        # No shard has been opened in the place of the standard output.
        done = self.run_with_output_to(">&- <&-", "convert", path, "--output", self.folder / "anew")
        self.assertEqual(done.returncode, 1)
        anew = program.shard_bytes(self.folder / "anew")
        self.assertEqual(anew, {name: before[name] for name in anew})
        self.assertEqual(len(anew), len(list(folder.glob("small-*.h5"))))

    def test_a_damaged_shard_is_an_error_that_names_it(self):
        (self.folder / "x.h5").write_bytes(b"no HDF5")
        for arguments in [("inspect",), ("preview", "--out", self.folder / "p")]:
            _, err = run(arguments[0], self.folder / "x.h5", *arguments[1:], expect=1)
            self.assertIn("x.h5", err)


if __name__ == "__main__":
    program.main()

"""What computes the network: engines and precisions by the manifest, calibration for int8, processors that lack instructions."""

import hashlib
import json
import pathlib
import re
import shutil
import subprocess
import unittest

import h5py
import numpy as np

import program
from program import SOURCE, run
from small_job import LENIENT, broken_cars, small_job

PAIRS = 30
SHIPPED = sorted((SOURCE / "manifests" / "weights").glob("eventgan-*.safetensors"))[0]
FLAGS = set(re.findall(r"[a-z]\w*", next((line for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines()
                                         if line.startswith("flags")), "")))
# A still network says nothing of its arithmetic: random frames make it speak, and int8's error is then some per cent.
MOST_INT8_ERROR = 0.25
TOLERANCE = 1e-4  # of the largest value, between float32 volumes


def relative_distance(volumes, reference):
    return np.linalg.norm(volumes - reference) / np.linalg.norm(reference)


class Engines(program.InFolder):
    def setUp(self):
        super().setUp()
        self.job = self.folder / "job"
        small_job(self.job, cars=PAIRS, people=0, samples_per_shard=PAIRS)
        shutil.copy(SHIPPED, self.job / "w.safetensors")

    def manifest(self, name="manifest.json", **generator):
        """Another manifest of the job, which writes to a folder of its own."""
        job = json.loads((self.job / "manifest.json").read_text())
        job.update(generator={"weights": "w.safetensors", **generator}, errors=LENIENT,
                   output={"directory": pathlib.Path(name).stem, "samples_per_shard": PAIRS, "dtype": "float32"})
        path = self.job / name
        path.write_text(json.dumps(job))
        return path

    def convert(self, name, environment=None, **generator):
        """The volumes, and what was said."""
        _, err = run("convert", self.manifest(f"{name}.json", **generator), "--progress", "none", "--overwrite",
                     environment=environment)
        with h5py.File(next((self.job / name).glob("*.h5"))) as shard:
            self.assertTrue(shard["valid"][:].all())
            return shard["events/volume"][:], err

    def test_scope_generates_the_tiles_that_it_says(self):
        for engine in ("onednn", "torch"):
            if not self.is_offered(self.manifest("offered.json", engine=engine)):
                continue
            whole, _ = self.convert("whole", engine=engine)
            for scope, is_any in (("motion", False), ("labels", True), ("labels_only", True)):
                # Nothing differs by more than 255 grey levels.
                volumes, _ = self.convert(scope, engine=engine, scope=scope, motion_threshold=255, label_margin_px=0, tile_px=8)
                with h5py.File(next((self.job / scope).glob("*.h5"))) as shard:
                    tiles = shard["events/tiles"]
                    self.assertEqual((tiles.attrs["scope"], tiles.attrs["tile_px"]), (scope, 8))
                    kept = np.repeat(np.repeat(tiles[:], 8, 1), 8, 2)[:, None, :whole.shape[2], :whole.shape[3]]
                self.assertEqual((kept.mean() > 0, kept.mean() < 1), (is_any, True))
                np.testing.assert_allclose(volumes, whole * kept, atol=1e-5 * whole.max())
                run("finalize", self.job / scope)
                run("verify", self.job / scope, "--deep")

    def is_offered(self, path):
        """Whether this program on this processor takes a manifest's engine and precision."""
        code = subprocess.run([program.PROGRAM, "plan", path], capture_output=True).returncode
        self.assertIn(code, (0, 64))
        return code == 0

    def needs_onednn(self):
        _, err = run("plan", self.manifest())
        if "without oneDNN" in err:
            self.skipTest("the program was built without oneDNN")

    def assert_near(self, volumes, reference):
        self.assertGreater(reference.max(), 0)
        self.assertLessEqual(np.abs(volumes - reference).max(), TOLERANCE * reference.max())

    def test_both_engines_make_the_same_volumes_and_say_their_name(self):
        self.needs_onednn()
        torch, err = self.convert("torch", engine="torch")
        self.assertRegex(err, r"(?m)^generator: torch float32 on \S+ \(as the manifest says\), trained on gaps 1-6$")
        onednn, err = self.convert("onednn", engine="onednn", precision="float32")
        self.assertRegex(err, r"(?m)^generator: onednn float32 on \S+ \(as the manifest says\), trained on gaps 1-6$")
        self.assert_near(onednn, torch)
        fastest, err = self.convert("auto", engine="auto")
        self.assertRegex(err, r"(?m)^generator: onednn float32 on \S+ \(auto: the fastest engine for float32 on this processor\), trained on gaps 1-6$")
        np.testing.assert_array_equal(fastest, onednn)
        engines = {name: json.loads((self.job / name / "plan.json").read_text())["fingerprint"]["engine"]
                   for name in ("torch", "onednn", "auto")}
        self.assertTrue(engines["torch"].startswith("torch float32"), engines)
        self.assertTrue(engines["onednn"].startswith("onednn float32"), engines)
        self.assertEqual(engines["auto"], engines["onednn"])

    def test_threads_change_no_byte_of_any_engine(self):
        run("calibrate", self.manifest(), "--pairs", "4", "--out", self.job / "calibrated.safetensors", "--progress", "none")
        for generator in [{"engine": "torch"}, {"engine": "onednn"}, {"engine": "torch", "precision": "bfloat16"},
                          {"engine": "onednn", "precision": "bfloat16"},
                          {"weights": "calibrated.safetensors", "precision": "int8"}]:
            path = self.manifest("threads.json", **generator)
            if generator != {"engine": "torch"} and not self.is_offered(path):
                continue
            with self.subTest(**generator):
                shards = []
                for threads in (1, 3):
                    run("convert", path, "--progress", "none", "--overwrite", "--threads", threads,
                        environment={"OMP_NUM_THREADS": str(threads)})
                    shards.append(program.shard_bytes(self.job / "threads"))
                self.assertEqual(len(shards[0]), 1)
                self.assertEqual(*shards)

    def test_a_folder_of_one_engine_is_not_gone_on_with_by_another(self):
        self.needs_onednn()
        path = self.manifest("out.json", engine="torch")
        run("convert", path, "--progress", "none")
        self.manifest("out.json", engine="onednn")
        _, err = run("convert", path, "--progress", "none", expect=64)
        self.assertRegex(err, r"engine: expected torch float32.*, got onednn float32")

    def test_every_command_that_generates_says_so(self):
        path = self.manifest("out.json", engine="torch")
        line = r"generator: torch float32 on .+ \(as the manifest says\), trained on gaps 1-6"
        self.assertRegex(run("plan", path)[1], line)
        with broken_cars(self.job, [1]):
            _, err = run("convert", path, "--progress", "json")
        notes = [json.loads(text) for text in err.splitlines()]
        self.assertTrue(any(note["event"] == "note" and re.fullmatch(line, note["text"]) for note in notes), err)
        self.assertRegex(run("retry", self.job / "out", "--progress", "none")[1], line)

    def test_what_is_no_engine_or_does_not_fit_is_64(self):
        _, err = run("plan", self.manifest(engine="cuda"), expect=64)
        self.assertIn('$.generator.engine: expected "auto", "torch" or "onednn", got "cuda"', err)
        _, err = run("convert", self.manifest(weights="untrained:2", precision="int8"), expect=64)
        if "without oneDNN" not in err:
            self.assertIn("expected weights with a calibration for int8, got untrained:2 without one; "
                          "run eventgan calibrate MANIFEST", err)
        _, err = run("convert", self.manifest(engine="torch", precision="int8"), expect=64)
        self.assertIn("LibTorch has no int8 for this network", err)

    def test_cuda_gives_the_volumes_of_the_processor_or_is_refused_before_any_work(self):
        path = self.manifest("cuda.json", device="cuda")
        if not self.is_offered(path):
            for command in ("plan", "convert"):
                out, err = run(command, path, "--progress", "none", expect=64)
                self.assertEqual(out, "")
                self.assertRegex(err, r'\A\S+ \$\.generator\.device: expected "cpu", got "cuda": '
                                      r"LibTorch (was built without CUDA|finds no CUDA device)\n\Z")
            self.assertFalse((self.job / "cuda").exists())
            return
        volumes, err = self.convert("cuda", device="cuda")
        self.assertRegex(err, r"(?m)^generator: torch float32 on cuda: .+ \(auto: the engine of device cuda\), trained on gaps 1-6$")
        self.assert_near(volumes, self.convert("torch", engine="torch")[0])
        shards = []
        for threads in (1, 3):
            run("convert", path, "--progress", "none", "--overwrite", "--threads", threads)
            shards.append(program.shard_bytes(self.job / "cuda"))
        self.assertEqual(*shards)

    def test_cuda_takes_neither_onednn_nor_int8(self):
        _, err = run("plan", self.manifest(engine="onednn", device="cuda"), expect=64)
        self.assertIn('$.generator.engine: expected "auto" or "torch" on device cuda, got "onednn"', err)
        _, err = run("plan", self.manifest(precision="int8", device="cuda"), expect=64)
        self.assertIn('$.generator.precision: expected "float32" or "bfloat16" on device cuda, got "int8"', err)

    # Calibration.

    def calibrate(self, *arguments, expect=0, **generator):
        return run("calibrate", self.manifest(**generator), "--progress", "none", *arguments, expect=expect)

    def test_calibrated_weights_convert_in_int8(self):
        self.needs_onednn()
        before = (self.job / "w.safetensors").read_bytes()
        out, err = self.calibrate("--pairs", "12")
        self.assertNotIn("skipped w", err)
        self.assertIn("calibrated on 12 pairs, 0 skipped", out)
        self.assertEqual((self.job / "w.safetensors").read_bytes(), before)
        data = (self.job / "w-calibrated.safetensors").read_bytes()
        self.assertIn(f"SHA-256 {hashlib.sha256(data).hexdigest()}", out)
        median, worst = map(float, re.search(r"on 6 other pairs: median (\S+), worst (\S+)", out).groups())
        self.assertTrue(0 < median <= worst < MOST_INT8_ERROR, out)

        line = re.search(r"For the manifest:\n *(\"generator\": .*)\n", out).group(1)
        generator = json.loads("{" + line + "}")["generator"]
        self.assertEqual(generator, {"weights": "w-calibrated.safetensors", "precision": "int8"})
        exact, _ = self.convert("exact", weights="w-calibrated.safetensors")
        int8, err = self.convert("int8", **generator)
        self.assertRegex(err, r"(?m)^generator: onednn int8 on \S+ \(auto")
        self.assertLess(relative_distance(int8, exact), MOST_INT8_ERROR)
        plain, _ = self.convert("plain")
        np.testing.assert_array_equal(exact, plain)  # a calibration changes nothing else

        self.calibrate("--pairs", "12")
        self.assertEqual((self.job / "w-calibrated.safetensors").read_bytes(), data)

    def test_where_the_calibrated_weights_go(self):
        named = self.folder / "named.safetensors"
        self.calibrate("--pairs", "1", "--out", named)
        self.assertTrue(named.exists())
        self.assertFalse((self.job / "w-calibrated.safetensors").exists())
        self.calibrate("--pairs", "1", "--out", self.job / "w.safetensors")  # the input, as it was told
        self.assertEqual((self.job / "w.safetensors").read_bytes(), named.read_bytes())
        width = SHIPPED.stem.removeprefix("eventgan-")
        self.calibrate("--pairs", "1", weights=f"shipped:{width}")
        self.assertTrue((self.job / f"eventgan-{width}-calibrated.safetensors").exists())
        self.calibrate("--out", "w.h5", expect=64)
        self.calibrate("--out", self.folder / "none" / "w.safetensors", expect=64)
        self.assertEqual([path.name for path in self.job.glob(".*")], [])

    def test_pairs_that_cannot_be_read_are_skipped_and_none_is_an_error(self):
        with broken_cars(self.job, range(0, PAIRS, 3)):
            out, err = self.calibrate("--out", self.folder / "w.safetensors")
        self.assertRegex(out, r"calibrated on \d+ pairs, 10 skipped")
        self.assertIn("skipped 000000", err)
        with broken_cars(self.job, range(PAIRS)):
            _, err = self.calibrate("--out", self.folder / "none.safetensors", expect=66)
        self.assertIn("expected pairs to calibrate on, got none that can be read", err)
        self.assertFalse((self.folder / "none.safetensors").exists())

    def test_a_simulator_has_nothing_to_calibrate(self):
        _, err = run("calibrate", self.job / "manifest.json", expect=64)
        self.assertIn('$.generator.kind: expected "network"', err)

    # Processors that lack instructions, as oneDNN believes.

    def test_float32_is_right_on_lesser_processors(self):
        self.needs_onednn()
        reference, _ = self.convert("torch", engine="torch")
        for limit in ["AVX2", "AVX512_CORE"]:
            for engine in ["torch", "onednn"]:
                with self.subTest(limit, engine=engine):
                    volumes, err = self.convert("limited", {"ONEDNN_MAX_CPU_ISA": limit}, engine=engine)
                    self.assert_near(volumes, reference)
                    self.assertNotIn("warning", err)

    def test_bfloat16_gets_a_clear_word_on_lesser_processors(self):
        self.needs_onednn()
        path = self.manifest("half.json", precision="bfloat16")
        _, err = run("convert", path, expect=64, environment={"ONEDNN_MAX_CPU_ISA": "AVX2"})
        self.assertIn('$.generator.precision: expected "float32", got "bfloat16": oneDNN has no compiled kernels', err)
        self.assertIn("avx2", err)
        if "avx512bw" not in FLAGS:
            return
        reference, _ = self.convert("torch", engine="torch")
        for engine in ["torch", "onednn"]:
            with self.subTest(engine):
                volumes, err = self.convert("half", {"ONEDNN_MAX_CPU_ISA": "AVX512_CORE"}, engine=engine, precision="bfloat16")
                self.assertIn("warning: precision bfloat16: this processor (avx512_core) has no instructions for it; "
                              "float32 is both faster and exact here", err)
                self.assertLess(relative_distance(volumes, reference), 0.05)


if __name__ == "__main__":
    program.main()

"""What computes the network: engines and precisions by the manifest, calibration for int8,
processors that lack instructions."""

import hashlib
import json
import pathlib
import re
import shutil
import subprocess
import sys
from unittest import mock

import h5py
import numpy as np
import PIL.Image

import program
from program import PACKAGE, SOURCE, run
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


def pytorch():
    """PyTorch, and what of the package is tried here; (None, None) without it."""
    sys.path.insert(0, str(PACKAGE))
    try:
        import torch
    except ImportError:
        return None, None
    import eventgan.torch
    return torch, eventgan.torch


def write_persons(root, count=12):
    """Sources of persons at random places in images of 200 x 160, a person an image: MPII's with centre and scale, with
    one of these or none, and Human3.6M's."""
    random = np.random.default_rng(7)
    (root / "images").mkdir(parents=True)

    def save(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        PIL.Image.fromarray(random.integers(0, 256, (160, 200), dtype=np.uint8)).save(path)

    people, middle, scale = [], random.uniform([20, 20], [180, 140], (count, 2)), random.uniform(0.02, 0.25, count)
    for k in range(count):
        name = f"{['annotated', 'annotated', 'joints', 'scale', 'center'][k % 5]}{k}"
        frames = root / "sequences" / name
        for frame in (4, 5, 6):
            save(frames / f"{frame:08d}.jpg")
        shutil.copy(frames / "00000005.jpg", root / "images" / f"{name}.jpg")
        joints = middle[k] + random.uniform(-30, 30, (16, 2))
        people.append({"image": f"{name}.jpg", "joints": np.clip(joints, 1, 160).tolist(), "joints_vis": [1] * 16,
                       "center": [-1, -1] if name[0] in "js" else middle[k].tolist(),
                       "scale": -1 if name[0] in "jc" else scale[k]})
    (root / "people.json").write_text(json.dumps(people))

    names = [f"S1_Walking.54138969_{5 * k + 1:06d}.jpg" for k in range(6)]
    for name in names:
        save(root / "h36m" / "S1" / "S1_Walking.54138969" / name)
    part = np.concatenate([middle[:6, None] + random.uniform(-20, 20, (6, 17, 2)), np.ones((6, 17, 1))], -1)
    np.savez(root / "h36m" / "a.npz", imgname=names, center=middle[:6], scale=scale[:6], part=part,
             S=np.ones((6, 17, 4)))
    return [{"dataset": "mpii_list", "root": str(root), "annotations": str(root / "people.json"),
             "sequences": str(root / "sequences"), "pairs": program.pairs([2], side="around")},
            {"dataset": "human36m", "layout": "extracted", "root": str(root / "h36m"), "pairs": program.pairs([1])}]


def tiles_of(to_volume, side, shape, tile_px=8):
    """bool [rows, columns]: the tiles with a pixel that a crop of side x side samples, bilinearly."""
    at = np.stack(np.meshgrid(np.arange(side), np.arange(side)), -1) @ to_volume[:, :2].T + to_volume[:, 2]
    tiles = np.zeros(shape, bool)
    for rounded in (np.floor(at + 1e-6), np.ceil(at - 1e-6)):
        for columns in (np.floor(at[..., 0] + 1e-6), np.ceil(at[..., 0] - 1e-6)):
            row, column = (rounded[..., 1] // tile_px).astype(int), (columns // tile_px).astype(int)
            inside = (row >= 0) & (row < shape[0]) & (column >= 0) & (column < shape[1])
            tiles[row[inside], column[inside]] = True
    return tiles


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
        with h5py.File(next((self.job / name).glob("*-of-*.h5"))) as shard:
            self.assertTrue(shard["valid"][:].all())
            return shard["events/volume"][:], err

    def test_scope_generates_the_tiles_that_it_says(self):
        for engine in ("onednn", "torch"):
            if not self.is_offered(self.manifest("offered.json", engine=engine)):
                continue
            whole, _ = self.convert("whole", engine=engine)
            for scope, is_any in (("motion", False), ("labels", True), ("labels_only", True)):
                # Nothing differs by more than 255 grey levels.
                volumes, _ = self.convert(scope, engine=engine, scope=scope, motion_threshold=255, label_margin_px=0,
                                          tile_px=8)
                with h5py.File(next((self.job / scope).glob("*-of-*.h5"))) as shard:
                    tiles = shard["events/tiles"]
                    self.assertEqual((tiles.attrs["scope"], tiles.attrs["tile_px"]), (scope, 8))
                    kept = np.repeat(np.repeat(tiles[:], 8, 1), 8, 2)[:, None, :whole.shape[2], :whole.shape[3]]
                self.assertEqual((kept.mean() > 0, kept.mean() < 1), (is_any, True))
                np.testing.assert_allclose(volumes, whole * kept, atol=1e-5 * whole.max())
                run("finalize", self.job / scope)
                run("verify", self.job / scope, "--deep")

    def test_labels_only_generates_all_that_pose_trainers_cut_out(self):
        """The program's crop and the package's are written twice: neither can change alone."""
        torch, cut_out = pytorch()
        if torch is None:
            self.skipTest("there is no PyTorch")
        sources = write_persons(self.folder / "persons")
        manifest = program.manifest(sources,
                                    generator={"weights": "untrained:2", "scope": "labels_only", "label_margin_px": 0,
                                               "tile_px": 8})
        run("convert", self.write_manifest(manifest), "--progress", "none")
        defaults = cut_out.PoseAugmentation()
        # The largest crop, turned so that its corners reach farthest: the default angles go beyond that.
        self.assertGreater(2 * defaults.rotation, 45)
        farthest = [torch.tensor([9.0, angle / defaults.rotation]) for angle in (-45, 45)]
        torch.manual_seed(7)
        not_larger = 0
        for path in sorted((self.folder / "out").glob("*-of-*.h5")):
            with h5py.File(path) as shard:
                self.assertTrue(shard["valid"][:].all())
                tiles = dict(zip(shard["pairs/sample_id"].asstr()[:], shard["events/tiles"][:].astype(bool)))
            samples = cut_out.Shards(path)
            both_wrists = [name for name in samples.default_joints() if "wrist" in name]
            for joints, augmentation in ((None, None), (None, defaults), (both_wrists, defaults)):
                persons = cut_out.PoseDataset(samples, joints=joints, augmentation=augmentation)
                for number in range(len(persons)):
                    crops = [persons[number][3] for _ in range(4)]
                    for drawn in farthest:
                        with mock.patch.object(torch, "randn",
                                               return_value=drawn), mock.patch.object(torch, "rand", torch.zeros):
                            crops.append(persons[number][3])
                    name, wanted = crops[0]["image"], tiles[crops[0]["image"]]
                    with self.subTest(name, joints=joints, augmentation=augmentation):
                        seen = np.any([tiles_of(crop["to_volume"], 256, wanted.shape) for crop in crops], 0)
                        self.assertEqual((seen & ~wanted).sum(), 0)
                        # MPII's crop is no larger than that: what is sampled ends half an input pixel before its last
                        # edges.
                        if name.startswith("annotated") and joints is None and augmentation:
                            rows, columns = (np.flatnonzero(seen.any(axis)) for axis in (1, 0))
                            reached = np.zeros_like(wanted)
                            reached[rows[0]:rows[-1] + 2, columns[0]:columns[-1] + 2] = True
                            self.assertEqual((wanted & ~reached).sum(), 0)
                            not_larger += not wanted.all()
        self.assertGreater(not_larger, 2)

    def is_offered(self, path):
        """Whether this program on this processor takes a manifest's engine and precision."""
        code = subprocess.run([program.PROGRAM, "plan", path], capture_output=True).returncode
        self.assertIn(code, (0, 64))
        return code == 0

    def needs_onednn(self):
        if not self.is_offered(self.manifest("offered.json", engine="onednn")):
            self.skipTest("the program was built without oneDNN")

    def assert_near(self, volumes, reference):
        self.assertGreater(reference.max(), 0)
        self.assertLessEqual(np.abs(volumes - reference).max(), TOLERANCE * reference.max())

    def test_both_engines_make_the_same_volumes_and_say_their_name(self):
        self.needs_onednn()
        torch, err = self.convert("torch", engine="torch")
        self.assertRegex(err, r"(?m)^generator: torch float32 on \S+, trained on gaps 1-6$")
        onednn, err = self.convert("onednn", engine="onednn", precision="float32")
        self.assertRegex(err, r"(?m)^generator: onednn float32 on \S+, trained on gaps 1-6$")
        self.assert_near(onednn, torch)
        fastest, err = self.convert("auto", engine="auto")
        self.assertRegex(err, r"(?m)^generator: onednn float32 on \S+, trained on gaps 1-6$")
        np.testing.assert_array_equal(fastest, onednn)
        engines = {name: json.loads((self.job / name / "plan.json").read_text())["fingerprint"]["engine"]
                   for name in ("torch", "onednn", "auto")}
        self.assertTrue(engines["torch"].startswith("torch float32"), engines)
        self.assertTrue(engines["onednn"].startswith("onednn float32"), engines)
        self.assertEqual(engines["auto"], engines["onednn"])

    def test_threads_change_no_byte_of_any_engine(self):
        run("calibrate", self.manifest(), "--pairs", "4", "--out", self.job / "calibrated.safetensors", "--progress",
            "none")
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

    def test_convert_says_it_and_no_other_command(self):
        path = self.manifest("out.json", engine="torch")
        self.assertEqual(run("plan", path, "--progress", "none")[1], "")
        with broken_cars(self.job, [1]):
            _, err = run("convert", path, "--progress", "json")
        notes = [json.loads(text) for text in err.splitlines()]
        line = r"generator: torch float32 on .+, trained on gaps 1-6"
        self.assertTrue(any(note["event"] == "note" and re.fullmatch(line, note["text"]) for note in notes), err)
        self.assertEqual(run("retry", self.job / "out", "--progress", "none")[1], "")

    def test_the_weights_warning_is_one_short_line_of_convert(self):
        for weights, warning in [("shipped", r"shipped:\d+ are stand-in weights; .*"),
                                 ("untrained:2", r".* UNTRAINED \(untrained:2\).*")]:
            path = self.manifest("warned.json", weights=weights)
            self.assertEqual(run("plan", path, "--progress", "none")[1], "")
            _, err = run("convert", path, "--overwrite", "--progress", "none")
            warnings = [text for text in err.splitlines() if text.startswith("warning: ")]
            self.assertEqual(len(warnings), 1, err)
            self.assertRegex(warnings[0], f"^warning: {warning}$")
            self.assertTrue(all(len(text) <= 80 for text in err.splitlines()), err)

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
        self.assertRegex(err, r"(?m)^generator: torch float32 on cuda: .+, trained on gaps 1-6$")
        self.assert_near(volumes, self.convert("torch", engine="torch")[0])
        shards = []
        for threads in (1, 3):
            run("convert", path, "--progress", "none", "--overwrite", "--threads", threads)
            shards.append(program.shard_bytes(self.job / "cuda"))
        self.assertEqual(*shards)

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
        self.assertRegex(err, r"(?m)^generator: onednn int8 on \S+, ")
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
        self.assertIn("expected readable pairs to calibrate on, got none", err)
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

    def test_what_init_chooses_is_no_bad_bargain(self):
        """A precision without instructions is chosen only where it is the faster one, and init says so."""
        self.needs_onednn()
        for limit in ["AVX2", "AVX512_CORE", "ALL"]:
            with self.subTest(limit):
                environment = {"ONEDNN_MAX_CPU_ISA": limit}
                path = self.folder / f"{limit}.json"
                told, _ = run("init", self.job / "cars", "--out", path, environment=environment)
                if limit == "AVX2":
                    self.assertIn("this processor (avx2) has no instructions for int8", told)
                _, err = run("convert", path, "--output", self.folder / limit, "--limit", 2, "--progress", "none",
                             environment=environment)
                self.assertNotIn("warning: precision", err)

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
                volumes, err = self.convert("half", {"ONEDNN_MAX_CPU_ISA": "AVX512_CORE"}, engine=engine,
                                            precision="bfloat16")
                self.assertIn("warning: precision bfloat16: this processor (avx512_core) has no instructions for it; "
                              "float32 is both faster and exact here", err)
                self.assertLess(relative_distance(volumes, reference), 0.05)


if __name__ == "__main__":
    program.main()

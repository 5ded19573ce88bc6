"""The benchmarks' drivers at their smallest: every part runs and fills its tables. Nothing is timed here."""

import importlib.util
import os
import pathlib
import re
import subprocess
import sys
import unittest

import program
from program import SHARED, SOURCE

BENCHMARKS = SOURCE / "tests" / "benchmarks"
NEEDED = ["matplotlib", "torch"]
SPECTRAL_EPSILON = 1e-12
ENGINES_OF_EVERY_BUILD = ["eager PyTorch float32", "torch float32"]
V2E = SOURCE.parent / "shared" / "peers" / "v2e"
DATASET_FREE = {**os.environ, "EVENTGAN_TEST_DATA": "/nowhere"}


def sections_of(page):
    """Title → rows of its tables, each a list of cells."""
    found = {}
    for title, body in re.findall(r"(?ms)^## (.+?)\n(.*?)(?=^## |\Z)", page):
        rows = [line.strip("| ").split(" | ") for line in body.splitlines() if line.startswith("|")
                and not line.startswith("| ---")]
        found[title] = rows
    return found


class Benchmarks(program.InFolder):
    def run_all(self, *arguments, environment=None):
        build = pathlib.Path(program.PROGRAM).parent
        done = subprocess.run([sys.executable, BENCHMARKS / "run.py", "--trial", "--build", build, "--out", self.folder,
                               *arguments],
                              capture_output=True, text=True, env=environment)
        self.assertEqual(done.returncode, 0, done.stderr)
        return (self.folder / "benchmarks.md").read_text()

    def test_every_part_fills_its_tables(self):
        page = self.run_all(environment=DATASET_FREE)
        sections = sections_of(page)
        self.assertEqual(list(sections), ["Engines", "Generators against threads within one", "Layers",
                                          "Numbers at the extremes", "Stages",
                                          "The whole conversion", "Against the image's size",
                                          "Against the number of pairs", "Against threads", "Storage", "Reading",
                                          "On the fly", "The call in Python", "Slow disk", "Scope", "Beside v2e"])
        self.assertEqual(sections.pop("Beside v2e"), [])
        if "python3-fusepy and /dev/fuse" in page:
            self.assertEqual(sections.pop("Slow disk"), [])
        self.assertIn("Skipped: no --v2e", page)
        for title, rows in sections.items():
            with self.subTest(title):
                self.assertGreater(len(rows), 1)
                for row in rows:
                    self.assertTrue(row[0])
                    self.assertNotIn("nan", row)
        engines = "\n".join(row[0] for row in sections["Engines"])
        for engine in ENGINES_OF_EVERY_BUILD:
            self.assertIn(engine, engines)
        self.assertEqual({row[-1] for row in sections["Against threads"][1:]}, {"equal"})
        self.assertIn("processor: ", page)
        self.assertIn("made-up frames", page)
        self.assertTrue((self.folder / "benchmarks.png").read_bytes().startswith(b"\x89PNG"))

    def test_one_part_by_itself(self):
        sections = sections_of(self.run_all("--parts", "storage"))
        self.assertEqual(list(sections), ["Storage"])
        self.assertFalse((self.folder / "benchmarks.png").exists())

    @unittest.skipUnless(SHARED.is_dir() and V2E.is_dir(), "no ../shared/data or no ../shared/peers/v2e")
    def test_v2e_takes_turns_with_the_project_and_its_scores_agree_with_realism(self):
        rows = sections_of(self.run_all("--parts", "v2e", "--v2e", V2E))["Beside v2e"]
        headings = [row for row in rows if row[0] == "made by"]
        self.assertEqual([len(heading) for heading in headings], [5, 5, 11])  # times twice, scores
        if (pathlib.Path(program.PROGRAM).parent / "python" / "eventgan").is_dir():
            times = {row[0]: row for row in rows if len(row) == 5}
            for kind in ("difference", "esim"):
                stage, call = (times[f"{kind}, threshold 0.2{how}"][3] for how in ("", ", by eventgan.Generator"))
                self.assertEqual(call, stage)  # events
            self.assertIn("shipped:8 float32, by eventgan.Generator", times)
        scores = {row[0]: dict(zip(headings[-1], row)) for row in rows[rows.index(headings[-1]) + 1:]}
        self.assertEqual(scores["real"]["F1 over time"], "1")
        # one pair
        self.assertEqual(scores["v2e, pair by pair"], scores["v2e, as one video"] | {"made by": "v2e, pair by pair"})
        for contender in ("v2e, pair by pair", "difference", "shipped:8 float32"):
            # esim, of another motion, has 0.3
            self.assertTrue(0.5 < float(scores[contender]["F1 over time"]) < 0.7, scores[contender])

    @unittest.skipUnless(SHARED.is_dir(), "no ../shared/data")
    def test_the_baseline_is_the_published_network(self):
        import h5py
        import torch
        sys.path.insert(0, str(BENCHMARKS))
        import eager_baseline
        with h5py.File(SHARED / "golden" / "golden.h5") as golden, torch.no_grad():
            group = golden["generator"]
            network = eager_baseline.Generator(int(group.attrs["base_channels"])).eval()
            network.load_state_dict(
                folded({name: torch.from_numpy(data[...]) for name, data in group["state"].items()}))
            for case in (name for name in group if name != "state"):
                volume = network(torch.from_numpy(group[case]["input"][:])[None])[0]
                expected = torch.from_numpy(group[case]["volume"][:])
                self.assertLess((volume - expected).abs().max() / expected.max(), 1e-5, case)


def folded(state):
    """The state with each spectral norm's weight divided by sigma, as its first forward pass does."""
    def unit(vector):
        return vector / (vector.norm() + SPECTRAL_EPSILON)

    plain = {}
    for name, tensor in state.items():
        layer, _, rest = name.partition(".module.")
        if rest == "weight_bar":
            matrix = tensor.flatten(1)
            v = unit(matrix.T @ state[f"{layer}.module.weight_u"])
            u = unit(matrix @ v)
            plain[f"{layer}.weight"] = tensor / (u @ (matrix @ v))
        elif not rest:
            plain[name] = tensor
    return plain


if __name__ == "__main__":
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        print(f"skipped: no {', '.join(missing)} (docker/bootstrap.sh packages benchmark)")
        raise SystemExit(program.SKIPPED)
    program.main()

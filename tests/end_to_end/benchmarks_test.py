"""The benchmarks' drivers at their smallest: every part runs and fills its tables. Nothing is timed here."""

import csv
import importlib.util
import os
import pathlib
import subprocess
import sys
import unittest

import program
from program import SHARED, SOURCE

BENCHMARKS = SOURCE / "tests" / "benchmarks"
NEEDED = ["torch"]
SPECTRAL_EPSILON = 1e-12
ENGINES_OF_EVERY_BUILD = ["eager PyTorch float32", "torch float32"]
V2E = SOURCE.parent / "shared" / "peers" / "v2e"
DATASET_FREE = {**os.environ, "EVENTGAN_TEST_DATA": "/nowhere"}


class Benchmarks(program.InFolder):
    def run_all(self, *arguments, environment=None):
        """Rows of each table, by heading; what was said to stderr."""
        build = pathlib.Path(program.PROGRAM).parent
        done = subprocess.run([sys.executable, BENCHMARKS / "run.py", "--trial", "--build", build, "--out", self.folder,
                               *arguments],
                              capture_output=True, text=True, env=environment)
        self.assertEqual(done.returncode, 0, done.stderr)
        return {path.stem: list(csv.DictReader(path.read_text().splitlines())) for path in self.folder.glob("*.csv")}, \
            done.stderr

    def test_every_part_fills_its_tables(self):
        tables, said = self.run_all(environment=DATASET_FREE)
        self.assertIn("not measured: v2e (", said)
        expected = {"engines", "engine_errors", "intra_op", "layers", "stability", "saturation", "subnormals", "stages",
                    "whole_conversion", "image_sizes", "pair_counts", "threads", "storage", "reading", "on_the_fly",
                    "python_call", "python_start", "python_workers", "slow_disk", "scopes", "photographs"}
        for name in ("slow_disk", "on_the_fly", "saturation"):  # without /dev/fuse, PyTorch or VNNI
            if name not in tables:
                self.assertIn("not measured: ", said)
                expected.remove(name)
        machine = {row["table"]: row for row in tables.pop("machine")}
        self.assertEqual(set(tables), expected)
        self.assertEqual(set(machine), expected)
        for name, rows in tables.items():
            with self.subTest(name):
                for row in rows:
                    self.assertTrue(next(iter(row.values())))
                    self.assertNotIn("nan", row.values())
                self.assertTrue(machine[name]["processor"])
                self.assertIn("made-up frames", machine[name]["frames"])
        self.assertLessEqual(set(ENGINES_OF_EVERY_BUILD), {row["engine"].removesuffix(" (not native here)")
                                                           for row in tables["engines"]})
        self.assertEqual({row["bytes"] for row in tables["threads"]}, {"equal"})
        self.assertIn("finish ms q3", tables["storage"][0])
        self.a_part_by_itself_leaves_the_other_tables(tables)

    def a_part_by_itself_leaves_the_other_tables(self, tables):
        (self.folder / "storage.csv").unlink()
        again, _ = self.run_all("--parts", "storage", environment=DATASET_FREE)
        machine = {row["table"]: row["command"] for row in again.pop("machine")}
        self.assertEqual((set(again), set(machine)), (set(tables), set(tables)))
        self.assertEqual({name for name in machine if "--parts storage" in machine[name]}, {"storage"})
        self.assertEqual({name for name in tables if again[name] != tables[name]} - {"storage"}, set())

    @unittest.skipUnless(SHARED.is_dir() and V2E.is_dir(), "no ../shared/data or no ../shared/peers/v2e")
    def test_v2e_takes_turns_with_the_project_and_its_scores_agree_with_realism(self):
        tables, _ = self.run_all("--parts", "v2e", "--v2e", V2E)
        if (pathlib.Path(program.PROGRAM).parent / "python" / "eventgan").is_dir():
            events = {(row["frames"], row["made by"]): row["events a pair"] for row in tables["v2e_times"]}
            self.assertEqual(len({frames for frames, _ in events}), 2)
            for frames, name in events:
                if name.endswith(", by eventgan.Generator"):
                    self.assertEqual(events[frames, name], events[frames, name.removesuffix(", by eventgan.Generator")])
            self.assertIn(("slider_depth", "shipped:8 float32, by eventgan.Generator"), events)
        scores = {row["made by"]: row for row in tables["v2e_scores"] if row["recording"] == "slider_depth"}
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
    if "EVENTGAN_NIGHTLY" not in os.environ:
        print("skipped: of .ci/run nightly (EVENTGAN_NIGHTLY)")
        raise SystemExit(program.SKIPPED)
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        print(f"skipped: no {', '.join(missing)} (docker/bootstrap.sh packages benchmark)")
        raise SystemExit(program.SKIPPED)
    program.main()

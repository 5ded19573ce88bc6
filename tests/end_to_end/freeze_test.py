"""`plan --freeze`: the plan before the first worker, for a cluster that wants the number of shards first."""

import json

import program
from folders import records
from program import run
from small_job import small_job


class Freeze(program.InFolder):
    def setUp(self):
        super().setUp()
        self.manifest = small_job(self.folder / "job")
        self.out = self.folder / "out"

    def freeze(self, *arguments, expect=0):
        return run("plan", self.manifest, "--freeze", "--output", self.out, *arguments, expect=expect)

    def test_it_is_the_plan_that_convert_takes(self):
        frozen = json.loads(self.freeze("--json")[0])
        self.assertEqual(sorted(path.name for path in self.out.iterdir()), ["plan.json", "run.json"])
        self.assertEqual(frozen["folder"], str(self.out))
        files = {path: path.read_bytes() for path in self.out.iterdir()}
        run("convert", self.manifest, "--output", self.out, "--threads", 1)
        self.assertEqual({path: path.read_bytes() for path in files}, files)
        self.assertEqual(frozen["shards"], 5)
        self.assertEqual(len(list(self.out.glob("*-of-*.h5"))), 5)
        committed = records(self.out).values()
        self.assertEqual({record["plan_hash"] for record in committed}, {frozen["plan_hash"]})
        self.assertEqual(sum(record["samples"] for record in committed), frozen["samples"])

    def test_again_it_is_taken_as_it_is(self):
        first = self.freeze("--json")
        inode = (self.out / "plan.json").stat().st_ino
        self.assertEqual(self.freeze("--json"), first)
        self.assertEqual((self.out / "plan.json").stat().st_ino, inode)
        self.assertIn("9 samples in 5 shards", self.freeze()[0])

    def test_another_fingerprint_is_refused_field_by_field(self):
        self.freeze()
        before = (self.out / "plan.json").read_bytes()
        job = json.loads(self.manifest.read_text())
        job["seed"] += 1
        self.manifest.write_text(json.dumps(job))
        _, err = self.freeze(expect=64)
        self.assertIn("manifest $.seed: expected", err)
        self.assertEqual((self.out / "plan.json").read_bytes(), before)

    def test_without_output_it_goes_where_the_manifest_says(self):
        run("plan", self.manifest, "--freeze")
        self.assertTrue((self.manifest.parent / "out" / "plan.json").exists())

    def test_a_trial_is_the_one_that_convert_takes(self):
        frozen = json.loads(run("plan", self.manifest, "--freeze", "--limit", 3, "--json")[0])
        trial = self.manifest.parent / "out-trial-3"
        self.assertEqual((frozen["folder"], frozen["samples"]), (str(trial), 3))
        run("convert", self.manifest, "--limit", 3)
        self.assertEqual({record["plan_hash"] for record in records(trial).values()}, {frozen["plan_hash"]})

    def test_wrong_usage(self):
        run("plan", self.manifest, "--output", self.out, expect=64)  # an output, but nothing to write
        run("plan", self.manifest, "--freeze", "--output", "", expect=64)
        self.assertFalse(self.out.exists())


if __name__ == "__main__":
    program.main()

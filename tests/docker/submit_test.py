"""What submit.sh sends to Slurm, by stand-ins for sbatch and scontrol: it needs no Slurm."""

import json
import os
import pathlib
import shlex
import subprocess
import sys

sys.path.append(str(pathlib.Path(__file__).parents[1] / "end_to_end"))
import program
import small_job

SUBMIT = program.SOURCE / "docker" / "slurm" / "submit.sh"
# Writes its arguments to calls, and runs what is to be waited for.
SBATCH = """#!/usr/bin/env python3
import json, pathlib, subprocess, sys
with (pathlib.Path(__file__).parent / "calls").open("a") as calls:
    calls.write(json.dumps(sys.argv[1:]) + "\\n")
script = next(i for i, word in enumerate(sys.argv) if word.endswith(".sbatch"))
options = {word.partition("=")[0]: word.partition("=")[2] for word in sys.argv[:script]}
print(7)
if "--wait" in options:
    with open(options["--output"], "w") as out, open(options["--error"], "w") as log:
        sys.exit(subprocess.run(sys.argv[script:], stdout=out, stderr=log).returncode)
"""


class Submit(program.InFolder):
    def setUp(self):
        super().setUp()
        self.bin = self.folder / "bin"
        self.bin.mkdir()
        for name, text in {"sbatch": SBATCH, "scontrol": "#!/bin/sh\necho MaxArraySize = 1000\n"}.items():
            (self.bin / name).write_text(text)
            (self.bin / name).chmod(0o755)
        self.manifest = small_job.small_job(self.folder / "job")

    def submit(self, *arguments, expect=0):
        done = subprocess.run([SUBMIT, *map(str, arguments)], capture_output=True, text=True,
                              env={**os.environ, "EVENTGAN": program.PROGRAM,
                                   "PATH": f"{self.bin}:{os.environ['PATH']}"})
        self.assertEqual(done.returncode, expect, done.stdout + done.stderr)
        return done

    def calls(self):
        path = self.bin / "calls"
        return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []

    def test_the_plan_takes_what_changes_it_and_the_tasks_take_all(self):
        self.submit(self.manifest, "--partition=cpu", "--", "--limit", 3, "--grace=5", "--progress", "none")
        plan, convert, finalize = self.calls()
        out = self.folder / "job" / "out-trial-3"
        self.assertNotIn("--grace=5", plan)
        self.assertEqual(finalize[-1], str(out))
        task = convert[next(i for i, word in enumerate(convert) if word.endswith("convert.sbatch")) + 1:]
        self.assertEqual(task, [str(self.manifest), "--output", str(out), "--limit", "3", "--grace=5", "--progress",
                                "none"])
        program.run("convert", *task)  # the plan is this one
        status = json.loads(program.run("status", out, "--json")[0])
        self.assertTrue(status["complete"])
        self.assertIn(f"--array=0-{len(list(out.glob('*-of-*.h5'))) - 1}", convert)

    def test_other_options_are_refused_before_anything_is_submitted(self):
        for options, message in {("--overwrite",): "got --overwrite", ("--output", "x"): "got --output",
                                 ("--shards=0/2",): "got --shards=0/2", ("--limit",): "--limit: expected a value",
                                 ("3",): "got 3"}.items():
            with self.subTest(options):
                self.assertIn(message, self.submit(self.manifest, "--", *options, expect=64).stderr)
        self.assertEqual(self.calls(), [])

    def test_help(self):
        for arguments in [("--help",), ("-h",), (self.manifest, "--help")]:
            self.assertIn("submit.sh MANIFEST", self.submit(*arguments).stdout)
        for arguments in [(), ("--partition=cpu",)]:
            self.assertIn("submit.sh MANIFEST", self.submit(*arguments, expect=64).stderr)
        self.assertEqual(self.calls(), [])

    def test_a_dry_run_prints_the_calls_and_leaves_nothing(self):
        before = sorted(self.folder.rglob("*"))
        arguments = self.manifest, self.folder / "a folder", "--workers=2", "--time=5"
        convert_options = "--", "--limit=3", "--grace", 5
        lines = self.submit(*arguments, "--dry-run", *convert_options).stdout.splitlines()
        self.assertEqual((self.calls(), sorted(self.folder.rglob("*"))), ([], before))
        self.submit(*arguments, *convert_options)
        for line, call in zip(lines, self.calls(), strict=True):
            words = shlex.split(line)
            self.assertEqual(words[:3], [f"EVENTGAN={program.PROGRAM}", "SHARD_COUNT=2", "sbatch"])
            same = [(said, done) for said, done in zip(words[3:], call, strict=True)
                    if not done.startswith(("--output=", "--error=", "--dependency="))]
            self.assertEqual(*map(list, zip(*same)))
        self.assertIn("--array=0-LAST", self.submit(self.manifest, "--dry-run").stdout)


if __name__ == "__main__":
    program.main()

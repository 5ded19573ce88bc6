"""The pages against the program: commands, options, exit codes, links, Python, and the tests that the pages of guarantees and of numbers name."""

import functools
import os
import re
import subprocess
import sys
import tempfile
import unittest

import program
from program import SOURCE, run

PAGES = [SOURCE / "README.md", SOURCE / "CONTRIBUTING.md", SOURCE / "docker" / "running.md", SOURCE / "manifests" / "weights" / "README.md",
         *sorted((SOURCE / "manifests" / "guides").glob("*.md"))]
GUARANTEES = SOURCE / "manifests" / "guides" / "guarantees.md"
NUMERICS = SOURCE / "manifests" / "guides" / "numerics.md"
COMMAND = re.compile(r"\beventgan ([a-z][a-z-]*)([^#|;&]*)")


def exit_codes():
    """Those of pipeline/runtime/errors.h."""
    return set(re.findall(r"= (\d+)", (SOURCE / "pipeline" / "runtime" / "errors.h").read_text()))


@functools.cache
def options_of(command):
    return set(re.findall(r"--[a-z][a-z-]*", run(command, "--help")[0]))


def code_of(page):
    """Code blocks and code in lines of text, a piece each."""
    text = page.read_text(encoding="utf-8")
    return re.findall(r"(?m)^    (.+)$", text) + re.findall(r"`([^`\n]+)`", text)


class Documentation(unittest.TestCase):
    def test_commands_and_options_are_the_programs(self):
        commands = set(re.findall(r"(?m)^  ([a-z-]+) {2,}", run("--help")[0].split("Subcommands:")[1]))
        self.assertIn("make-demo", commands)
        seen = set()
        for page in PAGES:
            for code in code_of(page):
                for command, arguments in COMMAND.findall(code):
                    with self.subTest(page=page.name, code=code):
                        self.assertIn(command, commands)
                        self.assertLessEqual(set(re.findall(r"--[a-z][a-z-]*", arguments)), options_of(command))
                        seen.add(command)
        self.assertLessEqual({"plan", "convert", "status", "retry", "finalize", "verify"}, seen)

    def test_exit_codes(self):
        codes = exit_codes()
        self.assertEqual(len(codes), 6)
        for command in ["convert", "status", "retry", "finalize", "verify"]:
            self.assertEqual(set(re.findall(r"\b(\d+) [a-z]", run(command, "--help")[0].split("Exit codes:")[1])), codes)
        for page in (GUARANTEES, SOURCE / "docker" / "running.md"):
            rows = set(re.findall(r"(?m)^\| (\d+) \|", page.read_text(encoding="utf-8")))
            self.assertEqual(rows - {"137"}, codes, page)  # 128 + SIGKILL, the shell's own

    def test_lines_are_short(self):
        for page in PAGES:
            is_fenced = False
            for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
                is_fenced ^= line.startswith("```")
                if not is_fenced and not line.startswith(("|", "    ")):
                    self.assertLessEqual(len(line), 120, f"{page}:{number}")

    def test_the_python_page_runs(self):
        """Its blocks one after the other in one process, as somebody who pastes them, on a small demo dataset."""
        page = (SOURCE / "manifests" / "guides" / "python.md").read_text(encoding="utf-8")
        blocks = re.findall(r"(?:^    .*\n|^\n(?=    ))+", page, re.M)
        code = "\n".join(re.sub(r"(?m)^    ", "", block) for block in blocks if re.search(r"\b(import|Shards\()", block))
        self.assertGreater(code.count("import"), 4)
        try:
            import matplotlib
            import torch
        except ImportError as missing:
            self.skipTest(str(missing))
        with tempfile.TemporaryDirectory(prefix="eventgan-") as folder:
            for command in (["make-demo", "demo", "--scenes", "10"], ["convert", "demo/manifest.json", "--output", "out", "--progress", "none"], ["finalize", "out"]):
                subprocess.run([program.PROGRAM, *command], cwd=folder, check=True, capture_output=True)
            ids = subprocess.run([sys.executable, "-c", "from eventgan_shards import Shards; print(Shards('out').column('sample_id')[0])"],
                                 cwd=folder, env={**os.environ, "PYTHONPATH": str(SOURCE / "manifests" / "python")}, check=True, capture_output=True)
            with open(os.path.join(folder, "wanted.txt"), "wb") as file:
                file.write(ids.stdout)
            shard = next(name for name in sorted(os.listdir(os.path.join(folder, "out"))) if name.endswith(".h5") and "-train-" in name)
            code = code.replace("kitti-events-train-00000-of-00117.h5", shard)
            run = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True,
                                 env={**os.environ, "PYTHONPATH": str(SOURCE / "manifests" / "python"), "MPLBACKEND": "agg", "OMP_NUM_THREADS": "1"})
            self.assertEqual(run.returncode, 0, run.stderr)
            self.assertTrue(os.path.exists(os.path.join(folder, "volume.png")))

    def test_links_lead_somewhere(self):
        for page in PAGES:
            for link in re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
                self.assertTrue((page.parent / link).exists(), f"{page}: {link}")

    def test_the_tests_that_hold_the_guarantees_are_there(self):
        text = GUARANTEES.read_text(encoding="utf-8") + NUMERICS.read_text(encoding="utf-8")
        tests = SOURCE / "tests"
        sources = "\n".join(path.read_text(encoding="utf-8") for path in tests.rglob("*_test.cc"))
        in_cc = {f"{suite}.{name}" for suite, name in re.findall(r"\bTEST(?:_F|_P)?\((\w+),\s*(\w+)\)", sources)}
        in_python = {f"{path.stem.removesuffix('_test')}.{name}" for path in (tests / "end_to_end").glob("*_test.py")
                     for name in re.findall(r"(?m)^    def test_(\w+)\(", path.read_text(encoding="utf-8"))}
        named = set(re.findall(r"`(\w+\.\w+)`", text)) - {"plan.json", "run.json", "amendments.json", "dataset.json", "dataset.h5"}
        self.assertGreater(len(named), 40)
        self.assertEqual(named - in_cc - in_python, set())

    def test_every_row_of_the_guarantees_names_its_test(self):
        heading = None
        for line in GUARANTEES.read_text(encoding="utf-8").splitlines():
            if not line.startswith("|"):
                heading = None
            elif heading is None:
                heading = line
                self.assertTrue(line.endswith("| held by |"), line)
            elif not line.startswith("|---"):
                self.assertRegex(line, r"\| (`\w+\.\w+`(, )?)+ \|$")


if __name__ == "__main__":
    program.main()

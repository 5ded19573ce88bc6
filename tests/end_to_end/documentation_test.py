"""The pages against the program: commands, options, paths, exit codes, links, Python; and how long the pages are."""

import functools
import itertools
import json
import os
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile
import unittest

import program
from program import PACKAGE, SOURCE, run

MOST_WORDS = {
    "README.md": 1300,
    "CONTRIBUTING.md": 1300,
    "CHANGELOG.md": 2450,
    "docker/running.md": 1150,
    "manifests/weights/README.md": 1150,
    "manifests/guides/choose.md": 900,
    "manifests/guides/datasets.md": 2300,
    "manifests/guides/exports.md": 2250,
    "manifests/guides/glossary.md": 700,
    "manifests/guides/guarantees.md": 1400,
    "manifests/guides/numerics.md": 1050,
    "manifests/guides/own_data.md": 1950,
    "manifests/guides/python.md": 1300,
    "manifests/guides/real_cameras.md": 1200,
    "manifests/guides/real_events.md": 1700,
    "manifests/guides/realism.md": 750,
    "manifests/guides/scores.md": 800,
    "manifests/guides/sensor.md": 700,
    "manifests/guides/shard_format.md": 2500,
    "manifests/guides/simulation.md": 1050,
    "manifests/guides/speed.md": 1150,
    "manifests/guides/tradeoff.md": 800,
    "manifests/guides/training.md": 1300,
    "manifests/guides/training_downstream.md": 1100,
    "manifests/guides/troubleshooting.md": 650,
    "manifests/guides/versions.md": 350,
    "tests/benchmarks/README.md": 800,
    "tests/experiments/README.md": 700,
}
MOST_WORDS_OF_ALL = 40_000
FOLDERS = ("docker", "manifests", "pipeline", "stages", "tests")
PAGES = sorted(page for page in (*SOURCE.glob("*.md"), *(page for folder in FOLDERS
                                                         for page in (SOURCE / folder).rglob("*.md")))
               if not any(part.startswith(".") for part in page.relative_to(SOURCE).parts))  # .pytest_cache has one
OPTION = r"--[a-z][a-z0-9-]*"
OWN_PATH = re.compile(r"(\.ci|docker|manifests|pipeline|stages|tests)/[\w./*-]*")
BLOCK = re.compile(r"(?:^    .*\n|^\n(?=    ))+", re.M)
PYTHON_PATH = {**os.environ, "PYTHONPATH": str(PACKAGE)}


def exit_codes():
    """Those of pipeline/runtime/errors.h."""
    return set(re.findall(r"= (\d+)", (SOURCE / "pipeline" / "runtime" / "errors.h").read_text()))


def blocks_of(page):
    return [re.sub("(?m)^    ", "", block) for block in BLOCK.findall(page.read_text(encoding="utf-8"))]


def commands_of(code):
    """The words of each command of shell code."""
    for line in code.replace("\\\n", " ").splitlines():
        lexer = shlex.shlex(line, posix=True, punctuation_chars=";&|<>()")
        lexer.whitespace_split = True
        try:
            words = list(lexer)
        except ValueError:  # a text of several lines begins or ends
            words = line.split()
        yield from (list(group) for divides, group in itertools.groupby(words, lambda word: set(word) <= set(";&|<>()"))
                    if not divides)


@functools.cache
def commands():
    return set(re.findall(r"(?m)^  ([a-z-]+) {2,}", run("--help")[0].split("Subcommands:")[1]))


@functools.cache
def options_of(*command):
    """Those that the help of a command of `eventgan`, or of a Python script, names."""
    if command[0] in commands():
        text = run(command[0], "--help")[0]
    else:
        done = subprocess.run([sys.executable, *command, "--help"], cwd=SOURCE, env=PYTHON_PATH, capture_output=True,
                              text=True)
        if "ModuleNotFoundError" in done.stderr:
            raise unittest.SkipTest(done.stderr.splitlines()[-1])
        text = done.stdout
    return set(re.findall(OPTION, text))


def unknown_options(words, *command):
    given = {re.match(OPTION, word)[0] for word in words if re.match(OPTION, word)}
    return given - options_of(*command) if given else set()


def unknown_words(words):
    """Those that the program which is called does not know; None if it is none of this repository, nor CMake."""
    if words[0] in ("from", "import"):  # Python
        return None
    # in a line of text, without the program's name
    if len(words) > 1 and words[0] in commands() and words[1].startswith("--"):
        words = ["eventgan", *words]
    for i, word in enumerate(words):
        name, rest = pathlib.PurePath(word).name, words[i + 1:]
        if name == "eventgan" and rest and re.fullmatch("[a-z-]+", rest[0]):
            return unknown_options(rest, rest[0]) if rest[0] in commands() else {rest[0]} - {"--version"}
        if name == "submit.sh" and "--" in rest:
            return unknown_options(rest[rest.index("--"):], "convert")
        if name == "bootstrap.sh" and rest:
            lists = {path.stem for path in (SOURCE / "docker" / "packages").glob("*.txt")}
            known = re.findall(r"(?m)^  (\w+)\) ", (SOURCE / "docker" / "bootstrap.sh").read_text())
            return {rest[0]}.difference(known) | (set(rest[1:]) - lists if rest[0] == "packages" else set())
        if name in ("cmake", "ctest") and "--preset" in rest:
            kind = "testPresets" if name == "ctest" else "buildPresets" if "--build" in rest else "configurePresets"
            presets = json.loads((SOURCE / "CMakePresets.json").read_text())[kind]
            return {rest[rest.index("--preset") + 1]} - {preset["name"] for preset in presets
                                                         if not preset.get("hidden")}
        if word == "-m" and rest and rest[0].startswith("eventgan."):
            return unknown_options(rest, "-m", *rest[:2])
        for script in (word, f"manifests/python/examples/{word}", f"tests/experiments/{word}"):
            if name.endswith(".py") and (SOURCE / script).is_file():
                return unknown_options(rest, script, *(word for word in rest[:1] if re.fullmatch("[a-z]+", word)))
    return None


class Documentation(unittest.TestCase):
    def test_commands_options_and_paths_are_there(self):
        seen = set()
        for page in PAGES:
            code = [*blocks_of(page), *re.findall(r"`([^`]+)`", page.read_text(encoding="utf-8"))]
            for words in (words for piece in code for words in commands_of(piece)):
                with self.subTest(page=page.name, command=" ".join(words)):
                    unknown = unknown_words(words)
                    self.assertFalse(unknown)
                    self.assertEqual([word for word in words if OWN_PATH.fullmatch(word)
                                      and not any(SOURCE.glob(word))], [])
                    seen.update(() if unknown is None else words)
        self.assertLessEqual({"plan", "convert", "status", "retry", "finalize", "verify", "docker/bootstrap.sh",
                              "ctest", "submit.sh", "eventgan.evaluate", "train_pose.py"},
                             {pathlib.PurePath(word).name for word in seen} | seen)

    def test_shell_blocks_parse(self):
        shell = [(page, block) for page in PAGES for block in blocks_of(page)
                 if any(unknown_words(words) is not None for words in commands_of(block))]
        self.assertGreater(len(shell), 30)
        for page, block in shell:
            done = subprocess.run(["bash", "-n"], input=block, capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, f"{page}:\n{block}{done.stderr}")

    def test_exit_codes(self):
        codes = exit_codes()
        self.assertEqual(len(codes), 6)
        for command in ["convert", "status", "retry", "finalize", "verify"]:
            self.assertEqual(set(re.findall(r"\b(\d+) [a-z]", run(command, "--help")[0].split("Exit codes:")[1])),
                             codes)
        for page in ("manifests/guides/guarantees.md", "docker/running.md"):
            rows = set(re.findall(r"(?m)^\| (\d+) \|", (SOURCE / page).read_text(encoding="utf-8")))
            self.assertEqual(rows - {"137"}, codes, page)  # 128 + SIGKILL, the shell's own

    def test_lines_are_short(self):
        for page in PAGES:
            is_fenced = False
            for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
                is_fenced ^= line.startswith("```")
                if not is_fenced and not line.startswith(("|", "    ")):
                    self.assertLessEqual(len(line), 120, f"{page}:{number}")

    def test_the_python_page_runs(self):
        """All its Python blocks one after the other in one process, as somebody who pastes them, where its `eventgan
        make-demo` was run; what a line prints is the comment beside it."""
        page = SOURCE / "manifests" / "guides" / "python.md"
        shell = {"docker/bootstrap.sh", "eventgan", "export", "python3"}  # any other first word is Python's
        of_shell = {is_shell: [block for block in blocks_of(page) if (block.split()[0] in shell) == is_shell]
                    for is_shell in (True, False)}
        code = "\n".join(of_shell[False])
        told = re.findall(r"(?m)^ *print\(.*\) {2,}# (.*)$", code)
        self.assertGreater(code.count("import"), 8)
        self.assertEqual(len(told), code.count("print("))
        for module in ("eventgan._engine", "matplotlib", "torch", "PIL"):
            if subprocess.run([sys.executable, "-c", f"import {module}"], env=PYTHON_PATH,
                              capture_output=True).returncode:
                self.skipTest(f"no {module}")
        with tempfile.TemporaryDirectory(prefix="eventgan-") as folder:
            for words in (words for block in of_shell[True] for words in commands_of(block) if words[0] == "eventgan"):
                subprocess.run([program.PROGRAM, *words[1:]], cwd=folder, check=True, capture_output=True)
            pathlib.Path(folder, "page.py").write_text(code)
            run = subprocess.run([sys.executable, "page.py"], cwd=folder, capture_output=True, text=True,
                                 env={**PYTHON_PATH, "MPLBACKEND": "agg", "OMP_NUM_THREADS": "1"})
            self.assertEqual(run.returncode, 0, run.stderr)
            self.assertEqual([line for line, _ in itertools.groupby(run.stdout.splitlines())], told)
            self.assertTrue({"volume.png", "difference.png"} <= set(os.listdir(folder)))

    def test_links_lead_somewhere(self):
        for page in PAGES:
            for link in re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
                self.assertTrue((page.parent / link).exists(), f"{page}: {link}")

    def test_pages_are_short(self):
        """Words as `wc -w` counts them."""
        words = {str(page.relative_to(SOURCE)): len(page.read_text(encoding="utf-8").split()) for page in PAGES}
        for page, count in words.items():
            with self.subTest(page):
                self.assertLessEqual(count, MOST_WORDS.get(page, 0))
        self.assertEqual(set(MOST_WORDS) - set(words), set())
        self.assertLessEqual(sum(words.values()), MOST_WORDS_OF_ALL)


if __name__ == "__main__":
    program.main()

"""`cmake --install`: the program, its man pages and completion, pages that find each other, examples, schemas, the Python package."""

import gzip
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

SOURCE = pathlib.Path(os.environ["EVENTGAN_SOURCE_DIR"])
BUILD = pathlib.Path(os.environ["EVENTGAN_PROGRAM"]).parent
SKIPPED = 77  # what ctest knows as skipped
COMPLETION_LIBRARY = pathlib.Path("/usr/share/bash-completion/bash_completion")


def run(*command, **how):
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, **how)
    if done.returncode != 0:
        raise AssertionError(f"{command}: {done.returncode}\n{done.stdout}\n{done.stderr}")
    return done.stdout


class Install(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.prefix = pathlib.Path(tempfile.mkdtemp(prefix="eventgan-"))
        cls.addClassCleanup(shutil.rmtree, cls.prefix)
        run("cmake", "--install", BUILD, "--prefix", cls.prefix)
        cls.program = cls.prefix / "bin" / "eventgan"
        cls.help = run(cls.program, "--help")
        cls.commands = re.findall(r"(?m)^  ([a-z-]+) {2,}", cls.help.split("Subcommands:")[1])

    def test_every_command_has_a_man_page(self):
        folder = self.prefix / "share" / "man" / "man1"
        self.assertEqual({path.name for path in folder.iterdir()},
                         {"eventgan.1.gz", *(f"eventgan-{command}.1.gz" for command in self.commands)})
        version = run(self.program, "--version").split()[1]
        for path in folder.iterdir():
            page = gzip.decompress(path.read_bytes()).decode()
            self.assertIn(f'"eventgan {version}"', page)
            self.assertRegex(page, r"(?m)^eventgan[a-z -]*\\- [A-Z]\w+ \w", path.name)  # NAME: what it is there for
            self.assertIn("Exit codes", page)
        convert = gzip.decompress((folder / "eventgan-convert.1.gz").read_bytes()).decode()
        self.assertIn(r"\-\-shards", convert)

    @unittest.skipUnless(COMPLETION_LIBRARY.exists(), "no bash-completion")
    def test_bash_completes_commands_options_and_words(self):
        file = self.prefix / "share" / "bash-completion" / "completions" / "eventgan"
        (self.prefix / "files" / "here.json").parent.mkdir()
        (self.prefix / "files" / "here.json").touch()

        def complete(line):
            script = (f"source {COMPLETION_LIBRARY}; source {file}; COMP_LINE='{line}'; COMP_POINT=${{#COMP_LINE}}; "
                      "eval \"COMP_WORDS=($COMP_LINE)\"; [[ $COMP_LINE == *' ' ]] && COMP_WORDS+=(''); "
                      "COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _eventgan; printf '%s\\n' \"${COMPREPLY[@]}\"")
            return set(run("bash", "--norc", "-c", script, cwd=self.prefix / "files").split())
        self.assertEqual(complete("eventgan "), {*self.commands, "--help", "--version"})
        self.assertEqual(complete("eventgan fin"), {"finalize"})
        self.assertEqual(complete("eventgan help ver"), {"verify"})
        self.assertEqual(complete("eventgan convert --gr"), {"--grace"})
        self.assertEqual(complete("eventgan convert --progress l"), {"lines"})
        self.assertEqual(complete("eventgan export --to "), {"yolo", "coco", "mpii", "davis", "webdataset", "events"})
        self.assertEqual(complete("eventgan convert he"), {"here.json"})
        for command in self.commands:
            options = set(re.findall(r"(?m)^  (?:-h,)?(--[a-z-]+)", run(self.program, command, "--help")))
            self.assertEqual(complete(f"eventgan {command} --"), options)

    def test_pages_examples_and_schemas(self):
        pages = self.prefix / "share" / "eventgan"
        for folder in ["manifests/examples", "manifests/schemas", "manifests/guides", "docker/slurm", "docker/kubernetes"]:
            here, there = pages / folder, SOURCE / folder
            installed, written = ({path.relative_to(top): path.read_bytes() for path in top.rglob("*") if path.is_file()}
                                  for top in (here, there))
            self.assertEqual(installed, written)
        documents = list(pages.rglob("*.md"))
        self.assertGreaterEqual(len(documents), 14)
        for page in documents:
            for link in re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", page.read_text()):
                if link.endswith((".cc", ".h")):  # into the sources
                    continue
                self.assertTrue((page.parent / link).exists(), f"{page}: {link}")
        self.assertIn("MIT License", (self.prefix / "share" / "doc" / "eventgan" / "copyright").read_text())

    def test_python_reads_shards_with_the_installed_package(self):
        where = run("/usr/bin/python3", "-B", "-c", "import eventgan_shards; print(eventgan_shards.__file__)", cwd="/",
                    env={"PYTHONPATH": str(self.prefix / "lib" / "python3" / "dist-packages")})
        self.assertTrue(where.startswith(str(self.prefix)))

    def test_nothing_else_is_installed(self):
        self.assertEqual({path.name for path in self.prefix.iterdir()} - {"files"}, {"bin", "share", "lib"})
        self.assertEqual([path.name for path in self.program.parent.iterdir()], ["eventgan"])
        self.assertFalse([path for path in self.prefix.rglob("*") if "__pycache__" in path.parts])


if __name__ == "__main__":
    missing = [name for name in ["cmake", "help2man"] if not shutil.which(name)]
    if missing:
        print(f"skipped: no {', '.join(missing)}: docker/bootstrap.sh packages package")
        sys.exit(SKIPPED)
    unittest.main(verbosity=2)

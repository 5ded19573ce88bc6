"""Exit codes, help and messages of the command line."""

import json
import unittest

import program
from program import run


class CommandLine(program.InFolder):
    def test_every_command_has_help(self):
        out, _ = run("--help")
        for command in ["convert", "plan", "verify", "inspect", "preview", "make-demo", "import-weights"]:
            self.assertIn(command, out)
            self.assertIn("Usage", run(command, "--help")[0])

    def test_version(self):
        self.assertRegex(run("--version")[0], r"eventgan \d+\.\d+\.\d+")

    def test_wrong_usage_is_64(self):
        run(expect=64)
        run("nonsense", expect=64)
        run("convert", expect=64)
        run("convert", "a.json", "--threads", "0", expect=64)
        run("convert", "a.json", "--progress", "loud", expect=64)
        run("make-demo", self.folder / "demo")
        run("convert", self.folder / "demo" / "manifest.json", "--output", "", expect=64)

    def test_missing_inputs_are_66(self):
        run("convert", self.folder / "none.json", expect=66)
        run("verify", self.folder, expect=66)
        path = self.write_manifest(program.manifest([{"dataset": "mpii", "root": "nowhere", "pairs": program.pairs([2])}]))
        _, err = run("convert", path, expect=66)
        self.assertIn("nowhere", err)
        run("inspect", self.folder / "none.h5", expect=66)
        run("preview", self.folder / "none.h5", "--out", self.folder / "p", expect=66)
        run("import-weights", self.folder / "none.pt", self.folder / "w.safetensors", expect=66)

    def test_a_bad_manifest_is_64_and_every_fault_is_told_at_once(self):
        bad = program.manifest([{"dataset": "mpii", "root": "x", "pairs": program.pairs([9.7])}], seed="x", colour=1)
        _, err = run("plan", self.write_manifest(bad), expect=64)
        for path in ["$.sources[0].pairs.gaps[0]", "$.seed", "$.colour"]:
            self.assertIn(path, err)

    def test_a_damaged_shard_is_an_error_that_names_it(self):
        (self.folder / "x.h5").write_bytes(b"no HDF5")
        for arguments in [("inspect",), ("preview", "--out", self.folder / "p")]:
            _, err = run(arguments[0], self.folder / "x.h5", *arguments[1:], expect=1)
            self.assertIn("x.h5", err)


if __name__ == "__main__":
    program.main()

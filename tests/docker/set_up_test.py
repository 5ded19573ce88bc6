"""The set-up script, and who calls it: the README, the image, the workflow on GitHub."""

import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

import yaml

SOURCE = pathlib.Path(os.environ["EVENTGAN_SOURCE_DIR"])
DOCKER = SOURCE / "docker"
README = (SOURCE / "README.md").read_text(encoding="utf-8")
SYSTEMS = {"debian 12": 'ID=debian\nVERSION_ID="12"\nPRETTY_NAME="Debian GNU/Linux 12 (bookworm)"\n',
           "debian 13": 'ID=debian\nVERSION_ID="13"\nPRETTY_NAME="Debian GNU/Linux 13 (trixie)"\n',
           "unstable": 'ID=debian\nPRETTY_NAME="Debian GNU/Linux forky/sid"\n',
           "ubuntu 24.04": 'ID=ubuntu\nID_LIKE=debian\nVERSION_ID="24.04"\nPRETTY_NAME="Ubuntu 24.04.2 LTS"\n',
           "ubuntu 20.04": 'ID=ubuntu\nID_LIKE=debian\nVERSION_ID="20.04"\nPRETTY_NAME="Ubuntu 20.04.6 LTS"\n'}


def listed(name):
    lines = (line.split("#")[0].strip() for line in (DOCKER / "packages" / f"{name}.txt").read_text().splitlines())
    return [line for line in lines if line]


class Script(unittest.TestCase):
    """The script with another os-release, and with commands that only note how they were called."""

    def run_on(self, system, *arguments, installed=False):
        """(exit code, what was called, what it printed on standard error)"""
        with tempfile.TemporaryDirectory(prefix="eventgan-") as folder:
            top = pathlib.Path(folder)
            shutil.copytree(DOCKER, top / "docker")
            script = (DOCKER / "bootstrap.sh").read_text()
            self.assertIn("/etc/os-release", script)
            (top / "docker" / "bootstrap.sh").write_text(script.replace("/etc/os-release", f"{top}/os-release"))
            if system:
                (top / "os-release").write_text(SYSTEMS[system])
            commands = {"dpkg-query": "echo install ok installed" if installed else "exit 1", "id": "echo 0",
                        "git": "echo ' M README.md'",
                        **{name: f'echo "{name} $*" >>{top}/called' for name in ("apt-get", "cmake", "ctest", "cpack")}}
            (top / "bin").mkdir()
            (top / "build" / "release").mkdir(parents=True)
            for name, body in commands.items():
                (top / "bin" / name).write_text(f"#!/bin/sh\n{body}\n")
                (top / "bin" / name).chmod(0o755)
            done = subprocess.run([top / "docker" / "bootstrap.sh", *arguments], capture_output=True, text=True,
                                  env={**os.environ, "PATH": f"{top}/bin:{os.environ['PATH']}"})
            called = top / "called"
            return done.returncode, called.read_text().splitlines() if called.exists() else [], done.stderr

    def test_installs_what_is_missing_on_both_debians(self):
        for system in ("debian 12", "debian 13"):
            code, called, errors = self.run_on(system, "packages", "slurm", "package")
            self.assertEqual((code, errors), (0, ""))
            self.assertEqual([line.split()[1] for line in called], ["update", "install"])
            self.assertTrue(
                called[1].endswith(" ".join(["--no-install-recommends", *listed("slurm"), *listed("package")])))

    def test_ubuntu_is_tried_and_called_untested(self):
        code, called, errors = self.run_on("ubuntu 24.04", "packages", "slurm")
        self.assertEqual((code, errors), (0, "Ubuntu 24.04.2 LTS is untested: trying apt under Debian's names\n"))
        self.assertTrue(called[1].endswith(" ".join(["--no-install-recommends", *listed("slurm")])))

    def test_elsewhere_packages_says_what_to_do(self):
        names = {"ubuntu 20.04": "Ubuntu 20.04.6 LTS", "unstable": "Debian GNU/Linux forky/sid",
                 None: os.uname().sysname}
        for system, name in names.items():
            code, called, errors = self.run_on(system, "packages", "slurm")
            self.assertEqual((code, called), (1, []))
            what, *packages = errors.splitlines()
            self.assertRegex(what, rf"\Aexpected Debian 12 or 13, got {re.escape(name)}: .*docker build ")
            self.assertEqual(packages, listed("slurm"))

    def test_elsewhere_what_is_there_is_built(self):
        code, called, errors = self.run_on("unstable", "package")
        self.assertEqual(code, 0)
        self.assertEqual([line.split()[0] for line in called], ["cmake", "cmake", "cpack"])
        self.assertEqual(errors.count("expected Debian 12 or 13"), 2)  # what builds, what packs
        self.assertEqual(self.run_on("unstable", "packages", installed=True), (0, [], ""))

    def test_a_release_is_of_what_is_committed(self):
        self.assertEqual(self.run_on("debian 12", "release"),
                         (1, [], "expected no change since the last commit: git status\n"))

    def test_unknown_words(self):
        self.assertEqual(self.run_on("debian 13", "packages", "nothing")[0], 64)
        self.assertEqual(self.run_on("debian 13", "nothing")[0], 64)

    def test_lists_are_sorted_and_name_a_package_once(self):
        for path in (DOCKER / "packages").glob("*.txt"):
            packages = listed(path.stem)
            self.assertEqual(packages, sorted(set(packages)), path)
            # A library's name has a version that only one Debian has.
            self.assertEqual([name for name in packages if re.match(r"lib(?!.*-dev$)", name)], [], path)
        self.assertFalse(set(listed("build")) & set(listed("test")))


def stages():
    """The Dockerfile's stages by name, each a list of (instruction, rest), lines that go on joined;
    the last is None's."""
    text = re.sub(r"\\\n\s*", "", (DOCKER / "Dockerfile").read_text())
    result = {}
    for line in text.splitlines():
        if not line or line.startswith("#"):
            continue
        instruction, rest = line.split(maxsplit=1)
        if instruction == "FROM":
            base, _, name = rest.partition(" AS ")
            stage = result[name or None] = [("FROM", base)]
        elif result:
            stage.append((instruction, rest))
    return result


def values(stage, instruction):
    return [rest for found, rest in stage if found == instruction]


class Image(unittest.TestCase):
    def setUp(self):
        self.stages = stages()

    def test_two_images_without_and_with_libtorch(self):
        debian = "debian:${DEBIAN}-slim"
        self.assertEqual({name: values(stage, "FROM") for name, stage in self.stages.items()},
                         {"build": [debian], "plain": [debian], "torch": ["plain"], None: ["plain"]})
        self.assertEqual(len(self.stages[None]), 1)
        self.assertRegex((DOCKER / "Dockerfile").read_text(), r"(?m)^ARG DEBIAN=trixie$")

    def test_build_installs_the_lists_and_run_the_packages(self):
        self.assertEqual(values(self.stages["build"], "RUN"),
                         ["docker/bootstrap.sh packages build package", "docker/bootstrap.sh package"])
        packages = (DOCKER / "CMakeLists.txt").read_text()
        suggested = re.search(r'PACKAGE_SUGGESTS\s+"([^"]+)"', packages)[1].split(", ")
        plugins = [each for each in suggested if each not in ("bash-completion", "eventgan-torch")]
        self.assertIn("hdf5-plugin-lzf", plugins)
        for stage, component, more in (("plain", "EVENTGAN", plugins), ("torch", "TORCH", [])):
            name = re.search(rf"set\(CPACK_DEBIAN_{component}_PACKAGE_NAME (\S+)\)", packages)[1]
            (command,) = values(self.stages[stage], "RUN")
            self.assertIn("type=bind,from=build,source=/src/build/release,target=/packages ", command)
            self.assertEqual(re.findall(r"install (.*?) &&", command),
                             [" ".join(["-y --no-install-recommends", f"/packages/{name}_*.deb", *more])])

    def test_the_program_runs_without_rights(self):
        for stage in ("plain", "torch"):
            self.assertRegex(values(self.stages[stage], "USER")[-1], r"^[1-9]\d*:[1-9]\d*$")
        self.assertEqual(values(self.stages["plain"], "ENTRYPOINT"), ['["eventgan"]'])

    def test_what_is_copied_is_there(self):
        ignored = {line.strip("/") for line in (SOURCE / ".dockerignore").read_text().splitlines()}
        for stage in self.stages.values():
            for source in (rest.split()[0] for rest in values(stage, "COPY")):
                self.assertTrue((SOURCE / source).exists(), source)
                self.assertNotIn(source, ignored)


class Workflow(unittest.TestCase):
    def test_runs_the_readmes_commands_on_each_debian_once_and_all_checks_on_one(self):
        workflow = yaml.safe_load((SOURCE / ".github" / "workflows" / "ci.yml").read_text())
        trixie, checks, image = (workflow["jobs"][name] for name in ("trixie", "checks", "image"))
        self.assertEqual((trixie["container"], checks["container"]), ("debian:trixie", "debian:bookworm"))
        commands = [step["run"] for step in trixie["steps"] if "run" in step]
        self.assertEqual(commands, re.findall(r"(?m)^    (docker/bootstrap\.sh .*?) +#", README))
        self.assertEqual(len(commands), 2)
        self.assertIn("Debian 12 or 13", README)
        build = next(step["run"] for step in image["steps"] if "run" in step)
        for page in (README, (DOCKER / "bootstrap.sh").read_text()):
            self.assertIn(build, page)
        self.assertIn(".ci/run", [step.get("run") for step in checks["steps"]])
        self.assertTrue(os.access(SOURCE / ".ci" / "run", os.X_OK))
        for command in commands:
            self.assertRegex((SOURCE / ".ci" / "run").read_text(), rf"(?m)^{command}\b")
        for step in trixie["steps"] + checks["steps"] + image["steps"]:
            self.assertRegex(step.get("uses", "actions/checkout@v4"), r"@v\d+$")

    def test_clang_tidy_and_the_fuzzers_run_at_night(self):
        workflow = yaml.safe_load((SOURCE / ".github" / "workflows" / "nightly.yml").read_text())
        self.assertIn("schedule", workflow[True])  # YAML 1.1 takes `on` for a truth value
        self.assertIn(".ci/run nightly", [step.get("run") for step in workflow["jobs"]["checks"]["steps"]])
        always, end, at_night = re.split(r"(?m)^(if \[\[ \$nightly != nightly \]\]; then\n  step .*\n  exit\nfi)$",
                                         (SOURCE / ".ci" / "run").read_text())
        for command in ("cmake --preset fuzz", "run-clang-tidy"):
            self.assertIn(command, at_night)
            self.assertNotIn(command, always)

    def test_a_release_is_what_bootstrap_makes_on_the_oldest_debian(self):
        workflow = yaml.safe_load((SOURCE / ".github" / "workflows" / "release.yml").read_text())
        self.assertEqual(workflow[True], {"push": {"tags": ["v*"]}})  # YAML 1.1 takes `on` for a truth value
        files = workflow["jobs"]["files"]
        self.assertEqual(files["container"]["image"], "debian:bookworm")
        self.assertEqual(files["strategy"]["matrix"], {"machine": ["ubuntu-24.04", "ubuntu-24.04-arm"]})
        self.assertEqual(files["runs-on"], "${{ matrix.machine }}")
        commands = [step.get("run", "") for step in files["steps"]]
        self.assertIn("docker/bootstrap.sh release", commands)
        self.assertIn("tests/docker/portable.py build/wheel", commands)


if __name__ == "__main__":
    unittest.main(verbosity=2)

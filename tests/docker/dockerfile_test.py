"""The container image: its packages are those of the set-up script, and the ones the program needs, no more."""

import os
import pathlib
import re
import shutil
import subprocess
import sys
import unittest

SOURCE = pathlib.Path(os.environ["EVENTGAN_SOURCE_DIR"])
PROGRAM = os.environ["EVENTGAN_PROGRAM"]
DOCKER = SOURCE / "docker"
SKIPPED = 77  # what ctest knows as skipped


def output(*command):
    return subprocess.run(command, capture_output=True, text=True, check=True, env={**os.environ, "LC_ALL": "C"}).stdout


def listed(name):
    lines = (line.split("#")[0].strip() for line in (DOCKER / "packages" / f"{name}.txt").read_text().splitlines())
    return [line for line in lines if line]


def stages():
    """The Dockerfile's stages, each a list of (instruction, rest), lines that go on joined."""
    text = re.sub(r"\\\n\s*", "", (DOCKER / "Dockerfile").read_text())
    result = []
    for line in text.splitlines():
        if not line or line.startswith("#"):
            continue
        instruction, rest = line.split(maxsplit=1)
        if instruction == "FROM":
            result.append([])
        result[-1].append((instruction, rest))
    return result


def values(stage, instruction):
    return [rest for found, rest in stage if found == instruction]


def libraries():
    """The package of each shared library the program loads, by the library's name."""
    paths = dict(re.findall(r"^\s*(\S+) => (/\S+)", output("ldd", PROGRAM), re.MULTILINE))
    # Where /lib is a link to /usr/lib, dpkg may know either name; an alternative (libblas.so.3) is a link that dpkg does
    # not know at all.
    names = {name: [path, "/usr" + path, str(pathlib.Path(path).resolve())] for name, path in paths.items()}
    search = subprocess.run(["dpkg-query", "--search", *sum(names.values(), [])], capture_output=True, text=True)
    owners = {path: package for package, path in re.findall(r"^([^:\n]+)(?::\w+)?: (/.*)$", search.stdout, re.MULTILINE)}
    result = {}
    for name, choices in names.items():
        result[name] = next((owners[choice] for choice in choices if choice in owners), None)
        assert result[name], f"expected a package that owns {paths[name]}, got none"
    return result


def installed_packages():
    """What each installed package is (itself and what it provides) and depends on: for each name, a list of lists of
    alternatives."""
    provides, depends = {}, {}
    fields = "${Package}\t${Provides}\t${Pre-Depends}, ${Depends}\t${db:Status-Status}\n"
    for line in output("dpkg-query", "--show", f"--showformat={fields}").splitlines():
        package, provided, needed, status = line.split("\t")
        if status != "installed":
            continue
        for name in [package, *provided.split(",")]:
            provides.setdefault(bare(name), set()).add(package)
        depends[package] = [[bare(choice) for choice in group.split("|")] for group in needed.split(",") if group.strip()]
    return provides, depends


def bare(name):
    return re.sub(r"\(.*?\)|:\w+", "", name).strip()


def with_dependencies(packages):
    """The packages, and those installed that any of them needs, however far."""
    provides, depends = installed_packages()
    reached, left = set(), list(packages)
    while left:
        package = left.pop()
        if package in reached:
            continue
        reached.add(package)
        for alternatives in depends.get(package, []):
            left.extend(found for name in alternatives for found in provides.get(name, ()))
    return reached


class Dockerfile(unittest.TestCase):
    def test_packages_come_from_the_set_up_scripts_lists(self):
        build, run = stages()
        self.assertIn("docker/bootstrap.sh packages build", values(build, "RUN"))
        self.assertTrue(any("/docker/bootstrap.sh packages run" in command for command in values(run, "RUN")))
        for command in values(build, "RUN") + values(run, "RUN"):
            self.assertNotRegex(command, r"apt(-get)? ", "packages are named in docker/packages alone")
        script = (DOCKER / "bootstrap.sh").read_text()
        self.assertNotRegex(script, r"apt-get install(?!.*\$\{missing\[@\]\})")
        # The script builds with the list that the image's build stage installs.
        self.assertIn("install_packages docker/packages/build.txt", script)
        for name in re.findall(r"packages/([a-z]+)\.txt", script + (DOCKER / "Dockerfile").read_text()):
            self.assertTrue(listed(name), name)

    def test_lists_are_sorted_and_name_a_package_once(self):
        for path in (DOCKER / "packages").glob("*.txt"):
            packages = listed(path.stem)
            self.assertEqual(packages, sorted(set(packages)), path)
        self.assertFalse(set(listed("build")) & set(listed("test")))

    def test_both_stages_are_of_one_debian(self):
        build, run = stages()
        (base,), (small,) = values(build, "FROM"), values(run, "FROM")
        self.assertEqual(base.split(" AS ")[0], small)

    def test_the_small_stage_runs_the_program_without_rights(self):
        _, run = stages()
        (user,) = values(run, "USER")
        self.assertRegex(user, r"^[1-9]\d*:[1-9]\d*$")
        self.assertEqual(values(run, "ENTRYPOINT"), ['["eventgan"]'])
        self.assertEqual(values(run, "COPY"), ["--from=build /src/build/release/eventgan /usr/local/bin/eventgan"])

    def test_what_is_copied_is_there(self):
        ignored = {line.strip("/") for line in (SOURCE / ".dockerignore").read_text().splitlines()}
        for source in values(stages()[0], "COPY"):
            first = source.split()[0]
            self.assertTrue((SOURCE / first).exists(), first)
            self.assertNotIn(first, ignored)

    def test_run_list_is_what_the_program_loads_itself(self):
        direct = re.findall(r"NEEDED.*\[(.+)\]", output("readelf", "--dynamic", PROGRAM))
        owners = libraries()
        self.assertGreater(len(direct), 10)
        # The loader is libc's, and ldd gives it no arrow.
        self.assertEqual(listed("run"), sorted({owners[name] for name in direct if not name.startswith("ld-linux")}))

    def test_run_list_covers_every_library(self):
        covered = with_dependencies(listed("run"))
        for name, package in libraries().items():
            self.assertIn(package, covered, name)


if __name__ == "__main__":
    if not all(map(shutil.which, ["dpkg-query", "ldd", "readelf"])):
        print("skipped: not a Debian with binutils")
        sys.exit(SKIPPED)
    unittest.main(verbosity=2)

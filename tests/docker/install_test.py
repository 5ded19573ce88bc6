"""What is installed, by `cmake --install` and as Debian packages: the program, its man pages and completion, pages that
find each other, examples, schemas; apart from these what needs LibTorch, the library, and the Python package."""

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
        cls.root = pathlib.Path(tempfile.mkdtemp(prefix="eventgan-"))
        cls.addClassCleanup(shutil.rmtree, cls.root)
        # As packagers do: into a folder that stands for the system's root.
        cls.prefix = cls.root / "opt" / "eventgan"
        run("cmake", "--install", BUILD, "--prefix", "/opt/eventgan", env={**os.environ, "DESTDIR": str(cls.root)},
            umask=0o022)
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
        self.assertEqual(complete("eventgan export --to "),
                         {"yolo", "yolo-seg", "coco", "mpii", "hpe", "davis", "webdataset", "events", "dsec",
                          "rvt", "raw", "aedat4"})
        self.assertEqual(complete("eventgan convert he"), {"here.json"})
        for command in self.commands:
            options = set(re.findall(r"(?m)^  (?:-h,)?(--[a-z-]+)", run(self.program, command, "--help")))
            self.assertEqual(complete(f"eventgan {command} --"), options)

    def test_pages_examples_and_schemas(self):
        pages = self.prefix / "share" / "eventgan"
        for folder in ["manifests/examples", "manifests/schemas", "manifests/guides", "docker/slurm",
                       "docker/kubernetes"]:
            here, there = pages / folder, SOURCE / folder
            installed, written = ({path.relative_to(top): path.read_bytes() for path in top.rglob("*")
                                   if path.is_file()}
                                  for top in (here, there))
            self.assertEqual(installed, written)
        documents = list(pages.rglob("*.md"))
        self.assertGreaterEqual(len(documents), 14)
        for page in documents:
            for link in re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", page.read_text()):
                if link.endswith((".c", ".cc", ".h")):  # into the sources
                    continue
                self.assertTrue((page.parent / link).exists(), f"{page}: {link}")
        self.assertIn("MIT License", (self.prefix / "share" / "doc" / "eventgan" / "copyright").read_text())

    def test_everybody_may_read_it(self):
        installed = [path for folder in ("bin", "include", "lib", "libexec", "share")
                     for path in (self.prefix / folder).rglob("*")]
        self.assertGreater(len(installed), 100)
        for path in installed:
            wanted = 0o055 if path.is_dir() or path.stat().st_mode & 0o100 else 0o044
            self.assertEqual(path.stat().st_mode & 0o077, wanted, path)

    def test_python_takes_the_installed_package(self):
        code = ("import eventgan; print(eventgan.__file__, len(eventgan.Shards.__mro__)); "
                "print(eventgan.Generator('untrained:2')([[0.0, 1.0]], [[1.0, 0.0]]).shape); "
                "print({line.split()[-1] for line in open('/proc/self/maps') if 'libeventgan' in line})")
        said = run("/usr/bin/python3", "-B", "-c", code, cwd="/",
                   env={"PYTHONPATH": str(self.prefix / "lib" / "python3" / "dist-packages")})
        self.assertTrue(said.startswith(str(self.prefix)))
        self.assertEqual(said.splitlines()[1:], ["(18, 1, 2)", str({f"{self.prefix}/lib/libeventgan.so.1"})])

    def test_nothing_else_is_installed(self):
        self.assertEqual([path.relative_to(self.root).as_posix() for path in self.root.glob("*/*")], ["opt/eventgan"])
        self.assertEqual({path.name for path in self.prefix.iterdir()} - {"files"},
                         {"bin", "include", "libexec", "share", "lib"})
        executables = [path for path in self.prefix.rglob("*") if path.is_file() and not path.is_symlink()
                       and path.read_bytes()[:4] == b"\x7fELF"]
        self.assertEqual({path.relative_to(self.prefix).as_posix() for path in executables},
                         {"bin/eventgan", "libexec/eventgan/eventgan-torch", "libexec/eventgan/eventgan-video",
                          "lib/libeventgan.so.1"})
        self.assertTrue(all(os.access(path, os.X_OK) for path in executables if path.suffix != ".1"))
        self.assertFalse([path for path in self.prefix.rglob("*") if "__pycache__" in path.parts])


def loaded_packages(executable):
    """Those whose libraries an executable names itself."""
    names = re.findall(r"NEEDED.*\[(.+)\]", run("readelf", "--dynamic", executable))
    paths = dict(re.findall(r"(?m)^\s*(\S+) => (/\S+)", run("ldd", executable)))
    assert len(paths) > 10
    # Where /lib is a link to /usr/lib, dpkg may know either name. It does not know links of alternatives.
    places = [(path, "/usr" + path, os.path.realpath(path))
              for path in (paths[name] for name in names if name in paths)]  # the loader has no arrow
    found = subprocess.run(["dpkg-query", "--search", *sum(places, ())], capture_output=True, text=True).stdout
    package_of = {path: package for package, path in re.findall(r"(?m)^([^:\n]+)(?::\w+)?: (/.+)$", found)}
    return {next((package_of[path] for path in own if path in package_of), f"the package of {own[0]}")
            for own in places}


@unittest.skipUnless(shutil.which("dpkg-shlibdeps"), "no dpkg-dev")
class Packages(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="eventgan-"))
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        run("cpack", "-B", cls.folder, "-D", "CPACK_DEBIAN_COMPRESSION_TYPE=zstd", cwd=BUILD, umask=0o022)
        cls.files = {path.name.split("_")[0]: path for path in cls.folder.glob("*.deb")}

    def test_everybody_may_read_what_they_hold(self):
        for path in self.files.values():
            modes = set(re.findall(r"(?m)^(\S{10}) ", run("dpkg-deb", "--contents", path)))
            self.assertLessEqual(modes, {"drwxr-xr-x", "-rw-r--r--", "-rwxr-xr-x", "lrwxrwxrwx"}, path)

    def field(self, package, name):
        return run("dpkg-deb", "--field", self.files[package], name).strip()

    def names(self, package, name):
        return {entry.split()[0] for entry in self.field(package, name).split(",")}

    def test_the_packages_share_the_files(self):
        contents = {name: set(re.findall(r"(?m) \./(\S*[^/\s])(?: -> \S+)?$", run("dpkg-deb", "--contents", path)))
                    for name, path in self.files.items()}
        self.assertEqual(set(contents),
                         {"eventgan", "eventgan-torch", "libeventgan1", "libeventgan-dev", "python3-eventgan"})
        self.assertEqual(contents["libeventgan1"], {"usr/lib/libeventgan.so.1"})
        self.assertEqual(contents["libeventgan-dev"], {"usr/include/eventgan.h", "usr/lib/libeventgan.so",
                                                       "usr/share/doc/libeventgan-dev/example.c"})
        self.assertEqual(contents["eventgan-torch"], {"usr/libexec/eventgan/eventgan-torch"})
        self.assertLessEqual({"usr/bin/eventgan", "usr/libexec/eventgan/eventgan-video"}, contents["eventgan"])
        self.assertIn("usr/share/man/man1/eventgan.1.gz", contents["eventgan"])
        self.assertEqual(contents["python3-eventgan"], {
            f"usr/lib/python3/dist-packages/eventgan/{path.name}"
            for path in (SOURCE / "manifests" / "python" / "eventgan").iterdir() if path.name != "__pycache__"})
        self.assertFalse([name for name in contents["eventgan"] if "dist-packages" in name])
        self.assertFalse([name for name in contents["eventgan"] if "torch" in pathlib.PurePath(name).name
                          and "libexec" in name])

    def test_dependencies_are_the_libraries_packages(self):
        for package, executable in [("eventgan", "eventgan"), ("eventgan", "eventgan-video"),
                                    ("eventgan-torch", "eventgan-torch"), ("libeventgan1", "libeventgan.so.1")]:
            self.assertLessEqual(loaded_packages(BUILD / executable), self.names(package, "Depends"))
        version = run(BUILD / "eventgan", "--version").split()[1]
        self.assertIn(f"eventgan (= {version})", self.field("eventgan-torch", "Depends"))
        self.assertEqual(self.names("eventgan", "Recommends"), {"python3-eventgan"})
        self.assertEqual(self.names("python3-eventgan", "Recommends"), {"python3-h5py", "python3-matplotlib"})
        self.assertLessEqual({"python3-torch", "python3-tqdm"}, self.names("python3-eventgan", "Suggests"))

    def test_one_python_package_is_for_every_python_and_processor(self):
        version = run(BUILD / "eventgan", "--version").split()[1]
        self.assertEqual(self.field("python3-eventgan", "Architecture"), "all")
        self.assertEqual({entry.strip() for entry in self.field("python3-eventgan", "Depends").split(",")},
                         {f"libeventgan1 (>= {version})", "python3 (>= 3.9)", "python3-numpy"})
        self.assertEqual(self.field("libeventgan-dev", "Depends"), f"libeventgan1 (= {version})")
        run("dpkg-deb", "--control", self.files["libeventgan1"], self.folder / "library")
        self.assertEqual((self.folder / "library" / "triggers").read_text(), "activate-noawait ldconfig\n")

    def test_python_compiles_it_when_it_is_installed_and_takes_that_away_with_it(self):
        control = self.folder / "control"
        run("dpkg-deb", "--control", self.files["python3-eventgan"], control)
        for script, command in [("postinst", "py3compile"), ("prerm", "py3clean")]:
            self.assertTrue(os.access(control / script, os.X_OK))
            self.assertIn(f"{command} -p python3-eventgan\n", (control / script).read_text())

    def test_an_earlier_eventgan_gives_its_python_files_up(self):
        """It had them itself, which dpkg would not let another package write over."""
        version = run(BUILD / "eventgan", "--version").split()[1]
        self.assertEqual(self.field("python3-eventgan", "Breaks"), f"eventgan (<< {version})")
        self.assertEqual(self.field("python3-eventgan", "Replaces"), "eventgan")

    def test_only_one_needs_libtorch(self):
        needing = [package for package in self.files
                   if [name for name in self.names(package, "Depends") if name.startswith("libtorch")]]
        self.assertEqual(needing, ["eventgan-torch"])

    def test_descriptions_are_well_formed(self):
        for package in self.files:
            first, *rest = self.field(package, "Description").splitlines()
            self.assertLess(len(first), 80)
            self.assertTrue(rest)
            self.assertFalse([line for line in rest if not re.match(r" \S", line)])

    @unittest.skipUnless(shutil.which("apt-get"), "no apt-get")
    def test_apt_would_install_them(self):
        said = run("apt-get", "install", "--simulate", *self.files.values())
        for package in self.files:
            self.assertRegex(said, rf"(?m)^Inst {package} ")


if __name__ == "__main__":
    missing = [name for name in ["cmake", "help2man"] if not shutil.which(name)]
    if missing:
        print(f"skipped: no {', '.join(missing)}: docker/bootstrap.sh packages package")
        sys.exit(SKIPPED)
    unittest.main(verbosity=2)

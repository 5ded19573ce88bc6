"""docker/wheel/pack.py: what it refuses to pack, versions of functions that it lowers, and the wheel's form."""

import base64
import csv
import hashlib
import os
import pathlib
import platform
import shutil
import subprocess
import sys
import tempfile
import unittest
import zipfile

SOURCE = pathlib.Path(os.environ["EVENTGAN_SOURCE_DIR"])
SKIPPED = 77  # what ctest knows as skipped
PROGRAM = """#include <math.h>
#include <stdio.h>
#include <stdlib.h>
int main(int count, char** words) { printf("%g\\n", hypot(atof(words[1]), atof(words[count - 1]))); }
"""


class Pack(unittest.TestCase):
    def setUp(self):
        self.tree = pathlib.Path(tempfile.mkdtemp(prefix="eventgan-"))
        self.addCleanup(shutil.rmtree, self.tree)
        (self.tree / "bin").mkdir()
        self.program = self.tree / "bin" / "program"

    def build(self, *options):
        subprocess.run(["cc", "-xc", "-", "-o", self.program, "-lm", *options], input=PROGRAM, text=True, check=True)

    def faults(self):
        return [fault for fault in pack.faults(self.tree) if " version newer " not in fault]

    def test_libraries_lie_beside_it(self):
        self.build()
        self.assertEqual(self.faults(), [])
        (self.tree / "lib").mkdir()
        library = self.tree / "lib" / "libmore.so"
        subprocess.run(["cc", "-xc", "-", "-shared", "-fPIC", "-o", library], input="int more;", text=True, check=True)
        link = ["-Wl,--no-as-needed", "-L", self.tree / "lib", "-lmore"]
        self.build(*link)
        self.assertEqual(self.faults(), ["expected the library libmore.so beside it, got none, for bin/program"])
        self.build(*link, "-Wl,-rpath,$ORIGIN/../lib")
        self.assertEqual(self.faults(), [])
        self.build(*link, f"-Wl,-rpath,{self.tree}/lib")
        self.assertEqual(self.faults()[0],
                         f"expected a search path inside, $ORIGIN, got {self.tree}/lib, in bin/program")
        self.build(*link, "-Wl,-rpath,$ORIGIN/../../lib")  # out of the tree
        self.assertIn("got $ORIGIN/../../lib, in bin/program", self.faults()[0])

    def test_versions_are_those_of_the_tag(self):
        self.build()
        newest = dict(pack.NEWEST)
        self.addCleanup(pack.NEWEST.update, newest)
        pack.NEWEST["GLIBC"] = (2, 2, 4)
        self.assertTrue([fault for fault in pack.faults(self.tree)
                         if f"no version newer than GLIBC_2.2.4, got {pack.FIRST} of libc.so.6 (" in fault
                         and "printf" in fault and fault.endswith("), in bin/program")])

    @unittest.skipUnless(platform.machine() in ("aarch64", "x86_64"), "other versions")
    def test_hypot_of_an_older_glibc(self):
        self.build()
        before = pack.Elf(self.program)
        if ("libm.so.6", "GLIBC_2.35") not in before.versions:
            self.skipTest("glibc before 2.35")
        old = before.users(pack.FIRST)
        self.assertIn("(hypot)", " ".join(pack.faults(self.tree)))
        pack.lower_versions(self.program)
        self.assertNotIn("(hypot)", " ".join(pack.faults(self.tree)))
        self.assertEqual(pack.Elf(self.program).users(pack.FIRST) - old, {"hypot"})
        self.assertEqual(subprocess.run([self.program, "3", "4"], capture_output=True, check=True).stdout, b"5\n")

    def test_the_wheel_is_what_pip_expects(self):
        self.build()
        package = self.tree / "lib" / "python3" / "dist-packages" / "eventgan"
        package.mkdir(parents=True)
        (package / "__init__.py").write_text("# nothing\n")
        outs = [self.tree.with_name(f"{self.tree.name}-{i}") for i in range(2)]
        for out in outs:
            out.mkdir()
            self.addCleanup(shutil.rmtree, out)
        first, second = (pack.write_wheel(self.tree, out, "1.2.3") for out in outs)
        self.assertEqual(first.read_bytes(), second.read_bytes())
        self.assertRegex(first.name, r"^eventgan-1\.2\.3-py3-none-manylinux_2_34_\w+\.whl$")
        with zipfile.ZipFile(first) as wheel:
            modes = {entry.filename: entry.external_attr >> 16 for entry in wheel.infolist()}
            self.assertEqual(modes["eventgan/bin/program"], 0o100755)
            self.assertEqual(modes["eventgan/__init__.py"], 0o100644)
            record = list(csv.reader(wheel.read("eventgan-1.2.3.dist-info/RECORD").decode().splitlines()))
            self.assertEqual([name for name, _, _ in record], wheel.namelist())
            for name, digest, size in record[:-1]:
                data = wheel.read(name)
                expected = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).decode().rstrip("=")
                self.assertEqual((digest, int(size)), (f"sha256={expected}", len(data)))
            self.assertIn("\nVersion: 1.2.3\n", wheel.read("eventgan-1.2.3.dist-info/METADATA").decode())

    def test_tar_reads_the_archive_as_one(self):
        self.build()
        (self.tree / "lib").mkdir()
        for name in ("a", "libeventgan-weights.so.1", "z"):
            (self.tree / "lib" / name).write_bytes(name.encode() * 1000)
        out = pathlib.Path(tempfile.mkdtemp(prefix="eventgan-"))
        self.addCleanup(shutil.rmtree, out)
        subprocess.run(["tar", "-xf", pack.write_archive(self.tree, out, "1.2.3"), "-C", out], check=True)
        (unpacked,) = out.glob("eventgan-1.2.3-linux-*/")
        subprocess.run(["diff", "--recursive", self.tree, unpacked], check=True)
        self.assertTrue(os.access(unpacked / "bin" / "program", os.X_OK))
        self.assertFalse(os.access(unpacked / "lib" / "a", os.X_OK))


if __name__ == "__main__":
    missing = [name for name in ("cc", "objdump", "xz") if not shutil.which(name)]
    if missing or sys.version_info < (3, 11):
        print(f"skipped: no {', '.join(missing) or 'Python 3.11'}")
        sys.exit(SKIPPED)
    sys.path.insert(0, str(SOURCE / "docker" / "wheel"))
    import pack
    unittest.main(verbosity=2)

#!/usr/bin/env python3
"""pack.py BUILD: what runs on any Linux, of a build with EVENTGAN_PORTABLE, in BUILD: a wheel for pip, and an archive
to unpack. `docker/bootstrap.sh wheel` calls it.

Both hold one tree, the wheel inside the Python package:
    bin/eventgan, lib/libeventgan.so.1    find what they load in lib/eventgan
    lib/eventgan                          the libraries that not every Linux has, each under a name of its own, so that
                                          it meets no other of its kind in a process of Python
    share                                 pages, examples, schemas, sensors, man pages, completion
    share/doc/eventgan/licences           what is said of each Debian source package of which something is in here

Ends with exit code 1, and says why, if another Linux would not take it: where a library is missing or is looked for
outside, or asks for more than glibc 2.34 and GCC 11's libraries have (the rules of manylinux_2_34); where a licence is
missing; where a file is larger than MOST_BYTES. Needs docker/packages/wheel.txt; nothing of Python but its own library.
"""

from __future__ import annotations

import base64
import csv
import hashlib
import io
import lzma
import os
import pathlib
import platform
import re
import shutil
import struct
import subprocess
import sys
import tarfile
import tomllib
import zipfile

# What every Linux of the tag has, in at least these versions: RHEL 9, Debian 12, Ubuntu 22.04, and what came later.
SYSTEM = {"ld-linux-aarch64.so.1", "ld-linux-x86-64.so.2", "libc.so.6", "libdl.so.2", "libgcc_s.so.1", "libm.so.6",
          "libpthread.so.0", "librt.so.1", "libstdc++.so.6"}
NEWEST = {"GLIBC": (2, 34), "GLIBCXX": (3, 4, 29), "CXXABI": (1, 3, 13), "GCC": (11, 0)}
MACHINE = platform.machine()
TAG = f"manylinux_2_34_{MACHINE}"
FIRST = "GLIBC_2.17" if MACHINE == "aarch64" else "GLIBC_2.2.5"  # of glibc's versions
# Functions that got another version for what no caller here sees (errno, noexcept), and the one that they had.
LOWERED = {("libm.so.6", "GLIBC_2.35"): (FIRST, {"hypot", "hypotf"}),
           ("libstdc++.so.6", "GLIBCXX_3.4.30"):
               ("GLIBCXX_3.4.11", {"_ZNSt18condition_variable4waitERSt11unique_lockISt5mutexE"})}
# Of what is packed. A wheel's deflate packs oneDNN to 11 MB, xz to 7.
MOST_BYTES = {".whl": 53_000_000, ".xz": 40_000_000}
# Their licence asks nothing of what they are compiled into.
HEADERS_ONLY_OF_THE_COMPILER = re.compile(r"glibc|linux|gcc-\d+")
SOURCE = pathlib.Path(__file__).resolve().parents[2]
LICENCES = "share/doc/eventgan/licences"


def said(*command: str | os.PathLike) -> str:
    return subprocess.run(list(map(str, command)), check=True, stdout=subprocess.PIPE, text=True).stdout


def is_elf(path: pathlib.Path) -> bool:
    with path.open("rb") as file:
        return file.read(4) == b"\x7fELF"


class Elf:
    """What the dynamic linker reads of a file."""

    def __init__(self, path: pathlib.Path) -> None:
        self.path = path
        headers = said("objdump", "-p", path)
        self.needed = re.findall(r"(?m)^  NEEDED +(\S+)", headers)
        self.searched = [place for text in re.findall(r"(?m)^  R(?:UN)?PATH +(\S+)", headers)
                         for place in text.split(":")]
        # [(library, version)]
        self.versions = []
        for library, lines in re.findall(r"(?m)^  required from (\S+):\n((?:    .*\n)+)", headers):
            self.versions += [(library, version) for version in re.findall(r"(?m)(\S+)$", lines)]

    def users(self, version: str) -> set[str]:
        """The functions that are wanted in this version."""
        return set(re.findall(rf"\*UND\*.*\({re.escape(version)}\) +(\S+)", said("objdump", "-T", self.path)))


def elf_hash(name: bytes) -> int:
    """As the System V ABI has it."""
    value = 0
    for byte in name:
        value = (value << 4) + byte
        high = value & 0xF0000000
        value = (value ^ (high >> 24)) & ~high & 0xFFFFFFFF
    return value


def lower_versions(path: pathlib.Path) -> None:
    """Asks for LOWERED's functions in the version that they had before, which a newer library has, too."""
    elf = Elf(path)
    wanted = {(library, version): LOWERED[library, version] for library, version in elf.versions
              if (library, version) in LOWERED and elf.users(version) <= LOWERED[library, version][1]}
    if not wanted:
        return
    content = bytearray(path.read_bytes())
    (table,) = struct.unpack_from("<Q", content, 40)
    entry_size, count = struct.unpack_from("<HH", content, 58)
    sections = [struct.unpack_from("<IIQQQQII", content, table + i * entry_size) for i in range(count)]
    (needs,) = [section for section in sections if section[1] == 0x6FFFFFFE]  # SHT_GNU_verneed
    strings_at, strings_size = sections[needs[6]][4:6]
    strings = bytes(content[strings_at:strings_at + strings_size])

    def text(at: int) -> str:
        return strings[at:strings.index(b"\0", at)].decode()

    library_at = needs[4]
    while True:
        _, _, library, first, following = struct.unpack_from("<HHIII", content, library_at)
        version_at = library_at + first
        while True:
            _, _, _, name, next_version = struct.unpack_from("<IHHII", content, version_at)
            if (text(library), text(name)) in wanted:
                lower = wanted[text(library), text(name)][0].encode()
                struct.pack_into("<I", content, version_at, elf_hash(lower))
                struct.pack_into("<I", content, version_at + 8, strings.index(b"\0" + lower + b"\0") + 1)
            if not next_version:
                break
            version_at += next_version
        if not following:
            break
        library_at += following
    path.write_bytes(content)


def loaded(path: pathlib.Path) -> dict[str, pathlib.Path]:
    """Libraries by the name under which they are loaded, directly or not, where the system does not have them."""
    found = {}
    for name, where in re.findall(r"(?m)^\t(\S+) => (not found|\S+)", said("ldd", path)):
        if name in SYSTEM:
            continue
        if where == "not found":
            sys.exit(f"expected the library {name}, got none, for {path}")
        found[name] = pathlib.Path(where).resolve()
    return found


def install(build: pathlib.Path, tree: pathlib.Path) -> dict[str, pathlib.Path]:
    """The tree, complete but for the licences. Returns the libraries that were copied, by their names in the tree."""
    shutil.rmtree(tree, ignore_errors=True)
    for component in ("eventgan", "library", "python", "development"):
        said("cmake", "--install", build, "--prefix", tree, "--strip", "--component", component)
    (tree / "lib" / "libeventgan.so").unlink()  # a link, which a wheel cannot hold
    own = [tree / "bin" / "eventgan", tree / "lib" / "libeventgan.so.1"]
    # Where they were built, since what is installed finds not everything.
    libraries = {name: path for file in ("eventgan", "libeventgan.so.1") for name, path in loaded(build / file).items()}
    folder = tree / "lib" / "eventgan"
    folder.mkdir()
    copies, renamed = {}, []
    for name, path in sorted(libraries.items()):
        mark = hashlib.sha256(path.read_bytes()).hexdigest()[:8]
        copies[f"{name}.{mark}"] = path
        renamed += ["--replace-needed", name, f"{name}.{mark}"]
    for name, path in copies.items():
        shutil.copyfile(path, folder / name)
        (folder / name).chmod(0o755)
        said("strip", "--strip-unneeded", folder / name)
        said("patchelf", "--set-soname", name, folder / name)
    for path in [*own, *folder.iterdir()]:
        # One after the other: together, patchelf 0.14 takes one's text for another's.
        said("patchelf", *renamed, path)
        place = os.path.join("$ORIGIN", os.path.relpath(folder, path.parent)).removesuffix("/.")
        said("patchelf", "--set-rpath", place, path)
        lower_versions(path)
    return copies


def faults(tree: pathlib.Path) -> list[str]:
    """Why another Linux would not take it."""
    result = []
    for path in sorted(path for path in tree.rglob("*") if path.is_file() and is_elf(path)):
        elf, name = Elf(path), path.relative_to(tree)
        places = []
        for place in elf.searched:
            inside = (re.fullmatch(r"\$ORIGIN(/.*)?", place) and
                      (path.parent / ("." + place.removeprefix("$ORIGIN"))).resolve())
            if not inside or not inside.is_relative_to(tree.resolve()):
                result.append(f"expected a search path inside, $ORIGIN, got {place}, in {name}")
            else:
                places.append(inside)
        result += [f"expected the library {library} beside it, got none, for {name}" for library in elf.needed
                   if library not in SYSTEM and not any((place / library).exists() for place in places)]
        for library, version in elf.versions:
            kind, _, number = version.partition("_")
            newest = NEWEST.get(kind, ())
            known = re.fullmatch(r"[\d.]+", number) and tuple(map(int, number.split("."))) <= newest
            if library in SYSTEM and not known:
                result.append(f"expected no version newer than {kind}_{'.'.join(map(str, newest))}, got {version} of "
                              f"{library} ({', '.join(sorted(elf.users(version)))}), in {name}")
    return result


def owners(paths: set[str]) -> dict[str, str]:
    """The Debian packages of files."""
    result = {}
    done = subprocess.run(["dpkg-query", "--search", *sorted(paths)], stdout=subprocess.PIPE,
                          stderr=subprocess.DEVNULL, text=True, check=False)  # it fails for what is nobody's
    for line in done.stdout.splitlines():
        package, _, path = line.partition(": ")
        result[path] = package.split(",")[0]
    return result


def packed_files(build: pathlib.Path, copies: dict[str, pathlib.Path]) -> set[str]:
    """Files of the system that are in the tree or were compiled or linked into it."""
    files = {str(path) for path in copies.values() if build not in path.parents}
    for command in said("ninja", "-C", build, "-t", "commands", "eventgan", "libeventgan").splitlines():
        files |= {str(pathlib.Path(name).resolve()) for name in re.findall(r"(?<= )/usr/\S+\.a(?= |$)", command)}
    headers = re.findall(r"(?m)^    (/usr/include/\S+)", said("ninja", "-C", build, "-t", "deps"))
    return files | {os.path.realpath(name) for name in set(headers)}


def add_licences(build: pathlib.Path, tree: pathlib.Path, copies: dict[str, pathlib.Path]) -> list[str]:
    """Returns what is missing."""
    folder, missing = tree / LICENCES, []
    folder.mkdir(parents=True)
    files = packed_files(build, copies)
    # /lib is /usr/lib, and dpkg may know a file by either.
    package_of = owners(files | {name.removeprefix("/usr") for name in files if name.startswith("/usr/lib/")})
    packages = set()
    for name in sorted(files):
        # What the system's alternatives chose lies in a folder of its package.
        package = package_of.get(name) or package_of.get(name.removeprefix("/usr"))
        if package:
            packages.add(package)
        else:
            missing.append(f"expected the Debian package of {name}, got none")
    texts = []
    for package in sorted(packages):
        source = said("dpkg-query", "--show", "--showformat", "${source:Package}", package)
        copyright = pathlib.Path("/usr/share/doc") / package.split(":")[0] / "copyright"
        if HEADERS_ONLY_OF_THE_COMPILER.fullmatch(source) and not any(
                package_of.get(str(path)) == package for path in copies.values()):
            continue
        if not copyright.exists():
            missing.append(f"expected {copyright}, got none, for what is packed of {package}")
            continue
        shutil.copyfile(copyright, folder / source)
        texts.append(copyright.read_text(errors="replace"))
    for copyright in build.glob("ffmpeg/ffmpeg-*/debian/copyright"):
        shutil.copyfile(copyright, folder / "ffmpeg")
        texts.append(copyright.read_text(errors="replace"))
    # What Debian's files only point to.
    (folder / "common-licenses").mkdir()
    common = re.compile(r"/usr/share/common-licenses/([A-Za-z0-9.+-]*[A-Za-z0-9])")
    for name in sorted({name for text in texts for name in common.findall(text)}):
        if pathlib.Path("/usr/share/common-licenses", name).exists():
            shutil.copyfile(f"/usr/share/common-licenses/{name}", folder / "common-licenses" / name)
        else:
            missing.append(f"expected /usr/share/common-licenses/{name}, got none")
    return missing


def metadata(project: dict, version: str) -> str:
    lines = ["Metadata-Version: 2.1", f"Name: {project['name']}", f"Version: {version}",
             f"Summary: {project['description']}", "License: MIT; GPL-2.0-or-later with FFmpeg and x264 inside",
             f"Requires-Python: {project['requires-python']}", "Requires-Dist: numpy", "Requires-Dist: h5py>=3",
             "Description-Content-Type: text/markdown"]
    for extra, packages in project["optional-dependencies"].items():
        lines.append(f"Provides-Extra: {extra}")
        lines += [f'Requires-Dist: {package}; extra == "{extra}"' for package in packages]
    return "\n".join(lines) + "\n\n" + (SOURCE / "README.md").read_text(encoding="utf-8")


def files_of(folder: pathlib.Path) -> list[tuple[str, bytes, bool]]:
    """(path, content, whether it can be run), sorted. Links become what they point to."""
    return [(str(path.relative_to(folder)), path.read_bytes(), os.access(path, os.X_OK))
            for path in sorted(folder.rglob("*")) if path.is_file()]


def write_wheel(tree: pathlib.Path, out: pathlib.Path, version: str) -> pathlib.Path:
    """The same bytes of the same files."""
    project = tomllib.loads((SOURCE / "manifests" / "python" / "pyproject.toml").read_text())["project"]
    package = "lib/python3/dist-packages/eventgan/"
    info = f"eventgan-{version}.dist-info"
    content = []
    for name, data, runs in files_of(tree):
        content.append((f"eventgan/{name.removeprefix(package)}", data, runs and is_program(name)))
    form = f"Wheel-Version: 1.0\nGenerator: eventgan\nRoot-Is-Purelib: false\nTag: py3-none-{TAG}\n"
    content += [(f"{info}/METADATA", metadata(project, version).encode(), False),
                (f"{info}/WHEEL", form.encode(), False),
                (f"{info}/entry_points.txt", b"[console_scripts]\neventgan = eventgan.__main__:main\n", False),
                (f"{info}/LICENSE", (SOURCE / "LICENSE").read_bytes(), False)]
    record = io.StringIO()
    rows = csv.writer(record, lineterminator="\n")
    for name, data, _ in content:
        digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
        rows.writerow([name, f"sha256={digest}", len(data)])
    rows.writerow([f"{info}/RECORD", "", ""])
    content.append((f"{info}/RECORD", record.getvalue().encode(), False))
    path = out / f"eventgan-{version}-py3-none-{TAG}.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for name, data, runs in content:
            entry = zipfile.ZipInfo(name)  # of 1980
            entry.external_attr = (0o100755 if runs else 0o100644) << 16
            archive.writestr(entry, data, zipfile.ZIP_DEFLATED, 9)
    return path


def is_program(name: str) -> bool:
    return name.startswith("bin/") or ".so" in name or name.endswith((".sh", ".py"))


def write_archive(tree: pathlib.Path, out: pathlib.Path, version: str) -> pathlib.Path:
    """Likewise, and without owners and times."""
    name = f"eventgan-{version}-linux-{MACHINE}"
    path = out / f"{name}.tar.xz"
    # Two streams of xz, which tar and xz read as one: jumps in x86's code by where they lead are 4 % less, weights as
    # numbers of four bytes 8 %.
    most = {"id": lzma.FILTER_LZMA2, "preset": 9 | lzma.PRESET_EXTREME}
    code = [{"id": lzma.FILTER_X86}, most] if MACHINE == "x86_64" else [most]
    numbers = [{**most, "lc": 2, "lp": 2}]
    content = io.BytesIO()
    with tarfile.open(fileobj=content, mode="w") as archive:
        for file, data, runs in sorted(files_of(tree), key=lambda entry: is_weights(entry[0])):
            if is_weights(file):
                begin = archive.offset
            entry = tarfile.TarInfo(f"{name}/{file}")
            entry.size, entry.mode = len(data), 0o755 if runs else 0o644
            archive.addfile(entry, io.BytesIO(data))
    with content.getbuffer() as whole, path.open("wb") as packed:
        for part, filters in ((whole[:begin], code), (whole[begin:], numbers)):
            packed.write(lzma.compress(part, filters=filters))
    return path


def is_weights(name: str) -> bool:
    return "libeventgan-weights" in name


def main() -> None:
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    build = pathlib.Path(sys.argv[1]).resolve()
    version = re.search(r"(?m)^CMAKE_PROJECT_VERSION:STATIC=(.*)$", (build / "CMakeCache.txt").read_text())[1]
    tree = build / "tree"
    copies = install(build, tree)
    wrong = add_licences(build, tree, copies) + faults(tree)
    if wrong:
        sys.exit("\n".join(wrong))
    for path in (write_wheel(tree, build, version), write_archive(tree, build, version)):
        size = path.stat().st_size
        print(f"{path}: {size / 1e6:.1f} MB")
        if size > MOST_BYTES[path.suffix]:
            wrong.append(f"expected at most {MOST_BYTES[path.suffix] / 1e6:g} MB, got {size / 1e6:.1f}, of {path}")
    if wrong:
        sys.exit("\n".join(wrong))


if __name__ == "__main__":
    main()

#!/usr/bin/python3
"""What a stranger's machine does, tried in a bare Debian that debootstrap makes from the mirror of this machine's apt:

    bare_debian.py suite [RELEASE]             the README's two commands (default: in the other Debian, of 12 and 13)
    bare_debian.py image [RELEASE] [TARGET]    docker/Dockerfile, instruction by instruction (default: trixie, without
                                               LibTorch); then its program makes a dataset. Prints the image's size.

Needs root, debootstrap, about 6 GB in $TMPDIR (default: /var/tmp), and the time of a build from nothing. It is no
container: processes and network are the machine's.
"""

import copy
import json
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import tempfile

SOURCE = pathlib.Path(__file__).resolve().parents[2]
SKIPPED = 77  # what ctest knows as skipped
# What makes Docker's images slim, as the two files in them have it.
LEFT_OUT = ["usr/share/doc", "usr/share/info", "usr/share/locale", "usr/share/man"]
SLIM = {"etc/dpkg/dpkg.cfg.d/docker": "".join(f"path-exclude /{folder}/*\n" for folder in LEFT_OUT) +
        "path-include /usr/share/doc/*/copyright\n",
        "etc/apt/apt.conf.d/docker-clean": 'DPkg::Post-Invoke { "rm -f /var/cache/apt/archives/*.deb || true"; };\n'
        'Dir::Cache::pkgcache "";\nDir::Cache::srcpkgcache "";\n'}
PATH = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
PASSED_ON = ["JOBS", "http_proxy", "https_proxy", "no_proxy"]


def call(*command, **how):
    print("+", shlex.join(map(str, command)), flush=True)
    return subprocess.run(list(map(str, command)), check=True, **how)


def said(*command):
    return subprocess.run(list(map(str, command)), check=True, capture_output=True, text=True).stdout


def this_release():
    return re.search(r"(?m)^VERSION_CODENAME=(\w+)", pathlib.Path("/etc/os-release").read_text())[1]


def mirror():
    """Where this machine gets its Debian from."""
    lines = said("apt-get", "indextargets", "--format", "$(CODENAME) $(REPO_URI)", "Created-By: Packages").splitlines()
    return dict(reversed([line.split() for line in lines]))[this_release()]  # the first of several


class Tree:
    """A folder that commands take for the root of their file system. The rest is what a Dockerfile sets."""

    def __init__(self, root):
        self.root, self.folder, self.user, self.entrypoint = pathlib.Path(root), "/", "0:0", []

    def at(self, *parts):
        """A path inside, as it is outside."""
        return self.root.joinpath(*(str(part).lstrip("/") for part in parts))

    def debootstrap(self, release, slim):
        call("debootstrap", "--variant=minbase", release, self.root, mirror())
        if slim:
            for name, text in SLIM.items():
                self.at(name).write_text(text)
            call("sh", "-ec", f"cd $0; rm -rf {' '.join(LEFT_OUT)} var/lib/apt/lists/* var/cache/apt/*.bin "
                 "var/cache/apt/archives/*.deb", self.root)
        for name in ("hosts", "resolv.conf"):
            shutil.copy(f"/etc/{name}", self.at("etc", name))
        return self

    def run(self, command, mounts=(), read_only=False):
        """A shell's command inside. `mounts` are pairs of folders, outside and inside."""
        mounted = [("--bind", self.root, "/"), ("-t", "proc", "proc", "/proc"), ("-t", "tmpfs", "tmpfs", "/dev/shm"),
                   ("-t", "devpts", "-o", "newinstance,ptmxmode=0666", "devpts", "/dev/pts"),
                   *(("--bind", outside, inside) for outside, inside in mounts)]
        for *how, inside in mounted:
            self.at(inside).mkdir(parents=True, exist_ok=True)
            said("mount", *how, self.at(inside))
        if read_only:
            said("mount", "-o", "remount,bind,ro", self.root)
        settings = [f"{name}={os.environ[name]}" for name in PASSED_ON if name in os.environ]
        try:
            call("chroot", f"--userspec={self.user}", self.root,
                 "env", "-i", f"PATH={PATH}", "HOME=/root", "TERM=xterm", *settings,
                 "sh", "-ec", f"cd {shlex.quote(self.folder)}\n{command}", stdin=subprocess.DEVNULL)
        finally:
            said("umount", "--recursive", self.root)

    def size(self):
        """(MB on disk, number of packages)"""
        return (int(said("du", "--summarize", "--block-size=1M", "--one-file-system", self.root).split()[0]),
                len(said("chroot", self.root, "dpkg-query", "--show").splitlines()))


def copy_sources(folder):
    """What git has of them or would take."""
    for name in said("git", "-C", SOURCE, "ls-files", "--cached", "--others", "--exclude-standard").splitlines():
        if (SOURCE / name).exists():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(SOURCE / name, folder / name)


def suite(top, release=None):
    commands = re.findall(r"(?m)^    (docker/bootstrap\.sh (?:demo|test))\b", (SOURCE / "README.md").read_text())
    assert len(commands) == 2, commands
    release = release or {"bookworm": "trixie", "trixie": "bookworm"}[this_release()]
    tree = Tree(top / "tree").debootstrap(release, slim=False)
    tree.folder = "/src"
    copy_sources(tree.at(tree.folder))
    for command in commands:
        tree.run(command)


class Dockerfile:
    """docker/Dockerfile's stages, each made when it is needed. The instructions that are here are all that it may
    use."""

    def __init__(self, top, release):
        self.top, self.release, self.stages, self.made = top, release, {}, {}
        self.debian = None  # the base image's size
        text = re.sub(r"\\\n\s*", "", (SOURCE / "docker" / "Dockerfile").read_text())
        for instruction, rest in (line.split(maxsplit=1) for line in text.splitlines() if line and line[0] != "#"):
            if instruction == "FROM":
                base, _, name = rest.replace("${DEBIAN}", release).partition(" AS ")
                self.stages[name] = (base, [])
            elif instruction != "ARG":
                self.stages[name][1].append((instruction, rest))

    def stage(self, name):
        """Its tree. The last stage, which has no name, is "" here."""
        if name not in self.made:
            base, instructions = self.stages[name]
            self.made[name] = self.begun(base)
            for instruction, rest in instructions:
                self.do(self.made[name], instruction, rest)
        return self.made[name]

    def begun(self, base):
        if base in self.stages:
            tree = copy.copy(self.stage(base))
            tree.root = self.top / f"stage-{len(self.made)}"
            call("cp", "--archive", self.made[base].root, tree.root)
        else:
            assert base == f"debian:{self.release}-slim", base
            tree = Tree(self.top / f"stage-{len(self.made)}").debootstrap(self.release, slim=True)
            self.debian = tree.size()
        return tree

    def do(self, tree, instruction, rest):
        if instruction == "WORKDIR":
            tree.folder = rest
            tree.at(rest).mkdir(parents=True, exist_ok=True)
        elif instruction == "COPY":
            source, there = rest.split()
            there = tree.at(tree.folder, there)
            if source == ".":
                copy_sources(there)
            elif (SOURCE / source).is_dir():
                shutil.copytree(SOURCE / source, there, dirs_exist_ok=True)
            else:
                there.mkdir(parents=True, exist_ok=True)
                shutil.copy(SOURCE / source, there)
        elif instruction == "RUN":
            mount = re.match(r"--mount=type=bind,from=(\w+),source=(\S+),target=(\S+) ", rest)
            command = rest[mount.end():] if mount else rest
            tree.run(command, [(self.stage(mount[1]).at(mount[2]), mount[3])] if mount else [])
        elif instruction == "USER":
            tree.user = rest
        else:
            assert instruction == "ENTRYPOINT", instruction
            tree.entrypoint = json.loads(rest)


def image(top, release="trixie", target=""):
    dockerfile = Dockerfile(top, release)
    tree = dockerfile.stage(target)
    debian = dockerfile.debian
    size = tree.size()
    # As `docker run --read-only --volume DATA:/data`.
    data = top / "data"
    data.mkdir()
    os.chown(data, *map(int, tree.user.split(":")))
    for arguments in ("--version", "make-demo demo --scenes 10", "convert demo/manifest.json --output events",
                      "finalize events"):
        tree.run(f"{shlex.join(tree.entrypoint)} {arguments}", [(data, tree.folder)], read_only=True)
    print(f"{release}, {target or 'default target'}: {size[0]} MB, {size[1]} packages; "
          f"of these Debian's own are {debian[0]} MB, {debian[1]} packages")


def main():
    missing = [name for name in ("apt-get", "debootstrap", "git", "unshare") if not shutil.which(name)]
    if missing or os.geteuid() != 0:
        print(f"skipped: no {', '.join(missing) or 'root'}")
        sys.exit(SKIPPED)
    if sys.argv[1:2] not in (["suite"], ["image"]):
        sys.exit(__doc__)
    if "BARE_DEBIAN" not in os.environ:  # again, where mounts are gone with the last process
        os.execvpe("unshare", ["unshare", "--mount", sys.executable, *sys.argv], {**os.environ, "BARE_DEBIAN": "1"})
    top = pathlib.Path(tempfile.mkdtemp(prefix="eventgan-", dir=os.environ.get("TMPDIR", "/var/tmp")))
    try:
        {"suite": suite, "image": image}[sys.argv[1]](top, *sys.argv[2:])
    finally:
        call("rm", "--recursive", "--force", "--one-file-system", top)


if __name__ == "__main__":
    main()

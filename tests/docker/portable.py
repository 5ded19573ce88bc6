#!/usr/bin/python3
"""What `docker/bootstrap.sh wheel` packed, tried where nothing of it was built:

    portable.py BUILD [RELEASE...]    BUILD's files, in a bare Debian of each release (default: bookworm trixie sid)

Each time a user without rights unpacks the archive where there is no Python, then installs the wheel where there is
Python, NumPy and h5py: a dataset and a video are converted, finalized, reported, exported, the README's Python run, and
the volumes must be those of the program EVENTGAN_PROGRAM (a build's, with Debian's libraries) bit for bit. On x86-64,
one conversion runs as on an x86-64-v2 processor, where qemu-x86_64 is. Ubuntu, Fedora and others cannot be had from
Debian's mirrors: docker/wheel/pack.py's check of versions stands for them.

Needs what bare_debian.py needs, h5py and 3 GB. Exit code 77: something of that, or BUILD's files, is missing.
"""

import os
import pathlib
import platform
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile

import bare_debian

PROGRAM = os.path.abspath(os.environ.get("EVENTGAN_PROGRAM", bare_debian.SOURCE / "build" / "release" / "eventgan"))
MOST_S = {"program": 0.1, "command": 0.1, "import": 0.1}  # of a processor for one start, the quickest of ten
JOB = """
eventgan make-demo demo --scenes 2 --progress none
sed -i s/float16/float32/ demo/manifest.json
eventgan convert demo/manifest.json --output labelled --progress none
eventgan finalize labelled
eventgan preview labelled --out images --video
eventgan init images/*.mp4 --out clip.json
sed -i s/float16/float32/ clip.json
eventgan convert clip.json --output clip --progress none
for made in labelled clip; do eventgan finalize $made; eventgan report $made; done
eventgan export labelled --to yolo --out yolo --progress none
eventgan train "$(find . -path '*/examples/train.json')" --output none 2>said && exit 1
grep 'expected eventgan-torch, got none in .*: install ' said
"""
PYTHON = """
import resource, subprocess, sys
def used():
    return sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
def quickest(*command):
    took = []
    for _ in range(10):
        begin = used()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        took.append(used() - begin)
    return min(took)
bare = quickest(sys.executable, "-c", "pass")
program = sys.argv[1]
print("start", "program", quickest(program, "--version"))
print("start", "command", quickest("eventgan", "--version"))
print("start", "import", quickest(sys.executable, "-c", "import eventgan") - bare)
import numpy as np
images = np.random.default_rng(0).integers(0, 256, (2, 120, 160), np.uint8)
previous, following = images
%s
assert volume.shape == (18, 120, 160) and volume.dtype == np.float32 and len(events)
assert sum(1 for sample in eventgan.Shards("labelled")) == 30
eventgan.convert("demo/manifest.json", "again")
"""


def volumes(folder):
    """All float32 volumes by shard and slot."""
    import h5py
    result = {}
    for path in sorted(pathlib.Path(folder).glob("*-of-*.h5")):
        with h5py.File(path) as shard:
            result[path.name] = shard["events/volume"][()]
    assert result, folder
    return result


def differences(made, expected):
    """(the largest difference of any value, the number of values that differ at all)"""
    assert made.keys() == expected.keys(), (made.keys(), expected.keys())
    pairs = [(made[name], expected[name]) for name in made]
    return (max(float(abs(one - other).max()) for one, other in pairs),
            sum(int((one != other).sum()) for one, other in pairs))


def do_job(folder, program):
    """JOB on this machine."""
    folder.mkdir()
    (folder / "bin").mkdir()
    (folder / "bin" / "eventgan").symlink_to(program)
    # Where it is built, train finds its LibTorch.
    bare_debian.call("sh", "-ec", JOB.split("eventgan train")[0], cwd=folder, stdout=subprocess.DEVNULL,
                     env={**os.environ, "PATH": f"{folder}/bin:{os.environ['PATH']}"})


def unpack(archive, folder):
    with tarfile.open(archive) as file:
        file.extractall(folder)
    (unpacked,) = folder.glob("eventgan-*-linux-*")
    return unpacked


def user_of(tree, name):
    """Goes on in a folder of a user without rights, as one."""
    tree.folder, tree.user = f"/home/{name}", "1000:1000"
    tree.at(tree.folder).mkdir()
    return tree.at(tree.folder)


def run(tree, command):
    tree.run(f'export HOME="$PWD" PATH="$PWD/bin:$PATH"\n{command}')


def own(tree, home):
    bare_debian.said("chown", "--recursive", tree.user, home)


def try_release(top, release, wheel, archive, expected):
    tree = bare_debian.Tree(top / release).debootstrap(release, slim=False)

    home = user_of(tree, "archive")
    unpack(archive, home).rename(home / "unpacked")
    own(tree, home)
    run(tree, f'ln -s unpacked/bin bin; ! command -v python3\n{JOB}')
    for name, those in expected.items():
        assert differences(volumes(home / name), those) == (0, 0), (release, name)
    bare_debian.said("rm", "--recursive", home)

    tree.folder, tree.user = "/", "0:0"
    # sid's lists are valid for a week, and a mirror may be behind.
    tree.run("apt-get -o Acquire::Check-Valid-Until=false update -qq\n"
             "apt-get install -y -qq --no-install-recommends python3-venv python3-h5py >/dev/null")
    home = user_of(tree, "wheel")
    shutil.copy(wheel, home)
    readme = (bare_debian.SOURCE / "README.md").read_text(encoding="utf-8")
    (home / "try.py").write_text(PYTHON % "".join(re.sub("(?m)^    ", "", block) for block in re.findall(
        r"(?m)^    import eventgan\n(?:(?:    .*)?\n)*", readme)))
    own(tree, home)
    run(tree, f"""python3 -m venv --system-site-packages .
pip install --quiet --no-index --no-deps ./*.whl
{JOB}
python3 -m eventgan --version
python3 try.py "$(echo lib/python3*/site-packages/eventgan/bin/eventgan)" >told""")
    for name, those in {**expected, "again": expected["labelled"]}.items():
        assert differences(volumes(home / name), those) == (0, 0), (release, name)
    for name, took in re.findall(r"(?m)^start (\w+) (\S+)$", (home / "told").read_text()):
        print(f"{release}: {name} starts in {float(took):.3f} s")
        assert float(took) < MOST_S[name], (release, name, took)


def try_old_processor(top, archive, expected):
    """x86-64-v2: no AVX, no FMA."""
    emulator = shutil.which("qemu-x86_64")
    if not emulator or platform.machine() != "x86_64":
        print("skipped: no qemu-x86_64, or no x86-64, for an old processor")
        return
    folder = top / "old"
    folder.mkdir()
    program = [emulator, "-cpu", "Nehalem", unpack(archive, folder) / "bin" / "eventgan"]
    bare_debian.call(*program, "--version")
    bare_debian.call(*program, "convert", top / "expected" / "demo" / "manifest.json", "--output", folder / "labelled",
                     "--shards", "0/5", "--progress", "none")
    made = volumes(folder / "labelled")
    most, count = differences(made, {name: expected["labelled"][name] for name in made})
    print(f"x86-64-v2: {count} values differ, by {most:.1e} at most")
    assert most < 1e-4, most


def main():
    missing = [name for name in ("apt-get", "debootstrap", "unshare") if not shutil.which(name)]
    build = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "")
    wheels, archives = sorted(build.glob("*.whl")), sorted(build.glob("eventgan-*-linux-*.tar.xz"))
    if missing or os.geteuid() != 0 or not wheels or not archives:
        print(f"skipped: no {', '.join(missing)}" if missing else "skipped: no root" if os.geteuid() != 0 else
              f"skipped: no wheel and archive in {build}: docker/bootstrap.sh wheel")
        sys.exit(bare_debian.SKIPPED)
    if "BARE_DEBIAN" not in os.environ:  # again, where mounts are gone with the last process
        os.execvpe("unshare", ["unshare", "--mount", sys.executable, *sys.argv], {**os.environ, "BARE_DEBIAN": "1"})
    top = pathlib.Path(tempfile.mkdtemp(prefix="eventgan-", dir=os.environ.get("TMPDIR", "/var/tmp")))
    top.chmod(0o755)
    try:
        do_job(top / "expected", PROGRAM)
        expected = {name: volumes(top / "expected" / name) for name in ("labelled", "clip")}
        try_old_processor(top, archives[-1], expected)
        for release in sys.argv[2:] or ["bookworm", "trixie", "sid"]:
            try_release(top, release, wheels[-1], archives[-1], expected)
            bare_debian.said("rm", "--recursive", "--force", "--one-file-system", top / release)
    finally:
        bare_debian.said("rm", "--recursive", "--force", "--one-file-system", top)


if __name__ == "__main__":
    main()

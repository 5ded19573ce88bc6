"""libeventgan as other languages meet it: the functions it shows, the libraries it loads, the C example; and the same
bytes from C, from the Python package, and from ctypes without it."""

import ctypes
import os
import pathlib
import re
import subprocess
import sys

import numpy as np
import pytest

import eventgan

SOURCE = pathlib.Path(__file__).resolve().parents[3] / "pipeline" / "library"
BUILD = pathlib.Path(os.environ["EVENTGAN_BUILD"])
LIBRARY = BUILD / "libeventgan.so.1"
IMAGES = np.random.default_rng(4).integers(0, 256, (2, 37, 53), np.uint8)
pytestmark = pytest.mark.filterwarnings("ignore:shipped.*stand-in")
MANIFEST = '{"generator": {"weights": "shipped:8"}}'


def run(*command, **how):
    done = subprocess.run(list(map(str, command)), capture_output=True, **how)
    assert done.returncode == 0, done.stderr
    return done


def declared():
    return set(re.findall(r"^EVENTGAN_API [\w ]+\*?[ ](eventgan_\w+)\(", (SOURCE / "eventgan.h").read_text(), re.M))


def test_it_shows_what_the_header_declares_and_nothing_else():
    lines = run("nm", "--dynamic", "--defined-only", LIBRARY).stdout.decode().splitlines()
    names = {line.split()[2].split("@")[0] for line in lines if line.split()[1] != "A"}  # A: the version's own name
    assert len(names) == 15
    assert names == declared()
    dynamic = run("readelf", "--dynamic", LIBRARY).stdout.decode()
    assert "(SONAME)             Library soname: [libeventgan.so.1]" in dynamic
    needed = re.findall(r"\(NEEDED\).*\[(.+)\]", dynamic)
    assert [name for name in needed if name.startswith("libdnnl.")] or "without" in eventgan.Generator().description
    assert [name for name in needed
            if re.match(r"lib(torch|c10|hdf5|av|sw|tbb|matio|python|opencv_(?!core|imgproc))", name)] == []


def test_the_example_in_c(tmp_path):
    (tmp_path / "eventgan.h").symlink_to(SOURCE / "eventgan.h")
    example = tmp_path / "example"
    run(os.environ["CC"], "-std=c11", "-pedantic", "-Wall", "-Wextra", "-Werror", SOURCE / "example.c", "-I", tmp_path,
        "-L", BUILD, "-leventgan", f"-Wl,-rpath,{BUILD}", "-o", example)
    assert len((SOURCE / "example.c").read_text().splitlines()) <= 50
    for number, image in enumerate(IMAGES):
        (tmp_path / f"{number}.pgm").write_bytes(b"P5 53 37 255\n" + image.tobytes())
    done = run(example, "0.pgm", "1.pgm", cwd=tmp_path)
    volume = eventgan.Generator("shipped:8", precision="float32")(*IMAGES)
    assert done.stdout == volume.tobytes() and volume.any()
    events = eventgan.sample_events(volume, duration_s=0.1)
    assert [tuple(map(float, line.split())) for line in done.stderr.decode().splitlines()] == [
        (round(float(t), 9), x, y, p) for t, x, y, p in events.tolist()]
    (tmp_path / "bad.pgm").write_bytes(b"P5 53 40 255\n" + bytes(53 * 40))
    refused = subprocess.run([example, "0.pgm", "bad.pgm"], cwd=tmp_path, capture_output=True, text=True)
    assert refused.returncode == 64
    assert "expected as many images of one size, got 1 of (37, 53) and 1 of (40, 53)" in refused.stderr


def test_ctypes_without_the_package():
    class Images(ctypes.Structure):
        _fields_ = [("data", ctypes.c_void_p), ("count", ctypes.c_int64), ("height", ctypes.c_int64),
                    ("width", ctypes.c_int64), ("strides", ctypes.c_int64 * 4), ("channels", ctypes.c_int32),
                    ("number", ctypes.c_int32)]
    library, generator = ctypes.CDLL(str(LIBRARY)), ctypes.c_void_p()
    library.eventgan_version.restype = ctypes.c_char_p
    assert library.eventgan_version().decode() == eventgan.__version__
    assert library.eventgan_load(MANIFEST.encode(), ctypes.byref(generator)) == 0
    previous, following = (Images(image.ctypes.data, 1, 37, 53, (0, 53, 1, 0), 1, 0) for image in IMAGES)
    volume = np.empty((18, 37, 53), np.float32)
    assert library.eventgan_generate(generator, ctypes.byref(previous), ctypes.byref(following),
                                     ctypes.c_uint64(0), ctypes.c_void_p(volume.ctypes.data),
                                     ctypes.c_uint64(volume.size), None, ctypes.c_int64(0)) == 0
    np.testing.assert_array_equal(volume, eventgan.Generator("shipped:8", precision="float32")(*IMAGES))
    library.eventgan_free(generator)


def test_any_other_python_gives_the_same_bytes():
    others = [path for folder in ("/usr/bin", "/usr/local/bin", os.path.expanduser("~/.local/bin"))
              for path in pathlib.Path(folder).glob("python3.[0-9]*") if re.fullmatch(r"python3\.\d+", path.name)]
    code = ("import numpy as np, eventgan, sys\n"
            "images = np.frombuffer(sys.stdin.buffer.read(), np.uint8).reshape(2, 37, 53)\n"
            "sys.stdout.buffer.write(eventgan.Generator('shipped:8', precision='float32')(*images).tobytes())")
    here = eventgan.Generator("shipped:8", precision="float32")(*IMAGES).tobytes()
    asked = 0
    for other in others:
        version = subprocess.run([other, "-c", "import numpy, sys; print(sys.version_info >= (3, 9))"],
                                 capture_output=True, text=True)
        if other.resolve() == pathlib.Path(sys.executable).resolve() or version.stdout != "True\n":
            continue
        asked += 1
        assert run(other, "-W", "ignore", "-c", code, input=IMAGES.tobytes()).stdout == here, other
    if not asked:
        pytest.skip("no other Python with NumPy")

"""eventgan.Shards at URLs: what it reads there, how little of it, and what it says of servers that fail."""

import contextlib
import email.utils
import hashlib
import html
import http.server
import json
import multiprocessing
import os
import pathlib
import pickle
import re
import subprocess
import sys
import threading

import h5py
import numpy as np
import pytest
from conftest import NAME, SECOND

fsspec = pytest.importorskip("fsspec")
pytest.importorskip("aiohttp")

from eventgan import InvalidSample, Shards, open_shard, open_shards
from eventgan.remote import RemotePath, place

LARGE = (5, 18, 64, 100)  # of volumes that are longer than a block


class Server:
    """A web server of a folder, with what it was asked for: (path, first byte, bytes)."""

    def __init__(self, folder):
        self.folder, self.asked = folder, []
        self.fault, self.faults, self.at = None, 0, ".h5"  # what goes wrong, how often, with paths that end so
        self.version, self.lists = "ETag", False
        server = self

        class Handler(http.server.BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def log_message(self, *_):
                pass

            def do_GET(self):
                server.answer(self)

            def do_HEAD(self):
                self.send_error(405)

        self._server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._server.daemon_threads = True
        self._server.handle_error = lambda *_: None  # of clients that have gone
        threading.Thread(target=self._server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()
        self.url = f"http://127.0.0.1:{self._server.server_port}"

    def close(self):
        self._server.shutdown()
        self._server.server_close()

    def goes_wrong(self, fault, times=10**6, at=".h5"):
        self.fault, self.faults, self.at = fault, times, at

    def answer(self, request):
        path = request.path.partition("?")[0]
        file = pathlib.Path(f"{self.folder}/{path}")
        fault = self.fault if self.faults > 0 and path.endswith(self.at) else None
        self.faults -= fault is not None
        if fault in (404, 500):
            return request.send_error(fault)
        if file.is_dir() and self.lists:
            data = "".join(f'<a href="{html.escape(name)}">' for name in os.listdir(file)).encode()
        elif file.is_file():
            data = file.read_bytes()
        else:
            return request.send_error(404)
        headers = {"ETag": f'"{hashlib.sha256(data).hexdigest()}"',
                   "Last-Modified": email.utils.formatdate(file.stat().st_mtime, usegmt=True)}
        whole, first = len(data), 0
        asked = re.fullmatch(r"bytes=(\d+)-(\d+)", request.headers.get("Range", ""))
        if asked and fault != "no ranges":
            first = int(asked[1]) - (fault == "another range")
            data = data[int(asked[1]) : int(asked[2]) + 1]
            request.send_response(206)
            request.send_header("Content-Range", f"bytes {first}-{first + len(data) - 1}/{whole}")
        else:
            request.send_response(200)
        if self.version:
            request.send_header(self.version, headers[self.version])
        if fault == "few bytes":
            data = data[:-1]
        request.send_header("Content-Length", str(len(data)))
        request.end_headers()
        self.asked.append((path.rpartition("/")[2], first, len(data)))
        if fault == "breaks off":
            data = data[: len(data) // 2]
            request.close_connection = True
        request.wfile.write(data)

    @contextlib.contextmanager
    def sends(self):
        """A list that gets what is sent within."""
        sent = []
        before = len(self.asked)
        yield sent
        sent.extend(self.asked[before:])


def bytes_of(sent):
    return sum(size for _, _, size in sent)


@pytest.fixture
def server(tmp_path):
    server = Server(tmp_path)
    yield server
    server.close()


def describe(folder):
    """As `eventgan finalize` does."""
    records = [json.loads(path.read_text()) for path in sorted(folder.glob("demo-*.json"))]
    entries = [{"name": record["shard"], "split": "train", "samples": 5, "sha256": record["sha256"],
                "size_bytes": (folder / record["shard"]).stat().st_size} for record in records]
    quarantined = [{"shard": record["shard"], "slot": 2} for record in records]
    (folder / "dataset.json").write_text(json.dumps({"format": "eventgan-dataset", "version": "1.0",
                                                     "shards": entries, "quarantined": quarantined}))


def enlarge(path, seed):
    """Puts volumes of noise into a shard."""
    with h5py.File(path, "r+") as file:
        attributes, scale = dict(file["events/volume"].attrs), file["events/scale"]
        del file["events/volume"]
        volumes = np.random.default_rng(seed).random(LARGE).astype(np.float16)
        file.create_dataset("events/volume", data=volumes, chunks=(1, *LARGE[1:]), shuffle=True,
                            fletcher32=True).attrs.update(attributes)
        scale[:] = 1
    with h5py.File(path) as file:
        return [file["events/volume"].id.get_chunk_info(slot).size for slot in range(LARGE[0])]


@pytest.fixture
def described(two_shards):
    describe(two_shards)
    return two_shards


@pytest.fixture
def large(described):
    """The same with volumes of 225 KiB."""
    for seed, name in enumerate((NAME, SECOND)):
        enlarge(described / name, seed)
    describe(described)
    return described


@pytest.fixture(params=["http", "memory"])
def remote(request, described):
    """The folder, and a URL of the same."""
    if request.param == "http":
        server = request.getfixturevalue("server")
        yield described, f"{server.url}/{described.name}"
        return
    memory = fsspec.filesystem("memory")
    memory.put(str(described), "/kept/out", recursive=True)
    yield described, "memory://kept/out"
    memory.rm("/kept", recursive=True)


def assert_same(ours, theirs):
    assert ours.keys() == theirs.keys()
    for key, value in ours.items():
        if isinstance(value, dict):
            assert_same(value, theirs[key])
        elif key != "shard":
            np.testing.assert_equal(value, theirs[key])


def assert_same_samples(ours, theirs):
    assert len(ours) == len(theirs) > 0
    for one, other in zip(ours, theirs):
        assert_same(one, other)


def test_a_url_is_read_as_the_folder_is(remote, tmp_path):
    folder, url = remote
    local, there = Shards(folder), Shards(url)
    assert_same_samples(local, there)
    assert [sample["shard"] for sample in there] == [f"{url}/{name}" for name in (NAME, SECOND) for _ in range(4)]
    assert repr(there) == f"<eventgan.Shards {url}: 8 samples of 2 shards>"
    assert str(there).splitlines()[1:] == str(local).splitlines()[1:]
    (tmp_path / "ids.txt").write_text("000003\n000000\n")
    few = {"fields": ["volume"]}
    for options in ({"split": "train"}, {"ids": ["000001"]}, {"ids": tmp_path / "ids.txt"}, {"invalid": "keep"},
                    {"where": {"class": "Car", "sequence": "drive_1"}}, {"decode": False}, {"open_files": 1}):
        assert_same_samples(Shards(folder, **few, **options), Shards(url, **few, **options))
    local, there = Shards(folder, **few), Shards(url, **few)
    assert_same_samples(local[5:1:-2], there[5:1:-2])
    assert_same_samples(local.divide(0.5)[1], there.divide(0.5)[1])
    np.testing.assert_array_equal(local.masks(0), there.masks(0))
    for given in (url + "/", url + "/dataset.h5", [f"{url}/{name}" for name in (NAME, SECOND)], there.paths):
        assert_same_samples(local, Shards(given, **few))
    for shard in (f"{url}/{SECOND}", there.paths[1]):
        assert_same_samples(local[4:], Shards(shard, **few))
    assert open_shard(f"{url}/{NAME}").attrs["split"] == "train"
    with pytest.raises(ValueError, match=f"expected a split of train, got 'val', in {url}"):
        Shards(url, split="val")
    with pytest.raises(InvalidSample, match=f"{url}/{NAME} is quarantined: .*cannot decode"):
        Shards(url, invalid="raise")[2]


@pytest.mark.parametrize(("url", "name", "inside", "parent"), [
    ("https://host/out", "out", "https://host/out/x.json", "https://host"),
    ("https://host:1/a//out//", "out", "https://host:1/a//out/x.json", "https://host:1/a"),
    ("https://[::1]:8000/out", "out", "https://[::1]:8000/out/x.json", "https://[::1]:8000"),
    ("https://host/out?key=a/b::c", "out", "https://host/out/x.json?key=a/b::c", "https://host?key=a/b::c"),
    ("memory://kept/out", "out", "memory://kept/out/x.json", "memory://kept"),
    ("simplecache::memory://kept/out", "out", "simplecache::memory://kept/out/x.json", "simplecache::memory://kept")])
def test_places_at_urls(url, name, inside, parent):
    path = place(url)
    assert (path.name, str(path / "x.json"), str(path.parent)) == (name, inside, parent)
    assert str((path / "a.b-1.h5").with_suffix(".json")) == inside.replace("x.json", "a.b-1.json")
    assert path.is_dir() and (path / "x.h5").is_file()
    assert pickle.loads(pickle.dumps(path)) == path == place(path) != path.parent
    assert isinstance(place("out://"[:3]), pathlib.Path)


def test_a_volume_is_one_request_of_its_bytes(server, large):
    with h5py.File(large / NAME) as file:
        sizes = [file["events/volume"].id.get_chunk_info(slot).size for slot in range(5)]
    assert min(sizes) > 2e5
    with server.sends() as sent:
        shards = Shards(f"{server.url}/{large.name}")
    # one byte of each shard, which says how large it is, and all of its commit record
    assert sorted(name for name, _, _ in sent) == sorted(["dataset.json"] + [
        name for shard in (NAME, SECOND) for name in (shard, shard.replace(".h5", ".json"))])
    assert all(size == 1 for name, _, size in sent if name.endswith(".h5"))
    with server.sends() as sent:
        labels = shards.labels(1)
    assert labels["pair"]["sample_id"] == "000001" and bytes_of(sent) < 4 * 2**16 and len(sent) <= 4
    shards.sample(3, ["volume"])  # HDF5 knows from now on where volumes are
    for index, slot in enumerate([0, 1, 3, 4]):
        with server.sends() as sent:
            volume = shards.sample(index, ["volume"])["volume"]
        assert [(name, size) for name, _, size in sent] == [(NAME, sizes[slot])]
        assert volume.tobytes() == Shards(large)[index]["volume"].tobytes()
    with server.sends() as sent:
        Shards(f"{server.url}/{large.name}")[5]
    assert sizes[0] < bytes_of(sent) < sizes[0] + 6 * 2**16


def test_the_library_decodes_what_comes_over_the_network(server, large):
    if open_shards._engine_if_any() is None:
        pytest.skip("libeventgan is not there")
    shards = Shards(f"{server.url}/{large.name}")
    assert shards._files[shards.paths[0]]._decoded(0, 1.0).tobytes() == Shards(large)[0]["volume"].tobytes()


def test_a_cache_keeps_what_was_read(server, large, tmp_path):
    url, cache = f"{server.url}/{large.name}", tmp_path / "cache"
    local, first = Shards(large), Shards(url, cache=cache)
    with server.sends() as sent:
        first.sample(0, ["volume"])
    assert 0 < bytes_of(sent) < 5 * 2**18
    assert_same_samples(local, first)
    with server.sends() as sent:
        assert_same_samples(local, Shards(url, cache=str(cache)))
    assert all(size == 1 for name, _, size in sent if name.endswith(".h5"))  # whether it is the same
    files = [path for path in cache.rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) == sum((large / name).stat().st_size for name in (NAME, SECOND))
    files[0].write_bytes(b"short")
    assert_same_samples(local, Shards(url, cache=cache))
    local.close()
    enlarge(large / NAME, 7)
    describe(large)
    assert_same_samples(Shards(large), Shards(url, cache=cache))
    server.version = None
    with pytest.raises(OSError, match=f"expected a file with an ETag .* in {url}/{NAME}"):
        Shards(url, cache=cache)[0]


def volume_of(shards, index):
    return shards[index]["volume"]


def test_workers_open_files_of_their_own(server, large, tmp_path):
    local, shards = Shards(large, fields=["volume"]), Shards(f"{server.url}/{large.name}", cache=tmp_path / "cache")
    shards[0]
    for start, workers in (("fork", 2), ("spawn", 1)):
        with multiprocessing.get_context(start).Pool(workers) as pool:
            volumes = pool.starmap(volume_of, [(shards, i) for i in range(8)], chunksize=1)
        np.testing.assert_array_equal(volumes, [sample["volume"] for sample in local])
    np.testing.assert_array_equal(volume_of(shards, 7), local[7]["volume"])


def test_a_loader_of_pytorch(server, large):
    pytest.importorskip("torch")
    from torch.utils.data import DataLoader

    from eventgan.torch import DetectionDataset, collate_yolo

    local, there = (DataLoader(DetectionDataset(Shards(given)), 4, num_workers=workers, collate_fn=collate_yolo)
                    for given, workers in ((large, 0), (f"{server.url}/{large.name}", 2)))
    for (ours, targets, _), (theirs, others, _) in zip(local, there, strict=True):
        assert ours.equal(theirs) and targets.equal(others)


FAULTS = {404: "got none: '{url}'", 500: "got 500, .* in {url}", "breaks off": "in {url}", "few bytes": "in {url}",
          "no ranges": "got status 200 without the range asked for.*, in {url}",
          "another range": "got status 206 without the range asked for.*, in {url}"}


@pytest.mark.parametrize("fault", FAULTS)
def test_servers_that_fail_are_named(server, large, fault):
    url = f"{server.url}/{large.name}"
    told = FAULTS[fault].format(url=f"{url}/{NAME}")
    server.goes_wrong(fault, at=NAME)
    for given in (f"{url}/{NAME}", [f"{url}/{NAME}"]):
        with pytest.raises(OSError, match=told):
            Shards(given)[0]
    if fault != 404:
        with pytest.raises(OSError, match=told):
            Shards(url)
    server.goes_wrong(None)
    with Shards(url, fields=["volume"]) as shards:
        shards.labels(0)
        server.goes_wrong(fault, at=NAME)
        for _ in range(2):
            with pytest.raises(OSError, match=told):
                shards[1]
        server.goes_wrong(None)
        assert_same_samples(Shards(large, fields=["volume"]), shards)
        if fault != 404:
            server.goes_wrong(fault, times=1, at=NAME)  # a connection that breaks once is none that failed
            assert_same(Shards(large)[2], Shards(url)[2])


@pytest.mark.parametrize("version", ["ETag", "Last-Modified"])
def test_a_shard_that_is_replaced_while_it_is_read(server, large, version):
    server.version = version
    url = f"{server.url}/{large.name}"
    shards = Shards(url)
    shards.sample(0, ["volume"])
    before = (large / NAME).stat()
    enlarge(large / NAME, 9)
    os.utime(large / NAME, (before.st_atime, before.st_mtime + 5))
    assert (large / NAME).stat().st_size == before.st_size
    copies = [shards, pickle.loads(pickle.dumps(shards)), shards[1:]]
    for again in (False, True):
        for each in copies:
            with pytest.raises(OSError, match=f"got another in its place since it was first read, in {url}/{NAME}"):
                each[1]
            each.close()
    assert_same(Shards(large)[1], Shards(url)[1])


NOT_DESCRIBED = "expected the shard that dataset.json describes, got another or none, in .*" + NAME


@pytest.mark.parametrize(("name", "text", "told"), [
    (NAME, None, NOT_DESCRIBED), (NAME, "short", NOT_DESCRIBED),
    (NAME.replace(".h5", ".json"), '{"sha256": "0"}', NOT_DESCRIBED), (NAME.replace(".h5", ".json"), "", NOT_DESCRIBED),
    ("dataset.json", "<html>", "expected JSON, got .*, in .*/dataset.json"),
    ("dataset.json", None, "expected dataset.json, which eventgan finalize writes, or a list of the files, got nei")])
def test_folders_that_are_not_as_described(server, described, name, text, told):
    (described / name).unlink()
    if text is not None:
        (described / name).write_text(text)
    with pytest.raises(ValueError, match=told) as error:
        Shards(f"{server.url}/{described.name}")
    assert server.url in str(error.value)


def test_a_folder_that_is_not_finalized_is_read_where_it_is_listed(server, two_shards):
    server.lists = True
    url = f"{server.url}/{two_shards.name}"
    assert_same_samples(Shards(two_shards), Shards(url))
    with pytest.raises(ValueError, match=f"expected dataset.json beside dataset.h5, got none, in {url}"):
        Shards(url + "/dataset.h5")
    (two_shards / SECOND).with_suffix(".json").unlink()
    with pytest.raises(ValueError, match=f"expected 2 finished shards, got 1 unfinished .{SECOND}., in {url}"):
        Shards(url)
    assert_same_samples(Shards(two_shards, partial=True), Shards(url, partial=True))
    server.goes_wrong(500, at=".json")
    with pytest.raises(OSError, match="got 500"):
        Shards(url, partial=True)


def run(script, *arguments):
    return subprocess.run([sys.executable, "-c", script, *map(str, arguments)], capture_output=True, text=True,
                          timeout=60)


def test_a_process_that_leaves_files_open_and_garbage_ends_well(server, large):
    done = run("""
import ctypes, gc, sys, h5py, eventgan
shards = eventgan.Shards(sys.argv[1])
ctypes.pythonapi.Py_IncRef(ctypes.py_object(shards))  # as an extension might, so that it outlives Python
gc.set_threshold(50)
for i in range(24):
    garbage = [h5py.File(sys.argv[2])["valid"] for _ in range(3)]
    garbage.append(garbage)  # freed by whichever thread looks for garbage first
    print(shards.sample(i % 8, ["volume"])["volume"].shape)
""", f"{server.url}/{large.name}", large / NAME)
    assert (done.returncode, done.stdout, done.stderr) == (0, f"{LARGE[1:]}\n" * 24, "")


def test_without_fsspec(described):
    done = run("""
import sys
import eventgan
assert len(list(eventgan.Shards(sys.argv[1]))) == 8 and not {"fsspec", "aiohttp"} & set(sys.modules)
sys.modules["fsspec"] = None
eventgan.Shards("https://host/out")
""", described)
    assert done.returncode == 1
    assert "ImportError: expected the package fsspec" in done.stderr and "https://host/out" in done.stderr
    with pytest.raises(ValueError, match="nothing"):
        Shards("nothing://host/out")


def test_what_is_no_url():
    with pytest.raises(ValueError, match="expected a URL, got '://'"):
        RemotePath("://")

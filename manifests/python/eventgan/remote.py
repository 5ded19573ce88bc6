"""Files at a URL, which fsspec reads."""

from __future__ import annotations

import atexit
import contextlib
import errno
import fnmatch
import gc
import hashlib
import io
import os
import pathlib
import re
import tempfile
import types
import weakref
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar, Union

if TYPE_CHECKING:
    import h5py

BLOCK, CACHED_BLOCK = 1 << 16, 1 << 18  # bytes; labels lie close together, at both ends of a shard
MOST_BLOCKS = 4
VERSIONS = ("ETag", "etag", "LastModified", "last_modified", "updated", "mtime", "created")  # names of filesystems

Result = TypeVar("Result")


class RemotePath:
    """A file or folder at a URL: what `Shards` needs of pathlib.Path, which would make https:/ of https://.

    NAME.h5 is a file, any other a folder. A file that is not the one that this object has seen, also in the process
    that it was forked or pickled from, is an OSError. Errors name the URL. `cache` is a folder for what was read.
    """

    def __init__(self, url: str, cache: str | os.PathLike | None = None) -> None:
        parts = re.fullmatch(r"(.+?://.*?)/*(\?.*|::\w+(?:://|::).*)?", url, re.DOTALL)  # a query, or a chain's rest
        if not parts:
            raise ValueError(f"expected a URL, got {url!r}")
        self._place, self._rest = parts[1], parts[2] or ""
        self.cache = cache
        self.is_http = bool(re.match("https?://", url))
        self.version: tuple[str | None, int] | None = None  # of the file that was seen, and its size
        self.filesystem()

    def __str__(self) -> str:
        return self._place + self._rest

    __repr__ = __str__

    def __eq__(self, other: object) -> bool:
        return isinstance(other, RemotePath) and str(self) == str(other)

    def __hash__(self) -> int:
        return hash(str(self))

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_found"}

    def __truediv__(self, name: str) -> RemotePath:
        return self._at(f"{self._place}/{name}")

    @property
    def name(self) -> str:
        """The last part, without a query."""
        return self._place.rpartition("/")[2]

    @property
    def parent(self) -> RemotePath:
        """The folder that it is in."""
        return self._at(self._place.rpartition("/")[0])

    @property
    def at_once(self) -> int:
        """How many threads may ask the server at a time."""
        return 32 if self.filesystem()[0].async_impl else 1

    def with_suffix(self, suffix: str) -> RemotePath:
        """The file with another suffix."""
        return self._at(re.sub(r"\.\w+$", "", self._place) + suffix)

    def is_file(self) -> bool:
        """Whether it is NAME.h5; asks no server."""
        return self.name.endswith(".h5")

    def is_dir(self) -> bool:
        """Whether it is not."""
        return not self.is_file()

    def read_text(self, encoding: str) -> str:
        """The whole file."""
        filesystem, path = self.filesystem()
        return self.tried(lambda: filesystem.cat_file(path)).decode(encoding)

    def glob(self, pattern: str) -> list[RemotePath]:
        """The files of a folder with such names, in order; an OSError where the server does not list them."""
        filesystem, path = self.filesystem()
        filesystem.invalidate_cache()
        names = {found.rpartition("/")[2] for found in self.tried(lambda: filesystem.ls(path, detail=False))}
        return [self / name for name in sorted(fnmatch.filter(names, pattern))]

    def stat(self) -> types.SimpleNamespace:
        """Its size, `st_size`."""
        return types.SimpleNamespace(st_size=_RemoteFile(self, 1, None).size)

    def open(self) -> io.RawIOBase:
        """The file, to be read by parts, which are never short."""
        return _RemoteFile(self, 1 if self.cache else BLOCK, self.cache)

    def filesystem(self) -> tuple[Any, str]:
        """fsspec's filesystem in this process, and what the file is called there."""
        process, *found = vars(self).get("_found", (None,))
        if process != os.getpid():
            fsspec = _fsspec(self)
            thread = fsspec.asyn.iothread[0]
            if thread is not None and not thread.is_alive():  # it does not survive a fork, as newer versions know
                fsspec.asyn.reset_lock()
            options = {"get_client": _client} if self.is_http else {}
            found = fsspec.core.url_to_fs(str(self), **options)
            self._found = (os.getpid(), *found)
        return found[0], found[1]

    def tried(self, request: Callable[[], Result]) -> Result:
        """What a request gives, tried twice: the server may have closed a connection since the one before."""
        for last in (False, True):
            try:
                return request()
            except FileNotFoundError:
                raise FileNotFoundError(errno.ENOENT, "expected a file, got none", str(self)) from None
            except Exception as error:  # each filesystem has its own
                if last:
                    raise OSError(f"expected the file, got {str(error) or repr(error)}, in {self}") from error
        raise AssertionError

    def see(self, version: tuple[str | None, int]) -> None:
        """Refuses a file that is not the one seen before."""
        if self.version not in (None, version):
            raise OSError("another in its place since it was first read")
        self.version = version

    def _at(self, place: str) -> RemotePath:
        return RemotePath(place + self._rest, self.cache)


Place = Union[pathlib.Path, RemotePath]


def place(path: str | os.PathLike | RemotePath, cache: str | os.PathLike | None = None) -> Place:
    """The path; a URL with the folder that is its cache."""
    if isinstance(path, RemotePath):
        return path
    return RemotePath(path, cache) if isinstance(path, str) and "://" in path else pathlib.Path(path)


class _RemoteFile(io.RawIOBase):
    """A file of which HDF5 reads parts.

    A volume is one request of its bytes alone; the blocks that shorter parts lie in, those of labels, are kept. With a
    cache all is read by blocks, each a file in the cache, whole or absent, so processes share them. fsspec's own caches
    on disk are not safe to share: the file that another process is fetching is taken for whole (simplecache,
    filecache), and blocks that are not there for zeros (blockcache).
    """

    def __init__(self, path: RemotePath, first: int, cache: str | os.PathLike | None) -> None:
        self._path, self._at = path, 0
        self._file: Any = None
        self._size_of_block = CACHED_BLOCK if cache else BLOCK
        self._kept: dict[int, bytes] = {}
        self._folder = ""
        if path.is_http:
            data = path.tried(lambda: self._part(0, first))
            if first == BLOCK:
                self._kept[0] = data
        else:
            path.tried(self._see)
        assert path.version
        changed, self.size = path.version
        if cache:
            if not changed:
                raise OSError(f"expected a file with an ETag or a time of change, for a cache, got none, in {path}")
            name = hashlib.sha256(f"{path} {changed} {self.size}".encode()).hexdigest()
            self._folder = os.path.join(os.path.expanduser(cache), name)
            os.makedirs(self._folder, exist_ok=True)

    def __repr__(self) -> str:  # h5py's name of the file
        return str(self._path)

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        self._at = offset + {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self.size}[whence]
        return self._at

    def readinto(self, buffer: Any) -> int:
        view = memoryview(buffer).cast("B")
        start, end = self._at, self._at + len(view)
        if end > self.size:  # HDF5 would take what was in the buffer
            raise OSError(f"expected bytes up to {end:,}, got an end at {self.size:,}, in {self._path}")
        collects = gc.isenabled()
        gc.disable()  # in fsspec's thread it would wait for ever for h5py's lock, which this one has
        try:
            if not self._folder and end - start > BLOCK:
                view[:] = self._path.tried(lambda: self._part(start, end))
            else:
                size = self._size_of_block
                first = start // size
                data = b"".join(self._block(number) for number in range(first, -(-end // size)))
                view[:] = data[start - first * size : end - first * size]
        finally:
            if collects:
                gc.enable()
        self._at = end
        return len(view)

    def _block(self, number: int) -> bytes:
        if number in self._kept:
            return self._kept[number]
        start, data = number * self._size_of_block, b""
        end, file = min(start + self._size_of_block, self.size), os.path.join(self._folder, str(number))
        if self._folder:
            with contextlib.suppress(FileNotFoundError):
                data = pathlib.Path(file).read_bytes()
        if len(data) != end - start:
            data = self._path.tried(lambda: self._part(start, end))
            if self._folder:
                with tempfile.NamedTemporaryFile(dir=self._folder, delete=False) as new:
                    new.write(data)
                os.replace(new.name, file)
        if len(self._kept) == MOST_BLOCKS:
            self._kept.pop(next(iter(self._kept)))
        self._kept[number] = data
        return data

    def _see(self) -> None:
        filesystem, name = self._path.filesystem()
        info = filesystem.info(name)
        self._path.see((next((str(info[key]) for key in VERSIONS if info.get(key)), None), info["size"]))

    def _part(self, start: int, end: int) -> bytes:
        """Bytes `start` to before `end`, or to the end of the file."""
        filesystem, name = self._path.filesystem()
        if self._path.is_http:
            data = filesystem.cat_file(name, start, end, headers={"Accept-Encoding": "identity"},
                                       trace_request_ctx=self._path)
        else:
            if self._file is None:
                self._file = filesystem.open(name, "rb", cache_type="none")
            self._file.seek(start)
            data = self._file.read(end - start)
        assert self._path.version
        whole = min(end, self._path.version[1]) - start
        if len(data) != whole:
            raise OSError(f"{len(data)} of {whole} bytes")
        return data


async def _client(**options: Any) -> Any:
    """fsspec's client of web servers, which refuses what is not the part of the file that was asked for."""
    import aiohttp

    answers = aiohttp.TraceConfig()
    answers.on_request_end.append(_check)
    return aiohttp.ClientSession(trace_configs=[answers], **options)


async def _check(_: Any, context: Any, answer: Any) -> None:
    path, got = context.trace_request_ctx, answer.response
    if path is None or got.status >= 400:  # a whole file, or an error that fsspec knows
        return
    part = re.fullmatch(r"bytes (\d+)-\d+/(\d+)", got.headers.get("Content-Range", ""))
    try:
        if got.status != 206 or not part or not answer.headers["Range"].startswith(f"bytes={part[1]}-"):
            raise OSError(f"status {got.status} without the range asked for: a server that does not read by parts")
        path.see((got.headers.get("ETag") or got.headers.get("Last-Modified"), int(part[2])))
    except OSError:
        if got.connection:
            got.close()
        else:  # all has arrived, and until it is read aiohttp hears nothing more on the connection, which it keeps
            await got.read()
        raise


def _fsspec(path: RemotePath) -> Any:
    try:
        import fsspec
        import fsspec.asyn
    except ImportError as error:
        raise ImportError("expected the package fsspec (pip install fsspec[http], or Debian's python3-fsspec, "
                          f"python3-aiohttp and python3-requests), got none, for {path}") from error
    return fsspec


def close_at_exit(file: h5py.File) -> None:
    """For a file that HDF5 reads through Python: it would close it when there is no Python any more, and crash."""
    _open[id(file)] = file


_open: weakref.WeakValueDictionary[int, h5py.File] = weakref.WeakValueDictionary()


@atexit.register
def _close() -> None:
    for file in list(_open.values()):
        file.close()

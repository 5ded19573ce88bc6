"""What reading images ahead is worth: conversions from a disk on which every read waits, as on one behind a network.

The disk is a FUSE file system (python3-fusepy; /dev/fuse) that passes through to files in memory; its own work takes
processor time, too.
"""

import contextlib
import dataclasses
import errno
import multiprocessing
import os
import time

try:
    import fusepy
except ImportError:
    fusepy = None

from measuring.conversion import Job, convert
from measuring.frames import link_frames, original_frames
from measuring.report import Part, Table
from measuring.spread import spread


@dataclasses.dataclass(frozen=True)
class Settings:
    rounds: int
    frames: int = 240
    size: tuple = (260, 861)
    delays_ms: tuple = (0, 5, 20)
    precision: str = "float32"
    weights: str = "shipped:8"


SETTINGS = {
    "full": Settings(3),
    "quick": Settings(1, frames=120),
    "trial": Settings(1, 3, (32, 32), (1,), weights="untrained:2"),
}
THREADS = 2


def serve(root, mount, delay_s, reads):
    """Shows the files of `root`, and what its links lead to, below `mount`, until SIGTERM; counts reads in `reads`."""

    class Disk(fusepy.Operations):
        def getattr(self, path, fh=None):
            try:
                status = os.stat(root + path)
            except OSError as error:
                raise fusepy.FuseOSError(error.errno or errno.EIO) from error
            return {key: getattr(status, key) for key in ("st_mode", "st_nlink", "st_size", "st_uid", "st_gid",
                                                          "st_atime", "st_mtime", "st_ctime")}

        def readdir(self, path, fh):
            return [".", "..", *os.listdir(root + path)]

        def open(self, path, flags):
            return os.open(root + path, flags)

        def read(self, path, size, offset, fh):
            time.sleep(delay_s)
            with reads.get_lock():
                reads.value += 1
            return os.pread(fh, size, offset)

        def release(self, path, fh):
            os.close(fh)

    # What has been read stays in memory as long as the file is the same, as of a network's file system.
    fusepy.FUSE(Disk(), mount, foreground=True, ro=True, auto_cache=True, attr_timeout=60, entry_timeout=60)


@contextlib.contextmanager
def slow_disk(root, mount, delay_s):
    """The mounted file system with nothing of it in memory; gives the counter of reads."""
    mount.mkdir(exist_ok=True)
    reads = multiprocessing.Value("q", 0)
    server = multiprocessing.Process(target=serve, args=(str(root), str(mount), delay_s, reads))
    server.start()
    try:
        while not os.path.ismount(mount) and server.is_alive():
            time.sleep(0.01)
        yield reads
    finally:
        server.terminate()
        server.join()


def measure(bench):
    if fusepy is None or not os.path.exists("/dev/fuse"):
        return Part([], {"slow_disk": "it needs python3-fusepy and /dev/fuse"})
    settings = SETTINGS[bench.effort]
    originals, _ = original_frames(bench)
    frames = link_frames(bench.scratch / "frames", originals, settings.frames)
    mount = bench.scratch / "disk"
    job = Job(frames, *settings.size, weights=settings.weights, precision=settings.precision, threads=THREADS)
    in_memory, on_disk, reads_of = [], {delay: [] for delay in settings.delays_ms}, {}
    for _ in range(settings.rounds):
        in_memory.append(convert(bench.program, job))
        for delay in settings.delays_ms:
            with slow_disk(frames, mount, delay / 1000) as reads:
                on_disk[delay].append(convert(bench.program, dataclasses.replace(job, frames=mount)))
                reads_of[delay] = reads.value
    table = Table("slow_disk", ["each read waits, ms", "reads", "they wait, s in all", "conversion, s",
                                "times that from memory"])
    seconds = [run.wall_s for run in in_memory]
    table.add("from memory", "", "", spread(seconds), 1)
    for delay, runs in on_disk.items():
        times = [run.wall_s for run in runs]
        ratio = spread([slow / fast for slow, fast in zip(times, seconds)]).median
        table.add(delay, reads_of[delay], delay / 1000 * reads_of[delay], spread(times), ratio)
    return Part([table])

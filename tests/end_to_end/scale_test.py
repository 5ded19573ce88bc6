"""The bookkeeping of a million pairs in 4,000 shards: a plan is frozen within a minute of processor time and 1.5 GB,
status and finalize take seconds.

Only two shards are converted; the others are links to the first, with commit records as convert would have written
them."""

import hashlib
import json
import os
import shutil
import struct
import subprocess
import tempfile
import zlib

import program

FRAMES = 166_670
GAPS = 6
PAIRS = GAPS * FRAMES - sum(range(1, GAPS + 1))  # a frame less than g from the start has no pair of gap g
SHARD = 250
SHARDS = -(-PAIRS // SHARD)
FREEZE_LIMIT_S = 60
FREEZE_LIMIT_BYTES = 1.5e9
QUICK_LIMIT_S = 20
MOST_LINKS = 20_000  # of one file; some file systems have no more than 32,000 or 65,000
GENERATOR = {"kind": "difference"}


def grey_png(shade, side=16):
    """A flat image, made here so that nothing but Python's own library is needed."""
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    rows = (b"\0" + bytes([shade]) * side) * side
    header = struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


class Measured:
    """One run of the program: its output, processor time, whatever else runs on the machine, and peak memory."""

    def __init__(self, *arguments, expect=0, environment=None):
        with tempfile.TemporaryFile("w+") as errors:
            process = subprocess.Popen([program.PROGRAM, *map(str, arguments)], stdout=subprocess.PIPE, stderr=errors,
                                       text=True, env={**os.environ, **(environment or {})})
            with process.stdout:
                self.out = process.stdout.read()
            _, status, usage = os.wait4(process.pid, 0)  # getrusage() knows only the largest of all children
            process.returncode = os.waitstatus_to_exitcode(status)
            errors.seek(0)
            self.err = errors.read()
        self.seconds = usage.ru_utime + usage.ru_stime
        self.peak_bytes = usage.ru_maxrss * 1024
        print(f"{' '.join(map(str, arguments[:2]))}: {self.seconds:.1f} s, {self.peak_bytes / 1e6:.0f} MB", flush=True)
        if process.returncode != expect:
            raise AssertionError(f"expected exit code {expect}, got {process.returncode}, of "
                                 f"{arguments}\n{self.out[-4000:]}\n{self.err[-4000:]}")


class Scale(program.InFolder):
    def test_a_million_pairs(self):
        self.make_frames()
        source = {"dataset": "frames", "root": "frames", "pairs": program.pairs(list(range(1, GAPS + 1)), choose="all")}
        self.manifest = self.write_manifest(program.manifest(
            [source], image={"preset": "mpii", "height": 16, "width": 16}, generator=GENERATOR,
            output={"directory": "out", "samples_per_shard": SHARD},
            errors={"policy": "quarantine", "max_count": 1000, "max_fraction": 1}))
        self.out = self.folder / "out"

        self.freeze()
        self.convert_first_and_last()
        missing = self.make_commit_records()
        self.check_incomplete(missing)
        for path, text in missing.items():
            path.write_text(text)
        self.check_complete()

    def make_frames(self):
        clip = self.folder / "frames" / "clip"
        clip.mkdir(parents=True)
        for frame in range(FRAMES):
            original = self.folder / f"{frame // MOST_LINKS}.png"
            if not original.exists():
                original.write_bytes(grey_png(20 * (frame // MOST_LINKS)))
            os.link(original, clip / f"{frame:06d}.png")

    def freeze(self):
        done = Measured("plan", "--freeze", "--json", self.manifest)
        self.assertLess(done.seconds, FREEZE_LIMIT_S)
        self.assertLess(done.peak_bytes, FREEZE_LIMIT_BYTES)
        frozen = json.loads(done.out)
        self.assertEqual((frozen["samples"], frozen["shards"]), (PAIRS, SHARDS))
        self.assertEqual(frozen["folder"], str(self.out))

    def name(self, shard, ending):
        return self.out / f"job-train-{shard:05d}-of-{SHARDS:05d}.{ending}"

    def convert_first_and_last(self):
        """A worker's start needs no more than freezing did."""
        done = Measured("convert", self.manifest, "--threads", 1, "--shards", f"0/{SHARDS - 1}")
        self.assertLess(done.peak_bytes, FREEZE_LIMIT_BYTES)
        self.assertEqual(len(list(self.out.glob("*-of-*.h5"))), 2)

    def make_commit_records(self):
        """Links and commit records for the other shards; every hundredth has a quarantined sample. Three commit records
        are given back instead of written."""
        record = json.loads(self.name(0, "json").read_text())
        self.assertEqual((record["samples"], record["valid"]), (SHARD, SHARD))
        self.quarantined = 0
        kept = {}
        spoiled, sha256 = self.shard_without_a_sample(7)
        for shard in range(1, SHARDS - 1):
            os.link(spoiled if shard % 100 == 0 else self.name(0, "h5"), self.name(shard, "h5"))
            mine = dict(record, shard=self.name(shard, "h5").name)
            if shard % 100 == 0:
                mine["valid"] -= 1
                mine.update(sha256=sha256, size_bytes=spoiled.stat().st_size)
                mine["quarantined"] = [{"slot": 7, "sample_id": self.spoiled_id,
                                        "reason": "expected a PNG, got 0 bytes, in x"}]
                self.quarantined += 1
            text = json.dumps(mine, indent=2, sort_keys=True) + "\n"
            if shard in [1, 1999, SHARDS - 2]:
                kept[self.name(shard, "json")] = text
                os.unlink(self.name(shard, "h5"))
            else:
                self.name(shard, "json").write_text(text)
        return kept

    def shard_without_a_sample(self, slot):
        """A copy of the first shard with a sample in quarantine; its path and SHA-256."""
        import h5py
        path = self.folder / "spoiled.h5"
        shutil.copy(self.name(0, "h5"), path)
        with h5py.File(path, "r+") as file:
            file["valid"][slot] = 0
            self.spoiled_id = program.text(file["pairs/sample_id"][slot])
        return path, hashlib.sha256(path.read_bytes()).hexdigest()

    def quick(self, *arguments, expect=0):
        done = Measured(*arguments, expect=expect)
        self.assertLess(done.seconds, QUICK_LIMIT_S)
        return done

    def check_incomplete(self, missing):
        status = json.loads(self.quick("status", self.out, "--json").out)
        self.assertFalse(status["complete"])
        self.assertEqual(status["shards"], {"planned": SHARDS, "done": SHARDS - 3, "running": 0, "missing": 3})
        finalized = self.quick("finalize", self.out, expect=1)
        for path in missing:
            self.assertIn(path.with_suffix(".h5").name, finalized.out + finalized.err)
        self.assertFalse((self.out / "dataset.json").exists())
        for path in missing:
            os.link(self.name(0, "h5"), path.with_suffix(".h5"))

    def check_complete(self):
        status = json.loads(self.quick("status", self.out, "--json").out)
        self.assertTrue(status["complete"])
        self.assertEqual(status["shards"], {"planned": SHARDS, "done": SHARDS, "running": 0, "missing": 0})
        self.assertEqual(status["samples"], {"planned": PAIRS, "written": PAIRS - self.quarantined, "under_way": 0,
                                             "quarantined": self.quarantined})
        self.assertEqual(status["quarantined_by_reason"], {"expected a PNG, got 0 bytes": self.quarantined})

        self.quick("finalize", self.out)
        self.check_view()

    def check_view(self):
        import h5py
        with h5py.File(self.out / "dataset.h5") as view, h5py.File(self.name(0, "h5")) as first:
            self.assertEqual(view["events/volume"].shape, (PAIRS, *first["events/volume"].shape[1:]))
            for slot in [0, SHARD - 1]:
                for shard in [0, 2000]:  # a link to the first
                    self.assertTrue((view["events/volume"][shard * SHARD + slot] == first["events/volume"][slot]).all())
            with h5py.File(self.name(SHARDS - 1, "h5")) as last:
                self.assertEqual(len(last["valid"]), PAIRS - SHARD * (SHARDS - 1))
                self.assertEqual(view["pairs/sample_id"][PAIRS - 1], last["pairs/sample_id"][len(last["valid"]) - 1])


if __name__ == "__main__":
    program.main()

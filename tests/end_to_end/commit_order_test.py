"""In which order a file is published: whole and fsynced under its temporary name, renamed, its folder fsynced, and a
commit record only after its shard. A kill shows nothing of this, since the system keeps what it was given; a power cut
does."""

import re

import failing_files
import program
from folders import records
from small_job import LENIENT, broken_cars, small_job

TEMPORARY = re.compile(r"\.(?P<target>.+)\.[^.]+\.\d+\.\d+\.tmp")


class CommitOrder(program.InFolder):
    def setUp(self):
        super().setUp()
        self.manifest = small_job(self.folder / "job", errors=LENIENT)
        self.out = self.folder / "out"

    def calls(self, *command):
        outcome = failing_files.run(self.out, "", *command)
        self.assertEqual(outcome.code, 0, outcome.err)
        return failing_files.changes(outcome.calls)

    def convert(self, *more):
        return self.calls("convert", self.manifest, "--output", self.out, "--threads", "1", "--progress", "none", *more)

    def published(self, calls):
        """Names of the final files in the order of their renames; fails where something is not on the disk by then."""
        names, not_synced, folder_to_sync = [], set(), None
        for call in calls:
            temporary = TEMPORARY.fullmatch(call.path.name)
            if call.path == self.out and call.kind == "sync":
                folder_to_sync = None
            elif call.kind in ("rename", "link") and not temporary:
                self.assertNotIn(call.path.name, not_synced, "named before its bytes were fsynced")
                self.assertIsNone(folder_to_sync, f"the folder was not fsynced before {call.path.name} was named")
                names.append(call.path.name)
                folder_to_sync = call.path.name
            elif call.kind in ("create", "write", "truncate"):
                self.assertTrue(temporary, f"{call.kind} of {call.path} under its final name")
                not_synced.add(temporary["target"])
            elif call.kind == "sync" and temporary:
                not_synced.discard(temporary["target"])
        self.assertIsNone(folder_to_sync, "the folder was not fsynced in the end")
        return names

    def test_convert(self):
        names = self.published(self.convert())
        shards = sorted(records(self.out))
        committed = [name for shard in shards for name in (shard, shard.replace(".h5", ".json"))]
        self.assertEqual(names, ["plan.json", "run.json", *committed, "dataset.h5", "dataset.json"])

    def test_finalize(self):
        self.convert("--no-finalize")
        self.assertEqual(self.published(self.calls("finalize", self.out)), ["dataset.h5", "dataset.json"])

    def test_retry(self):
        with broken_cars(self.folder / "job", [1]):
            self.convert()
        spoiled, = (shard for shard, record in records(self.out).items() if record["quarantined"])
        names = self.published(self.calls("retry", self.out, "--threads", "1"))
        self.assertEqual(names, ["amendments.json", spoiled, spoiled.replace(".h5", ".json")])


if __name__ == "__main__":
    program.main()

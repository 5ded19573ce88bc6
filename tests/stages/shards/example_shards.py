"""The shards that write_example_shards makes, for the Python tests of this folder."""

import json
import os
import pathlib
import subprocess
import tempfile

SOURCE = pathlib.Path(__file__).resolve().parents[3]
NAME = "demo-train-00000-of-00001.h5"


class ExampleShards:
    """A temporary folder with the shards; `volumes` as they were before they were stored, [] for none."""

    def __init__(self):
        self._folder = tempfile.TemporaryDirectory()
        self.folder = pathlib.Path(self._folder.name)
        subprocess.run([os.environ["WRITE_EXAMPLE_SHARDS"], self.folder], check=True)
        self.volumes = json.loads((self.folder / "volumes.json").read_text())

    def path(self, kind):
        """kind: for instance "float16-1" (type and deflate level), or "unlabelled"."""
        return self.folder / kind / NAME

    def close(self):
        self._folder.cleanup()

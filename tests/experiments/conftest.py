"""Places that the tests of this folder share."""

import os
import pathlib

EXPERIMENTS = pathlib.Path(__file__).resolve().parent
SOURCE = EXPERIMENTS.parents[1]
DATA = pathlib.Path(os.environ.get("EVENTGAN_TEST_DATA", SOURCE.parent / "shared" / "data"))

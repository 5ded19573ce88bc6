"""The old name of the package `eventgan`: all of it is found here, too, until version 0.4."""

import warnings

import eventgan
from eventgan import FIELDS, InvalidSample, Sample, Shards, open_shard, read_description  # noqa: F401

warnings.warn("eventgan_shards is now called eventgan: import eventgan", DeprecationWarning, stacklevel=2)
__path__ = eventgan.__path__  # its modules under the old name: eventgan_shards.torch, python3 -m eventgan_shards.evaluate

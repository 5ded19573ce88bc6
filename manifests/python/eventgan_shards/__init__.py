"""Event-volume shards of eventgan, read from Python with h5py and numpy, nothing else.

    from eventgan_shards import Shards

    shards = Shards("out", split="train")   # a folder (finalized or not), a shard, or a list of shards
    for sample in shards:
        sample["volume"]                    # float32 [2B, H, W], >= 0
        sample["boxes"]["xyxy"]             # float64 [boxes, 4], volume pixels
        sample["persons"]["joints"]         # float64 [persons, J, 2], volume pixels

manifests/guides/shard_format.md says what each field means; the keys are its names. `eventgan_shards.torch` has PyTorch's datasets of
boxes and poses, `eventgan_shards.evaluate` scores what a network finds.
"""

from .shards import FIELDS, InvalidSample, Sample, Shards, open_shard, read_description

__all__ = ["FIELDS", "InvalidSample", "Sample", "Shards", "open_shard", "read_description"]

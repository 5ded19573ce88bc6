"""Reads a weights file by the rules of the safetensors format, on its own:
nothing of this project's reader is in it."""

import json
import struct

LARGEST_HEADER = 100_000_000
SIZES = {"F64": 8, "I64": 8, "F32": 4, "I32": 4, "F16": 2, "BF16": 2, "I16": 2, "U8": 1, "I8": 1, "BOOL": 1}


def refuse_twice(pairs):
    keys = [key for key, _ in pairs]
    assert len(set(keys)) == len(keys), f"a key twice in {keys}"
    return dict(pairs)


def read_safetensors(path):
    """The tensors, name → (shape, bytes), and the metadata. Fails an assertion where a rule is broken."""
    content = path.read_bytes()
    assert len(content) >= 8, "no header length"
    length, = struct.unpack("<Q", content[:8])
    assert length <= LARGEST_HEADER and 8 + length <= len(content), f"header length {length}"
    text, data = content[8:8 + length], content[8 + length:]
    assert text.startswith(b"{"), "the header does not begin with {"
    assert (8 + length) % 8 == 0, "the tensors are not aligned to 8 bytes"
    assert text.rstrip(b" ").endswith(b"}"), "the header is padded with something else than spaces"
    header = json.loads(text.decode("utf-8"), object_pairs_hook=refuse_twice)

    metadata = header.pop("__metadata__", {})
    assert all(isinstance(value, str) for value in metadata.values()), "metadata that is not text"
    tensors, end = {}, 0
    for name, entry in sorted(header.items(), key=lambda item: item[1]["data_offsets"]):
        assert set(entry) == {"dtype", "shape", "data_offsets"}, f"other keys of {name}"
        size = SIZES[entry["dtype"]]
        for side in entry["shape"]:
            assert isinstance(side, int) and side >= 0, f"a side of {name}"
            size *= side
        first, last = entry["data_offsets"]
        assert first == end and last == first + size, f"a hole or another size at {name}"
        assert first % SIZES[entry["dtype"]] == 0, f"{name} is not aligned to its numbers"
        tensors[name] = (entry["shape"], data[first:last])
        end = last
    assert end == len(data), "bytes behind the last tensor"
    return tensors, metadata

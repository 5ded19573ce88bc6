"""Writes the seeds of the fuzz corpus: small checkpoints as PyTorch writes them, small weights files, small MATLAB and
CDF files.

    python3 tests/fuzz/make_corpus.py tests/fuzz/corpus

Needs no PyTorch: classes of its names stand in for what a pickle refers to. Beside the seeds
stand inputs that the fuzzer made of them to reach other branches of the readers (found_*).
"""

import collections
import gzip
import io
import json
import pathlib
import pickle
import struct
import sys
import types
import zipfile
import zlib

MAGIC = 0x1950A86A20F9469CFC6C


def stand_in(module, name):
    made = sys.modules.setdefault(module, types.ModuleType(module))
    value = type(name, (), {"__module__": module, "__qualname__": name})
    setattr(made, name, value)
    return value


stand_in("torch", "nothing")
STORAGES = {letter: stand_in("torch", name) for letter, name in
            {"f": "FloatStorage", "d": "DoubleStorage", "e": "HalfStorage", "q": "LongStorage"}.items()}
REBUILD = stand_in("torch._utils", "_rebuild_tensor_v2")
PARAMETER = stand_in("torch._utils", "_rebuild_parameter")


class Storage:
    def __init__(self, key, letter, values):
        self.key, self.letter, self.values = key, letter, values

    def data(self):
        return struct.pack(f"<{len(self.values)}{self.letter}", *self.values)


class Tensor:
    def __init__(self, storage, shape, offset=0, strides=None, parameter=False):
        self.storage, self.shape, self.offset, self.parameter = storage, shape, offset, parameter
        self.strides = strides
        if strides is None:
            self.strides, step = [], 1
            for side in reversed(shape):
                self.strides.insert(0, step)
                step *= side

    def __reduce__(self):
        rebuilt = (REBUILD, (self.storage, self.offset, tuple(self.shape), tuple(self.strides), False,
                             collections.OrderedDict()))
        if not self.parameter:
            return rebuilt
        inner = Tensor(self.storage, self.shape, self.offset, self.strides)
        return PARAMETER, (inner, True, collections.OrderedDict())


class Pickler(pickle.Pickler):
    def __init__(self, file, legacy):
        super().__init__(file, protocol=2)
        self.legacy, self.storages = legacy, {}

    def persistent_id(self, value):
        if not isinstance(value, Storage):
            return None
        self.storages[value.key] = value
        known = ("storage", STORAGES[value.letter], value.key, "cpu", len(value.values))
        return known + (None,) if self.legacy else known


def dump(value, legacy):
    file = io.BytesIO()
    pickler = Pickler(file, legacy)
    pickler.dump(value)
    return file.getvalue(), pickler.storages


def legacy_checkpoint(value, little_endian=True):
    data, storages = dump(value, legacy=True)
    keys = sorted(storages)
    machine = {"protocol_version": 1001, "little_endian": little_endian, "type_sizes": {"short": 2, "int": 4, "long": 4}}
    result = b"".join(pickle.dumps(part, protocol=2) for part in (MAGIC, 1001, machine)) + data
    result += pickle.dumps(keys, protocol=2)
    for key in keys:
        result += struct.pack("<q", len(storages[key].values)) + storages[key].data()
    return result


def zip_checkpoint(value, method):
    data, storages = dump(value, legacy=False)
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", method) as archive:
        members = {"archive/data.pkl": data, "archive/version": b"3\n"}
        members.update({f"archive/data/{key}": storage.data() for key, storage in storages.items()})
        for name, content in members.items():
            archive.writestr(zipfile.ZipInfo(name), content, method)
    return file.getvalue()


def checkpoint():
    shared = Storage("0", "f", [0.5 * i for i in range(12)])
    half = Storage("1", "e", [1.0, -2.0])
    count = Storage("2", "q", [7])
    network = collections.OrderedDict([
        ("head.conv2d.weight", Tensor(shared, [2, 3])), ("transposed", Tensor(shared, [3, 2], 6, [1, 3])),
        ("half", Tensor(half, [2])), ("parameter", Tensor(half, [2, 1], parameter=True)),
        ("norm.num_batches_tracked", Tensor(count, []))])
    optimizer = {"state": {0: {"step": 3, "exp_avg": Tensor(Storage("3", "d", [0.25, 1.5]), [2])}},
                 "param_groups": [{"lr": 2e-4, "betas": (0.0, 0.999), "params": [0]}]}
    return {"gen": network, "dis": collections.OrderedDict(w=Tensor(half, [1], 1)), "optimizer_gen": optimizer,
            "epoch": 3, "dataset_perm": None, "big": 1 << 70, "done": True}


def safetensors(header, data=b""):
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    return struct.pack("<Q", len(text)) + text + data


class Mat:
    """MATLAB files, level 5: elements of type, size and data, in one of the byte orders."""

    def __init__(self, order="<"):
        self.order = order

    def numbers(self, *values):
        return struct.pack(f"{self.order}{len(values)}I", *values)

    def element(self, kind, data):
        return self.numbers(kind, len(data)) + data + bytes(-len(data) % 8)

    def array(self, kind, dims, content, name=b"", flags=0):
        header = self.element(6, self.numbers(kind | flags, 0)) + self.element(5, self.numbers(*dims)) + self.element(1, name)
        return self.element(14, header + content)

    def text(self, value):
        return self.array(4, [1, len(value)], self.element(16, value.encode()))

    def doubles(self, *values):
        return self.array(6, [len(values) and 1, len(values)], self.element(9, struct.pack(f"{self.order}{len(values)}d", *values)))

    def structs(self, names, rows, name=b""):
        fields = self.element(5, self.numbers(16)) + self.element(1, b"".join(field.encode().ljust(16, b"\0") for field in names))
        return self.array(2, [1, len(rows)], fields + b"".join(b"".join(row) for row in rows), name)

    def file(self, *arrays):
        version = struct.pack(f"{self.order}H", 0x100) + (b"IM" if self.order == "<" else b"MI")
        return b"MATLAB 5.0 MAT-file".ljust(124) + version + b"".join(arrays)

    def release(self):
        images = self.structs(["name", "x"], [[self.text("a.jpg"), self.doubles(1, 2.5)], [self.text("b"), self.doubles()]])
        train = self.array(9, [1, 2], self.element(2, b"\1\0"), flags=0x200)
        return self.structs(["annolist", "img_train"], [[images, train]], b"RELEASE")

    def compressed(self, array):
        stream = zlib.compress(array)
        return self.numbers(15, len(stream)) + stream


class Cdf:
    """CDF files, version 3: records of size, type and fields, which tell where others lie."""

    VARIABLE, VALUES = 432, 792

    def __init__(self, encoding=6, row_major=True, packs_values=False, packs_file=False):
        self.encoding, self.row_major, self.packs_values, self.packs_file = encoding, row_major, packs_values, packs_file

    @staticmethod
    def record(kind, fields, *values, tail=b""):
        body = struct.pack(">" + fields, *values) + tail
        return struct.pack(">QI", 12 + len(body), kind) + body

    def file(self, rows=2, columns=3, following=0, numbers=b""):
        numbers = numbers or struct.pack("<6f" if self.encoding == 6 else ">6f", *(range(6) if self.row_major else (0, 3, 1, 4, 2, 5)))
        packed = gzip.compress(numbers, mtime=0)
        values = self.record(13, "IQ", 0, len(packed), tail=packed) if self.packs_values else self.record(7, "", tail=numbers)
        index = self.VALUES + len(values)
        compression = self.record(11, "4I", 5, 0, 1, 6)
        records = b"".join([
            self.record(1, "QIIIIIIIIi256x", 320, 3, 9, self.encoding, 2 + self.row_major, 0, 0, 0, 2, -1),
            self.record(2, "QQQQIIiIIQIIi", 0, self.VARIABLE, 0, index + 44, 0, 0, -1, 0, 1, 0, 0, 20170101, -1),
            compression,
            self.record(8, "QIIQQIIIiiIIQI256sIIIii", following, 21, 0, index, index, 5 if self.packs_values else 1, 0, 0, -1, -1, 1,
                        0, 404, 1, b"Pose", 2, rows, columns, -1, -1),
            values, self.record(6, "QIIIIQ", 0, 1, 1, 0, 0, self.VALUES)])
        if not self.packs_file:
            return struct.pack(">II", 0xCDF30001, 0xFFFF) + records
        packed = gzip.compress(records, mtime=0)
        whole = self.record(10, "QQI", 40 + len(packed), len(records), 0, tail=packed)
        return struct.pack(">II", 0xCDF30001, 0xCCCC0001) + whole + compression


def main(folder):
    mat = Mat()
    values = checkpoint()
    bare = collections.OrderedDict([("head.conv2d.weight", Tensor(Storage("0", "f", [1.0] * 4), [2, 2]))])
    tensor = {"dtype": "F32", "shape": [2], "data_offsets": [0, 8]}
    seeds = {
        "checkpoint/legacy": legacy_checkpoint(values),
        "checkpoint/legacy_bare": legacy_checkpoint(bare),
        "checkpoint/legacy_big_endian": legacy_checkpoint(bare, little_endian=False),
        "checkpoint/legacy_cut": legacy_checkpoint(values)[:-9],
        "checkpoint/zip": zip_checkpoint(values, zipfile.ZIP_STORED),
        "checkpoint/zip_deflated": zip_checkpoint(bare, zipfile.ZIP_DEFLATED),
        "checkpoint/tar": b"sys_info".ljust(257, b"\0") + b"ustar" + bytes(250),
        "zip_pickle/network": dump({"gen": {"w": Tensor(Storage("0", "f", [1.0] * 16), [4, 4])}}, legacy=False)[0],
        "zip_pickle/shared": dump({"gen": {str(i): Tensor(Storage("0", "e", [1.0] * 32), [4, 8]) for i in range(4)}},
                                  legacy=False)[0],
        "zip_pickle/bare": dump(bare, legacy=False)[0],
        "safetensors/two": safetensors({"__metadata__": {"format": "eventgan-generator", "format_version": "1",
                                                         "base_channels": "1", "bins": "9"},
                                        "head.bias": tensor, "pred.bias": {**tensor, "data_offsets": [8, 16]}},
                                       bytes(16)),
        "safetensors/empty": safetensors({}),
        "safetensors/hole": safetensors({"a": {**tensor, "data_offsets": [4, 12]}}, bytes(12)),
        "safetensors/deep": safetensors(b'{"a":' + b"[" * 64),
        "mat/plain": mat.file(mat.release()),
        "mat/big_endian": Mat(">").file(Mat(">").release()),
        "mat/compressed": mat.file(mat.compressed(mat.release())),
        "mat/cells": mat.file(mat.array(1, [2, 2], 3 * mat.text("x") + mat.element(14, b""), b"annolist_keyframes")),
        "mat/types": mat.file(mat.array(1, [1, 5], mat.array(10, [1, 1], mat.element(3, b"\1\2")) + mat.array(
            7, [1, 1], mat.element(7, bytes(4))) + mat.array(15, [1, 1], mat.element(13, b"\xff" * 8)) + mat.array(
                4, [2, 2], mat.element(17, "abcd".encode("utf-16-le"))) + mat.array(5, [1, 1], b""), b"annolist_keyframes")),
        "mat/huge": mat.file(mat.array(6, [0x7fffffff, 1], mat.numbers(9, 0xfffffff8), b"RELEASE")),
        "cdf/plain": Cdf().file(),
        "cdf/big_endian": Cdf(encoding=1, row_major=False).file(),
        "cdf/packed_values": Cdf(packs_values=True).file(),
        "cdf/packed_file": Cdf(packs_file=True).file(),
        "cdf/huge": Cdf(packs_values=True).file(rows=0x7FFFFFFF),
        "cdf/bomb": Cdf(packs_file=True).file()[:28] + struct.pack(">Q", 1 << 40) + Cdf(packs_file=True).file()[36:],
        "mat/bomb": mat.file(mat.compressed(mat.numbers(14, 1 << 20) + bytes(1 << 20))),
    }
    for name, content in seeds.items():
        path = pathlib.Path(folder) / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


if __name__ == "__main__":
    main(sys.argv[1])

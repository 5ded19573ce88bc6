"""Writes the seeds of the fuzz corpus: small checkpoints as PyTorch writes them, small weights files, small MATLAB and
CDF files, labels of a few boxes, tables of events, small recordings.

    python3 tests/fuzz/make_corpus.py tests/fuzz/corpus

Needs no PyTorch: classes of its names stand in for what a pickle refers to. Beside the seeds
stand inputs that the fuzzer made of them to reach other branches of the readers (found_*).
"""

import bz2
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
    machine = {"protocol_version": 1001, "little_endian": little_endian,
               "type_sizes": {"short": 2, "int": 4, "long": 4}}
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
        header = (self.element(6, self.numbers(kind | flags, 0)) + self.element(5, self.numbers(*dims))
                  + self.element(1, name))
        return self.element(14, header + content)

    def text(self, value):
        return self.array(4, [1, len(value)], self.element(16, value.encode()))

    def doubles(self, *values):
        return self.array(6, [len(values) and 1, len(values)],
                          self.element(9, struct.pack(f"{self.order}{len(values)}d", *values)))

    def structs(self, names, rows, name=b""):
        fields = (self.element(5, self.numbers(16))
                  + self.element(1, b"".join(field.encode().ljust(16, b"\0") for field in names)))
        return self.array(2, [1, len(rows)], fields + b"".join(b"".join(row) for row in rows), name)

    def file(self, *arrays):
        version = struct.pack(f"{self.order}H", 0x100) + (b"IM" if self.order == "<" else b"MI")
        return b"MATLAB 5.0 MAT-file".ljust(124) + version + b"".join(arrays)

    def release(self):
        images = self.structs(["name", "x"],
                              [[self.text("a.jpg"), self.doubles(1, 2.5)], [self.text("b"), self.doubles()]])
        train = self.array(9, [1, 2], self.element(2, b"\1\0"), flags=0x200)
        return self.structs(["annolist", "img_train"], [[images, train]], b"RELEASE")

    def compressed(self, array):
        stream = zlib.compress(array)
        return self.numbers(15, len(stream)) + stream


class Cdf:
    """CDF files, version 3: records of size, type and fields, which tell where others lie."""

    VARIABLE, VALUES = 432, 792

    def __init__(self, encoding=6, row_major=True, packs_values=False, packs_file=False):
        self.encoding, self.row_major, self.packs_values, self.packs_file = (encoding, row_major, packs_values,
                                                                             packs_file)

    @staticmethod
    def record(kind, fields, *values, tail=b""):
        body = struct.pack(">" + fields, *values) + tail
        return struct.pack(">QI", 12 + len(body), kind) + body

    def file(self, rows=2, columns=3, following=0, numbers=b""):
        numbers = numbers or struct.pack("<6f" if self.encoding == 6 else ">6f",
                                         *(range(6) if self.row_major else (0, 3, 1, 4, 2, 5)))
        packed = gzip.compress(numbers, mtime=0)
        values = self.record(13, "IQ", 0,
                             len(packed), tail=packed) if self.packs_values else self.record(7, "", tail=numbers)
        index = self.VALUES + len(values)
        compression = self.record(11, "4I", 5, 0, 1, 6)
        records = b"".join([
            self.record(1, "QIIIIIIIIi256x", 320, 3, 9, self.encoding, 2 + self.row_major, 0, 0, 0, 2, -1),
            self.record(2, "QQQQIIiIIQIIi", 0, self.VARIABLE, 0, index + 44, 0, 0, -1, 0, 1, 0, 0, 20170101, -1),
            compression,
            self.record(8, "QIIQQIIIiiIIQI256sIIIii", following, 21, 0, index, index, 5 if self.packs_values else 1, 0,
                        0, -1, -1, 1, 0, 404, 1, b"Pose", 2, rows, columns, -1, -1),
            values, self.record(6, "QIIIIQ", 0, 1, 1, 0, 0, self.VALUES)])
        if not self.packs_file:
            return struct.pack(">II", 0xCDF30001, 0xFFFF) + records
        packed = gzip.compress(records, mtime=0)
        whole = self.record(10, "QQI", 40 + len(packed), len(records), 0, tail=packed)
        return struct.pack(">II", 0xCDF30001, 0xCCCC0001) + whole + compression


VOC_OBJECT = """<object><name>%s</name><truncated>1</truncated><difficult>0</difficult><occluded>0</occluded>
<bndbox><xmin>%s</xmin><ymin>5</ymin><xmax>30.5</xmax><ymax>20</ymax></bndbox></object>
"""


def voc(*objects, before=""):
    content = "".join(VOC_OBJECT % pair for pair in objects)
    return (before + "<annotation><filename>a.jpg</filename><size><width>40</width><height>20</height></size>\n"
            + content +
            "</annotation>\n").encode()


def coco(annotation, category=None):
    box = {"id": 4, "image_id": 9, "category_id": 3, "bbox": [1, 2.5, 30, 4]}
    return json.dumps({"info": {"year": 2026}, "images": [{"id": 9, "file_name": "a.jpg", "width": 40, "height": 30}],
                       "annotations": [{**box, **annotation}],
                       "categories": [{"id": 3, "name": "person", **(category or {})}]}).encode()


def png(width, height, kind, bits, rows, palette=b"", interlaced=0):
    """What read_png_input makes a file of."""
    header = struct.pack(">IIBBBBB", width, height, bits, kind, 0, 0, interlaced)
    return header + bytes([len(palette) // 3]) + palette + rows


def index_png(bits, rows, palette=False):
    """A PNG of numbers, grey or of a palette, 8 or 16 bits each."""
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    header = struct.pack(">IIBBBBB", len(rows[0]), len(rows), bits, 3 if palette else 0, 0, 0, 0)
    packed = b"".join(b"\0" + struct.pack(f">{len(row)}{'H' if bits == 16 else 'B'}", *row) for row in rows)
    colours = chunk(b"PLTE", bytes(3 * 256)) if palette else b""
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + colours + chunk(b"IDAT", zlib.compress(packed))
            + chunk(b"IEND", b""))


class Aedat4:
    """Recordings in AEDAT 4.0. Its FlatBuffers have their length in front; of a field there is None, its bytes, or, for
    a string or vector, the bytes with a count in front, as one in a tuple."""

    INFO = b"""<dv version="2.0"><node name="outInfo"><node name="0"><attr key="typeIdentifier">EVTS</attr>\
<node name="info">
<attr key="sizeX">4</attr><attr key="sizeY">3</attr></node></node><node name="1">\
<attr key="typeIdentifier">FRME</attr></node>
<node name="2"><attr key="typeIdentifier">IMUS</attr></node></node></dv>"""

    def __init__(self, compression=0):
        self.compression = compression

    @staticmethod
    def table(fields):
        """A table with its list of places in front, where the table begins in it,
        and where its vectors are to be told."""
        places, body, vectors = b"", bytes(8), []
        for field in fields:
            places += struct.pack("<H", 0 if field is None else len(body))
            if isinstance(field, tuple):
                vectors.append((len(body), field[0]))
            body += b"" if field is None else bytes(8) if isinstance(field, tuple) else field + bytes(-len(field) % 8)
        places = struct.pack("<HH", 4 + len(places), len(body)) + places
        start = len(places) + -len(places) % 8
        return places.ljust(start, b"\0") + struct.pack("<i", start) + body[4:], start, vectors

    def root(self, identifier, *fields):
        inner, start, vectors = self.table(fields)
        whole = bytearray(struct.pack("<II4s4x", 0, 16 + start - 4, identifier) + inner)
        for place, content in vectors:
            whole += bytes((4 - len(whole)) % 8)
            struct.pack_into("<I", whole, 16 + start + place, len(whole) - (16 + start + place))
            whole += content
        struct.pack_into("<I", whole, 0, len(whole) - 4)
        return bytes(whole)

    def packed(self, content):
        if self.compression in (1, 2):  # one LZ4 block, as it is
            return bytes.fromhex("04224d18604082") + struct.pack("<I", len(content) | 1 << 31) + content + bytes(4)
        if self.compression in (3, 4):  # one Zstandard block, as it is
            return (bytes.fromhex("28b52ffda0") + struct.pack("<I", len(content))
                    + struct.pack("<I", len(content) << 3 | 1)[:3] + content)
        return content

    def header(self, table_byte):
        return b"#!AER-DAT4.0\r\n" + self.root(b"IOHE", struct.pack("<i", self.compression),
                                               struct.pack("<q", table_byte),
                                               (struct.pack("<I", len(self.INFO)) + self.INFO + b"\0",))

    def events(self, *events):
        return self.root(b"EVTS", (struct.pack("<I", len(events))
                                   + b"".join(struct.pack("<qhhB3x", *event) for event in events),))

    def frame(self, time, channels=1):
        numbers = [struct.pack("<q", value) for value in (time, 0, 0, time - 1, time + 1)]
        numbers += [struct.pack("<b", 8 * channels - 8)] + [struct.pack("<h", value) for value in (4, 3, 0, 0)]
        return self.root(b"FRME", *numbers, (struct.pack("<I", 12 * channels) + bytes(range(12 * channels)),))

    def file(self, has_table=True):
        packets = [(0, self.events((5, 0, 0, 1), (6, 3, 2, 0)), 2, 5, 6), (1, self.frame(6), 1, 6, 6),
                   (2, b"other", 1, 0, 0),
                   (0, self.events((6, 1, 1, 1), (9, 2, 2, 0)), 2, 6, 9), (1, self.frame(10, 3), 1, 10, 10)]
        result, entries = self.header(-1), []
        for stream, content, count, begin, end in packets:
            content = self.packed(content)
            entries.append(self.table([struct.pack("<q", len(result) + 8), struct.pack("<ii", stream, len(content)),
                                       *(struct.pack("<q", value) for value in (count, begin, end))]))
            result += struct.pack("<ii", stream, len(content)) + content
        if not has_table:
            return result
        vector, tables = struct.pack("<I", len(entries)), b""
        begin = 4 * len(entries) + -4 * len(entries) % 8  # of the first table, behind the count
        for i, (entry, start, _) in enumerate(entries):
            vector += struct.pack("<I", begin + len(tables) + start - 4 * i)
            tables += entry
        table = self.root(b"FTAB", (vector.ljust(4 + begin, b"\0") + tables,))
        return self.header(len(result)) + result[len(self.header(-1)):] + self.packed(table)


def aedat3():
    """Events of a DVS128, one marked invalid; others; a frame that its sensor does not have."""
    def packet(kind, size, *events):
        return struct.pack("<HHIIIIII", kind, 1, size, 4, 0, *[len(events)] * 3) + b"".join(events)
    events = [struct.pack("<II", x << 17 | y << 2 | p << 1 | valid, t)
              for x, y, t, p, valid in ((0, 0, 5, 1, 1), (9, 9, 6, 1, 0), (127, 1, 7, 0, 1))]
    return (b"#!AER-DAT3.1\r\n#Format: RAW\r\n#Source 1: DVS128\r\n#!END-HEADER\r\n" + packet(1, 8, *events)
            + packet(3, 12, bytes(12)) + packet(2, 40, struct.pack("<9i", 3, 1, 4, 2, 3, 2, 1, 0, 0) + bytes(4)))


def rosbag(compression, has_index=True):
    """An EventArray, an Image and an EventPacket in mono; definitions are left out."""
    def text(content):
        return struct.pack("<I", len(content)) + content

    def record(data, **fields):
        header = b"".join(text(name.encode() + b"=" + value) for name, value in fields.items())
        return text(header) + text(data)

    def start(height, width):
        return struct.pack("<III", 1, 1, 3000) + text(b"cam") + struct.pack("<II", height, width)
    number = struct.Struct("<I").pack
    connections = b"".join(
        record(text(b"type=" + kind) + text(b"message_definition="), op=b"\7", conn=number(i), topic=topic)
        for i, (topic, kind) in enumerate(((b"/a/e", b"dvs_msgs/EventArray"), (b"/a/i", b"sensor_msgs/Image"),
                                           (b"/a/e", b"event_camera_msgs/EventPacket"))))
    messages = (start(3, 4) + struct.pack("<IHHIIBHHIIB", 2, 0, 0, 1, 5000, 1, 3, 2, 1, 9000, 0),
                start(3, 4) + text(b"mono8") + struct.pack("<BI", 0, 4) + text(bytes(range(12))),
                start(3, 4) + struct.pack("<QQ", 1, 50000) + text(b"mono") + b"\0" + text(
                    struct.pack("<Q", 1 << 63 | 1 << 48 | 2 << 32 | 7000)))
    content = connections + b"".join(record(message, op=b"\2", conn=number(i), time=bytes(8))
                                     for i, message in enumerate(messages))
    packed = {"none": content, "bz2": bz2.compress(content),
              "lz4": bytes.fromhex("04224d18604082") + number(len(content) | 1 << 31) + content + bytes(4)}[compression]
    chunk = record(packed, op=b"\5", compression=compression.encode(), size=number(len(content)))

    def head(index_at):
        return b"#ROSBAG V2.0\n" + record(b"", op=b"\3", index_pos=struct.pack("<Q", index_at), conn_count=number(3),
                                          chunk_count=number(1))
    place = len(head(0))
    index = connections + record(b"".join(struct.pack("<II", i, 1) for i in range(3)), op=b"\6", ver=number(1),
                                 chunk_pos=struct.pack("<Q", place), count=number(3))
    return head(place + len(chunk)) + chunk + index if has_index else head(0) + chunk


def prophesee(header, letter, *words):
    return "".join(f"% {line}\n" for line in header).encode() + struct.pack(f"<{len(words)}{letter}", *words)


def npy(descr, shape, data):
    header = f"{{'descr': {descr!r}, 'fortran_order': False, 'shape': {shape!r}, }}".encode()
    header += b" " * (-(11 + len(header)) % 64) + b"\n"
    return b"\x93NUMPY\1\0" + struct.pack("<H", len(header)) + header + data


def npz(arrays):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in arrays.items():
            archive.writestr(zipfile.ZipInfo(name + ".npy"), content, zipfile.ZIP_DEFLATED)
    return file.getvalue()


def tables():
    fields = [("t", "<u8"), ("x", "<u2"), ("", "|V1"), ("y", "<i2"), ("p", "|b1")]
    boxes = [("ts", "<u8"), ("x", "<f4"), ("y", "<f4"), ("w", "<f4"), ("h", "<f4"), ("class_id", "|u1")]
    rows = [(5, 0, 2, 1), (7, 3, 0, 0)]
    return {"fields": npy(fields, (2,), b"".join(struct.pack("<QHxhB", *row) for row in rows)),
            "rows": npy("<f4", (2, 4), b"".join(struct.pack("<4f", *row) for row in rows)),
            "arrays": npz({name: npy("<i4", (2,), struct.pack("<2i", *column))
                           for name, column in zip("txyp", zip(*rows))}),
            "lines": b"x,t,y,p\n0,5,2,1\n3,7,0,0\n",
            "boxes": npy(boxes, (1,), struct.pack("<Q4fB", 5, 1, 2, 3, 4, 0)),
            "nothing": npy([("t", "|V0"), ("x", "<u2")], (1 << 40,), b""),
            "huge": npy(fields, (1 << 60,), bytes(28)),
            "bomb": npz({name: npy("|u1", (1 << 20,), bytes(1 << 20)) for name in "txyp"})}


def main(folder):
    mat = Mat()
    dat = ["Data file containing CD events", "Version 2", "Width 8", "Height 6"]
    evt2, evt3 = ["evt 2.0", "geometry 8x6", "end"], ["format EVT3;height=6;width=40", "end"]
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
                4, [2, 2], mat.element(17, "abcd".encode("utf-16-le"))) + mat.array(5, [1, 1], b""),
                                        b"annolist_keyframes")),
        "mat/huge": mat.file(mat.array(6, [0x7fffffff, 1], mat.numbers(9, 0xfffffff8), b"RELEASE")),
        "cdf/plain": Cdf().file(),
        "cdf/big_endian": Cdf(encoding=1, row_major=False).file(),
        "cdf/packed_values": Cdf(packs_values=True).file(),
        "cdf/packed_file": Cdf(packs_file=True).file(),
        "cdf/huge": Cdf(packs_values=True).file(rows=0x7FFFFFFF),
        "cdf/bomb": Cdf(packs_file=True).file()[:28] + struct.pack(">Q", 1 << 40) + Cdf(packs_file=True).file()[36:],
        "voc/two": voc(("person", 1), ("traffic &amp; light", 12.25)),
        "voc/empty": voc(),
        "voc/outside": voc(("person", 0)),
        "voc/doctype": voc(before='<!DOCTYPE annotation [<!ENTITY a "b"><!ENTITY c "&a;&a;">]>'),
        "voc/deep": b"<annotation>" + b"<a>" * 2000,
        "voc/wide": voc(("person", 1)).decode().encode("utf-16"),
        "mot/two": b"2,1,10,20,30.5,40,1,1,0.5\r\n1,1,9,20,30,40,0,7,1\r\n",
        "mot/2015": b"1,1,10,20,30,40,1,-1,-1,-1\n1,2,10,20,30,40,0,5.5,0,1e3",
        "mot/faults": b"1,1,1,1,1,1\n2,1,nan,1,1,1,1\n3,1,1,1,1,1,1,14\n4,1,1,1,1,1,1\n4,1,1,1,1,1,1\n",
        "mot/seqinfo": b"[Sequence]\nname=a\nimDir=img1\nframeRate=30\n"
                       b"seqLength=9\nimWidth=40\nimHeight=20\nimExt=.jpg\n",
        "csv/three": b"\xef\xbb\xbfimage,class,left,top,right,bottom,track\r\na.png,car,1,2,3.5,4,7\r\n"
                     b'"b ""1"", c.png","x,y",0,0,1,1,\r\n'
                     b"c.png,,,,,,\r\n",
        "csv/faults": b"class,bottom,right,top,left,image\ncar,4,3,2,1,a\ncar,4,nan,2,1,b\n,,,,,a\n,4,3,2,1,c\n",
        "csv/quotes": b'image,class,left,top,right,bottom\n"a,""b\n"c,d,1,2,3,4\n',
        "csv/nul": b"image,class,left,top,right,bottom,note\na,car,1,2,3,4,\0\n",
        "coco/instances": coco({}),
        "coco/persons": coco({"keypoints": [1, 2, 2, 0, 0, 0], "num_keypoints": 1}, {"keypoints": ["nose", "tail"]}),
        "coco/segments": coco({"segmentation": {"counts": "a", "size": [3, 4]}, "area": 1.5, "iscrowd": 1}),
        "coco/polygons": coco({"segmentation": [[1, 2, 30.5, 2, 9, 20], [5, 5, 5, 9, 9, 9, 9, 5], []], "bbox": None}),
        "coco/runs": coco({"segmentation": {"counts": [100, 20, 1080], "size": [30, 40]}, "bbox": None}),
        "coco/text": coco({"segmentation": {"counts": "T3d0hQ1", "size": [30, 40]}, "iscrowd": True}),
        "coco/outside": coco({"bbox": [90, 1, 2, 3]}),
        "coco/nan": coco({"area": float("nan")}),
        "coco/orphan": coco({"image_id": 8}),
        "coco/deep": b'{"info": ' + b"[" * 4000,
        "mask/grey": index_png(8, [[0, 1, 1, 0], [2, 1, 0, 0], [2, 2, 0, 255]]),
        "mask/palette": index_png(8, [[0, 1, 1, 0], [2, 1, 255, 0], [1, 2, 2, 0]], palette=True),
        "mask/wide": index_png(16, [[0, 1001, 1001, 0], [2002, 0, 10000, 10000]]),
        "mask/white": index_png(8, [[0, 255], [255, 0]]),
        "mask/cut": index_png(8, [[0, 1, 2, 3]])[:-9],
        "png/colours": png(2, 2, 2, 8, b"\1abcdef\2ABCDEF"),
        "png/average": png(3, 2, 0, 8, b"\3abc\4ABC"),
        "png/palette": png(2, 2, 3, 8, b"\0\0\1\0\1\0", b"rgbRGB"),
        "png/beyond": png(2, 1, 3, 8, b"\0\0\2", b"rgbRGB"),
        "png/wide": png(2, 1, 4, 16, b"\4abcdefgh"),
        "png/bits": png(9, 1, 0, 1, b"\0ab"),
        "png/interlaced": png(1, 1, 2, 8, b"\0abc", interlaced=1),
        "yolo/data": b"path: ../x\nnames:\n  0: person\n  1: 'a b'\nkpt_shape: [17, 3]\nflip_idx: [0, 2, 1]\n",
        "yolo/aliases": b"a: &a [x, y]\nb: &b [*a, *a]\nnames: *a\n",
        "yolo/boxes": b"0 0.5 0.5 0.25 1e-1\r\n1 0.1 0.2 0.2 0.4\n",
        "yolo/pose": b"0 0.5 0.5 0.25 0.5 0.4 0.5 2 0 0 0\n",
        "yolo/outline": b"0 0.1 0.1 0.2 0.1 0.2 0.2\n",
        "yolo/mixed": b"0 0.1 0.1 0.2 0.1 0.2 0.2 0.1 0.3\n1 0.5 0.5 0.2 0.2\n",
        "yolo/deep": b"names: " + b"[" * 4000,
        "aedat4/plain": Aedat4().file(),
        "aedat4/lz4": Aedat4(1).file(),
        "aedat4/zstd": Aedat4(4).file(),
        "aedat4/unplugged": Aedat4(3).file(has_table=False)[:-7],
        "aedat4/begun": Aedat4().file()[:len(Aedat4().file(has_table=False)) + 4],
        "aedat4/huge": Aedat4().file().replace(struct.pack("<Iq", 2, 5), struct.pack("<Iq", 1 << 31, 5)),
        "aedat3/plain": aedat3(),
        "aedat3/cut": aedat3()[:-50],
        "rosbag/plain": rosbag("none"),
        "rosbag/bz2": rosbag("bz2"),
        "rosbag/lz4": rosbag("lz4"),
        "rosbag/interrupted": rosbag("none", has_index=False) + b"\x20\0\0\0",
        "prophesee/dat": prophesee(dat, "H", 0x080c) + struct.pack("<4I", 5, 1 << 28 | 5 << 14 | 7, 6, 0),
        "prophesee/evt2": prophesee(evt2, "I", 0x10000000, 0x80000003, 0x11403805, 0xa0000000, 0x80000004, 0x00001003),
        "prophesee/evt3": prophesee(evt3, "H", 0x2001, 0x8fff, 0x6fff, 0x0005, 0x2827, 0x3803, 0x4801, 0x5080, 0xa001,
                                    0x8000, 0x6001, 0x2001, 0xe000, 0xf000, 0x7000),
        "prophesee/falls": prophesee(evt3, "H", 0x8800, 0x8700),
        "mat/bomb": mat.file(mat.compressed(mat.numbers(14, 1 << 20) + bytes(1 << 20))),
    }
    seeds.update({f"table/{name}": content for name, content in tables().items()})
    for name, content in seeds.items():
        path = pathlib.Path(folder) / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


if __name__ == "__main__":
    main(sys.argv[1])

"""Reads AEDAT 4.0 as its page describes it: a line, a header, packets, a table of them; each a FlatBuffer, packed as
an LZ4 frame. Nothing of the program's, nor of any library."""

import struct
import xml.etree.ElementTree as ElementTree

import numpy as np

LINE = b"#!AER-DAT4.0\r\n"


def unpack_block(block, out):
    """Appends the content of an LZ4 block, which may repeat what is in `out`."""
    place = 0

    def length(nibble):
        nonlocal place
        more = 255 if nibble == 15 else 0
        while more == 255:
            more = block[place]
            nibble += more
            place += 1
        return nibble

    while True:
        token = block[place]
        place += 1
        literals = length(token >> 4)
        out += block[place:place + literals]
        place += literals
        if place == len(block):
            return
        offset, = struct.unpack_from("<H", block, place)
        place += 2
        for _ in range(length(token & 15) + 4):
            out.append(out[-offset])


def unpack_lz4(frame):
    """The content of an LZ4 frame without a dictionary; checksums are passed over."""
    magic, flags, _ = struct.unpack_from("<IBB", frame)
    assert magic == 0x184D2204 and flags >> 6 == 1 and not flags & 1
    at, out = 7 + (8 if flags & 8 else 0), bytearray()
    while True:
        size, = struct.unpack_from("<I", frame, at)
        at += 4
        if size == 0:
            assert at + (4 if flags & 4 else 0) == len(frame)
            return bytes(out)
        block = frame[at:at + (size & 0x7fffffff)]
        assert len(block) == size & 0x7fffffff
        at += len(block) + (4 if flags & 16 else 0)
        if size >> 31:
            out += block
        else:
            unpack_block(block, out)


class Table:
    """A FlatBuffer's table: fields by their place."""

    def __init__(self, data, at):
        self.data, self.at = data, at
        vtable = at - struct.unpack_from("<i", data, at)[0]
        size, = struct.unpack_from("<H", data, vtable)
        self.places = struct.unpack_from(f"<{size // 2 - 2}H", data, vtable + 4)

    @classmethod
    def root(cls, data, identifier):
        """Of a FlatBuffer with its size in front."""
        assert struct.unpack_from("<I", data)[0] == len(data) - 4 and data[8:12] == identifier, data[:12]
        return cls(data, 4 + struct.unpack_from("<I", data, 4)[0])

    def place(self, field):
        return self.at + self.places[field] if field < len(self.places) and self.places[field] else None

    def number(self, field, kind, default=0):
        place = self.place(field)
        return default if place is None else struct.unpack_from("<" + kind, self.data, place)[0]

    def vector(self, field):
        """Where its elements begin, and how many they are."""
        place = self.place(field)
        place += struct.unpack_from("<I", self.data, place)[0]
        return place + 4, struct.unpack_from("<I", self.data, place)[0]

    def bytes(self, field):
        place, count = self.vector(field)
        return self.data[place:place + count]

    def tables(self, field):
        place, count = self.vector(field)
        return [Table(self.data, at + struct.unpack_from("<I", self.data, at)[0])
                for at in range(place, place + 4 * count, 4)]


def read(path):
    """Width and height; events t, x, y, p; frames, each its time and its pixels [y, x] or [y, x, channel]."""
    data = path.read_bytes()
    assert data.startswith(LINE)
    begin = len(LINE) + 4 + struct.unpack_from("<I", data, len(LINE))[0]
    header = Table.root(data[len(LINE):begin], b"IOHE")
    assert header.number(0, "i") == 1  # LZ4
    table_at = header.number(1, "q", -1)
    streams = ElementTree.fromstring(header.bytes(2).decode()).find("node[@name='outInfo']")
    sizes = []
    for number, kind in (("0", "EVTS"), ("1", "FRME")):
        stream = streams.find(f"node[@name='{number}']")
        assert stream.find("attr[@key='typeIdentifier']").text == kind
        assert stream.find("attr[@key='compression']").text == "LZ4"
        sizes.append([int(stream.find(f"node[@name='info']/attr[@key='{key}']").text) for key in ("sizeX", "sizeY")])
    assert sizes[0] == sizes[1]

    rows, frames, at, told = [], [], begin, []
    while at < table_at:
        stream, size = struct.unpack_from("<ii", data, at)
        content = unpack_lz4(data[at + 8:at + 8 + size])
        if stream == 0:
            place, count = Table.root(content, b"EVTS").vector(0)
            assert 0 < count <= 8192 and place % 8 == 0  # as 64-bit numbers want it
            rows.append(np.frombuffer(content, [("t", "<i8"), ("x", "<i2"), ("y", "<i2"), ("p", "?"), ("", "V3")],
                                      count, place))
            told.append((at + 8, size, stream, count, rows[-1]["t"][0], rows[-1]["t"][-1]))
        else:
            frame = Table.root(content, b"FRME")
            time, *others = (frame.number(field, "q") for field in range(5))
            assert not any(others)  # no exposure
            width, height, left, top = (frame.number(field, "h") for field in range(6, 10))
            assert [width, height, left, top] == [*sizes[0], 0, 0]
            shape = {0: (height, width), 16: (height, width, 3)}[frame.number(5, "b")]
            frames.append((time, np.frombuffer(frame.bytes(10), np.uint8).reshape(shape)))
            told.append((at + 8, size, stream, 1, time, time))
        at += 8 + size
    assert at == table_at
    entries = Table.root(unpack_lz4(data[table_at:]), b"FTAB").tables(0)
    assert told == [(entry.number(0, "q"), *struct.unpack_from("<ii", entry.data, entry.place(1))[::-1],
                     *(entry.number(field, "q") for field in (2, 3, 4))) for entry in entries]
    events = np.concatenate(rows) if rows else np.zeros(0, [("t", "i8"), ("x", "i2"), ("y", "i2"), ("p", "?")])
    return sizes[0], tuple(events[name].astype(np.int64) for name in "txyp"), frames

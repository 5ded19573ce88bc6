"""Recordings that exports write, read with numpy and h5py, or as their pages describe the bytes."""

import contextlib

import h5py
import numpy as np

# Prophesee's boxes, as RVT's utils/evaluation/prophesee/io/box_loading.py has them.
BBOX_DTYPE = np.dtype({"names": ["t", "x", "y", "w", "h", "class_id", "track_id", "class_confidence"],
                       "formats": ["<i8", "<f4", "<f4", "<f4", "<f4", "<u4", "<u4", "<f4"],
                       "offsets": [0, 8, 12, 16, 20, 24, 28, 32], "itemsize": 40})
# DSEC-Det's, as the text of its label.py has them.
TRACKS_DTYPE = np.dtype([("t", "<u8"), ("x", "<f8"), ("y", "<f8"), ("h", "<f8"), ("w", "<f8"), ("class_id", "u1"),
                         ("class_confidence", "<f8"), ("track_id", "<u8")])


def read_windows(path):
    """Begin, end, label in microseconds, number of events, and id of each sample of a recording."""
    lines = [line.split(" ", 4) for line in path.read_text().splitlines()]
    return [(*map(int, fields[:4]), fields[4]) for fields in lines]


def slice_dsec(file, begin_us, end_us):
    """The events t, x, y, p of a window, as DSEC's EventSlicer finds them."""
    ms_to_idx, offset = file["ms_to_idx"][:].astype(np.int64), int(file["t_offset"][()])
    begin_us, end_us = begin_us - offset, end_us - offset
    first, last = ms_to_idx[begin_us // 1000], ms_to_idx[-(-end_us // 1000)]  # beyond them EventSlicer has no window
    t = file["events/t"][first:last].astype(np.int64)
    inside = slice(first + np.searchsorted(t, begin_us), first + np.searchsorted(t, end_us))
    return [file[f"events/{name}"][inside].astype(np.int64) + (offset if name == "t" else 0) for name in "txyp"]


def arrays_of(path):
    """The arrays of a .npy, .npz or HDF5 file, by their names: dtype, shape, bytes."""
    if path.suffix == ".h5":
        with h5py.File(path) as file:
            arrays = {name: file[name][()] for name in file}
    else:
        with np.load(path) if path.suffix == ".npz" else contextlib.nullcontext({"": np.load(path)}) as file:
            arrays = dict(file)
    return {name: (array.dtype, array.shape, array.tobytes()) for name, array in arrays.items()}


def read_columns(path):
    """t, x, y, p of DSEC's and Prophesee's HDF5."""
    with h5py.File(path) as file:
        t, *others = (file[f"events/{column}"][:].astype("int64") for column in "txyp")
        return t + (file["t_offset"][()] if "t_offset" in file else 0), *others


def decode_evt3(data):
    """Height and width, and t, x, y, p of a RAW file of short silences, as the page of EVT 3.0 describes it."""
    header, words = data.split(b"% end\n", 1)
    height, width = (int(header.split(key, 1)[1].split(end, 1)[0])
                     for key, end in ((b"height=", b";"), (b"width=", b"\n")))
    words = np.frombuffer(words, "<u2").astype(np.int64)

    def last(kind, value):
        """What the last word of a kind told, at each word."""
        at = np.where(words >> 12 == kind, np.arange(len(words)), 0)
        return np.maximum.accumulate(at), value[np.maximum.accumulate(at)]

    at_high, _ = last(8, words)
    highs = words[words >> 12 == 8] & 0xfff
    high = (highs + 4096 * np.cumsum(np.diff(highs, prepend=0) < 0))[np.cumsum(words >> 12 == 8) - 1]
    at_low, low = last(6, words & 0xfff)
    t = (high << 12) + np.where(at_low > at_high, low, 0)
    events = words >> 12 == 2
    return (height, width), (t[events], words[events] & 0x7ff, last(0, words & 0x7ff)[1][events],
                             words[events] >> 11 & 1)

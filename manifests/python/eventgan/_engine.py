"""libeventgan's functions, by ctypes: pipeline/library/eventgan.h says what each does. NumPy owns all arrays."""

from __future__ import annotations

import ctypes
import os

import numpy as np

_NAME = "libeventgan.so.1"


def _library() -> ctypes.CDLL:
    """Beside this file, as pip and a build lay it; below, in the wheel with a program; behind python3/dist-packages;
    else the system's."""
    here = os.path.dirname(os.path.abspath(__file__))
    for place in (here, os.path.join(here, "lib"), os.path.join(here, "..", "..", "..")):
        if os.path.exists(os.path.join(place, _NAME)):
            return ctypes.CDLL(os.path.join(place, _NAME))
    return ctypes.CDLL(_NAME)


class _Images(ctypes.Structure):
    _fields_ = [("data", ctypes.c_void_p), ("count", ctypes.c_int64), ("height", ctypes.c_int64),
                ("width", ctypes.c_int64), ("strides", ctypes.c_int64 * 4), ("channels", ctypes.c_int32),
                ("number", ctypes.c_int32)]


class Labels(ctypes.Structure):
    """An eventgan_labels."""

    _fields_ = [("boxes", ctypes.c_void_p), ("box_count", ctypes.c_int64), ("clipped", ctypes.c_void_p),
                ("unclipped", ctypes.c_void_p), ("joints", ctypes.c_void_p), ("person_count", ctypes.c_int64),
                ("joint_count", ctypes.c_int64), ("placed", ctypes.c_void_p)]


EVENT = np.dtype([("t", "f8"), ("x", "i4"), ("y", "i4"), ("p", "i1")], align=True)
USAGE, INPUT_MISSING, OUT_OF_MEMORY = 64, 66, 71

try:
    lib = _library()
except OSError as error:
    raise ImportError(str(error)) from error
_P, _I32, _I64, _U64, _F64 = ctypes.c_void_p, ctypes.c_int32, ctypes.c_int64, ctypes.c_uint64, ctypes.c_double
for _name, _result, _arguments in [
        ("version", ctypes.c_char_p, ()), ("error", ctypes.c_char_p, ()), ("load", _I32, (ctypes.c_char_p, _P)),
        ("free", None, (_P,)), ("describe", ctypes.c_char_p, (_P,)),
        ("shape", _I32, (_P, _I64, _I64, _I64, _I32, _P, _P)),
        ("generate", _I32, (_P, _P, _P, _U64, _P, _U64, _P, _I64)),
        ("sample", _I32, (_P, _P, _P, _P, _I32, _U64, _P, _U64, _P)),
        ("prepare", _I32, (_P, _P, _P, _U64)),
        ("sample_events", _I32, (_P, _I32, _I32, _I32, _F64, _U64, _I32, _P, _P)), ("free_events", None, (_P,)),
        ("representations", ctypes.c_char_p, ()),
        ("represent", _I32, (_P, _U64, ctypes.c_char_p, _I32, _I32, _P, _P, _P, _P, _U64)),
        ("decode", _I32, (ctypes.c_char_p, _U64, _I32, _I32, ctypes.c_float, _P, _U64)), ("end", None, ())]:
    _function = getattr(lib, f"eventgan_{_name}")
    _function.restype, _function.argtypes = _result, _arguments

# A daemon thread goes on while Python ends; the library is taken down behind that, and behind all handlers of `atexit`,
# of which one may join a thread that still calls.
ctypes.pythonapi.Py_AtExit(lib.eventgan_end)


def check(code: int) -> None:
    """Raises what an eventgan_result stands for."""
    if code:
        error = {USAGE: ValueError, INPUT_MISSING: ValueError, OUT_OF_MEMORY: MemoryError}.get(code, RuntimeError)
        raise error(lib.eventgan_error().decode(errors="replace"))


def address(array: np.ndarray) -> int:
    """Of the first number."""
    return array.__array_interface__["data"][0]


def shape_text(array: np.ndarray) -> str:
    """ "(260, 861, 3)" """
    return f"({', '.join(map(str, array.shape))})"


class Images:
    """Images [H, W] and [H, W, 3], or a batch of them: an eventgan_images, and the array in whose memory they are."""

    def __init__(self, array: np.ndarray, name: str, is_batch: bool = False) -> None:
        axes = array.ndim - int(is_batch)
        if axes not in (2, 3) or axes == 3 and array.shape[-1] != 3:
            wanted = "[N, H, W] or [N, H, W, 3]" if is_batch else "[H, W] or [H, W, 3]"
            raise ValueError(f"expected an array {wanted}, got one of shape {shape_text(array)} for {name}")
        if array.dtype.kind != "f" and array.dtype != np.uint8:
            raise ValueError(f"expected uint8, or floating-point numbers from 0 to 1, got {array.dtype} for {name}")
        if array.dtype not in (np.uint8, np.float32, np.float64):
            array = array.astype(np.float64)
        shape, strides = array.shape, array.strides
        if not is_batch:
            shape, strides = (1, *shape), (0, *strides)
        self.array, self.count, self.height, self.width = array, *shape[:3]
        channels = 3 if axes == 3 else 1
        self._struct = _Images(address(array), *shape[:3], (*strides, 0) if channels == 1 else strides, channels,
                               0 if array.dtype == np.uint8 else array.dtype.itemsize // 4)
        self.pointer = ctypes.byref(self._struct)


def pair(previous: np.ndarray, following: np.ndarray, is_batch: bool = False) -> tuple[Images, Images]:
    """Two images of one size, or as many of each."""
    both = Images(previous, "previous", is_batch), Images(following, "following", is_batch)
    if len({(each.count, each.height, each.width) for each in both}) != 1:
        raise ValueError(f"expected images of one size, got shapes {shape_text(previous)} and "
                         f"{shape_text(following)} for previous and following")
    return both

"""What messages say of values that are not as expected."""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterable, Sequence
from typing import Any


def did_you_mean(unknown: Iterable[Any], known: Iterable[Any]) -> str:
    """ "; did you mean Car?" of the nearest name for the first unknown one that has any, or nothing."""
    by_letters = {str(name).lower(): str(name) for name in known}
    for word in unknown:
        for near in difflib.get_close_matches(str(word).lower(), by_letters, 1):
            return f"; did you mean {by_letters[near]}?"
    return ""


def sides(size: Any) -> tuple[int, int]:
    """Height and width; a ValueError for what is none."""
    if isinstance(size, (str, bytes)) or not hasattr(size, "__len__") or len(size) != 2:
        raise ValueError(f"expected a size of height and width, such as (192, 320), got {size!r}")
    return size[0], size[1]


def listed(names: Any, what: str) -> Sequence[str]:
    """The names; a ValueError for one text, whose letters nobody means."""
    if isinstance(names, (str, bytes)) or not isinstance(names, Iterable):
        raise ValueError(f"expected a list of {what}, such as ['person'], got {names!r}")
    return list(names)


def path_of(path: Any, what: str) -> str:
    """The path; a ValueError for what is none."""
    if not isinstance(path, (str, bytes, os.PathLike)):
        raise ValueError(f"expected the path of {what}, got {path!r}")
    return os.fsdecode(path)


def counted(number: int, one: str) -> str:
    """ "1 person", "2 persons"."""
    return f"{number} {one}{'s' * (number != 1)}"


def first_of(texts: Iterable[str], most: int = 5) -> str:
    """ "a, b, ...": so many of them, and whether there are more."""
    texts = list(texts)
    return ", ".join(texts[:most]) + (", ..." if texts[most:] else "")

"""Medians and how far the rounds lie apart."""

import dataclasses
import statistics


@dataclasses.dataclass(frozen=True)
class Spread:
    least: float
    lower: float   # a quarter of the rounds is below
    median: float
    upper: float   # a quarter is above


def spread(values):
    values = sorted(values)
    if len(values) == 1:
        return Spread(*values * 4)
    return Spread(values[0], *statistics.quantiles(values, n=4, method="inclusive"))


def rotated(items, turn):
    """The items from a later start, so that over the rounds each is at each place."""
    turn %= len(items)
    return items[turn:] + items[:turn]

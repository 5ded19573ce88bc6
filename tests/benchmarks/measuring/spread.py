"""Medians and how far the rounds lie apart."""

import dataclasses
import statistics

from measuring.report import number


@dataclasses.dataclass(frozen=True)
class Spread:
    least: float
    lower: float   # a quarter of the rounds is below
    median: float
    upper: float   # a quarter is above
    most: float

    def quartiles(self, digits=3):
        """The middle half of the rounds as text."""
        return f"{number(self.lower, digits)}–{number(self.upper, digits)}"

    def median_and_quartiles(self, digits=3):
        if self.least == self.most:
            return number(self.median, digits)
        return f"{number(self.median, digits)} ({self.quartiles(digits)})"


def spread(values):
    values = sorted(values)
    if len(values) == 1:
        return Spread(*values * 5)
    lower, median, upper = statistics.quantiles(values, n=4, method="inclusive")
    return Spread(values[0], lower, median, upper, values[-1])


def rotated(items, turn):
    """The items from a later start, so that over the rounds each is at each place."""
    turn %= len(items)
    return items[turn:] + items[:turn]

"""What a part of the benchmarks hands back, and its tables as CSV."""

import csv
import dataclasses

from measuring.spread import Spread


@dataclasses.dataclass
class Table:
    name: str      # of its file
    columns: list  # headings
    rows: list = dataclasses.field(default_factory=list)  # of texts, numbers and spreads, as many as columns

    def add(self, *cells):
        if len(cells) != len(self.columns):
            raise ValueError(f"expected {len(self.columns)} cells, got {cells}")
        self.rows.append(cells)

    def write(self, folder):
        """A column of spreads becomes three: the medians and both quartiles."""
        widths = [3 if any(isinstance(cell, Spread) for cell in column) else 1 for column in zip(*self.rows)]
        headings = [part for name, width in zip(self.columns, widths)
                    for part in (name, f"{name} q1", f"{name} q3")[:width]]
        write_lines(folder / f"{self.name}.csv",
                    [headings, *([part for cell, width in zip(row, widths) for part in _parts(cell)[:width]]
                                 for row in self.rows)])


@dataclasses.dataclass
class Part:
    tables: list
    missing: dict = dataclasses.field(default_factory=dict)  # why it was not measured, by name
    libraries: set = dataclasses.field(default_factory=set)  # with their versions, as far as the part knows them
    frames: str = ""  # if they are not those of original_frames


def _parts(cell):
    numbers = (cell.median, cell.lower, cell.upper) if isinstance(cell, Spread) else (cell, "", "")
    return [f"{number:.4g}" if isinstance(number, float) else number for number in numbers]


def write_lines(path, lines):
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(lines)

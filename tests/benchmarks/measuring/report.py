"""What a part of the benchmarks hands back, and that as Markdown."""

import dataclasses
import textwrap


@dataclasses.dataclass
class Table:
    columns: list          # headings; the first column is text, the others numbers
    rows: list = dataclasses.field(default_factory=list)  # of texts, as many as columns
    caption: str = ""

    def add(self, *cells):
        if len(cells) != len(self.columns):
            raise ValueError(f"expected {len(self.columns)} cells, got {cells}")
        self.rows.append([str(cell) for cell in cells])


@dataclasses.dataclass
class Curves:
    """One panel of the image."""
    title: str
    x_label: str
    y_label: str
    lines: dict            # name → [(x, y)]
    ideal: str = ""        # name of a line that is drawn dashed
    logarithmic: bool = False  # both axes; else y starts at 0


@dataclasses.dataclass
class Section:
    title: str
    text: str
    tables: list
    curves: list = dataclasses.field(default_factory=list)
    libraries: set = dataclasses.field(default_factory=set)  # with their versions, as far as the part knows them


def markdown(sections):
    return "\n".join(part for section in sections for part in _section_lines(section))


def wrapped(text):
    """Each paragraph, and each line of a list, in lines of at most 120 characters."""
    def filled(line):
        return textwrap.fill(line, 120, subsequent_indent="  " * line.startswith("- "), break_long_words=False,
                             break_on_hyphens=False)

    return "\n\n".join("\n".join(map(filled, part.splitlines())) if part.startswith("- ") else filled(part)
                       for part in text.strip().split("\n\n"))


def _section_lines(section):
    yield f"## {section.title}\n"
    yield wrapped(section.text) + "\n"
    for table in section.tables:
        if table.caption:
            yield f"{table.caption}\n"
        yield _row(table.columns)
        yield _row(["---"] + ["---:"] * (len(table.columns) - 1))
        for row in table.rows:
            yield _row(row)
        yield ""


def _row(cells):
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def number(value, digits=3):
    """`digits` significant ones, without an exponent where that can be read."""
    if value == 0:
        return "0"
    if abs(value) < 1e-3 or abs(value) >= 1e6:
        return f"{value:.{digits - 1}e}"
    text = f"{value:.{digits}g}"
    return f"{value:.0f}" if "e" in text else text

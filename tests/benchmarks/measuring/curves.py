"""The curves of all parts as one image."""

import math

import matplotlib
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402  (after the choice of what draws)

COLUMNS = 2
PANEL_INCHES = (7.2, 4.2)
DOTS_PER_INCH = 110


def draw(all_curves, path, caption):
    rows = math.ceil(len(all_curves) / COLUMNS)
    figure, panels = pyplot.subplots(rows, COLUMNS, squeeze=False, layout="constrained",
                                     figsize=(COLUMNS * PANEL_INCHES[0], rows * PANEL_INCHES[1]))
    for panel, curves in zip(panels.flat, all_curves):
        _draw_panel(panel, curves)
    for panel in panels.flat[len(all_curves):]:
        panel.set_axis_off()
    figure.supxlabel(caption, fontsize="small")
    figure.savefig(path, dpi=DOTS_PER_INCH)
    pyplot.close(figure)


def _draw_panel(panel, curves):
    for name, points in curves.lines.items():
        style = {"linestyle": "--", "color": "grey"} if name == curves.ideal else {"marker": "o", "markersize": 4}
        panel.plot([x for x, _ in points], [y for _, y in points], label=name, **style)
    if curves.logarithmic:
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        panel.yaxis.set_minor_locator(NullLocator())
    else:
        panel.set_ylim(bottom=0, top=1.1 * max(y for points in curves.lines.values() for _, y in points))
    _mark_measured(panel, sorted({x for points in curves.lines.values() for x, _ in points}))
    panel.set(title=curves.title, xlabel=curves.x_label, ylabel=curves.y_label)
    panel.grid(alpha=0.3)
    panel.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1, 1))  # beside the curves, never on them


def _mark_measured(panel, values):
    """Ticks where something was measured, in plain numbers: powers of ten say little about so narrow a range."""
    panel.set_xticks(values, [f"{value:,}" for value in values], rotation=20)
    panel.set_xticks([], minor=True)
    panel.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}"))

"""Panels that figures share: one row a plant or sensor, a transient and a steady column."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from etac_ros.metrics.curves import Curve
from etac_ros.report.figures.downtime import shade
from etac_ros.report.figures.style import Theme
from etac_ros.report.view import View

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LEGEND_IN = 0.5
_FEW_ROWS = 2
_TALL_IN, _LOW_IN = 2.15, 1.65
_LETTERS_AN_INCH = 11.0

Style = Mapping[str, Any]
"""How a line is drawn, in matplotlib's words."""


@dataclass(frozen=True)
class Panel:
    """One pair of axes and the span of time that it shows."""

    axes: Axes
    row: int
    start_s: float
    end_s: float

    def part(self, curve: Curve) -> Curve:
        """What this panel shows of a dense curve."""
        return curve.between(self.start_s, self.end_s)

    def held_part(self, curve: Curve) -> Curve:
        """What this panel shows of a staircase: what held at its start goes on until the next step."""
        first = max(int(np.searchsorted(curve.times_s, self.start_s, side="right")) - 1, 0)
        last = int(np.searchsorted(curve.times_s, self.end_s, side="left")) + 1
        if curve.times_s[-1] < self.start_s:
            return Curve(curve.times_s[:0], curve.values[:0])
        times = np.clip(curve.times_s[first:last], self.start_s, self.end_s)
        return Curve(times, curve.values[first:last])


def row_in(rows: int) -> float:
    """Height of each row of a figure of so many [in]."""
    return _TALL_IN if rows <= _FEW_ROWS else _LOW_IN


def height_in(rows: int) -> float:
    """Height of a figure of so many rows [in]."""
    return _LEGEND_IN + rows * row_in(rows)


def panel_grid(figure: Figure, rows: Sequence[str], view: View) -> list[Panel]:
    """Make a row of panels for each name: transient and steady state, or one for all if they are not apart.

    Parameters
    ----------
    figure
        Empty.
    rows
        Names that are written on the panels where there is more than one; an empty one is not.
    view
        Knows where the transient ends.
    """
    cut_s = view.cut_s
    spans = [(0.0, view.end_s)] if cut_s is None else [(0.0, cut_s), (cut_s, view.end_s)]
    grid = figure.subplots(len(rows), len(spans), squeeze=False, sharex="col", width_ratios=[1.0, 1.12][: len(spans)])
    panels = []
    for row, name in enumerate(rows):
        for column, (start_s, stop_s) in enumerate(spans):
            axes = grid[row, column]
            axes.set_xlim(start_s, stop_s)
            shade(axes, view)
            words = [name] if len(rows) > 1 and name else []
            if cut_s is not None and (row == 0 or name):
                words.append("transient" if column == 0 else "steady state")
            if words:
                axes.set_title(", ".join(words))
            if row == len(rows) - 1:
                axes.set_xlabel("time [s]")
            panels.append(Panel(axes, row, start_s, stop_s))
    return panels


def axis_label(words: str, unit: str, height_in: float) -> str:
    """What a vertical axis is called, in lines that are not longer than the axis is high."""
    # A number stays with its unit, and a unit in one piece.
    text = f"{words} [{unit}]".replace(f"[{unit}]", f"[{unit}]".replace(" ", "\u00a0")) if unit else words
    return textwrap.fill(text, int(_LETTERS_AN_INCH * height_in), break_long_words=False, break_on_hyphens=False)


def key(place: Figure | Axes, names: Sequence[str], styles: Sequence[Style]) -> None:
    """Put a legend above all panels, or above one to the right; none where there is only one line."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], label=name, **style) for name, style in zip(names, styles, strict=True)]
    if len(handles) < 2:
        return
    if isinstance(place, Figure):
        place.legend(handles=handles, loc="outside upper left", ncols=_columns(names))
    else:
        place.legend(handles=handles, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(handles))


def run_key(place: Figure | Axes, view: View, theme: Theme) -> None:
    """The legend that tells the runs of a view."""
    key(place, view.labels, [theme.run_style(number) for number in range(len(view.labels))])


def column_styles(theme: Theme, count: int) -> list[Style]:
    """Styles of the curves of one panel where one run is shown."""
    return [{"color": theme.colour(number), "linewidth": 1.1} for number in range(count)]


def _columns(names: Sequence[str]) -> int:
    """As many entries a line as surely fit the width of a figure."""
    longest = max(len(name) for name in names)
    return max(1, min(len(names), 88 // (longest + 7)))

"""Panels that figures share: one row a plant or sensor, a transient and a steady column."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from etac_ros.report.figures.data import Curve
from etac_ros.report.figures.decimate import decimated
from etac_ros.report.figures.style import BUCKETS, Theme, prefixed
from etac_ros.report.view import View

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ROW_IN = 2.15
_LEGEND_IN = 0.5


@dataclass(frozen=True)
class Panel:
    """One pair of axes and the span of time that it shows."""

    axes: Axes
    row: str
    start_s: float
    end_s: float

    def part(self, curve: Curve) -> Curve:
        """What this panel shows of a dense curve."""
        return curve.between(self.start_s, self.end_s)

    def held_part(self, curve: Curve) -> Curve:
        """What this panel shows of a staircase: what held at its start goes on until the next step."""
        first = max(int(np.searchsorted(curve.times_s, self.start_s, side="right")) - 1, 0)
        last = int(np.searchsorted(curve.times_s, self.end_s, side="left")) + 1
        times = np.clip(curve.times_s[first:last], self.start_s, self.end_s)
        return Curve(times, curve.values[first:last])


def height_in(rows: int) -> float:
    """Height of a figure of so many rows [in]."""
    return _LEGEND_IN + rows * ROW_IN


def panel_grid(figure: Figure, rows: Sequence[str], view: View) -> list[Panel]:
    """Make one row of panels for each name: transient and steady state, or one for all if they are not apart.

    Parameters
    ----------
    figure
        Empty.
    rows
        Names; they are written on the panels where there is more than one.
    view
        Knows where the transient ends.
    """
    end_s, cut_s = view.run.end_s, view.cut_s
    spans = [(0.0, end_s)] if cut_s is None else [(0.0, cut_s), (cut_s, end_s)]
    grid = figure.subplots(len(rows), len(spans), squeeze=False, sharex="col", width_ratios=[1.0, 1.12][: len(spans)])
    panels = []
    for row, name in enumerate(rows):
        for column, (start_s, stop_s) in enumerate(spans):
            axes = grid[row, column]
            axes.set_xlim(start_s, stop_s)
            words = [name] if len(rows) > 1 else []
            if cut_s is not None:
                words.append("transient" if column == 0 else "steady state")
            if words:
                axes.set_title(", ".join(words))
            if row == len(rows) - 1:
                axes.set_xlabel("time [s]")
            panels.append(Panel(axes, name, start_s, stop_s))
    return panels


def draw_axes_of(panel: Panel, curve: Curve, label: str, unit: str, theme: Theme, beside: Curve | None = None) -> None:
    """Draw the columns of a dense curve, and dashed those of another run, in a unit that suits them."""
    part = panel.part(curve)
    behind = None if beside is None else panel.part(beside)
    shown = [part] if behind is None else [part, behind]
    largest = max(float(np.abs(some.values).max()) for some in shown if some.values.size)
    factor, unit = prefixed(unit, largest)
    if behind is not None:
        for column in range(behind.values.shape[1]):
            panel.axes.plot(
                *decimated(behind.times_s, factor * behind.values[:, column], BUCKETS),
                color=theme.colour(column),
                linewidth=0.9,
                linestyle=(0, (4, 2)),
                alpha=0.65,
            )
    for column in range(part.values.shape[1]):
        panel.axes.plot(*decimated(part.times_s, factor * part.values[:, column], BUCKETS), color=theme.colour(column))
    panel.axes.axhline(0.0, color=theme.muted, linewidth=0.5, zorder=1.5)
    panel.axes.set_ylabel(f"{label} [{unit}]")


def key(
    place: Figure | Axes,
    theme: Theme,
    names: Sequence[str],
    colours: Sequence[str] | None = None,
    dashed: str = "",
) -> None:
    """Put a legend above all panels, or into the corner of one; ``dashed`` names the run so drawn."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    colours = colours or [theme.colour(number) for number in range(len(names))]
    handles = [
        Line2D([], [], color=colour, linewidth=1.6, label=name) for name, colour in zip(names, colours, strict=True)
    ]
    if dashed:
        handles.append(Line2D([], [], color=theme.muted, linewidth=1.2, linestyle=(0, (4, 2)), label=dashed))
    if isinstance(place, Figure):
        place.legend(handles=handles, loc="outside upper left", ncols=len(handles))
    else:
        place.legend(handles=handles, loc="upper right", ncols=len(handles))

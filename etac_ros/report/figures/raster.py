"""Triggering instants on a time line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from etac_ros.metrics import curves
from etac_ros.modules.triggering import triggering_modules
from etac_ros.parameters import FloatArray
from etac_ros.report.figures.downtime import shade
from etac_ros.report.figures.kind import FigureKind
from etac_ros.report.figures.style import BUCKETS, Theme
from etac_ros.report.view import View

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ROW_IN = 0.3


@dataclass(frozen=True)
class Row:
    """One line of strokes.

    Attributes
    ----------
    name
        Stands on the left.
    instants_s
        Where the strokes are [s].
    run
        Number of the run, 0 is the reported one.
    """

    name: str
    instants_s: FloatArray
    run: int


def rows(view: View) -> list[Row]:
    """The sensors of this run, then those of the others."""
    found = []
    for number, (run, label) in enumerate(zip(view.runs, view.labels, strict=True)):
        names = triggering_modules(run.graph)
        for name in names:
            if not view.overlaid or (len(names) > 1 and number == 0):
                words = name
            else:
                words = f"{name}, {label}" if len(names) > 1 else label
            found.append(Row(words, curves.instants_s(run.graph, run.recording, name), number))
    return found


def draw_on(axes: Axes, view: View, theme: Theme) -> None:
    """Draw the rows with their names on the left and their counts on the right; the overview does so, too."""
    found = rows(view)
    for place, row in enumerate(found):
        colour = theme.run_style(row.run)["color"]
        axes.vlines(
            _apart(row.instants_s, view.end_s), place - 0.36, place + 0.36, color=colour, linewidth=0.8, clip_on=False
        )
        axes.annotate(
            f"{row.instants_s.size:,}",
            (1.0, place),
            xycoords=("axes fraction", "data"),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            color=colour,
            fontweight="bold",
        )
    axes.set_yticks(range(len(found)), [row.name for row in found])
    axes.set_ylim(len(found) - 0.4, -0.6)
    axes.set_xlim(0.0, view.end_s)
    shade(axes, view)
    axes.grid(visible=False, axis="y")
    axes.tick_params(axis="y", length=0.0)
    axes.spines["left"].set_visible(False)


def _apart(instants_s: FloatArray, end_s: float) -> FloatArray:
    """One of the instants that would fall on the same half pixel."""
    columns = np.floor(instants_s * (2.0 * BUCKETS / end_s)) if end_s > 0.0 else instants_s
    return instants_s[np.unique(columns, return_index=True)[1]]


def _draw(view: View, figure: Figure, theme: Theme) -> None:
    axes = figure.subplots()
    draw_on(axes, view, theme)
    axes.set_xlabel("time [s]")


FIGURE = FigureKind(
    name="raster",
    title="Triggering instants",
    draw=_draw,
    height_in=lambda view: 0.6 + _ROW_IN * len(rows(view)),
    caption=lambda view: "Every stroke is a triggering instant; the number of them stands on the right.",
)

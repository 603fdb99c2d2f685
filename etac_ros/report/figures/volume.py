"""Bytes that the network links have carried, over time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from etac_ros.metrics import curves
from etac_ros.metrics.curves import Curve
from etac_ros.report.figures.decimate import decimated
from etac_ros.report.figures.downtime import shade
from etac_ros.report.figures.kind import FigureKind
from etac_ros.report.figures.style import BUCKETS, Theme, thousands
from etac_ros.report.view import View

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_STEPS = "steps-post"


@dataclass(frozen=True)
class _Line:
    """One curve, and how it is drawn."""

    name: str
    curve: Curve
    drawstyle: str
    style: dict[str, Any]

    @property
    def total(self) -> float:
        return float(self.curve.values[-1, 0])


def _lines(view: View, theme: Theme) -> list[_Line]:
    lines = [
        _Line(
            label,
            curves.cumulative_bytes(run.graph, run.recording),
            _STEPS,
            {**theme.run_style(number), "zorder": 2.2 + 0.01 * number},
        )
        for number, (run, label) in enumerate(zip(view.runs, view.labels, strict=True))
    ]
    published = view.paper_baseline
    if published is not None and view.baseline is None:
        ends = Curve(np.array([0.0, view.run.end_s]), np.array([[0.0], [published.value]]))
        style = {"color": theme.muted, "linewidth": 1.3, "linestyle": (0, (5, 3))}
        lines.append(_Line(f"{view.source}'s baseline, not measured", ends, "default", style))
    return lines


def draw_on(axes: Axes, view: View, theme: Theme) -> None:
    """Draw all curves, each with its name and total at its end; the overview does so, too."""
    lines = _lines(view, theme)
    end_s = view.end_s
    highest = max(max(line.total for line in lines), 1.0)
    axes.set_xlim(0.0, end_s)
    shade(axes, view)
    thousands(axes)
    axes.set_ylabel("payload [bytes]")
    for line in lines:
        points = decimated(line.curve.times_s, line.curve.values[:, 0], BUCKETS)
        axes.plot(*points, drawstyle=line.drawstyle, **line.style)
    heights = _spread([line.total for line in lines], 0.1 * highest)
    axes.set_ylim(0.0, max(heights) + 0.14 * highest)
    for line, height in zip(lines, heights, strict=True):
        axes.annotate(
            f"{line.name}: {line.total:,.0f} B",
            (end_s, height),
            xytext=(-3, 3),
            textcoords="offset points",
            ha="right",
            va="bottom",
            color=line.style["color"],
            fontweight="bold" if line is lines[0] else "normal",
            bbox={"facecolor": theme.paper, "edgecolor": "none", "pad": 0.8, "alpha": 0.85},
        )


def _spread(totals: list[float], apart: float) -> list[float]:
    """Heights of the labels: those of the curves' ends, moved up where they would cover each other."""
    heights = list(totals)
    lowest = -apart
    for place in sorted(range(len(totals)), key=totals.__getitem__):
        heights[place] = lowest = max(totals[place], lowest + apart)
    return heights


def _draw(view: View, figure: Figure, theme: Theme) -> None:
    axes = figure.subplots()
    draw_on(axes, view, theme)
    axes.set_xlabel("time [s]")


def _caption(view: View) -> str:
    text = "Payload that had crossed all network links together: 4 bytes a component of float32, 8 of float64."
    if view.paper_baseline is not None and view.baseline is None:
        text += (
            f" The dashed line spreads the {view.paper_baseline.value:,.0f} bytes published for the baseline "
            "evenly over the run: it was not measured. A report of this bag and that of a baseline run measures it."
        )
    return text


FIGURE = FigureKind(
    name="bytes",
    title="Bytes on the network",
    draw=_draw,
    height_in=lambda view: 2.6,
    caption=_caption,
)

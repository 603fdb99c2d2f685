"""Control energy over time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from etac_ros.metrics.curves import Curve
from etac_ros.report.figures import panels
from etac_ros.report.figures.decimate import decimated
from etac_ros.report.figures.kind import FigureKind
from etac_ros.report.figures.panels import Panel, Style
from etac_ros.report.figures.style import BUCKETS, Theme, plain_logarithmic, prefixed
from etac_ros.report.source import ReportedRun
from etac_ros.report.view import View

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_UNIT = "N²m²s"
_LOG_FROM = 30.0
"""Between runs of which one spends so many times as much as another, the axis is logarithmic."""


def _since(curve: Curve, panel: Panel) -> Curve:
    """What was spent from the panel's start on; the curve is straight between its points and ends with its run."""
    end_s = min(panel.end_s, float(curve.times_s[-1]))
    inside = (curve.times_s > panel.start_s) & (curve.times_s < end_s)
    times = (
        np.concatenate([[panel.start_s], curve.times_s[inside], [end_s]])
        if end_s > panel.start_s
        else curve.times_s[:1]
    )
    spent = np.interp(times, curve.times_s, curve.values[:, 0])
    return Curve(times, (spent - spent[0])[:, np.newaxis])


@dataclass(frozen=True)
class _Line:
    """Energy that some plants of a run take, and how it is drawn."""

    name: str
    curve: Curve
    style: Style


def _total(run: ReportedRun) -> Curve:
    """Energy of all plants of a run together."""
    curves = list(run.energy.values())
    times = np.unique(np.concatenate([curve.times_s for curve in curves]))
    total = np.sum([np.interp(times, curve.times_s, curve.values[:, 0]) for curve in curves], axis=0)
    return Curve(times, total[:, np.newaxis])


def _lines(view: View, theme: Theme) -> list[_Line]:
    """The plants of one run, or the runs that are laid over each other."""
    run, plants = view.run, view.run.graph.plants
    if view.overlaid or len(plants) == 1:
        runs = zip(view.labels, view.runs, strict=True)
        return [_Line(label, _total(one), theme.run_style(number)) for number, (label, one) in enumerate(runs)]
    styles = panels.column_styles(theme, len(plants))
    return [_Line(plant, run.energy[plant], style) for plant, style in zip(plants, styles, strict=True)]


def _draw(view: View, figure: Figure, theme: Theme) -> None:
    lines = _lines(view, theme)
    of_torque = all(one.of_torque for run in view.runs for one in run.summary.performance.values())
    for panel in panels.panel_grid(figure, ("",), view):
        spent = [_since(line.curve, panel) for line in lines]
        totals = [total for curve in spent if (total := float(curve.values[-1, 0])) > 0.0]
        far_apart = bool(totals) and max(totals) > _LOG_FROM * min(totals)
        plain = far_apart or not of_torque
        factor, unit = (1.0, _UNIT) if plain else prefixed(_UNIT, max(totals, default=0.0))
        for number, (line, curve) in enumerate(zip(lines, spent, strict=True)):
            points = decimated(curve.times_s, factor * curve.values[:, 0], BUCKETS)
            panel.axes.plot(*points, **{**line.style, "zorder": 2.2 + 0.01 * number})
        if far_apart:
            plain_logarithmic(panel.axes)
        else:
            panel.axes.set_ylim(bottom=0.0)
        since = f" since {panel.start_s:g} s" if panel.start_s > 0.0 else ""
        panel.axes.set_ylabel(f"energy{since} [{unit}]" if of_torque else f"input², integrated{since}")
    panels.key(figure, [line.name for line in lines], [line.style for line in lines])


def _caption(view: View) -> str:
    plants = view.run.graph.plants
    ends = [
        f"{figures.energy_n2m2s:.4g}{f' {_UNIT}' if figures.of_torque else ''}"
        + (f" ({plant})" if len(plants) > 1 else "")
        for plant, figures in view.run.summary.performance.items()
    ]
    held = "torque" if all(one.of_torque for one in view.run.summary.performance.values()) else "input"
    text = f"Integral of the square of the held {held}, {', '.join(ends)} in all in this run."
    if view.overlaid and len(plants) > 1:
        text += " The curves are of all plants together."
    if view.cut_s is not None:
        text += f" On the right, what the steady state alone spends, counted from {view.cut_s:g} s."
    return text


FIGURE = FigureKind(
    name="energy",
    title="Control energy",
    draw=_draw,
    height_in=lambda view: panels.height_in(1),
    caption=_caption,
)

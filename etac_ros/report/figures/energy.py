"""Control energy over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from etac_ros.report.figures import data, panels
from etac_ros.report.figures.data import Curve
from etac_ros.report.figures.kind import FigureKind
from etac_ros.report.figures.panels import Panel
from etac_ros.report.figures.style import Theme, power_of_ten
from etac_ros.report.source import ReportedRun
from etac_ros.report.view import View

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_UNIT = "N²m²s"


def _since(curve: Curve, panel: Panel) -> Curve:
    """What was spent from the panel's start on; the curve is straight between its points."""
    inside = (curve.times_s > panel.start_s) & (curve.times_s < panel.end_s)
    times = np.concatenate([[panel.start_s], curve.times_s[inside], [panel.end_s]])
    spent = np.interp(times, curve.times_s, curve.values[:, 0])
    return Curve(times, (spent - spent[0])[:, np.newaxis])


def _spent(run: ReportedRun, panel: Panel) -> dict[str, Curve]:
    return {plant: _since(data.energy(run.graph, run.recording, plant), panel) for plant in run.graph.plants}


def _draw(view: View, figure: Figure, theme: Theme) -> None:
    plants = view.run.graph.plants
    colours = [theme.this if len(plants) == 1 else theme.colour(number) for number in range(len(plants))]
    for panel in panels.panel_grid(figure, ("",), view):
        measured = _spent(view.run, panel)
        beside = {} if view.other is None else _spent(view.other, panel)
        largest = max(float(curve.values.max()) for curve in [*measured.values(), *beside.values()])
        power = 0 if largest == 0.0 or 0.05 <= largest < 1e5 else 3 * int(np.floor(np.log10(largest) / 3.0))
        for colour, plant in zip(colours, plants, strict=True):
            if plant in beside:
                other = beside[plant]
                panel.axes.plot(
                    other.times_s,
                    10.0**-power * other.values[:, 0],
                    color=theme.other if len(plants) == 1 else colour,
                    linewidth=1.1,
                    linestyle=(0, (4, 2)),
                )
            curve = measured[plant]
            panel.axes.plot(curve.times_s, 10.0**-power * curve.values[:, 0], color=colour, linewidth=1.5)
        panel.axes.set_ylim(bottom=0.0)
        since = f" since {panel.start_s:g} s" if panel.start_s > 0.0 else ""
        factor = f"{power_of_ten(power)} " if power else ""
        panel.axes.set_ylabel(f"energy{since} [{factor}{_UNIT}]")
    if len(plants) > 1 or view.other is not None:
        names = ("this run",) if len(plants) == 1 else plants
        panels.key(figure, theme, names, colours, dashed=view.other_label)


def _caption(view: View) -> str:
    plants = view.run.graph.plants
    ends = [
        f"{figures.energy_n2m2s:.4g} {_UNIT}" + (f" ({plant})" if len(plants) > 1 else "")
        for plant, figures in view.run.summary.performance.items()
    ]
    text = f"Integral of the square of the held torque, {', '.join(ends)} in all."
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

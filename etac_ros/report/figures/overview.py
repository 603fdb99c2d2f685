"""One figure that tells the whole run: pointing, triggering instants, bytes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from etac_ros.report.figures import data, raster, volume
from etac_ros.report.figures.decimate import decimated
from etac_ros.report.figures.kind import FigureKind
from etac_ros.report.figures.panels import key
from etac_ros.report.figures.style import BUCKETS, Theme, plain_logarithmic
from etac_ros.report.view import View

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_HEIGHT_IN = 5.2
_RASTER_ROW_IN = 0.27


def _draw_angles(axes: Axes, view: View, theme: Theme) -> None:
    run, other = view.run, view.other
    plants = run.graph.plants
    for number, plant in enumerate(plants):
        colour = theme.this if len(plants) == 1 else theme.colour(number)
        if other is not None:
            beside = data.attitude_angle(other.graph, other.recording, plant)
            axes.plot(
                *decimated(beside.times_s, beside.values[:, 0], BUCKETS),
                color=theme.other if len(plants) == 1 else colour,
                linewidth=1.0,
                linestyle=(0, (4, 2)),
            )
        curve = data.attitude_angle(run.graph, run.recording, plant)
        axes.plot(*decimated(curve.times_s, curve.values[:, 0], BUCKETS), color=colour, linewidth=1.3)
    axes.set_xlim(0.0, run.end_s)
    plain_logarithmic(axes)
    axes.set_ylabel("attitude error [deg]")


def _draw(view: View, figure: Figure, theme: Theme) -> None:
    plants = view.run.graph.plants
    lines = _RASTER_ROW_IN * len(raster.rows(view)) + 0.1
    above, middle, below = figure.subplots(3, 1, sharex=True, height_ratios=[1.9, lines, 1.9])
    _draw_angles(above, view, theme)
    above.set_title("attitude error, as one angle")
    raster.draw_on(middle, view, theme)
    middle.set_title("triggering instants")
    volume.draw_on(below, view, theme)
    below.set_title("payload on the network")
    below.set_xlabel("time [s]")
    if len(plants) > 1 or view.other is not None:
        names = ("this run",) if len(plants) == 1 else plants
        colours = (theme.this,) if len(plants) == 1 else None
        key(above, theme, names, colours, dashed=view.other_label)
    figure.suptitle(
        view.run.scenario.run.title or view.run.scenario.name,
        x=0.008,
        ha="left",
        fontweight="bold",
        fontsize=9.5,
    )
    figure.align_ylabels([above, below])


FIGURE = FigureKind(
    name="overview",
    title="The run at a glance",
    draw=_draw,
    height_in=lambda view: _HEIGHT_IN + _RASTER_ROW_IN * (len(raster.rows(view)) - 1),
    caption=lambda view: (
        "Attitude error as one angle, triggering instants, and the payload that had crossed the network."
    ),
)

"""One figure that tells the whole run: pointing, triggering instants, bytes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from etac_ros.metrics import curves
from etac_ros.metrics.curves import Curve
from etac_ros.report.figures import raster, volume
from etac_ros.report.figures.decimate import decimated
from etac_ros.report.figures.downtime import shade
from etac_ros.report.figures.kind import FigureKind
from etac_ros.report.figures.panels import Style, column_styles, key, run_key
from etac_ros.report.figures.style import BUCKETS, Theme, plain_logarithmic
from etac_ros.report.source import ReportedRun
from etac_ros.report.view import View

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_HEIGHT_IN = 5.2
_RASTER_ROW_IN = 0.27


def _angle(run: ReportedRun, plants: tuple[str, ...]) -> Curve:
    """Attitude error as one angle [deg], the largest of several plants."""
    angles = [curves.attitude_angle(run.graph, run.recording, plant) for plant in plants]
    shortest = min(angles, key=lambda curve: curve.times_s.size)
    size = shortest.times_s.size
    return Curve(shortest.times_s, np.max([curve.values[:size] for curve in angles], axis=0))


def _draw_angles(axes: Axes, view: View, theme: Theme) -> None:
    plants = curves.attitude_plants(view.run.graph)
    if view.overlaid:
        for number, run in enumerate(view.runs):
            curve = _angle(run, plants)
            order = 2.2 + 0.01 * number
            axes.plot(
                *decimated(curve.times_s, curve.values[:, 0], BUCKETS), **{**theme.run_style(number), "zorder": order}
            )
        run_key(axes, view, theme)
    else:
        styles: list[Style] = [theme.run_style(0)] if len(plants) == 1 else column_styles(theme, len(plants))
        for style, plant in zip(styles, plants, strict=True):
            curve = _angle(view.run, (plant,))
            axes.plot(*decimated(curve.times_s, curve.values[:, 0], BUCKETS), **style)
        key(axes, plants, styles)
    axes.set_xlim(0.0, view.end_s)
    shade(axes, view)
    plain_logarithmic(axes)
    axes.set_ylabel("attitude error [deg]")


def _draw(view: View, figure: Figure, theme: Theme) -> None:
    plants = curves.attitude_plants(view.run.graph)
    lines = _RASTER_ROW_IN * len(raster.rows(view)) + 0.1
    heights = [1.9, lines, 1.9] if plants else [lines, 1.9]
    *angles, middle, below = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
    for above in angles:
        _draw_angles(above, view, theme)
        # Short, since a legend may stand beside it.
        several = view.overlaid and len(plants) > 1
        above.set_title("largest attitude error of all plants" if several else "attitude error, as one angle")
    raster.draw_on(middle, view, theme)
    middle.set_title("triggering instants")
    volume.draw_on(below, view, theme)
    below.set_title("payload on the network")
    below.set_xlabel("time [s]")
    figure.suptitle(
        view.run.scenario.run.title or view.run.scenario.name,
        x=0.008,
        ha="left",
        fontweight="bold",
        fontsize=9.5,
    )
    figure.align_ylabels([*angles, below])


FIGURE = FigureKind(
    name="overview",
    title="The run at a glance",
    draw=_draw,
    height_in=lambda view: _HEIGHT_IN + _RASTER_ROW_IN * (len(raster.rows(view)) - 1),
    caption=lambda view: (
        ("Attitude error as one angle, t" if curves.attitude_plants(view.run.graph) else "T")
        + "riggering instants, and the payload that had crossed the network."
    ),
)

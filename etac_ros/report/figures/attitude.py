"""Attitude error as Euler angles."""

from __future__ import annotations

from typing import TYPE_CHECKING

from etac_ros.report.figures import data, panels
from etac_ros.report.figures.kind import FigureKind
from etac_ros.report.figures.style import Theme
from etac_ros.report.view import View

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _draw(view: View, figure: Figure, theme: Theme) -> None:
    run, other = view.run, view.other
    for panel in panels.panel_grid(figure, tuple(data.bodies(run.graph)), view):
        beside = None if other is None else data.attitude(other.graph, other.recording, panel.row)
        curve = data.attitude(run.graph, run.recording, panel.row)
        panels.draw_axes_of(panel, curve, "attitude error", "deg", theme, beside)
    panels.key(figure, theme, ("roll", "pitch", "yaw"), dashed=view.other_label)


def _caption(view: View) -> str:
    ends = [
        f"{figures.max_attitude_error_deg:.3g} deg" + (f" ({plant})" if len(view.run.graph.plants) > 1 else "")
        for plant, figures in view.run.summary.performance.items()
    ]
    return (
        "Attitude error as 3-2-1 Euler angles, from the committed samples. Over the last 40 % of the run the "
        f"error, taken as one angle, is {', '.join(ends)} at most."
    )


FIGURE = FigureKind(
    name="attitude",
    title="Attitude error",
    draw=_draw,
    height_in=lambda view: panels.height_in(len(data.bodies(view.run.graph))),
    caption=_caption,
)

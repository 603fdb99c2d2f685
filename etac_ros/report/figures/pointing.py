"""Attitude error as Euler angles, and angular velocity error."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from etac_ros.graph.graph import Graph
from etac_ros.graph.recording import Recording
from etac_ros.metrics import curves
from etac_ros.metrics.curves import Curve
from etac_ros.metrics.summary import Performance
from etac_ros.report.figures import quantities
from etac_ros.report.figures.kind import FigureKind
from etac_ros.report.figures.quantities import Quantity
from etac_ros.report.source import ReportedRun
from etac_ros.report.view import View


def _found(
    view: View, label: str, unit: str, columns: tuple[str, ...], of: Callable[[Graph, Recording, str], Curve]
) -> list[Quantity]:
    def curve(run: ReportedRun, row: str) -> Curve:
        return of(run.graph, run.recording, row)

    return [Quantity(row, label, unit, columns, partial(curve, row=row)) for row in curves.bodies(view.run.graph)]


def _ends(view: View, figure: Callable[[Performance], float | None], unit: str) -> str:
    """The largest of a figure over the steady part, of each plant."""
    several = len(view.run.graph.plants) > 1
    ends = [
        f"{value:.3g} {unit}" + (f" ({plant})" if several else "")
        for plant, figures in view.run.summary.performance.items()
        if (value := figure(figures)) is not None
    ]
    return ", ".join(ends)


def _angles(view: View) -> list[Quantity]:
    return _found(view, "attitude error", "deg", ("roll", "pitch", "yaw"), curves.attitude)


def _rates(view: View) -> list[Quantity]:
    """A plant of one's own may turn about fewer axes."""
    run = view.run
    widths = [curves.rate(run.graph, run.recording, row).values.shape[1] for row in curves.bodies(run.graph)]
    return _found(view, "rate error", "deg/s", ("x", "y", "z")[: max(widths)], curves.rate)


ATTITUDE = FigureKind(
    name="attitude",
    title="Attitude error",
    draw=lambda view, figure, theme: quantities.draw(_angles(view), view, figure, theme),
    height_in=lambda view: quantities.height_in(_angles(view), view),
    caption=lambda view: (
        f"Attitude error as 3-2-1 Euler angles, from the committed samples. {view.steady_words} the error of this "
        f"run, taken as one angle, is {_ends(view, lambda figures: figures.max_attitude_error_deg, 'deg')} at most."
    ),
    applies=lambda view: bool(curves.bodies(view.run.graph)),
)
RATE = FigureKind(
    name="rate",
    title="Angular velocity error",
    draw=lambda view, figure, theme: quantities.draw(_rates(view), view, figure, theme),
    height_in=lambda view: quantities.height_in(_rates(view), view),
    caption=lambda view: (
        f"Angular velocity error in body axes, from the committed samples. {view.steady_words} its norm in this "
        f"run is {_ends(view, lambda figures: figures.max_rate_deg_s, 'deg/s')} at most."
    ),
    applies=lambda view: bool(curves.bodies(view.run.graph)),
)

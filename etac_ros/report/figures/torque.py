"""The torque that each plant holds between two messages."""

from __future__ import annotations

from functools import partial

from etac_ros.metrics import curves
from etac_ros.metrics.curves import Curve
from etac_ros.report.figures import quantities
from etac_ros.report.figures.kind import FigureKind
from etac_ros.report.figures.quantities import Bound, Quantity
from etac_ros.report.source import ReportedRun
from etac_ros.report.view import View

_AXES = ("x", "y", "z")


def _curve(run: ReportedRun, plant: str, port: str) -> Curve:
    return run.held[plant][port]


def _bounds(run: ReportedRun, plant: str, port: str) -> tuple[Bound, ...]:
    """The limit of whoever drives a port, where there is one."""
    senders = [link.sender for link in run.graph.hears[plant] if link.receivers[plant] == port]
    limits = [run.scenario.nodes[sender].get("limit_nm") for sender in senders]
    return (Bound("limit", limits[0]),) if len(limits) == 1 and isinstance(limits[0], float) else ()


def _found(view: View) -> list[Quantity]:
    run = view.run
    ports = {(plant, port): size for plant in run.graph.plants for port, size in _inputs(run, plant).items()}
    several = len(ports) > len(run.graph.plants)
    return [
        Quantity(
            f"{plant}: {port}" if several else plant,
            "held torque",
            "N m",
            _AXES[:size] if size <= len(_AXES) else tuple(str(place + 1) for place in range(size)),
            partial(_curve, plant=plant, port=port),
            staircase=True,
            bounds=_bounds(run, plant, port),
        )
        for (plant, port), size in ports.items()
    ]


def _inputs(run: ReportedRun, plant: str) -> dict[str, int]:
    return curves.dynamics(run.graph, plant).inputs


FIGURE = FigureKind(
    name="torque",
    title="Held torque",
    draw=lambda view, figure, theme: quantities.draw(_found(view), view, figure, theme),
    height_in=lambda view: quantities.height_in(_found(view), view),
    caption=lambda view: (
        "Control torque as the zero-order hold applies it, in body axes: every step is a message that arrived, and "
        "between two steps nothing is sent."
    ),
)

"""The torque that each plant holds between two messages."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from etac_ros.report.figures import data, panels
from etac_ros.report.figures.kind import FigureKind
from etac_ros.report.figures.style import Theme, prefixed
from etac_ros.report.view import View

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_MOST_STEPS = 1000
"""Beyond these, thinner lines keep the axes apart."""


def _rows(view: View) -> dict[str, tuple[str, str]]:
    """Plant and port of each row, by what is written on it."""
    ports = [(plant, port) for plant in view.run.graph.plants for port in data.dynamics(view.run.graph, plant).inputs]
    return {f"{plant}: {port}" if len(ports) > 1 else plant: (plant, port) for plant, port in ports}


def _limit_nm(view: View, plant: str, port: str) -> float | None:
    """The limit of whoever drives a port, where there is one."""
    graph = view.run.graph
    senders = [link.sender for link in graph.hears[plant] if link.receivers[plant] == port]
    limits = [view.run.scenario.nodes[sender].get("limit_nm") for sender in senders]
    return limits[0] if len(limits) == 1 and isinstance(limits[0], float) else None


def _draw(view: View, figure: Figure, theme: Theme) -> None:
    run, rows, widest = view.run, _rows(view), 0
    for panel in panels.panel_grid(figure, tuple(rows), view):
        plant, port = rows[panel.row]
        part = panel.held_part(data.held_inputs(run.graph, run.recording, plant)[port])
        largest = float(np.abs(part.values).max())
        factor, unit = prefixed("N m", largest)
        limit = _limit_nm(view, plant, port)
        if limit is not None and largest > 0.5 * limit:
            for sign in (1.0, -1.0):
                panel.axes.axhline(sign * factor * limit, color=theme.limit, linewidth=0.8, linestyle=(0, (1, 1.5)))
            panel.axes.annotate(
                f"limit {factor * limit:g} {unit}",
                (1.0, factor * limit),
                xycoords=("axes fraction", "data"),
                xytext=(0, -2),
                textcoords="offset points",
                ha="right",
                va="top",
                color=theme.limit,
                fontsize=7,
            )
        panel.axes.axhline(0.0, color=theme.muted, linewidth=0.5, zorder=1.5)
        widest = max(widest, part.values.shape[1])
        width = 1.0 if part.times_s.size <= _MOST_STEPS else 0.5
        for column in range(part.values.shape[1]):
            panel.axes.step(
                part.times_s,
                factor * part.values[:, column],
                where="post",
                color=theme.colour(column),
                linewidth=width,
            )
        panel.axes.set_ylabel(f"held torque [{unit}]")
    panels.key(figure, theme, ("x", "y", "z")[:widest])


def _caption(view: View) -> str:
    return (
        "Control torque as the zero-order hold applies it, in body axes: every step is a message that "
        "arrived, and between two steps nothing is sent."
    )


FIGURE = FigureKind(
    name="torque",
    title="Held torque",
    draw=_draw,
    height_in=lambda view: panels.height_in(len(_rows(view))),
    caption=_caption,
)

"""The states of plants that have no attitude: a servo's angle and speed, for instance."""

from __future__ import annotations

from functools import partial

import numpy as np

from etac_ros.maths.ticks import seconds
from etac_ros.metrics import curves
from etac_ros.metrics.curves import Curve
from etac_ros.plants.plant import has_attitude
from etac_ros.report.figures import quantities
from etac_ros.report.figures.kind import FigureKind
from etac_ros.report.figures.quantities import Quantity
from etac_ros.report.figures.style import symbols
from etac_ros.report.source import ReportedRun
from etac_ros.report.view import View


def _curve(run: ReportedRun, plant: str, column: int) -> Curve:
    ticks, states = run.recording.kept(plant)
    return Curve(np.asarray(seconds(ticks, run.graph.ticks_per_second)), states[:, column : column + 1])


def _found(view: View) -> list[Quantity]:
    """A quantity a state: they have units of their own."""
    found = []
    for plant in view.run.graph.plants:
        dynamics = curves.dynamics(view.run.graph, plant)
        if has_attitude(dynamics):
            continue
        for column, label in enumerate(dynamics.labels):
            name, _, unit = label.partition(" [")
            name, unit = symbols(name), symbols(unit.removesuffix("]"))
            found.append(Quantity(plant, name, unit, (name,), partial(_curve, plant=plant, column=column)))
    return found


FIGURE = FigureKind(
    name="states",
    title="States",
    draw=lambda view, figure, theme: quantities.draw(_found(view), view, figure, theme),
    height_in=lambda view: quantities.height_in(_found(view), view),
    caption=lambda view: "The states of each plant that has no attitude, from the committed samples.",
    applies=lambda view: bool(_found(view)),
)

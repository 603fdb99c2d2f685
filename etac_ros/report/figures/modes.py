"""Elastic modes of the plants that have them."""

from __future__ import annotations

from functools import partial

import numpy as np

from etac_ros.metrics import curves
from etac_ros.metrics.curves import Curve
from etac_ros.plants.plant import modes_slice_of
from etac_ros.report.figures import quantities
from etac_ros.report.figures.kind import FigureKind
from etac_ros.report.figures.quantities import Quantity
from etac_ros.report.figures.style import symbols
from etac_ros.report.source import ReportedRun
from etac_ros.report.view import View


def _curve(run: ReportedRun, plant: str, mode: int) -> Curve:
    curve = curves.modes(run.graph, run.recording, plant)
    return Curve(curve.times_s, curve.values[:, mode : mode + 1])


def _found(view: View) -> list[Quantity]:
    """A quantity a mode: their sizes differ too much for one pair of axes."""
    found = []
    for plant in view.run.graph.plants:
        dynamics = curves.dynamics(view.run.graph, plant)
        for mode, label in enumerate(dynamics.labels[modes_slice_of(dynamics)]):
            name, _, unit = label.partition(" [")
            name, unit = symbols(name), symbols(unit.removesuffix("]"))
            found.append(Quantity(plant, name, unit, (name,), partial(_curve, plant=plant, mode=mode)))
    return found


def _caption(view: View) -> str:
    """The norm of all coordinates of a plant is what flexible's Tables 3 to 5 report."""
    run, ends = view.run, []
    several = len(run.graph.plants) > 1
    for plant in run.graph.plants:
        curve = curves.modes(run.graph, run.recording, plant)
        late = min(int(np.searchsorted(curve.times_s, run.summary.steady_from_s)), curve.times_s.size - 1)
        if curve.values.size:
            largest = float(np.linalg.norm(curve.values[late:], axis=1).max())
            unit = next(quantity.unit for quantity in _found(view) if quantity.name == plant)
            ends.append(f"{largest:.3g} {unit}" + (f" ({plant})" if several else ""))
    return (
        "Modal coordinates of the elastic appendages, from the committed samples; no sensor measures them. "
        f"{view.steady_words} the norm of all of them is {', '.join(ends)} at most in this run."
    )


FIGURE = FigureKind(
    name="modes",
    title="Elastic modes",
    draw=lambda view, figure, theme: quantities.draw(_found(view), view, figure, theme),
    height_in=lambda view: quantities.height_in(_found(view), view),
    caption=_caption,
    applies=lambda view: bool(_found(view)),
)

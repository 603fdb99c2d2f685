"""The Lyapunov function of the paper's theorem along the run, and what the theorem bounds it by."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from etac_ros.report.figures import downtime, panels
from etac_ros.report.figures.decimate import decimated
from etac_ros.report.figures.kind import FigureKind
from etac_ros.report.figures.style import BUCKETS, Theme, logarithmic
from etac_ros.report.view import View

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _draw(view: View, figure: Figure, theme: Theme) -> None:
    found = view.lyapunov
    assert found is not None
    axes = figure.add_subplot()
    positive = np.maximum(found.values, np.finfo(np.float64).tiny)
    axes.plot(*decimated(found.times_s, positive, BUCKETS), color=theme.this, linewidth=1.0)
    axes.plot(*decimated(found.times_s, found.ceiling, BUCKETS), color=theme.limit, linewidth=1.4)
    logarithmic(axes)
    downtime.shade(axes, view)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("V")
    colours = (theme.this, theme.limit)
    panels.key(figure, ("V", "bound"), [{"color": colour, "linewidth": 1.4} for colour in colours])


def _caption(view: View) -> str:
    found = view.lyapunov
    assert found is not None
    return (
        f"V of the paper's eq. {found.equation} at every sample, and what its theorem bounds it by. What becomes of "
        "every bound: etac theorems."
    ) + (" Of this run only." if view.overlaid else "")


FIGURE = FigureKind(
    name="lyapunov",
    title="Lyapunov function",
    draw=_draw,
    height_in=lambda view: panels.height_in(1),
    caption=_caption,
    applies=lambda view: view.lyapunov is not None,
)
"""What a figure is to the report."""

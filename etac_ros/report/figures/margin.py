"""The error that a trigger rule watches, against its threshold."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from etac_ros.maths.ticks import seconds
from etac_ros.metrics.curves import Curve
from etac_ros.report.figures import panels
from etac_ros.report.figures.decimate import decimated
from etac_ros.report.figures.kind import FigureKind
from etac_ros.report.figures.style import BUCKETS, Theme, logarithmic
from etac_ros.report.view import View

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LONGEST_SYMBOL = 3
_MOST_MARKS = 400
_DECADES_BELOW = 2.0
"""How far below the smallest threshold the axis goes: right after a message the error is nearly zero."""


def _draw(view: View, figure: Figure, theme: Theme) -> None:
    found = view.margins
    names = tuple(found)
    for panel in panels.panel_grid(figure, names, view.alone):
        margins = found[names[panel.row]]
        times = np.asarray(seconds(margins.ticks, view.run.graph.ticks_per_second))
        both = panel.part(Curve(times, np.stack([margins.errors, margins.thresholds], axis=1)))
        fired = panel.part(Curve(times[margins.fired], margins.errors[margins.fired][:, np.newaxis]))
        axes = panel.axes
        axes.plot(*decimated(both.times_s, both.values[:, 0], BUCKETS), color=theme.this, linewidth=0.8)
        axes.plot(*decimated(both.times_s, both.values[:, 1], BUCKETS), color=theme.limit, linewidth=1.2)
        if fired.times_s.size <= _MOST_MARKS:
            axes.plot(fired.times_s, fired.values[:, 0], "o", color=theme.limit, markersize=2.2, markeredgewidth=0.0)
        positive = both.values[:, 1][both.values[:, 1] > 0.0]
        if positive.size:
            logarithmic(axes)
            axes.set_ylim(positive.min() * 10.0**-_DECADES_BELOW, 2.0 * both.values.max())
        words, unit = _label(view, names[panel.row])
        axes.set_ylabel(panels.axis_label(words, unit, panels.row_in(len(names))))
    colours = (theme.this, theme.limit)
    panels.key(figure, ("error", "threshold"), [{"color": colour, "linewidth": 1.4} for colour in colours])


def _label(view: View, name: str) -> tuple[str, str]:
    """Words and unit; a list of several quantities is no symbol to take a difference of."""
    parts = view.decisions[name].parts
    symbols = {part.symbol for part in parts}
    units = {part.unit for part in parts}
    unit = units.pop() if len(units) == 1 else ""
    symbol = symbols.pop() if len(symbols) == 1 else ""
    difference = symbol.isalpha() and len(symbol) <= _LONGEST_SYMBOL
    return (f"|{symbol}(tᵢ) − {symbol}|" if difference else "error"), unit


def _caption(view: View) -> str:
    noisy = any(
        view.run.scenario.nodes[name].get("noise", {}).get("enters", "nowhere") != "nowhere" for name in view.margins
    )
    seen = "what the sensor measured, its noise and filter included" if noisy else "the committed samples"
    return (
        f"What the trigger rule compared at every tick, recomputed from {seen}, and from the value that was "
        "last on the wire. The error grows until it reaches the threshold; that tick is a triggering instant "
        "(a dot, unless they are too many), after which it starts anew near zero (below the axis)."
    ) + (" Of this run only." if view.overlaid else "")


FIGURE = FigureKind(
    name="margin",
    title="Error and threshold of the trigger rule",
    draw=_draw,
    height_in=lambda view: panels.height_in(len(view.margins)),
    caption=_caption,
    applies=lambda view: bool(view.margins),
)

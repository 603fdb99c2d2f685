"""Inter-event times."""

from __future__ import annotations

from typing import TYPE_CHECKING

from etac_ros.metrics import curves
from etac_ros.metrics.curves import Curve
from etac_ros.modules.triggering import triggering_modules
from etac_ros.report.figures.downtime import shade
from etac_ros.report.figures.kind import FigureKind
from etac_ros.report.figures.style import Theme, plain_logarithmic
from etac_ros.report.view import View

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ROW_IN = 1.9
_MOST_STEMS = 400
"""Beyond these the stems would only make a solid block, and the points stand alone."""
_LOG_FROM = 30.0


def _found(view: View) -> dict[str, Curve]:
    run = view.run
    found = {
        name: curves.intervals(curves.instants_s(run.graph, run.recording, name))
        for name in triggering_modules(run.graph)
    }
    return {name: curve for name, curve in found.items() if curve.times_s.size}


def _draw(view: View, figure: Figure, theme: Theme) -> None:
    found = _found(view)
    tick_s = 1.0 / view.run.graph.ticks_per_second
    longest = max(curve.values.max() for curve in found.values())
    shortest = min(curve.values.min() for curve in found.values())
    logarithmic = longest > _LOG_FROM * shortest
    grid = figure.subplots(len(found), 1, squeeze=False, sharex=True, sharey=True)
    for axes, (name, curve) in zip(grid[:, 0], found.items(), strict=True):
        gaps = curve.values[:, 0]
        axes.set_xlim(0.0, view.run.end_s)
        shade(axes, view)
        if logarithmic:
            axes.set_ylim(0.7 * min(tick_s, shortest), 1.8 * longest)
        else:
            axes.set_ylim(0.0, 1.15 * longest)
        if gaps.size <= _MOST_STEMS:
            axes.vlines(curve.times_s, axes.get_ylim()[0], gaps, color=theme.this, linewidth=0.6, alpha=0.45)
        size = 3.0 if gaps.size <= _MOST_STEMS else 1.6
        axes.plot(curve.times_s, gaps, "o", color=theme.this, markersize=size, markeredgewidth=0.0)
        axes.axhline(gaps.mean(), color=theme.limit, linewidth=0.9, linestyle=(0, (5, 2)), zorder=1.6)
        if logarithmic:
            _draw_tick(axes, tick_s, theme)
            plain_logarithmic(axes)
        axes.set_ylabel("interval [s]")
        figures = f"min {gaps.min():.4g} s    mean {gaps.mean():.4g} s (dashed)    max {gaps.max():.4g} s"
        axes.set_title(f"{name}:    {figures}" if len(found) > 1 else figures)
    grid[-1, 0].set_xlabel("time [s]")


def _draw_tick(axes: Axes, tick_s: float, theme: Theme) -> None:
    axes.axhline(tick_s, color=theme.muted, linewidth=0.8, linestyle=(0, (1, 1.5)))
    axes.annotate(
        f"one tick: {tick_s:.4g} s",
        (1.0, tick_s),
        xycoords=("axes fraction", "data"),
        xytext=(0, 2),
        textcoords="offset points",
        ha="right",
        va="bottom",
        color=theme.muted,
        fontsize=7,
        bbox={"facecolor": theme.paper, "edgecolor": "none", "pad": 0.6},
    )


def _caption(view: View) -> str:
    tick_s = 1.0 / view.run.graph.ticks_per_second
    return (
        "Time since the previous triggering instant, drawn at the instant that ends it. No interval can be "
        f"shorter than one tick of the trigger grid, {tick_s:.4g} s."
    ) + (" Of this run only." if view.overlaid else "")


FIGURE = FigureKind(
    name="intervals",
    title="Inter-event times",
    draw=_draw,
    height_in=lambda view: 0.45 + _ROW_IN * len(_found(view)),
    caption=_caption,
    applies=lambda view: bool(_found(view)),
)

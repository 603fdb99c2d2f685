"""Latencies of a run in real time: of each topic, from sample to torque, and how late nodes woke."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from etac_ros.metrics.latency import latencies_ms, lateness_ms, loop_steps
from etac_ros.report.figures.kind import FigureKind
from etac_ros.report.figures.style import Theme
from etac_ros.report.view import View

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ROW_IN = 0.62
_BINS = 48
_SHORTEST_MS = 1e-3
"""What is shorter stands in the first bin: no clock here tells less apart."""


def _found(view: View) -> dict[str, list[float]]:
    """Values [ms] by what they are of, in the order of the tables."""
    graph, recording = view.run.graph, view.run.recording
    if recording.wall is None:
        return {}
    found = {topic: values for topic, values in latencies_ms(graph, recording).items() if values}
    for step in loop_steps(graph, recording):
        found.setdefault(f"sample to {step.topic}", []).append((step.arrived_ns - step.instant_ns) * 1e-6)
    for name, entries in recording.ledgers.items():
        late = lateness_ms(entries)
        if late:
            found[f"{name} woke late"] = late
    return found


def _draw(view: View, figure: Figure, theme: Theme) -> None:
    from matplotlib.ticker import FuncFormatter

    found = _found(view)
    wall = view.run.recording.wall
    assert wall is not None
    tick_ms = wall.tick_ns * 1e-6
    values = {name: np.maximum(np.array(some), _SHORTEST_MS) for name, some in found.items()}
    least = min(float(some.min()) for some in values.values())
    most = max(tick_ms, *(float(some.max()) for some in values.values()))
    bins = np.geomspace(0.8 * least, 1.25 * most, _BINS)
    grid = figure.subplots(len(values), 1, squeeze=False, sharex=True)
    for axes, (name, some) in zip(grid[:, 0], values.items(), strict=True):
        axes.hist(some, bins=bins.tolist(), color=theme.this)
        axes.axvline(float(np.median(some)), color=theme.limit, linewidth=1.0, linestyle=(0, (5, 2)))
        axes.axvline(tick_ms, color=theme.muted, linewidth=0.9, linestyle=(0, (1, 1.5)))
        axes.set_xscale("log")
        axes.set_yticks([])
        axes.set_title(f"{name}:    {some.size:,}, median {np.median(some):.3g} ms, most {some.max():.3g} ms")
    grid[-1, 0].xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    grid[-1, 0].set_xlabel("[ms]")


def _caption(view: View) -> str:
    wall = view.run.recording.wall
    assert wall is not None
    return (
        "How often each latency came: of topics from the source timestamp until a receiver took the message, then from "
        "the instant of a triggering sample until its torque arrived, then how late nodes woke for their own acts. "
        f"Dashed: the median. Dotted: a tick, {wall.tick_ns * 1e-6:.4g} ms."
    ) + (" Of this run only." if view.overlaid else "")


FIGURE = FigureKind(
    name="latency",
    title="Latencies in real time",
    draw=_draw,
    height_in=lambda view: 0.6 + _ROW_IN * len(_found(view)),
    caption=_caption,
    applies=lambda view: bool(_found(view)),
    over_time=False,
)

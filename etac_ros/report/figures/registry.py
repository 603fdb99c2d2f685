"""All figures, in the order in which a report shows them. A new one is a new file and a line here."""

from __future__ import annotations

from etac_ros.report.figures import (
    energy,
    intervals,
    latency,
    lyapunov,
    margin,
    modes,
    network,
    overview,
    pointing,
    raster,
    signal,
    states,
    torque,
    volume,
    watched,
)
from etac_ros.report.figures.kind import FigureKind

FIGURES: tuple[FigureKind, ...] = (
    overview.FIGURE,
    pointing.ATTITUDE,
    pointing.RATE,
    states.FIGURE,
    torque.FIGURE,
    watched.FIGURE,
    modes.FIGURE,
    signal.FIGURE,
    network.FIGURE,
    margin.FIGURE,
    intervals.FIGURE,
    volume.FIGURE,
    raster.FIGURE,
    energy.FIGURE,
    latency.FIGURE,
    lyapunov.FIGURE,
)

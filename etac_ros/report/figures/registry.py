"""All figures, in the order in which a report shows them. A new one is a new file and a line here."""

from __future__ import annotations

from etac_ros.report.figures import (
    attitude,
    energy,
    intervals,
    margin,
    overview,
    raster,
    rate,
    torque,
    volume,
)
from etac_ros.report.figures.kind import FigureKind

FIGURES: tuple[FigureKind, ...] = (
    overview.FIGURE,
    attitude.FIGURE,
    rate.FIGURE,
    torque.FIGURE,
    margin.FIGURE,
    intervals.FIGURE,
    volume.FIGURE,
    raster.FIGURE,
    energy.FIGURE,
)

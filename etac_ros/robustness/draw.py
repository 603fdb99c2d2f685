"""The maps of a scenario as a picture: how much worse the steady error is, by loss and delay."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from etac_ros.report.figures import style
from etac_ros.report.figures.style import WIDTH_IN, Theme
from etac_ros.robustness.grid import Cell, Map, Robustness

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

_ROW_IN = 0.42
_REST_IN = 1.0
_WORST = 100.0
"""Errors beyond so many times that of ideal links have one colour."""
_DARK = 10.0
"""Beyond so many times, words in a cell are light."""


def picture(found: Robustness) -> bytes:
    """A PNG with a panel for each loop, for a light page; the same maps always give the same bytes."""
    height = _REST_IN + _ROW_IN * len(found.losses)
    return style.picture(lambda figure, theme: _fill(figure, theme, found), (WIDTH_IN, height))


def _fill(figure: Figure, theme: Theme, found: Robustness) -> None:
    panels = figure.subplots(1, len(found.maps), sharey=True, squeeze=False)[0]
    images = [_panel(axes, theme, found, which) for axes, which in zip(panels, found.maps, strict=True)]
    panels[0].set_ylabel("loss")
    bar = figure.colorbar(images[0], ax=list(panels), ticks=[1.0, found.factor, 10.0, _WORST], fraction=0.03)
    bar.ax.set_yticklabels(["1", f"{found.factor:g}", "10", f"{_WORST:g}"])
    bar.ax.minorticks_off()
    bar.set_label("steady error / ideal")


def _panel(axes: Axes, theme: Theme, found: Robustness, which: Map) -> AxesImage:
    from matplotlib.colors import LogNorm

    ideal = which.at(0.0, 0.0).error_deg
    ratios = np.array([[_ratio(which.at(loss, delay), ideal) for delay in found.delays_s] for loss in found.losses])
    image = axes.imshow(ratios, norm=LogNorm(1.0, _WORST), cmap="YlOrRd", aspect="auto")
    axes.grid(visible=False)
    axes.set_title(f"{found.scenario.name}, {which.variant}")
    axes.set_xlabel("delay [s]")
    axes.set_xticks(range(len(found.delays_s)), [f"{delay:g}" for delay in found.delays_s])
    axes.set_yticks(range(len(found.losses)), [f"{loss:g}" for loss in found.losses])
    for row, loss in enumerate(found.losses):
        for column, delay in enumerate(found.delays_s):
            cell = which.at(loss, delay)
            words = f"{cell.messages:,}" if cell.holds else f"{cell.messages:,}\nfails"
            colour = theme.paper if ratios[row, column] > _DARK else theme.ink
            axes.text(column, row, words, ha="center", va="center", fontsize=6.5, color=colour)
    return image


def _ratio(cell: Cell, ideal: float | None) -> float:
    """How many times as large as over ideal links the error is, as far as the colours go."""
    if cell.halted:
        return _WORST
    if cell.error_deg is None or not ideal:
        return 1.0
    return float(np.clip(cell.error_deg / ideal, 1.0, _WORST))

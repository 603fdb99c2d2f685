"""What a figure is to the report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from etac_ros.report.figures import downtime
from etac_ros.report.figures.style import WIDTH_IN, Theme
from etac_ros.report.view import View

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class FigureKind:
    """One figure that a report may have.

    Attributes
    ----------
    name
        Stem of its PNG file, and its key in the scenario's ``published.shown_in``.
    title
        Heads the caption.
    draw
        Fills an empty figure.
    height_in
        Height for a run [in].
    caption
        What is to be seen, in sentences, with the figures that one reads off.
    applies
        Whether a run has what it shows.
    over_time
        Whether its horizontal axis is time, on which faults are shaded.
    """

    name: str
    title: str
    draw: Callable[[View, Figure, Theme], None]
    height_in: Callable[[View], float]
    caption: Callable[[View], str]
    applies: Callable[[View], bool] = lambda view: True
    over_time: bool = True

    def words(self, view: View) -> str:
        """The caption, with what is shaded."""
        return self.caption(view) + (downtime.caption(view) if self.over_time else "")

    def size_in(self, view: View) -> tuple[float, float]:
        """Width and height for a run [in]."""
        return WIDTH_IN, self.height_in(view)

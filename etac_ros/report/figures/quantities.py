"""Quantities over time: how a figure of them is laid out and drawn, for one run and for several over each other."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from etac_ros.metrics.curves import Curve
from etac_ros.parameters import FloatArray
from etac_ros.report.figures import panels
from etac_ros.report.figures.decimate import decimated
from etac_ros.report.figures.panels import Panel
from etac_ros.report.figures.style import BUCKETS, Theme, prefixed
from etac_ros.report.source import ReportedRun
from etac_ros.report.view import View

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_STEPS = 1000
"""Beyond these, thinner lines keep the steps of a staircase apart."""
_THIN = 0.5
_NEAR = 0.3
"""A bound is drawn where a curve reaches this part of it; beyond, it would only flatten the curve."""
_LARGER = 10.0
"""A run whose values are so many times those of the reported one may leave the panel; its largest is written above."""
_MARGIN = 0.08
_ROUGH = 3.0
"""A curve that goes up and down so many times as far as that of the reported run lies behind it, not before it."""


@dataclass(frozen=True)
class Bound:
    """A line at plus and minus a value."""

    name: str
    value: float


@dataclass(frozen=True)
class Quantity:
    """What is drawn over time, with a column for each axis or mode.

    Attributes
    ----------
    name
        Whose it is; stands on the panel where a figure has several.
    label, unit
        What the vertical axis is called.
    columns
        Name of each column.
    curve
        Gives it for a run; None where the run does not have it.
    staircase
        Whether a value holds until the next.
    bounds
        Lines to compare it with.
    dots
        Gives values that are marked by dots, where there are any.
    """

    name: str
    label: str
    unit: str
    columns: tuple[str, ...]
    curve: Callable[[ReportedRun], Curve | None]
    staircase: bool = False
    bounds: tuple[Bound, ...] = ()
    dots: Callable[[ReportedRun], Curve | None] = lambda run: None


@dataclass(frozen=True)
class _Row:
    """A row of panels: some columns of a quantity."""

    quantity: Quantity
    columns: tuple[int, ...]
    words: str


def height_in(quantities: Sequence[Quantity], view: View) -> float:
    """Height of a figure of these quantities [in]."""
    return panels.height_in(len(_rows(quantities, view)))


def draw(quantities: Sequence[Quantity], view: View, figure: Figure, theme: Theme) -> None:
    """Draw one run with a row a quantity and a colour a column, several with a row a column and a style a run."""
    rows = _rows(quantities, view)
    several = len({quantity.name for quantity in quantities}) > 1
    grid = panels.panel_grid(figure, [row.quantity.name if several and _heads(row) else "" for row in rows], view)
    curves = {id(quantity): [quantity.curve(run) for run in view.runs] for quantity in quantities}
    for panel in grid:
        row = rows[panel.row]
        dots = row.quantity.dots(view.run) if not view.overlaid else None
        _draw_panel(panel, row, curves[id(row.quantity)], view.labels, dots, theme, panels.row_in(len(rows)))
    if view.overlaid:
        panels.run_key(figure, view, theme)
        return
    keys = dict.fromkeys(quantity.columns for quantity in quantities if len(quantity.columns) > 1)
    if len(keys) == 1:
        (columns,) = keys
        panels.key(figure, columns, panels.column_styles(theme, len(columns)))
        return
    for panel in grid:
        columns = rows[panel.row].quantity.columns
        if panel.start_s == 0.0:
            panels.key(panel.axes, columns, panels.column_styles(theme, len(columns)))


def _rows(quantities: Sequence[Quantity], view: View) -> list[_Row]:
    rows = []
    for quantity in quantities:
        every = tuple(range(len(quantity.columns)))
        if view.overlaid and len(every) > 1:
            rows += [_Row(quantity, (column,), f"{quantity.label} {quantity.columns[column]}") for column in every]
        else:
            rows.append(_Row(quantity, every, quantity.label))
    return rows


def _heads(row: _Row) -> bool:
    return row.columns[0] == 0


def _draw_panel(
    panel: Panel,
    row: _Row,
    curves: Sequence[Curve | None],
    labels: Sequence[str],
    dots: Curve | None,
    theme: Theme,
    high_in: float,
) -> None:
    quantity = row.quantity
    cut = panel.held_part if quantity.staircase else panel.part
    parts = [None if curve is None else cut(curve) for curve in curves]
    shown = {
        number: Curve(part.times_s, part.values[:, row.columns])
        for number, part in enumerate(parts)
        if part is not None and part.values.size
    }
    spans = {number: _span(part.values) for number, part in shown.items()}
    beyond = _beyond(spans)
    within = [span for number, span in spans.items() if number not in beyond]
    low, high = min((span[0] for span in within), default=0.0), max((span[1] for span in within), default=0.0)
    factor, unit = prefixed(quantity.unit, max(-low, high))
    if beyond:
        margin = _MARGIN * (high - low)
        panel.axes.set_ylim(factor * (low - margin), factor * (high + margin))
        words = [f"{labels[number]}: up to {_in_words(span, quantity.unit)}" for number, span in beyond.items()]
        panel.axes.set_title("; ".join(words), loc="right", fontsize=7)
    panel.axes.axhline(0.0, color=theme.muted, linewidth=0.5, zorder=1.5)
    for bound in quantity.bounds:
        _draw_bound(panel, bound, (low, high), (factor, unit), theme)
    for column, part, style in _lines(shown, len(curves) > 1, theme):
        drawstyle = "steps-post" if quantity.staircase else "default"
        if quantity.staircase and part.times_s.size > _MOST_STEPS:
            style = {**style, "linewidth": min(_THIN, style["linewidth"])}
        points = decimated(part.times_s, factor * part.values[:, column], BUCKETS)
        panel.axes.plot(*points, drawstyle=drawstyle, **style)
    if dots is not None:
        marks = panel.part(dots)
        for place, column in enumerate(row.columns):
            panel.axes.plot(
                marks.times_s,
                factor * marks.values[:, column],
                "o",
                color=theme.colour(place),
                markersize=2.0,
                markeredgewidth=0.0,
            )
    panel.axes.set_ylabel(panels.axis_label(row.words, unit, high_in))


def _span(values: FloatArray) -> tuple[float, float]:
    """Smallest and largest of what is a number."""
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)


def _in_words(span: tuple[float, float], unit: str) -> str:
    largest = max(-span[0], span[1])
    factor, unit = prefixed(unit, largest)
    return f"{factor * largest:.3g} {unit}".rstrip()


def _beyond(spans: dict[int, tuple[float, float]]) -> dict[int, tuple[float, float]]:
    """Runs that are so much larger than the reported one that it would be a flat line beside them."""
    reach = {number: max(-low, high) for number, (low, high) in spans.items()}
    own = reach.get(0, 0.0)
    return {number: spans[number] for number in spans if 0.0 < _LARGER * own < reach[number]}


def _lines(shown: dict[int, Curve], several: bool, theme: Theme) -> Iterator[tuple[int, Curve, dict[str, Any]]]:
    """Columns of the runs and how they are drawn; a rough curve of another run goes behind the reported one's."""
    if not several:
        for part in shown.values():
            for column, style in enumerate(panels.column_styles(theme, part.values.shape[1])):
                yield column, part, dict(style)
        return
    ways = {number: float(np.abs(np.diff(part.values[:, 0])).sum()) for number, part in shown.items()}
    for number, part in shown.items():
        rough = number > 0 and ways[number] > _ROUGH * ways.get(0, np.inf)
        yield 0, part, {**theme.run_style(number), "zorder": 2.0 if rough else 2.2 + 0.01 * number}


def _draw_bound(
    panel: Panel, bound: Bound, extremes: tuple[float, float], scale: tuple[float, str], theme: Theme
) -> None:
    factor, unit = scale
    signs = [sign for sign, reached in ((1.0, extremes[1]), (-1.0, -extremes[0])) if reached >= _NEAR * bound.value]
    for sign in signs:
        height = sign * factor * bound.value
        panel.axes.axhline(height, color=theme.limit, linewidth=0.8, linestyle=(0, (1, 1.5)))
    for sign in signs[:1]:
        panel.axes.annotate(
            f"{bound.name} {'±' if len(signs) > 1 else ''}{sign * factor * bound.value:g} {unit}".rstrip(),
            (1.0, sign * factor * bound.value),
            xycoords=("axes fraction", "data"),
            xytext=(0, -2 * sign),
            textcoords="offset points",
            ha="right",
            va="top" if sign > 0.0 else "bottom",
            color=theme.limit,
            fontsize=7,
            bbox={"facecolor": theme.paper, "edgecolor": "none", "pad": 0.6, "alpha": 0.8},
        )

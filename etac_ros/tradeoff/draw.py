"""The picture of a trade-off: steady error and energy against network bytes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from etac_ros.report.figures import style
from etac_ros.report.figures.style import WIDTH_IN, Theme, plain_logarithmic
from etac_ros.tradeoff.curves import Tradeoff, envelope
from etac_ros.tradeoff.layout import PERIODIC
from etac_ros.tradeoff.points import TradePoint

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_HEIGHT_IN = 3.9
_SMALL = 6.5
_MARKS = ("o", "s", "D", "v")


def picture(tradeoff: Tradeoff) -> bytes:
    """A PNG with two panels, for a light page; the same trade-off always gives the same bytes."""
    return style.picture(lambda figure, theme: _fill(figure, theme, tradeoff), (WIDTH_IN, _HEIGHT_IN))


def _fill(figure: Figure, theme: Theme, tradeoff: Tradeoff) -> None:
    left, right = figure.subplots(1, 2, sharex=True)
    papers = [point for point in tradeoff.papers if point.counts]
    for axes, figure_of in ((left, "error"), (right, "energy")):
        for number, name in enumerate(tradeoff.layout.section.curves):
            _curve(axes, theme, tradeoff.curve(name), figure_of, number)
        _periodic(axes, theme, tradeoff.curve(PERIODIC), figure_of)
        for point in papers[:1]:  # more of them would cover each other
            _guides(axes, theme, tradeoff, point, figure_of)
        _papers(axes, theme, papers, figure_of)
        axes.set_xlabel("network payload [bytes]")
        plain_logarithmic(axes)
    left.set_title(tradeoff.layout.error_label)
    right.set_title("energy [N²m²s]")
    _logarithmic_bytes(left)
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4 if len(labels) <= 4 else 3)


def _curve(axes: Axes, theme: Theme, points: Sequence[TradePoint], figure: str, number: int) -> None:
    """A line in the order of the values; of a grid all points, and a line along its lower-left envelope."""
    held = [point for point in points if point.counts]
    if not held:
        return
    # The first of the theme's colours is that of the paper's points.
    colour, mark = theme.axes[1 + number % (len(theme.axes) - 1)], _MARKS[number % len(_MARKS)]
    grid = len(held[0].values) > 1
    line = envelope(held) if grid else held
    axes.plot(*_place(line, figure), color=colour, marker=mark, markersize=3.2, label=held[0].label)
    if grid:
        axes.plot(*_place(held, figure), color=colour, marker=mark, markersize=2.0, linestyle="none", alpha=0.5)
    elif figure == "error":  # once is enough
        _name_ends(axes, theme, held, figure, colour)


def _periodic(axes: Axes, theme: Theme, points: Sequence[TradePoint], figure: str) -> None:
    held = [point for point in points if point.counts]
    style: dict[str, Any] = {"color": theme.muted, "marker": "|", "markersize": 6.0, "linestyle": (0, (5.0, 1.6))}
    if held:
        axes.plot(*_place(held, figure), label=held[0].label, **style)
        if len(held[0].values) == 1:
            _name_ends(
                axes, theme, held, figure, theme.muted, " s" if next(iter(held[0].values)).endswith("_s") else ""
            )


def _guides(axes: Axes, theme: Theme, tradeoff: Tradeoff, point: TradePoint, figure: str) -> None:
    """From a paper's point across and up to the periodic curve: the answer at the same error, and at the same bytes."""
    said = tradeoff.answer(point)
    if said is None:
        return
    across = said.bytes_at_error if figure == "error" else said.bytes_at_energy
    up = said.error_at_bytes if figure == "error" else said.energy_at_bytes
    (x,), (y,) = _place([point], figure)
    style: dict[str, Any] = {"color": theme.this, "linestyle": (0, (1.0, 1.6)), "linewidth": 1.0}
    if across is not None:
        axes.plot([x, across * x], [y, y], **style)
    if up is not None:
        axes.plot([x, x], [y, up * y], **style)


def _papers(axes: Axes, theme: Theme, held: Sequence[TradePoint], figure: str) -> None:
    if not held:
        return
    axes.plot(
        *_place(held, figure),
        color=theme.this,
        marker="*",
        markersize=11.0,
        markeredgecolor=theme.paper,
        linestyle="none",
        label="the paper's point" if len(held) == 1 else "the paper's points",
        zorder=5,
    )
    for number, point in enumerate(held if len(held) > 1 and figure == "error" else []):
        # In turn above and below: the paper's points often lie side by side.
        _write(axes, theme, point, figure, point.label, theme.this, (0.0, -13.0 if number % 2 else 8.0), "center")


def _name_ends(axes: Axes, theme: Theme, held: Sequence[TradePoint], figure: str, colour: str, unit: str = "") -> None:
    """Write the first and the last value beside a curve's ends."""
    for point in (held[0], held[-1]) if len(held) > 1 else held:
        value = next(iter(point.values.values()))
        _write(axes, theme, point, figure, f"{value:g}{unit}", colour, (4.0, 2.5), "left")


def _write(
    axes: Axes,
    theme: Theme,
    point: TradePoint,
    figure: str,
    text: str,
    colour: str,
    offset: tuple[float, float],
    side: str,
) -> None:
    from matplotlib.patheffects import withStroke

    (x,), (y,) = _place([point], figure)
    axes.annotate(
        text, (x, y), offset, textcoords="offset points", ha=side, fontsize=_SMALL, color=colour, zorder=6,
        path_effects=[withStroke(linewidth=1.8, foreground=theme.paper)],
    )  # fmt: skip


def _place(points: Sequence[TradePoint], figure: str) -> tuple[list[float], list[float]]:
    values = [point.error if figure == "error" else point.energy for point in points]
    return [point.payload_bytes for point in points], values


def _logarithmic_bytes(axes: Axes) -> None:
    """Make the horizontal axis logarithmic, with its bytes written out."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    if not math.isfinite(axes.dataLim.minposx):
        return
    axes.set_xscale("log")
    low, high = axes.get_xlim()
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0,) if high > 100.0 * low else (1.0, 2.0, 5.0)))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}"))

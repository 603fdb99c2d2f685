"""Trade-offs as a page: pictures, answers, tables, Zeno check."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from etac_ros import __version__
from etac_ros.tables.markdown import markdown_lines
from etac_ros.tables.table import Row, Table
from etac_ros.tradeoff.curves import Tradeoff, values_of
from etac_ros.tradeoff.layout import PERIODIC
from etac_ros.tradeoff.points import TradePoint
from etac_ros.tradeoff.zeno import Shortest, zeno_words

HEAD = (
    "curve",
    "value",
    "triggers",
    "messages",
    "bytes",
    "steady error",
    "energy",
    "bytes ×",
    "error ×",
    "why it does not count",
)
ZENO_HEAD = ("curve", "value", "shortest [s]", "ticks", "the paper's bound [s]", "after")
_NONE = "-"

_INTRODUCTION = """\
A trigger rule trades accuracy for traffic, and each paper shows a single point of that trade. Here the rule's own
parameters are varied, and beside them stands the same law at a fixed period.

Triggers, messages, payload bytes, steady error and energy are means over the runs of a point, which all draw the same
dispersed starts (the scenario's section `dispersion`); behind the error stands its standard deviation. `bytes ×` is how
many times a point's bytes the periodic loop needs for the same steady error, `error ×` how many times as large its
error is with the same bytes; both are read off the periodic curve by straight lines in log-log, the first at the
fewest bytes that do. A dash means that the point lies outside that curve. The dotted lines in a picture show the same
for the first of the paper's points. A grid of two values is drawn as points, with a line along its lower-left
envelope. A point at which a watch ended a run, or whose error does not become smaller than it was at the start, is in
the table with the reason, and in no curve."""


def picture_name(name: str) -> str:
    """File name of the picture of a scenario."""
    return f"tradeoff_{name}.png"


def markdown(found: Sequence[tuple[Tradeoff, Sequence[Shortest]]], runs: int, command: str) -> str:
    """The whole page.

    Parameters
    ----------
    found
        Trade-offs with their shortest inter-event times, in the order in which they are shown.
    runs
        At each point.
    command
        The command that writes this very page.
    """
    plural = "run" if runs == 1 else "runs"
    lines = [
        "# What traffic buys: event-triggered against periodic",
        "",
        f"Written by `{command}`, etac_ros {__version__}; {runs} dispersed {plural} at each point, in process.",
        "",
        _INTRODUCTION,
    ]
    for tradeoff, shortest in found:
        lines += ["", *_section(tradeoff, shortest)]
    return "\n".join(lines) + "\n"


def _section(tradeoff: Tradeoff, shortest: Sequence[Shortest]) -> list[str]:
    scenario = tradeoff.layout.scenario
    title = scenario.run.title or scenario.name
    lines = [f"## {title}", "", f"![{_alternative(tradeoff)}]({picture_name(scenario.name)})", ""]
    lines += [f"- {words}" for words in tradeoff.words()]
    lines += ["", f"Steady error: {tradeoff.layout.error_label}. Energy in N²m²s.", ""]
    lines += markdown_lines(points_table(tradeoff))
    lines += ["", "**Zeno check.** " + zeno_words(shortest, scenario.run.ticks_per_second), ""]
    if shortest:
        lines += markdown_lines(zeno_table(shortest))
        lines += [line for remark in remarks(shortest) for line in ("", remark)]
    return lines


def _alternative(tradeoff: Tradeoff) -> str:
    return f"Steady error and energy of {tradeoff.layout.scenario.name} against its network bytes"


def points_table(tradeoff: Tradeoff) -> Table:
    """All points of a trade-off, with a line between curves."""
    points = tradeoff.points
    ends = [one.curve != following.curve for one, following in pairwise(points)]
    rows = (Row(_cells(tradeoff, point), ends=end) for point, end in zip(points, [*ends, False], strict=True))
    return Table("", HEAD, tuple(rows), texts=frozenset({HEAD[1], HEAD[-1]}))


def zeno_table(shortest: Sequence[Shortest]) -> Table:
    """The shortest inter-event times beside the papers' bounds."""
    rows = tuple(Row(_zeno_cells(one)) for one in shortest)
    return Table("", ZENO_HEAD, rows, texts=frozenset({ZENO_HEAD[1], ZENO_HEAD[-1]}))


def _cells(tradeoff: Tradeoff, point: TradePoint) -> tuple[str, ...]:
    """A point as text, in the order of the head."""
    first = f"{'the paper: ' if point.curve is None else ''}{point.label}", values_of(point)
    if point.failed:
        return (*first, *(_NONE for _ in HEAD[3:]), point.failed)
    numbers = (
        f"{point.triggers:,.0f}",
        f"{point.messages:,.0f}",
        f"{point.payload_bytes:,.0f}",
        f"{point.error:.3g} ± {point.error_sd:.1g}",
        f"{point.energy:.4g}",
    )
    if point.curve == PERIODIC:
        return (*first, *numbers, "", "", "")
    said = tradeoff.answer(point)
    factors = (None, None) if said is None else (said.bytes_at_error, said.error_at_bytes)
    return (*first, *numbers, *(_factor(factor) for factor in factors), "")


def _zeno_cells(one: Shortest) -> tuple[str, ...]:
    """The shortest inter-event time of a curve as text, in the order of its head."""
    bound = one.bound
    return (
        one.point.label,
        values_of(one.point),
        f"{one.seconds:g}",
        f"{one.ticks:,}",
        _NONE if bound is None or bound.seconds is None else f"{bound.seconds:.3g}",
        "" if bound is None else bound.equation,
    )


def remarks(shortest: Sequence[Shortest]) -> list[str]:
    """What has to be said of the papers' bounds, each once."""
    bounds = [one.bound for one in shortest if one.bound is not None]
    return [
        f"{equation}: {remark}." for equation, remark in dict.fromkeys((one.equation, one.remark) for one in bounds)
    ]


def _factor(factor: float | None) -> str:
    return _NONE if factor is None else f"{factor:.3g}"

"""The Zeno check: the shortest inter-event time of a trade-off beside the tick and beside the paper's bound."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from etac_ros.tradeoff.answer import times
from etac_ros.tradeoff.bounds import bound_of
from etac_ros.tradeoff.layout import PERIODIC, Layout
from etac_ros.tradeoff.points import TradePoint
from etac_ros.triggers.bound import Bound


@dataclass(frozen=True)
class Shortest:
    """The shortest inter-event time of a curve, or of one of the paper's points.

    Attributes
    ----------
    point
        Where it occurred.
    seconds, ticks
        How long it is.
    bound
        The paper's, at this point; None where none is known.
    """

    point: TradePoint
    seconds: float
    ticks: int
    bound: Bound | None


def shortest_of(layout: Layout, points: Sequence[TradePoint]) -> list[Shortest]:
    """The shortest inter-event time of each event-triggered curve, and of each of the paper's points.

    Failed points count, too: they were triggered by events as well.

    Parameters
    ----------
    layout
        What was run.
    points
        What came of it, in the order of its places.
    """
    best: dict[tuple[str | None, str], int] = {}
    for number, point in enumerate(points):
        key = point.curve, point.label
        if point.curve == PERIODIC or point.shortest_s is None:
            continue
        before = points[best[key]].shortest_s if key in best else None
        if before is None or point.shortest_s < before:
            best[key] = number
    found = []
    for number in best.values():
        seconds = points[number].shortest_s
        assert seconds is not None
        ticks = round(seconds * layout.scenario.run.ticks_per_second)
        found.append(Shortest(points[number], seconds, ticks, bound_of(layout.places[number].scenario)))
    return found


def zeno_words(shortest: Sequence[Shortest], ticks_per_second: int) -> str:
    """What the shortest intervals say, in words; nothing where there are none."""
    if not shortest:
        return "No event-triggered module triggered twice: there is no inter-event time."
    least = min(shortest, key=lambda one: one.seconds)
    ticks = "one tick" if least.ticks == 1 else f"{least.ticks:,} ticks"
    words = f"The shortest inter-event time of all points and runs is {least.seconds:g} s, {ticks}."
    if least.ticks == 1:
        words += " That is as short as this grid allows: there the grid, and not the rule, keeps the instants apart."
    bounds = [(one.seconds, one.bound.seconds) for one in shortest if one.bound and one.bound.seconds is not None]
    if not bounds:
        return f"{words} The paper's bound cannot be evaluated." if any(one.bound for one in shortest) else words
    values = [bound for _, bound in bounds]
    span = f"{min(values):.2g} to {max(values):.2g} s" if min(values) < max(values) else f"{max(values):.2g} s"
    broken = sum(seconds < bound for seconds, bound in bounds)
    if broken:
        return f"{words} The paper's bound, {span}, is not kept in {broken} of the {len(bounds)} rows below."
    factor = min(seconds / bound for seconds, bound in bounds)
    words += (
        f" The paper's bound, {span}, is kept in every row below, where intervals are {times(factor)} as long or more."
    )
    if max(values) < 1.0 / ticks_per_second:
        words += " It is shorter than a tick, so that this grid keeps it by itself."
    return words

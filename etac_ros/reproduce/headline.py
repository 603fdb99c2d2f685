"""How many independent figures of the papers come out: what is fitted, constructed or said twice does not count."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from etac_ros.metrics.verdict import Verdict
from etac_ros.reproduce.rows import Row
from etac_ros.scenario.schema import FigureKind

HEADLINE = (
    "Independent figures: those that were neither fitted nor constructed, each once. What follows from a count - its "
    "percentage, its messages and bytes, its mean interval - stands or falls with it, as one figure with the worst "
    "verdict of them, and is fitted where the count is. A figure that several readings have counts for the first of "
    "them, the file as it stands or the variant that comes first. Limits are counted apart: to stay below is easier "
    "than to meet. What cannot be tested counts among the figures, not among those that are reproduced."
)
"""The rule in words."""
_OF_A_COUNT = frozenset(
    {
        "triggers", "mean_interval_s", "network_messages", "network_deliveries", "network_payload_bytes",
        "message_reduction_percent", "reduction_percent", "equal_content_reduction_percent",
        "trigger_reduction_percent", "baseline_more_triggers",
    }
)  # fmt: skip
"""Figures that follow from a count of triggering instants."""
_WORST_FIRST = (Verdict.NOT_REPRODUCED, Verdict.NOT_TESTABLE, Verdict.NEAR, Verdict.REPRODUCED)


@dataclass(frozen=True)
class Headline:
    """Numbers of independent figures.

    Attributes
    ----------
    figures, reproduced, near, untestable
        Figures that have to be met, and of these those with a verdict.
    limits, kept
        Figures that have to be stayed below, and of these those that are.
    rows
        Of the whole table.
    """

    figures: int
    reproduced: int
    near: int
    untestable: int
    limits: int
    kept: int
    rows: int

    def __str__(self) -> str:
        untestable = f", {self.untestable} not testable" if self.untestable else ""
        return (
            f"{self.reproduced} of {self.figures} independent figures reproduced ({self.near} near{untestable}), "
            f"{self.kept} of {self.limits} limits kept; {self.rows} rows in all"
        )


def headline(rows: Sequence[Row]) -> Headline:
    """Count what is independent among rows, in the order of their readings."""
    firsts = _firsts(rows)
    limits = [row for row in firsts if row.paper.kind is FigureKind.LIMIT]
    verdicts = [_worst(group) for group in _groups(firsts) if not _says_nothing(group)]
    return Headline(
        figures=len(verdicts),
        reproduced=verdicts.count(Verdict.REPRODUCED),
        near=verdicts.count(Verdict.NEAR),
        untestable=verdicts.count(Verdict.NOT_TESTABLE),
        limits=len(limits),
        kept=sum(row.verdict is Verdict.KEPT for row in limits),
        rows=len(rows),
    )


def _firsts(rows: Sequence[Row]) -> list[Row]:
    """Each printed figure in the first reading that has it, also where that is fitted to it."""
    found: dict[tuple[str, ...], Row] = {}
    for row in rows:
        found.setdefault((row.scenario, row.key.name, row.paper.printed, _whose(row)), row)
    return list(found.values())


def _whose(row: Row) -> str:
    """The spacecraft of a figure: in a formation each has its own."""
    return (row.key.node or "").rpartition("/")[0] if row.of_formation else ""


def _groups(rows: Sequence[Row]) -> list[list[Row]]:
    """Rows that stand or fall together; limits stand alone, and are left out."""
    found: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        if row.paper.kind is FigureKind.LIMIT:
            continue
        name = "count" if row.key.name in _OF_A_COUNT else f"{row.key.name} {row.paper.printed}"
        found.setdefault((row.scenario, row.variant, _whose(row), name), []).append(row)
    return list(found.values())


def _says_nothing(group: Sequence[Row]) -> bool:
    kinds = {row.paper.kind for row in group}
    return FigureKind.FITTED in kinds or kinds == {FigureKind.CONSTRUCTED}


def _worst(group: Sequence[Row]) -> Verdict:
    verdicts = {row.verdict for row in group}
    return next((verdict for verdict in _WORST_FIRST if verdict in verdicts), Verdict.NOT_REPRODUCED)

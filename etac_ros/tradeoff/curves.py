"""A trade-off that has been run: its curves, and what they say beside each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from etac_ros.sweep.run import OnProgress, sweep
from etac_ros.sweep.workers import Workers
from etac_ros.tradeoff.answer import Answer, PeriodicCurve, answer, periodic_curve, times
from etac_ros.tradeoff.layout import PERIODIC, Layout
from etac_ros.tradeoff.points import TradePoint, points_of

_AS_GOOD = 1.1
"""Errors up to this much above the smallest count as no worse."""


@dataclass(frozen=True)
class Tradeoff:
    """A trade-off that has been run.

    Attributes
    ----------
    layout
        What was run.
    points
        What came of it, in the order of the layout's places.
    """

    layout: Layout
    points: tuple[TradePoint, ...]

    @property
    def curve_names(self) -> tuple[str, ...]:
        """The curves in their order; the periodic one comes last."""
        return (*self.layout.section.curves, PERIODIC)

    def curve(self, name: str) -> list[TradePoint]:
        """The points of a curve, in the order of its values, failed ones included."""
        return [point for point in self.points if point.curve == name]

    @property
    def papers(self) -> list[TradePoint]:
        """The paper's own points."""
        return [point for point in self.points if point.curve is None]

    @cached_property
    def periodic_errors(self) -> PeriodicCurve | None:
        """Steady error of the periodic loop over its bytes; None if fewer than two of its points hold."""
        return periodic_curve([(point.payload_bytes, point.error) for point in self._periodic])

    @cached_property
    def periodic_energies(self) -> PeriodicCurve | None:
        """Energy of the periodic loop over its bytes; None if fewer than two of its points hold."""
        return periodic_curve([(point.payload_bytes, point.energy) for point in self._periodic])

    @property
    def _periodic(self) -> list[TradePoint]:
        return [point for point in self.curve(PERIODIC) if point.counts]

    def answer(self, point: TradePoint) -> Answer | None:
        """What the periodic loop needs beside an event-triggered point; None if there is nothing to compare."""
        errors, energies = self.periodic_errors, self.periodic_energies
        measured = (point.payload_bytes, point.error, point.energy)
        if errors is None or energies is None or not point.counts or min(measured) <= 0.0:
            return None
        return answer(*measured, errors, energies)

    def words(self) -> list[str]:
        """The question of the papers, answered by the numbers: a sentence for each of their points, and two more."""
        found = []
        for point in self.papers:
            said = self.answer(point)
            reason = point.failed or "the periodic curve has fewer than two points that hold"
            found.append(f"{point.label}: {f'no answer ({reason}).' if said is None else said.words}")
        found += self._range()
        found += self._knee()
        return found

    def _range(self) -> list[str]:
        """Over all points of the event-triggered curves."""
        counted = [point for name in self.layout.section.curves for point in self.curve(name)]
        answers = [said for point in counted if (said := self.answer(point)) is not None]
        at_error = [said.bytes_at_error for said in answers if said.bytes_at_error is not None]
        at_energy = [said.bytes_at_energy for said in answers if said.bytes_at_energy is not None]
        parts = [
            f"{_span(factors)} the bytes at equal {what} ({len(factors)} of {len(counted)} points lie within its curve)"
            for factors, what in ((at_error, "error"), (at_energy, "energy"))
            if factors
        ]
        return [f"Over all event-triggered points, periodic needs {', and '.join(parts)}."] if parts else []

    def _knee(self) -> list[str]:
        """How far the period can be stretched."""
        held = [point for point in self._periodic if point.payload_bytes > 0.0]
        if not held:
            return []
        smallest = min(point.error for point in held)
        knee = min((point for point in held if point.error <= _AS_GOOD * smallest), key=lambda one: one.payload_bytes)
        found = (
            f"Periodic stays within {_AS_GOOD - 1.0:.0%} of its smallest error ({smallest:.3g}) down to "
            f"{knee.payload_bytes:,.0f} bytes ({values_of(knee)})"
        )
        failed = [values_of(point) for point in self.curve(PERIODIC) if not point.counts]
        return [f"{found}; of those tried it does not hold with {', '.join(failed)}." if failed else f"{found}."]


def _span(factors: Sequence[float]) -> str:
    low, high = min(factors), max(factors)
    return times(high) if times(low) == times(high) else f"{times(low).removesuffix(' times')} to {times(high)}"


def run_tradeoff(layout: Layout, workers: Workers | None, on_progress: OnProgress) -> Tradeoff:
    """Run a trade-off in process.

    Parameters
    ----------
    layout
        From :func:`etac_ros.tradeoff.layout.lay_out`.
    workers, on_progress
        As for :func:`etac_ros.sweep.run.sweep`.
    """
    return Tradeoff(layout, tuple(points_of(layout, sweep(layout.plan, workers, on_progress))))


def envelope(points: Sequence[TradePoint]) -> list[TradePoint]:
    """The lower-left envelope of points: those than which none has fewer bytes and a smaller error, by bytes."""
    found: list[TradePoint] = []
    for point in sorted((point for point in points if point.counts), key=lambda one: (one.payload_bytes, one.error)):
        if not found or point.error < found[-1].error:
            found.append(point)
    return found


def values_of(point: TradePoint) -> str:
    """The varied values of a point, as text: ``alpha 0.5, gamma 1e-06``, or ``period 2 s``."""
    return ", ".join(_named(key.rpartition(".")[2], value) for key, value in point.values.items())


def _named(name: str, value: float) -> str:
    return f"{name.removesuffix('_s')} {value:g} s" if name.endswith("_s") else f"{name} {value:g}"

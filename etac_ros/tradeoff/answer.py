"""The question of every paper: what a time-triggered loop needs for the same, read off its curve in log-log."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class PeriodicCurve:
    """What a time-triggered loop gets for its bytes, over its period; joined by straight lines in log-log.

    Attributes
    ----------
    payload_bytes
        Strictly ascending, positive; two or more.
    values
        Steady error or energy at these bytes, positive.
    """

    payload_bytes: tuple[float, ...]
    values: tuple[float, ...]

    def value_at(self, payload_bytes: float) -> float | None:
        """What so many bytes get; None outside the curve."""
        if not self.payload_bytes[0] <= payload_bytes <= self.payload_bytes[-1]:
            return None
        place = next(i for i, end in enumerate(self.payload_bytes[1:]) if payload_bytes <= end)
        return _between(payload_bytes, self.payload_bytes[place : place + 2], self.values[place : place + 2])

    def bytes_for(self, value: float) -> float | None:
        """The fewest bytes at which the curve comes down to a value.

        None outside the curve: where it never comes down so far, or is below the value from its fewest bytes on.
        """
        if self.values[0] <= value:
            return self.payload_bytes[0] if self.values[0] == value else None
        for i in range(len(self.values) - 1):
            if self.values[i + 1] <= value:  # and so values[i] > value
                return _between(value, self.values[i : i + 2], self.payload_bytes[i : i + 2])
        return None


def periodic_curve(points: Sequence[tuple[float, float]]) -> PeriodicCurve | None:
    """The curve through points of (bytes, value) in any order; None if there are fewer than two.

    Of several points with as many bytes the one with the smallest value stands; points that a logarithm cannot show
    are left out.
    """
    best: dict[float, float] = {}
    for payload_bytes, value in points:
        if payload_bytes > 0.0 and value > 0.0:
            best[payload_bytes] = min(value, best.get(payload_bytes, math.inf))
    if len(best) < 2:
        return None
    ordered = sorted(best.items())
    return PeriodicCurve(tuple(x for x, _ in ordered), tuple(y for _, y in ordered))


@dataclass(frozen=True)
class Answer:
    """What a time-triggered loop needs beside one event-triggered point.

    Every factor is the loop's figure over the point's; None where the point lies outside the loop's curve.

    Attributes
    ----------
    bytes_at_error, energy_at_error
        Of its bytes and its energy where its error is the point's.
    bytes_at_energy
        Of its bytes where its energy is the point's.
    error_at_bytes, energy_at_bytes
        Of its error and its energy where its bytes are the point's.
    words
        The answer as a sentence, which also says where the curve does not reach.
    """

    bytes_at_error: float | None
    energy_at_error: float | None
    bytes_at_energy: float | None
    error_at_bytes: float | None
    energy_at_bytes: float | None
    words: str


def answer(payload_bytes: float, error: float, energy: float, errors: PeriodicCurve, energies: PeriodicCurve) -> Answer:
    """Compare one event-triggered point with the time-triggered loop.

    Parameters
    ----------
    payload_bytes, error, energy
        Of the point, all positive.
    errors, energies
        Curves of the time-triggered loop over the same bytes, in the same units.
    """
    needed = errors.bytes_for(error)
    spent = None if needed is None else _over(energies.value_at(needed), energy)
    and_energy = "" if spent is None else f" and {times(spent)} the energy"
    parts = [
        f"At its error, {_needed(payload_bytes, error, errors, 'error')}{and_energy}",
        f"at its energy, {_needed(payload_bytes, energy, energies, 'energy')}",
        f"at its bytes, {_reached(payload_bytes, error, energy, errors, energies)}",
    ]
    return Answer(
        bytes_at_error=_over(needed, payload_bytes),
        energy_at_error=spent,
        bytes_at_energy=_over(energies.bytes_for(energy), payload_bytes),
        error_at_bytes=_over(errors.value_at(payload_bytes), error),
        energy_at_bytes=_over(energies.value_at(payload_bytes), energy),
        words=f"{'; '.join(parts)}.",
    )


def times(factor: float) -> str:
    """A factor in words: ``2.30 times``."""
    if factor >= 10.0:
        return f"{factor:,.0f} times"
    return f"{factor:.2f} times" if factor >= 0.1 else f"{factor:.2g} times"


def _needed(payload_bytes: float, value: float, curve: PeriodicCurve, noun: str) -> str:
    needed = curve.bytes_for(value)
    if needed is not None:
        return f"periodic needs {times(needed / payload_bytes)} the bytes ({needed:,.0f})"
    if curve.values[0] < value:
        fewest = curve.payload_bytes[0]
        return (
            f"periodic needs at most {times(fewest / payload_bytes)} the bytes (outside its curve, which begins with "
            f"a smaller {noun} at {fewest:,.0f})"
        )
    smallest = min(curve.values)
    return (
        f"periodic has no answer (outside its curve, whose smallest {noun} is {times(smallest / value)} as large, with "
        f"{times(curve.payload_bytes[curve.values.index(smallest)] / payload_bytes)} the bytes)"
    )


def _reached(payload_bytes: float, error: float, energy: float, errors: PeriodicCurve, energies: PeriodicCurve) -> str:
    own_error, own_energy = errors.value_at(payload_bytes), energies.value_at(payload_bytes)
    if own_error is not None and own_energy is not None:
        return f"periodic's error is {times(own_error / error)} as large, its energy {times(own_energy / energy)}"
    below = payload_bytes < errors.payload_bytes[0]
    side, end = ("begins", errors.payload_bytes[0]) if below else ("ends", errors.payload_bytes[-1])
    return f"periodic has no answer (outside its curve, which {side} at {times(end / payload_bytes)} these bytes)"


def _over(own: float | None, other: float) -> float | None:
    return None if own is None else own / other


def _between(x: float, xs: Sequence[float], ys: Sequence[float]) -> float:
    """The straight line in log-log through two points, at x between them."""
    if x in xs:
        return ys[xs.index(x)]
    part = math.log(x / xs[0]) / math.log(xs[1] / xs[0])
    return float(ys[0] * (ys[1] / ys[0]) ** part)

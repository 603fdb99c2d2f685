"""The points of a trade-off: means over dispersed runs, and what became of those that did not hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from etac_ros.metrics.figures import of_nodes
from etac_ros.parameters import FloatArray
from etac_ros.sweep.result import SweepResult
from etac_ros.tradeoff.layout import USUAL_ERROR, Layout, Place, start_error_deg

Rows = npt.NDArray[np.int64]
"""Places in the table of a sweep."""


@dataclass(frozen=True)
class TradePoint:
    """One point of a trade-off.

    Attributes
    ----------
    curve
        Name of its curve; None for one of the paper's own points.
    label
        Of the curve, or of the paper's point.
    values
        What stands at the varied keys.
    runs
        Over how many runs the means are.
    triggers, messages, payload_bytes
        Mean triggering instants of all modules that decide by events, and mean network traffic.
    error, error_sd
        Steady error of a run is the largest of all plants; its mean, and its standard deviation over the runs.
    energy
        Mean energy [N^2 m^2 s].
    shortest_s
        The shortest inter-event time of all runs [s]; None if no module triggered twice.
    failed
        Why the point does not count: ended by a watch, refused, or unsettled. Empty otherwise.
    """

    curve: str | None
    label: str
    values: Mapping[str, float]
    runs: int
    triggers: float
    messages: float
    payload_bytes: float
    error: float
    error_sd: float
    energy: float
    shortest_s: float | None
    failed: str

    @property
    def counts(self) -> bool:
        """Whether it is a point of its curve."""
        return not self.failed


def points_of(layout: Layout, result: SweepResult) -> list[TradePoint]:
    """The points of a trade-off that has been run, in the order of its places.

    A point fails if a watch ended one of its runs, a draw was refused, a figure is no finite number, or the mean of a
    plant's largest attitude error in the steady part is no smaller than what its formation started from.
    """
    of_rows = result.table["point"].to_numpy()
    return [
        _point(layout, place, result, np.flatnonzero(of_rows == number)) for number, place in enumerate(layout.places)
    ]


def _point(layout: Layout, place: Place, result: SweepResult, rows: Rows) -> TradePoint:
    triggers = _columns(result, rows, "triggers", layout.deciders)
    plants = place.scenario.build().plants
    errors = _columns(result, rows, layout.section.error, plants)
    angles = _columns(result, rows, USUAL_ERROR, plants)
    intervals = _columns(result, rows, "min_interval_s", layout.deciders)
    found = TradePoint(
        curve=place.curve,
        label=place.label,
        values=place.values,
        runs=rows.size,
        triggers=float(triggers.sum(axis=1).mean()),
        messages=_mean(result, rows, "network_messages"),
        payload_bytes=_mean(result, rows, "network_payload_bytes"),
        error=float(errors.max(axis=1).mean()),
        error_sd=float(errors.max(axis=1).std(ddof=1)) if rows.size > 1 else 0.0,
        energy=_mean(result, rows, "energy_n2m2s"),
        shortest_s=None if np.isnan(intervals).all() else float(np.nanmin(intervals)),
        failed="",
    )
    return _judged(found, place, result, rows, float(angles.max(axis=1).mean()))


def _judged(point: TradePoint, place: Place, result: SweepResult, rows: Rows, largest_deg: float) -> TradePoint:
    halted = [reason for reason in _texts(result, rows, "halted") if reason]
    refused = [reason for reason in _texts(result, rows, "refused") if reason]
    measured = (point.triggers, point.payload_bytes, point.error, point.energy)
    why = ""
    if halted:
        why = f"{len(halted)} of {point.runs} runs ended by a watch: {_short(halted[0])}"
    elif refused:
        why = f"{len(refused)} of {point.runs} draws refused: {refused[0]}"
    elif not np.isfinite(measured).all():
        why = "diverged"
    elif largest_deg >= start_error_deg(place.scenario):
        why = f"does not settle: {largest_deg:.3g} deg from an error of {start_error_deg(place.scenario):.3g} deg"
    return replace(point, failed=why)


def _short(reason: str) -> str:
    """What a watch said, without the state that follows."""
    return reason.partition(";")[0]


def _columns(result: SweepResult, rows: Rows, figure: str, nodes: Sequence[str]) -> FloatArray:
    """A figure of several nodes, a column for each that has it; NaN where a run does not. Shape (runs, columns)."""
    names = [str(key) for key in of_nodes(figure, nodes)]
    chosen = [name for name in names if name in result.table.column_names]
    if not chosen:
        return np.full((rows.size, 1), np.nan)
    values = np.array([_numbers(result, name)[rows] for name in chosen]).T
    # A scenario with several plants has no column of the bare name, and the other way round: all NaN.
    return values[:, ~np.isnan(values).all(axis=0)] if not np.isnan(values).all() else values[:, :1]


def _mean(result: SweepResult, rows: Rows, name: str) -> float:
    return float(_numbers(result, name)[rows].mean())


def _numbers(result: SweepResult, name: str) -> FloatArray:
    values = result.table[name].to_pylist()
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)


def _texts(result: SweepResult, rows: Rows, name: str) -> list[str]:
    values = result.table[name].to_pylist()
    return [str(values[row]) for row in rows]

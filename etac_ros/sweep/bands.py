"""What a sweep says: the spread of each figure beside the published one, and the shortest inter-event time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa

from etac_ros.metrics.figures import of_nodes
from etac_ros.metrics.summary import PublishedValue
from etac_ros.parameters import FloatArray
from etac_ros.sweep.result import SweepResult

_MIN_INTERVAL = "min_interval_s"


@dataclass(frozen=True)
class Band:
    """The spread of one figure over the runs at one grid point.

    Attributes
    ----------
    figure
        Its name.
    point
        Number of the grid point.
    count
        Runs that have the figure.
    mean, sd, low, high, p5, p95
        Mean, standard deviation of a sample (n - 1; 0 for one run), least, largest, and percentiles 5 and 95.
    published
        The paper's figure; None where none stands beside these runs.
    """

    figure: str
    point: int
    count: int
    mean: float
    sd: float
    low: float
    high: float
    p5: float
    p95: float
    published: PublishedValue | None


@dataclass(frozen=True)
class ShortestInterval:
    """The shortest inter-event time of a sweep.

    Attributes
    ----------
    seconds, ticks
        How long it is.
    sample, run, point
        Where it occurred: ``--replay SAMPLE`` runs it again.
    """

    seconds: float
    ticks: int
    sample: int
    run: int
    point: int


@dataclass(frozen=True)
class Endings:
    """How the runs at one grid point ended.

    Attributes
    ----------
    runs
        Finished samples.
    halted
        Of these, ended early by a watch.
    refused
        Of these, not run, because the scenario refuses what they drew.
    """

    runs: int
    halted: int
    refused: int


def bands(result: SweepResult, figures: Iterable[str] | None = None) -> list[Band]:
    """Spread of figures at each grid point.

    A run that a watch ended counts like any other; one whose draws were refused has no figures.

    Parameters
    ----------
    result
        Of a sweep, complete or not.
    figures
        Which; None takes all.

    Returns
    -------
    list
        Grid point by grid point; a figure that no run has there is left out.
    """
    found = []
    wanted = result.figures if figures is None else tuple(figures)
    points = result.table["point"].to_numpy()
    columns = {name: _numbers(result.table[name]) for name in wanted if name in result.figures}
    for point in range(len(result.description["points"])):
        published: Mapping[str, Any] = result.description["published"][point]
        for name, column in columns.items():
            values = column[points == point]
            values = values[~np.isnan(values)]
            if values.size:
                figure = published.get(name)
                found.append(_band(name, point, values, None if figure is None else PublishedValue(**figure)))
    return found


def endings(result: SweepResult) -> list[Endings]:
    """How the runs ended, grid point by grid point."""
    points = result.table["point"].to_numpy()
    halted, refused = (np.array(result.table[name].to_pylist(), dtype=object) != "" for name in ("halted", "refused"))
    return [
        Endings(int((points == point).sum()), int(halted[points == point].sum()), int(refused[points == point].sum()))
        for point in range(len(result.description["points"]))
    ]


def shortest_interval(result: SweepResult) -> ShortestInterval | None:
    """The shortest inter-event time of all event-triggered modules over all runs; None if no module triggered twice.

    Time is a grid, so no interval is shorter than a tick: runs that show Zeno behaviour show intervals of one tick.
    """
    sensors = result.description["event_triggered"]
    names = [str(key) for key in of_nodes(_MIN_INTERVAL, sensors)]
    best: tuple[float, int] | None = None
    for name in names if sensors else []:
        if name not in result.table.column_names:
            continue
        values = _numbers(result.table[name])
        if np.isnan(values).all():
            continue
        row = int(np.nanargmin(values))
        if best is None or values[row] < best[0]:
            best = float(values[row]), row
    if best is None:
        return None
    interval, row = best
    sample, run, point = (result.table[name][row].as_py() for name in ("sample", "run", "point"))
    return ShortestInterval(interval, round(interval * result.description["ticks_per_second"]), sample, run, point)


def _band(name: str, point: int, values: FloatArray, published: PublishedValue | None) -> Band:
    p5, p95 = np.percentile(values, [5.0, 95.0])
    return Band(
        figure=name,
        point=point,
        count=int(values.size),
        mean=float(values.mean()),
        sd=float(values.std(ddof=1)) if values.size > 1 else 0.0,
        low=float(values.min()),
        high=float(values.max()),
        p5=float(p5),
        p95=float(p95),
        published=published,
    )


def _numbers(column: pa.ChunkedArray) -> FloatArray:
    """The values of a column, NaN where there is none."""
    return np.array([np.nan if value is None else value for value in column.to_pylist()], dtype=np.float64)

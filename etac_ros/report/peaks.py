"""The samples of a very long run that make up its curves: every peak of what is drawn, and not the million between."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from etac_ros.graph.graph import Graph
from etac_ros.graph.recording import Recording
from etac_ros.graph.spool import Chunk
from etac_ros.metrics.curves import dynamics, errors_at
from etac_ros.parameters import FloatArray
from etac_ros.plants.plant import bodies_of, has_attitude
from etac_ros.report.figures.decimate import first_of_each

LONG_TICKS = 1 << 20
"""Beyond so many ticks of a plant a run is shown by its peaks."""
_SPANS = 2048
"""A span lasts this part of the time that has gone by, a tick at least: more than a figure has columns."""


def is_long(graph: Graph, recording: Recording) -> bool:
    """Whether a run is shown by its peaks."""
    return any(recording.span(plant)[1] > LONG_TICKS for plant in graph.plants)


def with_peaks(graph: Graph, recording: Recording) -> Recording:
    """The recording with those samples alone at which something that is drawn is largest or smallest within a span.

    What is drawn of a plant are its states, its errors, and angles and rates of its bodies.
    """
    truth: dict[str, list[Chunk]] = {}
    at: dict[str, npt.NDArray[np.int64]] = {}
    for plant in graph.plants:
        found = [_peaks(graph, part, plant) for part in recording.parts(plant)]
        at[plant] = np.concatenate([ticks for ticks, _ in found])
        truth[plant] = [(int(ticks[0]), states) for ticks, states in found]
    return replace(recording, truth=truth, at=at, _joined={})


def _peaks(graph: Graph, part: Recording, plant: str) -> tuple[npt.NDArray[np.int64], FloatArray]:
    ticks, states = part.kept(plant)
    body = dynamics(graph, plant)
    errors = errors_at(body, ticks, states)
    drawn = [states, errors]
    if has_attitude(body):
        drawn.append(np.asarray(body.attitude_angle(errors))[:, np.newaxis])
    for one in bodies_of(body):
        drawn += [np.asarray(one.euler_angles(errors)), np.asarray(one.rates(errors))]
    early = np.minimum(ticks, _SPANS)
    span = (early + _SPANS * np.log(np.maximum(ticks, _SPANS) / _SPANS)).astype(np.int64)
    starts = np.flatnonzero(np.diff(span, prepend=-1))
    place = np.repeat(np.arange(starts.size), np.diff(starts, append=span.size))
    rows = [np.array([0, span.size - 1])]
    for column in np.hstack(drawn).T:
        lows, highs = np.minimum.reduceat(column, starts), np.maximum.reduceat(column, starts)
        rows += [first_of_each(column == lows[place], place), first_of_each(column == highs[place], place)]
    kept = np.unique(np.concatenate(rows))
    return ticks[kept], states[kept]

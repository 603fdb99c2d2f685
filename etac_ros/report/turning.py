"""The bodies of a run as they turn: what the 3-D view of a report shows, thinned to what a slider can tell apart."""

from __future__ import annotations

from functools import reduce
from typing import Any

import numpy as np
import numpy.typing as npt

from etac_ros.bag.markers import arrow_tips
from etac_ros.maths.ticks import seconds
from etac_ros.metrics import curves
from etac_ros.parameters import FloatArray
from etac_ros.plants.plant import bodies_of
from etac_ros.report.interactive import packed
from etac_ros.report.source import ReportedRun

POSITIONS = 240
"""Of the slider."""
_EARLY = 2.0
"""Positions lie denser at the start, where a manoeuvre is: the times grow with this power."""


def turning(run: ReportedRun) -> dict[str, Any] | None:
    """Times, and by body its attitude and the torque that it is given; None where no body says its attitude.

    A body's attitude is that relative to the frame that it names, and turned further by the attitude of that frame
    where it is another body's.
    """
    graph, rate = run.graph, run.graph.ticks_per_second
    last = curves.last_tick(graph, run.recording)
    ticks = np.unique(np.round(last * np.linspace(0.0, 1.0, POSITIONS) ** _EARLY).astype(np.int64))
    ticks = _nearest(ticks, [run.recording.kept(plant)[0] for plant in graph.plants])
    shown = []
    for plant in graph.plants:
        known, states = run.recording.kept(plant)
        held = run.held[plant]
        ports = list(held)
        of_plant: dict[str, FloatArray] = {}
        bodies = [body for body in bodies_of(curves.dynamics(graph, plant)) if body.quaternions is not None]
        for body in sorted(bodies, key=lambda body: body.parent in {other.frame for other in bodies}):
            assert body.quaternions is not None
            q = np.asarray(body.quaternions(states[np.searchsorted(known, ticks)]), dtype=np.float64)
            q = _product(of_plant[body.parent], q) if body.parent in of_plant else q
            of_plant[body.frame] = q
            port = body.port or (ports[0] if ports else "")
            torques = np.zeros((ticks.size, 3))
            if port in held and held[port].values.shape[1] == 3:
                stairs = held[port]
                times = np.asarray(seconds(ticks, rate))
                places = np.searchsorted(stairs.times_s, times, side="right") - 1
                torques = stairs.values[np.maximum(places, 0)]
            name = f"{plant}/{body.frame}" if body.frame else plant
            shown.append({"name": name, "q": packed(q.ravel()), "torque": packed(arrow_tips(torques).ravel())})
    if not shown:
        return None
    return {"times": packed(np.asarray(seconds(ticks, rate))), "bodies": shown}


def _nearest(ticks: npt.NDArray[np.int64], known: list[npt.NDArray[np.int64]]) -> npt.NDArray[np.int64]:
    """The ticks, moved a little where a bag does not keep every sample, to those at which all plants are known."""
    common = reduce(np.intersect1d, known) if any(some.size != known[0].size for some in known) else known[0]
    return np.unique(common[np.minimum(np.searchsorted(common, ticks), common.size - 1)])


def _product(a: FloatArray, b: FloatArray) -> FloatArray:
    """``a`` followed in the body by ``b``, row by row, as :func:`etac_ros.maths.quaternion.product` has it."""
    a0, b0, av, bv = a[:, :1], b[:, :1], a[:, 1:], b[:, 1:]
    scalar = a0 * b0 - np.sum(av * bv, axis=1, keepdims=True)
    return np.hstack([scalar, a0 * bv + b0 * av + np.cross(av, bv)])

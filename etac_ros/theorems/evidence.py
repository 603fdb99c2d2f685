"""What the theorems need of a run: samples, torques, and what the trigger rule was shown."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from etac_ros.graph.graph import Graph
from etac_ros.graph.recording import Recording
from etac_ros.maths.ticks import seconds
from etac_ros.metrics.decisions import Decisions, Margins, decisions, margins
from etac_ros.metrics.published import held_torque, quantity
from etac_ros.parameters import FloatArray
from etac_ros.scenario.load import Scenario


class NotApplicable(Exception):
    """A run about which a paper's theorems say nothing."""


@dataclass(frozen=True)
class Evidence:
    """A recorded run, for one paper's theorems.

    Attributes
    ----------
    scenario
        What was run.
    graph
        Its modules, which no engine has run.
    recording
        What came of it.
    """

    scenario: Scenario
    graph: Graph
    recording: Recording

    def parameters(self, node: str, component: str) -> Mapping[str, Any]:
        """Parameters of a component of a node, as the scenario has them."""
        found: Mapping[str, Any] = self.scenario.nodes[node][component]
        return found

    def states(self, plant: str) -> FloatArray:
        """Committed samples of a plant but the last, after which no torque acts any more, shape (n, m)."""
        return np.ascontiguousarray(self.recording.samples(plant)[1][:-1])

    def torques(self, plant: str) -> FloatArray:
        """The torque that acts from each of these samples on [N m], shape (n, 3)."""
        return held_torque(self.graph, self.recording, plant)[:-1]

    def quantity(self, node: str, name: str) -> FloatArray:
        """A quantity of a node at each of these samples, shape (n, m)."""
        return quantity(self.graph, self.recording, node, name)[1][:-1]

    def times_s(self, plant: str) -> FloatArray:
        """Instants of these samples [s]."""
        first, states = self.recording.samples(plant)
        return np.asarray(seconds(np.arange(first, first + states.shape[0] - 1), self.graph.ticks_per_second))

    @property
    def tick_s(self) -> float:
        """Length of a tick [s]."""
        return 1.0 / self.graph.ticks_per_second

    def trigger(self, node: str) -> Trigger:
        """What the trigger rule of a node was shown.

        Raises
        ------
        NotApplicable
            If it cannot be recomputed, goes by time, or has fired less than twice.
        """
        found = decisions(self.graph, self.recording, node)
        compared = None if found is None else margins(self.graph, found, node)
        if found is None or compared is None or found.ticks.size < 2:
            raise NotApplicable(node)
        return Trigger(found, compared, self.graph.ticks_per_second)


@dataclass(frozen=True)
class Trigger:
    """What a trigger rule was shown and compared."""

    shown: Decisions
    compared: Margins
    ticks_per_second: int

    @property
    def intervals_s(self) -> FloatArray:
        """Inter-event times [s]."""
        return np.diff(self.shown.ticks) / self.ticks_per_second

    @property
    def at_triggers(self) -> npt.NDArray[np.int64]:
        """Rows of what was shown, of every triggering instant but the first."""
        return self.shown.ticks[1:] - self.shown.first


def norms(values: FloatArray) -> FloatArray:
    """Euclidean norm of each row."""
    return np.asarray(np.linalg.norm(values, axis=1))


def sinusoids(parameters: Mapping[str, Any], times_s: FloatArray) -> FloatArray:
    """A plant's disturbance ``constant + sine sin(w t + phase) + cosine cos(w t + phase)`` [N m], shape (n, 3)."""
    zero = [0.0, 0.0, 0.0]
    frequency = np.broadcast_to(np.asarray(parameters.get("frequency_rad_s", 0.0), dtype=np.float64), (3,))
    angles = times_s[:, np.newaxis] * frequency + np.asarray(parameters.get("phase_rad", zero))
    return np.asarray(
        np.asarray(parameters.get("constant_nm", zero))
        + np.asarray(parameters.get("sine_nm", zero)) * np.sin(angles)
        + np.asarray(parameters.get("cosine_nm", zero)) * np.cos(angles)
    )

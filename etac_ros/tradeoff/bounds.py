"""The papers' lower bounds of the inter-event time, evaluated where their constants can be had.

The bounds stand with the rules (:class:`etac_ros.triggers.bound.BoundedRule`). Their proofs assume bounds of torques
and rates whose values no paper gives. They are not invented here: where a run of the very scenario shows them, its
largest values take their place, and the bound is then one of that run.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np

from etac_ros.graph.graph import Graph
from etac_ros.graph.plant import PlantModule
from etac_ros.graph.recording import Recording
from etac_ros.metrics.published import held_torque
from etac_ros.modules.triggering import event_triggered_modules
from etac_ros.parameters import FloatArray, square
from etac_ros.plants.plant import errors_of, has_attitude
from etac_ros.runs import simulate
from etac_ros.scenario.load import Scenario
from etac_ros.triggers.bound import Bound, BoundedRule


def bound_of(scenario: Scenario) -> Bound | None:
    """The paper's bound for a scenario, from one undisturbed run of it; None where no paper is known.

    Parameters
    ----------
    scenario
        As it would be run, with the values of a point.
    """
    graph = scenario.build()
    for name in event_triggered_modules(graph):
        rule = graph.modules[name].trigger  # type: ignore[attr-defined]  # it is triggered by events
        if isinstance(rule, BoundedRule):
            return rule.interval_bound(_UndisturbedRun(scenario, graph, name))
    return None


class _UndisturbedRun:
    """What a bound's constants are taken from.

    Parameters
    ----------
    scenario, graph
        What is run, once it is needed.
    node
        The module whose rule is asked.
    """

    def __init__(self, scenario: Scenario, graph: Graph, node: str) -> None:
        self._scenario, self._graph, self._node = scenario, graph, node
        self.signal: Any = getattr(graph.modules[node], "signal", None)
        self.gains = tuple(float(law["k"]) for law in self._components("law") if "k" in law)
        self.inertias_kg_m2 = tuple(
            square(dynamics["inertia_kg_m2"])
            for dynamics in self._components("dynamics")
            if "inertia_kg_m2" in dynamics
        )
        self.sensors = sum("trigger" in parameters for parameters in scenario.nodes.values())

    @cached_property
    def _recording(self) -> Recording:
        return simulate(self._scenario).recording

    def signals(self) -> FloatArray:
        """What was watched at each tick of the run, shape (n, m)."""
        states = self._recording.samples(self._graph.reads[self._node])[1]
        return np.asarray(self.signal.evaluate(np.ascontiguousarray(states)))

    def drift_nm(self, inertia_kg_m2: FloatArray) -> float:
        """Largest ``|J s_dot - u|`` [N m] over the ticks of the run, between which the torque is constant."""
        torques = held_torque(self._graph, self._recording, self._graph.reads[self._node])
        rates = np.diff(self.signals(), axis=0) * self._graph.ticks_per_second
        return float(np.linalg.norm(rates @ inertia_kg_m2.T - torques[: rates.shape[0]], axis=1).max())

    def motion(self) -> tuple[float, float, float]:
        """Largest rate, acceleration, and second derivative of the reference rate, of all spacecraft and references."""
        return _motion(self._graph, self._recording)

    def _components(self, name: str) -> list[Mapping[str, Any]]:
        nodes = self._scenario.nodes.values()
        return [node[name] for node in nodes if isinstance(node.get(name), Mapping)]


def _motion(graph: Graph, recording: Recording) -> tuple[float, float, float]:
    """Largest rate, acceleration, and second derivative of the reference rate, of all spacecraft and references."""
    first, second, third = 0.0, 0.0, 0.0
    for name in graph.plants:
        module = graph.modules[name]
        assert isinstance(module, PlantModule)
        tick, states = recording.samples(name)
        plant = module.plant
        assert has_attitude(plant)  # the bound is that of a spacecraft
        reference = states - errors_of(plant, states, tick)
        for motion in (states, reference):
            attitudes, rates = motion[:, plant.attitude_slice], motion[:, plant.rate_slice]
            first = max(first, _largest(rates), _largest(_derivative(attitudes, graph)))
            second = max(second, _largest(_derivative(rates, graph)), _largest(_derivative(attitudes, graph, 2)))
        third = max(third, _largest(_derivative(reference[:, plant.rate_slice], graph, 2)))
    return first, second, third


def _derivative(values: FloatArray, graph: Graph, order: int = 1) -> FloatArray:
    return np.asarray(np.diff(values, n=order, axis=0) * float(graph.ticks_per_second) ** order)


def _largest(values: FloatArray) -> float:
    return float(np.linalg.norm(values, axis=1).max())

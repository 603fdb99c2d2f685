"""Lower bounds of the inter-event time as the papers print them, evaluated where their constants can be had.

The proofs assume bounds of torques and rates whose values no paper gives. They are not invented here: where a run of
the very scenario shows them, its largest values take their place, and the bound is then one of that run.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from etac_ros.graph.graph import Graph
from etac_ros.graph.plant import PlantModule
from etac_ros.graph.recording import Recording
from etac_ros.metrics.published import held_torque
from etac_ros.modules.sensor import Sensor
from etac_ros.parameters import FloatArray, square
from etac_ros.plants.plant import errors_of, has_attitude
from etac_ros.runs import simulate
from etac_ros.scenario.load import Scenario


@dataclass(frozen=True)
class Bound:
    """What a paper says of the shortest inter-event time.

    Attributes
    ----------
    equation
        Where.
    seconds
        Its value [s]; None where it cannot be evaluated.
    remark
        What stands in for constants that the paper does not give, or why there is no value.
    """

    equation: str
    seconds: float | None
    remark: str


def bound_of(scenario: Scenario) -> Bound | None:
    """The paper's bound for a scenario, from one undisturbed run of it; None where no paper is known.

    Parameters
    ----------
    scenario
        As it would be run, with the values of a point.
    """
    rules = {_class(node, "trigger"): name for name, node in scenario.nodes.items() if "trigger" in node}
    for rule, bound in _BOUNDS.items():
        if rule in rules:
            return bound(scenario, rules[rule])
    return None


def relative_threshold(gamma: float, gain_nms: float, inertia: FloatArray, drift_nm: float, signal: float) -> float:
    """``ln(1 + k gamma / (D + k S)) / (k |J^-1|)`` [s] (wu2018 eq. 36, flexible eq. 73).

    Parameters
    ----------
    gamma
        Absolute part of the threshold [rad/s]; the paper of ``flexible`` calls it rho.
    gain_nms
        ``k``.
    inertia
        ``J`` [kg m^2], shape (3, 3); its norm is the spectral one.
    drift_nm
        ``D``: bound of ``|L|``, what acts on the signal beside the control torque [N m].
    signal
        ``S``: bound of the signal [rad/s].
    """
    norm = 1.0 / float(np.linalg.eigvalsh(inertia)[0])
    return math.log1p(gain_nms * gamma / (drift_nm + gain_nms * signal)) / (gain_nms * norm)


def split_norm(
    c1: float, c2: float, spacecraft: int, r: float, delta1: float, delta2: float, delta3: float, inertia: float
) -> float:
    """``c1 exp(-c2 pi / 2) / psi`` [s] (xie2021 eq. 35), with the psi of eq. (32).

    Parameters
    ----------
    c1, c2
        Of the threshold.
    spacecraft
        ``n``.
    r
        Of the law.
    delta1, delta2, delta3
        Bounds of rates, accelerations and of the reference's jerk (assumptions 2 to 4).
    inertia
        Largest norm of an inertia matrix [kg m^2].
    """
    psi = (
        2.0 * (spacecraft + 1) * r * delta1
        + 2.0 * (spacecraft + 2) * delta2
        + (2.0 * delta1 * delta2 + delta3) * inertia
    )
    return c1 * math.exp(-c2 * math.pi / 2.0) / psi


def _relative_threshold(scenario: Scenario, node: str) -> Bound | None:
    equation, constants = _RELATIVE_OF.get(_class(scenario.nodes[node], "signal"), ("", ""))
    gains = [law["k"] for law in _components(scenario, "law") if "k" in law]
    inertias = [dynamics["inertia_kg_m2"] for dynamics in _components(scenario, "dynamics")]
    if not equation or len(gains) != 1 or len(inertias) != 1:
        return None
    run = simulate(scenario)
    graph, recording = scenario.build(), run.recording
    inertia = square(inertias[0])
    plant = graph.reads[node]
    sensor = graph.modules[node]
    assert isinstance(sensor, Sensor)
    signals = sensor.signal.evaluate(np.ascontiguousarray(recording.samples(plant)[1]))
    drift = _drift(signals, held_torque(graph, recording, plant), inertia, graph.ticks_per_second)
    largest = float(np.linalg.norm(signals, axis=1).max())
    gamma = float(scenario.nodes[node]["trigger"]["gamma"])
    return Bound(
        equation,
        relative_threshold(gamma, float(gains[0]), inertia, drift, largest),
        f"the paper gives no value of {constants}; what is bounded by it, and the signal, are the largest of one "
        "undisturbed run with the point's values instead",
    )


def _drift(signals: FloatArray, torques: FloatArray, inertia: FloatArray, ticks_per_second: int) -> float:
    """Largest ``|J s_dot - u|`` [N m] over the ticks of a run, between which the torque is constant."""
    rates = np.diff(signals, axis=0) * ticks_per_second
    return float(np.linalg.norm(rates @ inertia.T - torques[: rates.shape[0]], axis=1).max())


def _split_norm(scenario: Scenario, node: str) -> Bound | None:
    sensors = [parameters for parameters in scenario.nodes.values() if "trigger" in parameters]
    signal, trigger = scenario.nodes[node].get("signal"), scenario.nodes[node]["trigger"]
    if not isinstance(signal, Mapping) or "r" not in signal:
        return None
    graph, recording = scenario.build(), simulate(scenario).recording
    delta1, delta2, delta3 = _motion(graph, recording)
    norms = [float(np.linalg.norm(square(one["inertia_kg_m2"]), 2)) for one in _components(scenario, "dynamics")]
    seconds = split_norm(
        trigger["c1"], trigger["c2"], len(sensors), float(signal["r"]), delta1, delta2, delta3, max(norms)
    )
    return Bound(
        "xie2021 eq. (35)",
        seconds,
        "the paper gives no value of delta_1 to delta_3; in their place stands the largest of one undisturbed run with "
        "the point's values. The proof takes neighbours as known at every instant: where they are known by broadcasts, "
        "each arrival moves the error at once, which the bound does not cover",
    )


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


def _components(scenario: Scenario, name: str) -> list[Mapping[str, Any]]:
    return [node[name] for node in scenario.nodes.values() if isinstance(node.get(name), Mapping)]


def _class(node: Mapping[str, Any], name: str) -> str:
    component = node.get(name)
    return str(component.get("class", "")) if isinstance(component, Mapping) else ""


def _without_value(equation: str, remark: str) -> Callable[[Scenario, str], Bound | None]:
    return lambda scenario, node: Bound(equation, None, remark)


_RELATIVE_OF = {
    "etac_ros.laws.wu2018:FilteredError": ("wu2018 eq. (36)", "the constant b of its eq. (27)"),
    "etac_ros.laws.flexible:FeedbackVector": ("flexible eq. (73)", "its bound Gamma of eq. (64)"),
}
_BOUNDS: Mapping[str, Callable[[Scenario, str], Bound | None]] = {
    "etac_ros.triggers.relative:RelativeThreshold": _relative_threshold,
    "etac_ros.triggers.split_norm:SplitNormThreshold": _split_norm,
    "etac_ros.triggers.state_relative:StateRelativeThreshold": _without_value(
        "qi2022 eq. (18)",
        "|delta tau| / gamma: the paper gives no gamma, the bound of the torque's rate, and the threshold that delta "
        "tau reaches vanishes with the state, so that no value holds throughout",
    ),
    "etac_ros.triggers.componentwise:ComponentThreshold": _without_value(
        "shi2022 eq. (45)",
        "(3 beta |u| + 3 |Lambda|) / tau_m: the paper gives no tau_m, the bound of the torque's rate, and Lambda falls "
        "with exp(-delta t)",
    ),
}

"""What a trade-off runs: the points of its curves and the paper's own, as one sweep, checked before anything runs."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from etac_ros.errors import ScenarioError
from etac_ros.graph.plant import PlantModule
from etac_ros.metrics.published import check_measure
from etac_ros.metrics.summary import steady_from_s
from etac_ros.modules.triggering import event_triggered_modules
from etac_ros.plants.plant import errors_of, has_attitude
from etac_ros.scenario.document import EVERYWHERE, choice
from etac_ros.scenario.load import Scenario, load
from etac_ros.scenario.places import available
from etac_ros.scenario.schema import Published, PublishedFigure, TradeoffCurve, TradeoffSection
from etac_ros.sweep.plan import Plan, Point, make_plan

USUAL_ERROR = "max_attitude_error_deg"


@dataclass(frozen=True)
class Place:
    """One point before it is run.

    Attributes
    ----------
    curve
        Name of its curve; None for one of the paper's own points.
    label
        Of the curve, or of the paper's point.
    values
        What stands at the varied keys; nothing for the paper's own points.
    scenario
        Undisturbed.
    """

    curve: str | None
    label: str
    values: Mapping[str, float]
    scenario: Scenario


@dataclass(frozen=True)
class Layout:
    """A trade-off before it runs.

    Attributes
    ----------
    scenario
        The file as it stands.
    section
        Its section ``tradeoff``.
    places
        All points: those of the event-triggered curves, those of the periodic one, the paper's.
    plan
        The sweep over them; its grid points are ``places``.
    deciders
        Modules that trigger by events in the file as it stands: their triggering instants are counted.
    """

    scenario: Scenario
    section: TradeoffSection
    places: tuple[Place, ...]
    plan: Plan
    deciders: tuple[str, ...]

    @property
    def error_label(self) -> str:
        """What the steady error is called on an axis."""
        if self.section.error == USUAL_ERROR:
            return f"largest error from {steady_from_s(self.scenario):g} s on [deg]"
        own = _own_figures(self.scenario, self.section.error)
        labels = {figure.label for figure in own.values()} - {""}
        return labels.pop() if len(labels) == 1 else self.section.error.replace("_", " ")


PERIODIC = "periodic"
"""Name of the time-triggered curve."""


def with_tradeoffs() -> list[str]:
    """The scenarios that are shipped with a section ``tradeoff``."""
    return [name for name in available() if load(name).run.tradeoff is not None]


def lay_out(name: str, runs: int) -> Layout:
    """Lay out the trade-off of a scenario.

    Parameters
    ----------
    name
        The scenario.
    runs
        Perturbed runs at each point.

    Raises
    ------
    ScenarioError
        If the scenario has no section ``tradeoff``, or anything at all is wrong with it.
    """
    scenario = load(name)
    section = scenario.run.tradeoff
    file = f"{scenario.path}: {EVERYWHERE}.tradeoff"
    if section is None:
        raise ScenarioError(
            file, "is missing: nothing says what is to be varied", "curves, and a periodic one",
            f"see the scenarios that have it: {', '.join(with_tradeoffs())}",
        )  # fmt: skip
    if PERIODIC in section.curves:
        raise ScenarioError(f"{file}.curves.{PERIODIC}", "is the name of the time-triggered curve", "another name")
    named = [(name, f"{file}.curves.{name}", curve) for name, curve in section.curves.items()]
    named.append((PERIODIC, f"{file}.{PERIODIC}", section.periodic))
    parts: list[tuple[str, Plan]] = []
    places: list[Place] = []
    for curve_name, where, curve in named:
        plan = _plan(scenario, where, runs, curve.variant, curve)
        parts.append((where, plan))
        for values, point in zip(_grid(curve), plan.points, strict=True):
            places.append(Place(curve_name, curve.label or curve_name, values, point.scenario))
    for variant in section.paper or (None,):
        plan = _plan(scenario, f"{file}.paper", runs, variant)
        parts.append((f"{file}.paper", plan))
        places.append(Place(None, variant or "as the file stands", {}, plan.scenario))
    own = _own_figures(scenario, section.error)
    places = [replace(place, scenario=_with_figures(place.scenario, own)) for place in places]
    _check_error(section, own, places, file)
    plan = _joined(parts, places)
    return Layout(scenario, section, tuple(places), plan, event_triggered_modules(scenario.build()))


def start_error_deg(scenario: Scenario) -> float:
    """The largest attitude error of all plants at the start [deg]."""
    graph = scenario.build()
    angles = []
    for name in graph.plants:
        module = graph.modules[name]
        assert isinstance(module, PlantModule)
        if not has_attitude(module.plant):
            continue
        start = errors_of(module.plant, module.state[np.newaxis], 0)
        angles.append(float(np.degrees(module.plant.attitude_angle(start)[0])))
    return max(angles, default=0.0)


def _plan(scenario: Scenario, where: str, runs: int, variant: str | None, curve: TradeoffCurve | None = None) -> Plan:
    if variant is not None and variant not in scenario.variants:
        raise ScenarioError(where, f"no variant '{variant}'", choice(variant, scenario.variants))
    vary = {} if curve is None else curve.vary
    assignments = [f"{key}={','.join(json.dumps(value) for value in values)}" for key, values in vary.items()]
    try:
        return make_plan(str(scenario.path), runs, variant, assignments, baselines=False)
    except ScenarioError as error:
        raise ScenarioError(where, f"{error.where}: {error.found}", error.expected, error.remedy) from None


def _grid(curve: TradeoffCurve) -> list[dict[str, float]]:
    """Values of each point, in the order of the sweep's grid: the last key changes fastest."""
    return [dict(zip(curve.vary, values, strict=True)) for values in product(*curve.vary.values())]


def _joined(parts: Sequence[tuple[str, Plan]], places: Sequence[Place]) -> Plan:
    """One sweep over all points: the draws of a run are then the same at all of them."""
    _, first = parts[0]
    for where, plan in parts:
        if plan.dispersions != first.dispersions:
            raise ScenarioError(where, "its variant draws other dispersions than the first curve", "the same for all")
        if plan.scenario.run.duration_s != first.scenario.run.duration_s:
            raise ScenarioError(where, "its variant lasts another time than the first curve", "the same for all")
    points = tuple(Point(dict(place.values), place.scenario, None) for place in places)
    return Plan(points, first.runs, first.dispersions, ())


def _own_figures(scenario: Scenario, error: str) -> dict[str, PublishedFigure]:
    """The published figures with a measure that the steady error is: one, or one for each plant."""
    return {
        name: figure
        for name, figure in scenario.published.items()
        if error == (figure.figure or name) and figure.measure is not None
    }


def _with_figures(scenario: Scenario, own: Mapping[str, PublishedFigure]) -> Scenario:
    """The scenario with these figures to be measured, which a variant does not take over from the file."""
    if not own:
        return scenario
    values = {**scenario.run.published.model_dump(), **{name: figure.model_dump() for name, figure in own.items()}}
    published = Published.model_validate(values)
    return replace(scenario, run=scenario.run.model_copy(update={"published": published}))


def _check_error(
    section: TradeoffSection, own: Mapping[str, PublishedFigure], places: Sequence[Place], file: str
) -> None:
    if section.error != USUAL_ERROR and not own:
        known = sorted(
            {figure.figure or name for name, figure in places[-1].scenario.published.items() if figure.measure}
        )  # the file's own: the paper's points come last
        raise ScenarioError(f"{file}.error", f"found '{section.error}'", choice(section.error, [USUAL_ERROR, *known]))
    for place in places if own else []:
        graph = place.scenario.build()
        for name, figure in own.items():
            assert figure.measure is not None
            check_measure(figure.measure, graph, f"{place.scenario.path}: published.{name}.measure")

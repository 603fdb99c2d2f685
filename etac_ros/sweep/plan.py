"""What a sweep runs: a grid of scenarios, a number of runs at each of its points, and what each run draws."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

from etac_ros.errors import ScenarioError
from etac_ros.metrics.summary import Summary
from etac_ros.modules.triggering import event_triggered_modules, triggering_modules
from etac_ros.runs import checked_graph, simulate
from etac_ros.scenario.classes import validated
from etac_ros.scenario.load import Scenario, baseline_of, load
from etac_ros.scenario.schema import Dispersion
from etac_ros.scenario.values import value_at
from etac_ros.scenario.yaml_text import parse_value
from etac_ros.sweep.draws import check_target, dispersed, run_seed

_KINDS = tuple(Dispersion.model_fields)
_TRIED = 3
"""Runs whose draws are tried before a sweep begins."""


@dataclass(frozen=True)
class Point:
    """One point of the grid.

    Attributes
    ----------
    values
        What stands at the keys of the grid here.
    scenario
        The scenario with these values, undisturbed.
    baseline
        What the baseline did here, undisturbed and once: its runs are compared with it. None if there is none.
    """

    values: Mapping[str, Any]
    scenario: Scenario
    baseline: Summary | None


@dataclass(frozen=True)
class Plan:
    """A sweep before it runs.

    A **sample** is one run at one grid point. Samples are numbered from 0, with all points of a run before the next
    run, so that the points fill up evenly: ``sample = run * len(points) + point``.

    Attributes
    ----------
    points
        The grid, the last key changing fastest; one point without a grid.
    runs
        Runs at each point.
    dispersions
        What each run draws, by NODE.KEY.
    fixed
        Assignments that hold at every point.
    """

    points: tuple[Point, ...]
    runs: int
    dispersions: Mapping[str, Dispersion]
    fixed: tuple[str, ...]

    @property
    def scenario(self) -> Scenario:
        """The scenario at the first point."""
        return self.points[0].scenario

    @property
    def seed(self) -> int:
        """The master seed: the scenario's."""
        return self.scenario.run.seed

    @property
    def samples(self) -> range:
        """Numbers of all samples."""
        return range(self.runs * len(self.points))

    @cached_property
    def sensors(self) -> Mapping[str, bool]:
        """The modules that trigger, and whether by events: a Zeno check looks at those only."""
        graph = self.scenario.build()
        by_events = event_triggered_modules(graph)
        return {name: name in by_events for name in triggering_modules(graph)}

    def place(self, sample: int) -> tuple[int, int]:
        """Run and grid point of a sample.

        Raises
        ------
        ScenarioError
            If the sweep has no such sample.
        """
        if sample not in self.samples:
            raise ScenarioError(f"sample {sample}", "is not in this sweep", f"0 to {len(self.samples) - 1}")
        return divmod(sample, len(self.points))

    def draws(self, sample: int) -> dict[str, Any]:
        """The dispersed values of a sample, by NODE.KEY."""
        run, point = self.place(sample)
        nodes = self.points[point].scenario.nodes
        return {
            key: dispersed(value_at(nodes, key, key), key, dispersion, self.seed, run)
            for key, dispersion in self.dispersions.items()
        }

    def scenario_of(self, sample: int) -> Scenario:
        """The scenario of a sample, with its grid values, draws and seed."""
        run, point = self.place(sample)
        return self.points[point].scenario.with_values(self.draws(sample), run_seed(self.seed, run))


def make_plan(
    name: str,
    runs: int,
    variant: str | None = None,
    assignments: Sequence[str] = (),
    dispersions: Sequence[str] = (),
    dispersion: bool = True,
    baselines: bool = True,
) -> Plan:
    """Lay out a sweep and check all of it before anything runs.

    Parameters
    ----------
    name, variant
        The scenario.
    runs
        Runs at each grid point.
    assignments
        ``KEY=VALUE``, or ``KEY=A,B,C`` for a key of the grid.
    dispersions
        ``KEY=KIND:SIZE`` with the kinds of :class:`Dispersion`, beside or instead of the scenario's own;
        ``KEY=none`` takes one away.
    dispersion
        False draws nothing: runs then differ by the seed of noise and lossy links only.
    baselines
        False runs no baseline: figures beside one are then missing.

    Raises
    ------
    ScenarioError
        If anything at all is wrong with it.
    """
    if runs < 1:
        raise ScenarioError(f"--runs {runs}", "is no number of runs", "1 or more")
    fixed, grid = _sorted_out(assignments)
    points = _points(name, variant, fixed, grid, baselines)
    scenario = points[0].scenario
    wanted: dict[str, tuple[str, Dispersion | None]] = {}
    if dispersion:
        file = f"{scenario.path}: /**.dispersion"
        wanted = {key: (f"{file}.{key}", dispersion) for key, dispersion in scenario.run.dispersion.items()}
    for text in dispersions:
        key, one = _dispersion(text)
        if not dispersion:
            raise ScenarioError(f"--dispersion {text}", "stands beside --no-dispersion", "one of the two")
        wanted[key] = f"--dispersion {text}", one
    chosen = {key: (where, one) for key, (where, one) in wanted.items() if one is not None}
    for point in points:
        for key, (where, one) in chosen.items():
            check_target(key, value_at(point.scenario.nodes, key, where), one, where)
    plan = Plan(points, runs, {key: one for key, (_, one) in chosen.items()}, fixed)
    _try(plan)
    return plan


def _sorted_out(assignments: Sequence[str]) -> tuple[tuple[str, ...], dict[str, list[Any]]]:
    """Assignments with one value as they are, and keys of the grid with their values."""
    fixed: list[str] = []
    grid: dict[str, list[Any]] = {}
    for assignment in assignments:
        key, equals, text = assignment.partition("=")
        key = key.strip()
        if not equals or not key:
            raise ScenarioError(f"--set {assignment}", "is no assignment", "KEY=VALUE, or KEY=A,B,C for a grid")
        values = parse_value(f"[{text}]", f"--set {assignment}")
        if not isinstance(values, list) or not values:
            raise ScenarioError(f"--set {assignment}", "the list of values is empty", "one value or more")
        if len(values) == 1:
            fixed.append(f"{key}={json.dumps(values[0])}")
            continue
        if key == "seed":
            raise ScenarioError(f"--set {assignment}", "the seed is no key of a grid", "one value; --runs varies it")
        if key in grid:
            raise ScenarioError(f"--set {assignment}", f"{key} has a list of values already", "one list a key")
        if len({json.dumps(value) for value in values}) < len(values):
            raise ScenarioError(f"--set {assignment}", "a value stands there twice", "different values")
        grid[key] = values
    return tuple(fixed), grid


def _points(
    name: str, variant: str | None, fixed: Sequence[str], grid: Mapping[str, Sequence[Any]], baselines: bool
) -> tuple[Point, ...]:
    summaries: dict[str, Summary] = {}
    points = []
    for combination in product(*grid.values()):
        values = dict(zip(grid, combination, strict=True))
        assignments = [*fixed, *(f"{key}={json.dumps(value)}" for key, value in values.items())]
        scenario = load(name, variant, assignments)
        checked_graph(scenario)
        baseline = baseline_of(scenario) if baselines else None
        if baseline is not None and baseline.digest not in summaries:  # most keys of a grid do not concern it
            summaries[baseline.digest] = simulate(baseline).summary
        points.append(Point(values, scenario, None if baseline is None else summaries[baseline.digest]))
    return tuple(points)


def _dispersion(text: str) -> tuple[str, Dispersion | None]:
    where = f"--dispersion {text}"
    key, equals, what = text.partition("=")
    kind, sized, size = what.partition(":")
    if not equals or not key or not (kind in _KINDS if sized else kind == "none"):
        raise ScenarioError(where, "is no dispersion", f"KEY=KIND:SIZE with one of {', '.join(_KINDS)}, or KEY=none")
    if kind == "none":
        return key.strip(), None
    return key.strip(), validated(Dispersion, {kind: parse_value(size, where)}, where)


def _try(plan: Plan) -> None:
    """Refuse a sweep whose first draws are all refused: its dispersions are too large, or of the wrong kind."""
    error: ScenarioError | None = None
    for sample in plan.samples[: _TRIED * len(plan.points)]:
        try:
            plan.scenario_of(sample).build()
        except ScenarioError as found:
            error = found
        else:
            return
    if error is not None:
        raise ScenarioError(
            error.where, f"every draw that was tried is refused; the last: {error.found}", error.expected,
            "choose smaller dispersions, or others; see --dispersion and --no-dispersion",
        )  # fmt: skip

"""One row for each published figure: measured over one run, with its band over many dispersed ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from etac_ros.errors import RunHalted, ScenarioError
from etac_ros.metrics.figures import FigureKey, label
from etac_ros.metrics.published import published_figures
from etac_ros.metrics.summary import PublishedValue, Summary, published_value, with_measured
from etac_ros.reproduce.verdict import Spread, Verdict, judge
from etac_ros.runs import RosOptions, run_in_process, run_over_ros
from etac_ros.scenario.load import Scenario, baseline_of, load
from etac_ros.sweep.bands import bands
from etac_ros.sweep.plan import make_plan
from etac_ros.sweep.run import cores, sweep, usual_workers

_FEWEST = 10
"""Perturbed runs of a variant, however long one takes."""

Say = Callable[[str], None]


@dataclass(frozen=True)
class Row:
    """A published figure and what became of it.

    Attributes
    ----------
    scenario, variant
        What was run; an empty variant is the scenario as it stands.
    figure, label
        Name of the figure, and what it is called.
    where
        Where the paper prints it.
    published, is_limit
        The paper's figure; whether it is a limit that has to be kept.
    measured
        None where the run has no such figure.
    spread
        Over dispersed runs.
    verdict, reason
        By the rule; why it is not reproduced.
    """

    scenario: str
    variant: str
    figure: str
    label: str
    where: str
    published: float
    is_limit: bool
    measured: float | None
    spread: Spread | None
    verdict: Verdict
    reason: str


@dataclass(frozen=True)
class Effort:
    """How much is run.

    Attributes
    ----------
    runs
        Perturbed runs of each variant, at most.
    budget_s
        Wall time for them: where a run takes long, fewer are made.
    engine
        ``ros`` or ``inprocess``, for the measured figures.
    workers
        Processes of the sweep; None takes every core.
    """

    runs: int = 200
    budget_s: float = 10.0
    engine: str = "ros"
    workers: int | None = None


def published_variants(name: str, overrides: Sequence[str] = ()) -> list[Scenario]:
    """The variants of a scenario with published figures; of those that change nothing, the file as it stands."""
    base = load(name, None, overrides)
    found = [base] if base.published else []
    for variant in base.variants:
        try:
            scenario = load(name, variant, overrides)
        except ScenarioError:
            continue  # refused for a reason of its own: there is nothing to measure
        if scenario.published and scenario.published != base.published:
            found.append(scenario)
    return found


def rows_of(scenario: Scenario, effort: Effort, folder: Path, overrides: Sequence[str], say: Say) -> list[Row]:
    """Measure a variant and judge its published figures.

    Parameters
    ----------
    scenario
        The variant.
    effort
        How much is run.
    folder
        Where bags go.
    overrides
        As for :func:`etac_ros.scenario.load.load`.
    say
        Told what is being done.
    """
    title = f"{scenario.name} {scenario.variant or ''}".strip()
    say(f"{title}: one run over {effort.engine}")
    summary = _measured(scenario, effort, folder)
    # Also with values overridden: then the verdicts say what the change does to them.
    figures = {key: published_value(key, one) for key, one in published_figures(scenario, scenario.build()).items()}
    measured = summary.figures
    spreads = _spreads(scenario, effort, overrides, [key for key in figures if key in measured], say)
    return [_row(scenario, figure, measured.get(key), spreads.get(str(key))) for key, figure in figures.items()]


def _measured(scenario: Scenario, effort: Effort, folder: Path) -> Summary:
    if effort.engine == "ros":
        summary = run_over_ros(
            scenario, folder / f"{scenario.name}_{scenario.variant or 'as_it_stands'}", RosOptions()
        ).summary
    else:
        summary = run_in_process(scenario).summary
    return with_measured(summary, _baseline(scenario))


def _baseline(scenario: Scenario) -> Summary | None:
    """What the run's own baseline did; None where it has none, or a watch ended it."""
    baseline = baseline_of(scenario)
    try:
        return None if baseline is None else run_in_process(baseline).summary
    except RunHalted:
        return None


def _spreads(
    scenario: Scenario, effort: Effort, overrides: Sequence[str], keys: Sequence[FigureKey], say: Say
) -> Mapping[str, Spread]:
    if not scenario.run.dispersion:
        return {}
    workers = effort.workers or cores()
    one = run_in_process(scenario).summary.timing.total_s
    runs = max(min(effort.runs, math.floor(effort.budget_s * workers / max(one, 1e-6))), _FEWEST)
    runs = min(runs, effort.runs)
    plan = make_plan(str(scenario.path), runs, scenario.variant, overrides)
    title = f"{scenario.name} {scenario.variant or ''}".strip()
    result = sweep(
        plan, usual_workers(effort.workers), lambda done, planned: say(f"{title}: {done} of {planned} dispersed runs")
    )
    found = bands(result, [str(key) for key in keys])
    return {band.figure: Spread(band.p5, band.p95, band.count) for band in found}


def _row(scenario: Scenario, figure: PublishedValue, measured: float | None, spread: Spread | None) -> Row:
    verdict = judge(figure.value, figure.is_limit, measured, spread)
    return Row(
        scenario=scenario.name,
        variant=scenario.variant or "",
        figure=str(figure.key),
        label=label(figure.key, figure.label),
        where=figure.where,
        published=figure.value,
        is_limit=figure.is_limit,
        measured=measured,
        spread=spread,
        verdict=verdict,
        reason="" if verdict is Verdict.REPRODUCED else figure.reason or _UNEXPLAINED[verdict],
    )


_UNEXPLAINED = {
    Verdict.NEAR: "",
    Verdict.NOT_REPRODUCED: "no reading of the paper that was tried gives it",
    Verdict.NOT_TESTABLE: "a run does not give it",
}

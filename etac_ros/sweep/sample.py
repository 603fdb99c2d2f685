"""One sample of a sweep: run it, and what is kept of it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from etac_ros.errors import ScenarioError
from etac_ros.metrics.figures import FigureKey, key_of
from etac_ros.metrics.summary import Summary, with_measured
from etac_ros.runs import Run, simulate
from etac_ros.sweep.draws import run_seed
from etac_ros.sweep.plan import Plan

Row = dict[str, Any]
"""One row of a result by column: numbers, texts, lists of numbers; None where a run does not have the figure."""

SET, DRAWN = "set.", "drawn."
"""Prefixes of the columns with grid values and draws, before the key."""
KEYS = ("sample", "run", "point", "seed", "halted", "refused", "wall_s")
"""Columns that are no figures."""


def run_sample(plan: Plan, sample: int) -> Run:
    """Run one sample in process.

    Returns
    -------
    Run
        Its summary stands beside the baseline of its grid point.

    Raises
    ------
    ScenarioError
        If the values that the sample drew are refused.
    """
    _, point = plan.place(sample)
    run = simulate(plan.scenario_of(sample))
    return replace(run, summary=with_measured(run.summary, plan.points[point].baseline))


def row_of(plan: Plan, sample: int) -> Row:
    """The row of one sample.

    A run that a watch ended is a row with the reason under ``halted``; a draw that the scenario refuses is one without
    figures and with the reason under ``refused``.
    """
    run, point = plan.place(sample)
    row: Row = {
        "sample": sample,
        "run": run,
        "point": point,
        "seed": run_seed(plan.seed, run),
        "halted": "",
        "refused": "",
        "wall_s": 0.0,
        **{f"{SET}{key}": value for key, value in plan.points[point].values.items()},
        **{f"{DRAWN}{key}": value for key, value in plan.draws(sample).items()},
    }
    try:
        summary = run_sample(plan, sample).summary
    except ScenarioError as error:
        return {**row, "refused": f"{error.where}: {error.found}"}
    return {**row, "halted": summary.halted, "wall_s": summary.timing.total_s, **figures_of(summary)}


def figures_of(summary: Summary) -> dict[str, float]:
    """All figures of a run that a sweep keeps, each by the text of its key."""
    found = summary.figures
    found[FigureKey("network_cdr_bytes")] = float(summary.network.cdr_bytes)
    found[FigureKey("internal_messages")] = float(summary.internal.messages)
    for plant, performance in summary.performance.items():
        values = performance.model_dump(exclude_none=True)
        found |= {key_of(name, plant, summary.performance): value for name, value in values.items()}
    for node, watches in summary.watches.items():
        for watch in watches:
            found[key_of(f"largest_{watch.name.replace(' ', '_')}", node, summary.watches)] = watch.largest
    return {str(key): value for key, value in found.items()}

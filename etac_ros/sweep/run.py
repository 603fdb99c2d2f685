"""Run a sweep: go on where it was left, keep every row on disk at once, and write the result."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from etac_ros.runs import warm_up
from etac_ros.sweep.describe import check_same, describe
from etac_ros.sweep.journal import SUFFIX, Journal
from etac_ros.sweep.plan import Plan
from etac_ros.sweep.result import SweepResult, read_result, result_of, write_result
from etac_ros.sweep.sample import Row
from etac_ros.sweep.workers import Workers, here, processes

OnProgress = Callable[[int, int], None]
"""Told the finished and the planned number of samples."""


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0))


def usual_workers(count: int | None = None) -> Workers:
    """One worker is the calling process, more are a pool; None takes every core."""
    wanted = cores() if count is None else count
    return here if wanted == 1 else processes(wanted)


def sweep(
    plan: Plan,
    workers: Workers | None = None,
    on_progress: OnProgress = lambda finished, planned: None,
) -> SweepResult:
    """Run a whole sweep and keep its rows in memory.

    With more than one worker, a program that calls this has its own start behind ``if __name__ == "__main__":``, as
    everything that uses :mod:`multiprocessing`.

    Parameters
    ----------
    plan
        From :func:`etac_ros.sweep.plan.make_plan`.
    workers
        Who runs it; None takes every core.
    on_progress
        Called after each chunk.

    Returns
    -------
    SweepResult
        The same, but for wall times, whoever ran it.
    """
    rows: list[Row] = []
    _run(plan, list(plan.samples), workers, rows.extend, on_progress)
    return result_of(rows, describe(plan))


def sweep_to_file(
    plan: Plan,
    path: Path,
    workers: Workers | None = None,
    on_progress: OnProgress = lambda finished, planned: None,
) -> SweepResult:
    """Run a sweep, or what is left of it, and write its result.

    If it is interrupted, what is finished stands in the file and in a journal beside it; the next call goes on. A
    result that is complete is read, and nothing runs.

    Parameters
    ----------
    plan, workers, on_progress
        As for :func:`sweep`.
    path
        The Parquet file.

    Raises
    ------
    ScenarioError
        If the file or its journal is damaged, belongs to another sweep, or cannot be written.
    """
    description = describe(plan)
    beside = path.with_name(path.name + SUFFIX)
    if path.exists():
        found = read_result(path)
        check_same(description, found.description, str(path))
        if found.complete:
            return found
    with Journal(beside, description) as journal:
        finished = {row["sample"] for row in journal.rows}
        try:
            _run(
                plan,
                [sample for sample in plan.samples if sample not in finished],
                workers,
                journal.append,
                on_progress,
            )
        finally:
            result = result_of(journal.rows, description)
            if journal.rows:
                result = write_result(result, path)
    beside.unlink()
    return result


def _run(
    plan: Plan,
    samples: list[int],
    workers: Workers | None,
    keep: Callable[[list[Row]], None],
    on_progress: OnProgress,
) -> None:
    planned = len(plan.samples)
    finished = planned - len(samples)
    on_progress(finished, planned)
    if not samples:
        return
    warm_up(plan.scenario, in_one=True)  # once, so that not every worker compiles what is in no cache yet
    run = workers or usual_workers()
    with closing(run(plan, samples)) as chunks:  # type: ignore[type-var]
        for rows in chunks:
            keep(rows)
            finished += len(rows)
            on_progress(finished, planned)

"""How many runs a second a sweep makes, with one process and with more.

    .venv/bin/python bench/sweep.py                   # wu2018; this process, one process, all cores
    .venv/bin/python bench/sweep.py --scenario qi2022 --runs 60 --workers 1 --workers 2

Rounds are interleaved (1 2, 1 2, ...), so a machine that changes its speed changes it for all alike. Processes start
within each round; what counts is the time from the first finished chunks on, after which all of them are warm.
"""

from __future__ import annotations

import os
import statistics
import time
from typing import Annotated

import typer
from rich.progress import track
from rich.table import Table

from etac_ros.cli.show import make_console
from etac_ros.sweep.plan import Plan, make_plan
from etac_ros.sweep.run import cores, sweep
from etac_ros.sweep.sample import row_of
from etac_ros.sweep.workers import Workers, here, processes

_SINGLE = 40


def main(
    scenario: Annotated[str, typer.Option(help="Which scenario.")] = "wu2018",
    variant: Annotated[str | None, typer.Option(help="Which variant.")] = None,
    runs: Annotated[int, typer.Option(help="Runs of each sweep.")] = 600,
    workers: Annotated[list[int] | None, typer.Option(help="Processes; repeatable. Default: 1 and all cores.")] = None,
    rounds: Annotated[int, typer.Option(help="Rounds.")] = 3,
) -> None:
    """Measure and print."""
    console = make_console()
    plan = make_plan(scenario, runs, variant)
    ways: dict[str, Workers] = {"this process": here}
    for count in workers or sorted({1, cores()}):
        ways[f"{count} process{'es' if count > 1 else ''}"] = processes(count)
    speeds: dict[str, list[float]] = {name: [] for name in ways}
    whole: dict[str, list[float]] = {name: [] for name in ways}
    for _ in track(range(rounds), "measuring", console=console, transient=True):
        for name, way in ways.items():
            speed, total = measured(plan, way)
            speeds[name].append(speed)
            whole[name].append(total)
    table = Table("", "warm: runs/s, median", "best", "whole sweep [s], median", "ratio to 1 process")
    base = statistics.median(speeds.get("1 process") or speeds["this process"])
    for name, values in speeds.items():
        median = statistics.median(values)
        table.add_row(
            name,
            f"{median:.1f}",
            f"{max(values):.1f}",
            f"{statistics.median(whole[name]):.2f}",
            f"{median / base:.2f}",
        )
    load = os.getloadavg()[0]
    console.print(f"\n{plan.scenario.run.title}, {runs:,} runs, {cores()} cores, load average {load:.1f}")
    console.print(table)
    console.print(f"a run takes {cpu_of_a_run(plan) * 1e3:.1f} ms of processor time, least of {_SINGLE} warm runs")


def cpu_of_a_run(plan: Plan) -> float:
    """Processor time of a run in this process [s]: it says what an idle machine would do, also where others work."""
    row_of(plan, 0)
    times = []
    for sample in plan.samples[:_SINGLE]:
        began = time.process_time()
        row_of(plan, sample)
        times.append(time.process_time() - began)
    return min(times)


def measured(plan: Plan, way: Workers) -> tuple[float, float]:
    """Runs a second once warm, and the time of the whole sweep [s]."""
    marks: list[tuple[float, int]] = []
    began = time.perf_counter()
    sweep(plan, way, lambda finished, planned: marks.append((time.perf_counter(), finished)))
    warm = next(mark for mark in marks if mark[1] >= len(plan.samples) // 5)
    last = marks[-1]
    return (last[1] - warm[1]) / (last[0] - warm[0]), time.perf_counter() - began


if __name__ == "__main__":
    typer.run(main)

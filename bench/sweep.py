"""How many runs a second a sweep makes, with one process and with more.

    ./scripts/bench sweep                             # wu2018; this process, one process, all cores
    ./scripts/bench sweep --scenario qi2022 --runs 60 --workers 1 --workers 2

Rounds are interleaved (1 2, 1 2, ...), so a machine that changes its speed changes it for all alike. Processes start
within each round; what counts is the time from the first finished chunks on, after which all of them are warm.
"""

from __future__ import annotations

import statistics
import time
from typing import Annotated

import typer
from rich.progress import track
from section import Section

from etac_ros.sweep.plan import Plan, make_plan
from etac_ros.sweep.run import cores, sweep
from etac_ros.sweep.sample import row_of
from etac_ros.sweep.workers import Workers, here, processes
from etac_ros.tables.table import Row, Table

_SINGLE = 40


def main(
    scenario: Annotated[str, typer.Option(help="Which scenario.")] = "wu2018",
    variant: Annotated[str | None, typer.Option(help="Which variant.")] = None,
    runs: Annotated[int, typer.Option(help="Runs of each sweep.")] = 600,
    workers: Annotated[list[int] | None, typer.Option(help="Processes; repeatable. Default: 1 and all cores.")] = None,
    rounds: Annotated[int, typer.Option(help="Rounds.")] = 3,
    write: Annotated[bool, typer.Option(help="Write its section of docs/performance.md.")] = False,
) -> None:
    """Measure and print."""
    plan = make_plan(scenario, runs, variant)
    ways: dict[str, Workers] = {"this process": here}
    for count in workers or sorted({1, cores()}):
        ways[f"{count} process{'es' if count > 1 else ''}"] = processes(count)
    speeds: dict[str, list[float]] = {name: [] for name in ways}
    whole: dict[str, list[float]] = {name: [] for name in ways}
    for _ in track(range(rounds), "measuring", transient=True):
        for name, way in ways.items():
            speed, total = measured(plan, way)
            speeds[name].append(speed)
            whole[name].append(total)
    section = Section("sweep", "Sweeps", "./scripts/bench sweep")
    section.say(
        f"`etac sweep` of `{scenario}`, {runs:,} runs, {cores()} cores: each run draws its start, is built, computed "
        f"and summed up. Runs a second once all processes are warm, {rounds} rounds in turns; "
        "a whole sweep has the start of its processes besides."
    )
    base = speeds.get("1 process") or speeds["this process"]
    rows = []
    for name, values in speeds.items():
        ratio = statistics.median(one / other for one, other in zip(values, base, strict=True))
        figures = (max(values), statistics.median(values), min(whole[name]), statistics.median(whole[name]))
        rows.append(Row((name, *(f"{figure:,.1f}" for figure in figures), f"{ratio:.2f}")))
    columns = ("", "runs/s, most", "median", "whole sweep [s], least", "median", "ratio to 1 process")
    section.show(Table("", columns, tuple(rows)))
    least, middle = cpu_of_a_run(plan)
    section.say(
        f"A run takes {least * 1e3:.1f} ms of processor time at least and {middle * 1e3:.1f} ms in the median of "
        f"{_SINGLE} warm ones: so many a second would be {1.0 / least:,.0f} on a core with nothing else to do."
    )
    if write:
        section.write()


def cpu_of_a_run(plan: Plan) -> tuple[float, float]:
    """Processor time of a run in this process [s], least and median: also where others work, it is the run's own."""
    row_of(plan, 0)
    times = []
    for sample in plan.samples[:_SINGLE]:
        began = time.process_time()
        row_of(plan, sample)
        times.append(time.process_time() - began)
    return min(times), statistics.median(times)


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

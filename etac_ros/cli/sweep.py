"""``etac sweep``: many runs of a scenario, with progress while they last and their spread afterwards."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import timedelta
from hashlib import sha256
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.text import Text

from etac_ros.cli.interrupts import Interrupted
from etac_ros.cli.outputs import check_output, write_output
from etac_ros.cli.progress import lines_now_and_then, progress_console, steps
from etac_ros.cli.show import show_summary
from etac_ros.errors import ScenarioError
from etac_ros.metrics.cells import BAND, printed
from etac_ros.metrics.figures import FigureKey, label
from etac_ros.metrics.summary import with_measured
from etac_ros.runs import RosOptions, Run, free_bag_directory, run_over_ros
from etac_ros.sweep.bands import Band, bands, endings, shortest_interval
from etac_ros.sweep.describe import describe
from etac_ros.sweep.plan import Plan, make_plan
from etac_ros.sweep.result import SweepResult
from etac_ros.sweep.run import sweep_to_file, usual_workers
from etac_ros.sweep.sample import run_sample
from etac_ros.sweep.workers import Workers
from etac_ros.tables.numbers import number
from etac_ros.tables.table import Row, Table
from etac_ros.tables.terminal import show

_FOLDER = Path("sweeps")
_MAIN = (
    "triggers",
    "max_interval_s",
    "network_messages",
    "network_payload_bytes",
    "attitude_error_deg",
    "max_attitude_error_deg",
    "max_rate_deg_s",
    "energy_n2m2s",
)
"""Figures that are shown although nothing published stands beside them."""


@dataclass(frozen=True)
class SweepRequest:
    """What the user asked for on the command line."""

    scenario: str
    runs: int
    variant: str | None
    overrides: tuple[str, ...]
    dispersions: tuple[str, ...]
    dispersion: bool
    workers: int | None
    scheduler: str | None
    output: Path | None
    replay: int | None
    engine: str
    bag: Path | None
    json: Path | None


def sweep_and_show(request: SweepRequest, console: Console) -> None:
    """Sweep, or run one sample of a sweep again, and show what came of it.

    Raises
    ------
    Interrupted
        If it was: what is finished has been kept.
    """
    workers = _workers(request)
    with steps(console, f"{request.scenario}: preparing"):
        plan = make_plan(
            request.scenario, request.runs, request.variant, request.overrides, request.dispersions, request.dispersion
        )
    for option, given in (("--engine ros", request.engine == "ros"), ("--bag", request.bag), ("--json", request.json)):
        if given and request.replay is None:
            raise ScenarioError(option, "is for --replay SAMPLE: a sweep runs in process and writes one Parquet file")
    if request.replay is not None:
        check_output("--json", request.json)
        _replay(plan, request, console)
        return
    path = request.output or _usual_path(plan)
    finished = 0
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=30),
        TextColumn("{task.completed:.0f}/{task.total:.0f} runs"),
        _Speed(),
        TimeRemainingColumn(),
    )
    whole = True
    shown = progress_console(console)
    say = lines_now_and_then(console.quiet or shown.is_terminal)
    with Progress(*columns, console=shown, transient=True, disable=not shown.is_terminal) as progress:
        task = progress.add_task(plan.scenario.name, total=len(plan.samples))

        def on_progress(done: int, planned: int) -> None:
            nonlocal finished
            finished = done
            progress.update(task, completed=done)
            say(f"{plan.scenario.name}: {done:,} of {planned:,} runs")

        try:
            result = sweep_to_file(plan, path, workers, on_progress)
        except KeyboardInterrupt:
            whole = False
    if not whole:
        raise Interrupted(
            f"{finished:,} of {len(plan.samples):,} runs are finished and stand in {path}; the same command goes on"
        )
    show_result(result, console)


class _Speed(ProgressColumn):
    """Runs a second, of those that this call has seen."""

    def render(self, task: Task) -> Text:
        speed = task.finished_speed or task.speed
        return Text("" if speed is None else f"{speed:,.0f} runs/s")


def _workers(request: SweepRequest) -> Workers:
    if request.scheduler is not None:
        if request.workers is not None:
            raise ScenarioError("--workers", "stands beside --scheduler", "one of the two")
        from etac_ros.sweep.cluster import cluster  # only here: it needs an extra

        return cluster(request.scheduler)
    if request.workers is not None and request.workers < 1:
        raise ScenarioError(f"--workers {request.workers}", "is no number of processes", "1 or more")
    return usual_workers(request.workers)


def _usual_path(plan: Plan) -> Path:
    """The same file for the same sweep, so that the same command goes on with it."""
    described = describe(plan)
    same = {key: described[key] for key in ("digests", "fixed", "points", "dispersions", "runs", "seed", "version")}
    variant = f"_{plan.scenario.variant}" if plan.scenario.variant else ""
    return _FOLDER / f"{plan.scenario.name}{variant}_{sha256(repr(same).encode()).hexdigest()[:8]}.parquet"


def _replay(plan: Plan, request: SweepRequest, console: Console) -> None:
    assert request.replay is not None
    scenario = plan.scenario_of(request.replay)
    run, point = plan.place(request.replay)
    console.print(f"sample {request.replay}: run {run} at grid point {point}, seed {scenario.run.seed}")
    for key, value in {**plan.points[point].values, **plan.draws(request.replay)}.items():
        console.print(f"  {key} = {value}", soft_wrap=True)
    shown = _replayed_over_ros(plan, request) if request.engine == "ros" else run_sample(plan, request.replay)
    if request.json is not None:  # before the tables: whoever reads those may stop reading
        write_output("--json", request.json, shown.summary.model_dump_json(indent=2) + "\n")
    show_summary(scenario, shown.summary, console)
    if shown.summary.halted:
        console.print(f"halted: {shown.summary.halted}", style="bold")


def _replayed_over_ros(plan: Plan, request: SweepRequest) -> Run:
    assert request.replay is not None
    scenario = plan.scenario_of(request.replay)
    _, point = plan.place(request.replay)
    found = run_over_ros(scenario, request.bag or free_bag_directory(scenario), RosOptions())
    return Run(scenario, with_measured(found.summary, plan.points[point].baseline), found.recording, found.bag)


def show_result(result: SweepResult, console: Console) -> None:
    """The tables that stand after a sweep."""
    described = result.description
    variant = f", variant {described['variant']}" if described["variant"] else ""
    console.print(f"\n{described['title'] or described['scenario']}{variant}: {described['runs']:,} runs", style="bold")
    for key, dispersion in described["dispersions"].items():
        console.print(f"  {key}: {', '.join(f'{kind} {size:g}' for kind, size in dispersion.items())}")
    spread = bands(result)
    for point, (values, ended) in enumerate(zip(described["points"], endings(result), strict=True)):
        console.print()
        if values:
            console.print(", ".join(f"{key} = {value}" for key, value in values.items()), style="bold")
        _show_bands([one for one in spread if one.point == point], result, console)
        if ended.halted:
            console.print(f"{ended.halted:,} of {ended.runs:,} runs were ended by a watch")
        if ended.refused:
            console.print(f"{ended.refused:,} of {ended.runs:,} draws were refused by the scenario")
    _show_shortest(result, console)
    wall = sum(result.table["wall_s"].to_pylist())
    console.print(
        f"{result.table.num_rows:,} runs, {timedelta(seconds=round(wall))} of computing: {result.path}", soft_wrap=True
    )


def _show_bands(spread: Sequence[Band], result: SweepResult, console: Console) -> None:
    shown = [one for one in spread if one.published or _is_main(one.figure)]
    rows = tuple(
        Row(
            (
                _label(one),
                f"{one.count:,}",
                number(one.mean),
                f"{one.sd:.3g}",
                _range(one.low, one.high),
                _range(one.p5, one.p95),
                *_beside(one),
            )
        )
        for one in sorted(shown, key=lambda one: one.published is None)
    )
    columns = ("runs", "mean", "sd", "least to largest", BAND, result.description["source"], "sd from it")
    show(Table("", ("", *columns), rows), console)


def _range(low: float, high: float) -> str:
    return number(low) if low == high else f"{_short(low)} to {_short(high)}"


def _short(value: float) -> str:
    return number(value) if float(value).is_integer() else f"{value:,.3g}" if abs(value) < 1000.0 else f"{value:,.0f}"


def _beside(one: Band) -> tuple[str, str]:
    """The paper's figure, and how many standard deviations the mean of these runs is from it."""
    if one.published is None:
        return "", ""
    distance = f"{(one.mean - one.published.value) / one.sd:+.1f}" if one.sd else ""
    return printed(one.published), distance


def _is_main(figure: str) -> bool:
    return FigureKey.parse(figure).name in _MAIN


def _label(one: Band) -> str:
    own = "" if one.published is None else one.published.label
    return label(FigureKey.parse(one.figure), own)


def _show_shortest(result: SweepResult, console: Console) -> None:
    shortest = shortest_interval(result)
    console.print()
    if shortest is None:
        console.print("no event-triggered module triggered twice: there is no inter-event time")
        return
    ticks = "1 tick" if shortest.ticks == 1 else f"{shortest.ticks:,} ticks"
    console.print(
        f"shortest inter-event time of all runs: {shortest.seconds:g} s, {ticks} (sample {shortest.sample}, "
        f"run {shortest.run}; --replay {shortest.sample} runs it again)"
    )

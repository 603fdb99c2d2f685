"""``etac run``: the main job, with progress while it lasts and tables afterwards."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from etac_ros.bag.live import HOST, check_live
from etac_ros.bag.reserve import release
from etac_ros.bag.write import check_writable
from etac_ros.cli.interrupts import keeping
from etac_ros.cli.outputs import check_output, write_output
from etac_ros.cli.progress import progress_console, steps
from etac_ros.cli.show import show_summary
from etac_ros.engines.ros.domain import check_domain, domain_of_environment
from etac_ros.engines.ros.environment import without_effect
from etac_ros.engines.ros.liveness import QUIET_S
from etac_ros.engines.ros.several_machines import find_peers, machines_of
from etac_ros.errors import RunHalted, ScenarioError
from etac_ros.metrics.summary import with_measured
from etac_ros.runs import (
    RosOptions,
    Run,
    free_bag_directory,
    play_part,
    run_in_process,
    run_over_ros,
    warm_up,
)
from etac_ros.scenario.load import Scenario, baseline_of, load


@dataclass(frozen=True)
class RunRequest:
    """What the user asked for on the command line."""

    scenario: str
    variant: str | None
    overrides: tuple[str, ...]
    engine: str
    processes: str
    baseline: bool
    bag: Path | None
    json: Path | None
    domain: int | None
    record_windows: bool
    only: str | None = None
    quiet_s: float = QUIET_S
    rate: float | None = None
    strict: bool = False
    capture: str | None = None
    """The pcapng file to keep; empty keeps none; None captures nothing."""
    pace: float | None = None
    priority: int = 0
    peers: str | None = None
    interface: str | None = None
    live: int | None = None

    @property
    def options(self) -> RosOptions:
        """How the run is spread over processes, recorded and timed."""
        return RosOptions(
            self.processes,
            self.domain,
            self.record_windows,
            self.only,
            self.quiet_s,
            self.rate,
            self.strict,
            self.capture is not None,
            Path(self.capture) if self.capture else None,
            self.pace,
            self.priority,
            machines_of(self.peers, self.interface),
            self.live,
        )


def ticks_of_truth(words: str) -> int:
    """What ``--truth`` says, as the scenario's ``truth_every``.

    Raises
    ------
    ScenarioError
        If it says nothing of that kind.
    """
    if words in ("all", "none"):
        return int(words == "all")
    if not words.isdecimal() or int(words) < 1:
        raise ScenarioError(
            f"--truth {words}", "is none of its values", "all, none, or a number of ticks from one sample to the next"
        )
    return int(words)


def run_and_show(request: RunRequest, console: Console) -> None:
    """Run what was asked for, show the tables, write the summary."""
    if request.engine == "ros":
        request = _in_this_process(request)
    elif request.rate is not None:
        raise ScenarioError("--clock wall", "is for --engine ros: by calls nothing takes its time", "",
                            "leave out --engine, or --clock wall; --rate alone slows simulated time down")  # fmt: skip
    scenario = load(request.scenario, request.variant, request.overrides)
    if request.capture is not None:
        _check_capture(request)
    if request.peers is not None or request.interface is not None:
        _check_machines(request)
    if request.live is not None and request.engine != "ros":
        raise ScenarioError("--live", "is for --engine ros")
    if request.only is not None and request.pace is not None:
        raise ScenarioError("--rate", "slows simulated time down for all parts at once", "", "leave out --only")
    if request.only is not None:
        if request.engine != "ros":
            raise ScenarioError("--only", "is for --engine ros")
        options = request.options
        console.print(f"{scenario.name}: {request.only} joins ROS domain {request.domain}")
        if play_part(scenario, options):
            console.print(f"{request.only}: the run is over")
            given = {"--bag": request.bag, "--json": request.json, "--live": request.live, "--capture": request.capture}
            idle = ", ".join(option for option, value in given.items() if value is not None)
            if idle:
                print(f"etac: {idle}: no effect here; the part that keeps time records the run", file=sys.stderr)
            return
    if request.live is not None:
        check_live(request.live)
        console.print(f"live: ws://{HOST}:{request.live}, in Foxglove: Open connection", soft_wrap=True)
    if request.bag is not None:
        check_writable(request.bag)
    check_output("--json", request.json)
    other = _baseline_of(scenario, console)
    for note in (*scenario.notes, *(() if other is None else other.overruled)):
        console.print(note, soft_wrap=True)
    bag = request.bag
    if bag is None and request.engine == "ros":
        bag = free_bag_directory(scenario)
    try:
        with keeping(lambda: _kept(bag)):
            with steps(console, f"{scenario.name}: compiling kernels, seconds the first time"):
                warm_up(scenario)
            baseline = None if other is None else _run_baseline(other, request, bag, console)
            run = _run(scenario, request, bag, console)
    finally:
        if bag is not None:
            release(bag)
    summary = with_measured(run.summary, None if baseline is None else baseline.summary)
    if request.json is not None:  # before the tables: whoever reads those may stop reading
        write_output("--json", request.json, summary.model_dump_json(indent=2) + "\n")
    show_summary(scenario, summary, console)
    if request.json is not None:
        console.print(f"summary: {request.json}", soft_wrap=True)


def _in_this_process(request: RunRequest) -> RunRequest:
    """What the shell's environment means for the run, before anything of ROS is loaded.

    Without ``--domain`` a ROS_DOMAIN_ID is the wanted domain, as for any ROS program.
    """
    idle = without_effect(os.environ, Path.cwd())
    if idle:
        print(f"etac: no effect on a run, which keeps to this machine: {', '.join(idle)}", file=sys.stderr)
    os.environ.pop("RMW_IMPLEMENTATION", None)  # this process is ours, and a run has but one choice
    if request.domain is not None:
        check_domain(request.domain, "--join" if request.only else "--domain")
        return request
    return replace(request, domain=domain_of_environment(os.environ))


def _baseline_of(scenario: Scenario, console: Console) -> Scenario | None:
    """The run's baseline. One that does not fit it is no reason against the run that was asked for."""
    try:
        return baseline_of(scenario)
    except ScenarioError as error:
        console.print(f"no baseline to compare with: {error}", soft_wrap=True)
        return None


def _check_machines(request: RunRequest) -> None:
    if request.engine != "ros":
        raise ScenarioError("--peers", "is for --engine ros: calls do not leave this machine")
    if request.capture is not None:
        raise ScenarioError("--capture", "captures the loopback of this machine alone", "", "leave out --peers")
    find_peers(machines_of(request.peers, request.interface), request.domain)


def _check_capture(request: RunRequest) -> None:
    if request.engine != "ros":
        raise ScenarioError("--capture", "is for --engine ros: by calls nothing is on a wire")
    if request.capture:
        path = Path(request.capture)
        if path.is_dir() or not path.parent.is_dir() or not os.access(path if path.exists() else path.parent, os.W_OK):
            raise ScenarioError(f"--capture {path}", "may not be written to", "a file that may be written")


def _kept(bag: Path | None) -> str:
    """What an interrupt leaves of a run."""
    if bag is None or not any(bag.glob("*.mcap")):
        return "no bag was begun; the same command begins anew"
    return f"what had happened until then is in {bag}, which is readable (etac info, etac report)"


def _run_baseline(scenario: Scenario, request: RunRequest, bag: Path | None, console: Console) -> Run | None:
    """The baseline's counts are the same with either engine; only on request it takes the long way.

    None where a watch ended it: that is no reason against the run that was asked for.
    """
    try:
        if request.baseline and request.engine == "ros":
            beside = None if bag is None else bag.with_name(f"{bag.name}_{scenario.variant}")
            return _run(scenario, replace(request, capture=None), beside, console)
        return run_in_process(scenario)
    except RunHalted as halted:
        console.print(f"no baseline '{scenario.variant}' to compare with: {halted}", soft_wrap=True)
        return None


def _run(scenario: Scenario, request: RunRequest, bag: Path | None, console: Console) -> Run:
    if request.engine == "inprocess":
        return run_in_process(scenario, bag, request.pace)
    assert bag is not None
    options = request.options
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=30),
        TextColumn("{task.completed:.0f}/{task.total:.0f} s simulated"),
        TextColumn("{task.fields[note]}"),
    )
    shown = progress_console(console)
    with Progress(*columns, console=shown, transient=True, disable=not shown.is_terminal) as progress:
        task = progress.add_task(scenario.name, total=scenario.run.duration_s, note="joining")
        began = time.perf_counter()

        def on_progress(tick: int, fired: Mapping[str, int]) -> None:
            simulated = tick / scenario.run.ticks_per_second
            speed = simulated / max(time.perf_counter() - began, 1e-9)
            triggers = f"{sum(fired.values())} triggers, " if fired else ""
            note = f"{triggers}{speed:.0f} x real time"
            progress.update(task, completed=simulated, note=note)

        return run_over_ros(scenario, bag, options, on_progress)

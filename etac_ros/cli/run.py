"""``etac run``: the main job, with progress while it lasts and tables afterwards."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from etac_ros.bag.live import HOST, check_live
from etac_ros.bag.reserve import release
from etac_ros.bag.write import check_writable
from etac_ros.beside import Beside
from etac_ros.cli.interrupts import keeping
from etac_ros.cli.outputs import check_output, write_output
from etac_ros.cli.progress import lines_now_and_then, progress_console, steps
from etac_ros.engines.ros.domain import check_domain, domain_of_environment
from etac_ros.engines.ros.environment import without_effect
from etac_ros.engines.ros.several_machines import Machines, find_peers
from etac_ros.errors import RunHalted, ScenarioError
from etac_ros.runs import (
    RosOptions,
    Run,
    free_bag_directory,
    load_ros,
    play_part,
    run_in_process,
    run_over_ros,
    warm_up,
)
from etac_ros.scenario.load import Scenario, baseline_of, load

if TYPE_CHECKING:
    from etac_ros.metrics.summary import Summary


@dataclass(frozen=True)
class RunRequest:
    """What the user asked for on the command line.

    Attributes
    ----------
    scenario, variant, overrides
        What is run.
    engine
        ``ros`` or ``inprocess``.
    baseline
        Whether the baseline takes the same way.
    bag, json
        Where they go; None takes a new folder, and writes none.
    options
        How the run is spread over processes, recorded, timed and shown; by calls, as far as that makes sense.
    watch
        Whether it is shown in the terminal as it happens.
    """

    scenario: str
    variant: str | None = None
    overrides: tuple[str, ...] = ()
    engine: str = "ros"
    baseline: bool = False
    bag: Path | None = None
    json: Path | None = None
    options: RosOptions = field(default_factory=RosOptions)
    watch: bool = False


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
        request = replace(request, options=_in_this_process(request.options))
    elif request.options.rate is not None:
        raise ScenarioError("--clock wall", "is for --engine ros: by calls nothing takes its time", "",
                            "leave out --engine, or --clock wall; --rate alone slows simulated time down")  # fmt: skip
    scenario = load(request.scenario, request.variant, request.overrides)
    options = request.options
    if request.engine != "ros":
        _check_by_calls(request)
    if options.capture:
        _check_capture(options)
    if options.machines is not None:
        _check_machines(options, options.machines)
    if options.only is not None:
        if options.domain is None:
            raise ScenarioError(f"--only {options.only}", "has no run to join", "--join ID, the same for all parts")
        joins = f"{scenario.name}: {options.only} joins ROS domain {options.domain}"
        if play_part(scenario, options, lambda: console.print(joins)):
            console.print(f"{options.only}: the run is over")
            _say_what_was_idle(request)
            return
    if options.live is not None:
        check_live(options.live)
        console.print(f"live: ws://{HOST}:{options.live}, in Foxglove: Open connection", soft_wrap=True)
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
        with keeping(lambda: _kept(bag, scenario.run.truth_every == 1)):
            with steps(console, f"{scenario.name}: compiling kernels, seconds the first time"):
                warm_up(scenario)
            baseline = None if other is None else _baseline(other, request, bag, console)
            run = _run(scenario, request, bag, console)
    finally:
        if bag is not None:
            release(bag)
    from etac_ros.metrics.summary import with_measured

    summary = with_measured(run.summary, baseline)
    if request.json is not None:  # before the tables: whoever reads those may stop reading
        write_output("--json", request.json, summary.model_dump_json(indent=2) + "\n")
    from etac_ros.cli.show import show_summary

    show_summary(scenario, summary, console)
    if request.json is not None:
        console.print(f"summary: {request.json}", soft_wrap=True)


def load_tables() -> None:
    """Import what shows a run, while its processes find each other and this one waits."""
    import etac_ros.cli.show  # noqa: F401


def _in_this_process(options: RosOptions) -> RosOptions:
    """What the shell's environment means for the run, before anything of ROS is loaded.

    Without ``--domain`` a ROS_DOMAIN_ID is the wanted domain, as for any ROS program.
    """
    idle = without_effect(os.environ, Path.cwd())
    if idle:
        print(f"etac: no effect on a run, which keeps to this machine: {', '.join(idle)}", file=sys.stderr)
    os.environ.pop("RMW_IMPLEMENTATION", None)  # this process is ours, and a run has but one choice
    if options.domain is not None:
        check_domain(options.domain, "--join" if options.only else "--domain")
        return options
    return replace(options, domain=domain_of_environment(os.environ))


def _say_what_was_idle(request: RunRequest) -> None:
    """What was asked of a part of a run that only the part that keeps time can do."""
    options = request.options
    given = {
        "--bag": request.bag is not None,
        "--json": request.json is not None,
        "--live": options.live is not None,
        "--watch": request.watch,
        "--rate": options.pace is not None,
        "--capture": options.capture,
    }
    idle = ", ".join(option for option, is_given in given.items() if is_given)
    if idle:
        print(
            f"etac: {idle}: no effect here; the part that keeps time paces and records the run, give it there",
            file=sys.stderr,
        )


def _baseline_of(scenario: Scenario, console: Console) -> Scenario | None:
    """The run's baseline. One that does not fit it is no reason against the run that was asked for."""
    try:
        return baseline_of(scenario)
    except ScenarioError as error:
        console.print(f"no baseline to compare with: {error}", soft_wrap=True)
        return None


def _check_by_calls(request: RunRequest) -> None:
    """Refuse what makes no sense where calls carry the messages."""
    options = request.options
    refused = {
        "--only": (options.only is not None, "is for --engine ros: by calls a run has no parts"),
        "--processes": (options.processes != RosOptions().processes, "is for --engine ros: calls stay in one process"),
        "--capture": (options.capture, "is for --engine ros: by calls nothing is on a wire"),
        "--peers": (options.machines is not None, "is for --engine ros: calls do not leave this machine"),
        "--parameters": (options.parameters, "is for --engine ros: by calls there are no nodes to ask"),
        "--record-windows": (options.record_windows, "is for --engine ros: by calls no window is a message"),
    }
    for option, (is_given, why) in refused.items():
        if is_given:
            raise ScenarioError(option, why, "", f"leave out {option}, or --engine")


def _check_machines(options: RosOptions, machines: Machines) -> None:
    if options.capture:
        raise ScenarioError("--capture", "captures the loopback of this machine alone", "", "leave out --peers")
    find_peers(machines, options.domain)


def _check_capture(options: RosOptions) -> None:
    path = options.keep_capture
    if path is not None and (
        path.is_dir() or not path.parent.is_dir() or not os.access(path if path.exists() else path.parent, os.W_OK)
    ):
        raise ScenarioError(f"--capture {path}", "may not be written to", "a file that may be written")


def _kept(bag: Path | None, all_samples: bool) -> str:
    """What an interrupt leaves of a run; a report of one that did not end takes all its samples."""
    if bag is None or not any(bag.glob("*.mcap")):
        return "no bag was begun; the same command begins anew"
    by = "etac info, etac report" if all_samples else "etac info"
    return f"what had happened until then is in {bag}, which is readable ({by})"


def _baseline(scenario: Scenario, request: RunRequest, bag: Path | None, console: Console) -> Summary | None:
    """The baseline's counts are the same with either engine; only on request it takes the long way.

    None where a watch ended it: that is no reason against the run that was asked for.
    """
    if request.engine != "ros":
        found = _by_calls(scenario)
    elif request.baseline:
        beside = None if bag is None else bag.with_name(f"{bag.name}_{scenario.variant}")
        plain = replace(request.options, capture=False, keep_capture=None, live=None)
        try:
            return _run(scenario, replace(request, options=plain), beside, console).summary
        except RunHalted as halted:
            found = halted
    else:
        # It ends before the run begins, which has both cores for itself then.
        outcome = Beside(longest_s=None)(partial(_by_calls, scenario))
        load_ros()
        found = outcome()
    if isinstance(found, RunHalted):
        console.print(f"no baseline '{scenario.variant}' to compare with: {found}", soft_wrap=True)
        return None
    return found


def _by_calls(scenario: Scenario) -> Summary | RunHalted:
    try:
        return run_in_process(scenario).summary
    except RunHalted as halted:
        return halted


def _run(scenario: Scenario, request: RunRequest, bag: Path | None, console: Console) -> Run:
    options = request.options
    shown = progress_console(console)
    if request.watch:
        from etac_ros.cli.screen import Screen

        say = lines_now_and_then(console.quiet)
        title = f"{scenario.name}, {scenario.variant}" if scenario.variant else scenario.name
        with Screen(shown, title, scenario.graph, say) as screen:
            if request.engine == "inprocess":
                return run_in_process(scenario, bag, options.pace, options.live, screen.show)
            assert bag is not None
            return run_over_ros(scenario, bag, options, on_picture=screen.show)
    if request.engine == "inprocess":
        return run_in_process(scenario, bag, options.pace, options.live)
    assert bag is not None
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=30),
        TextColumn("{task.completed:.0f}/{task.total:.0f} s simulated"),
        TextColumn("{task.fields[note]}"),
    )
    with Progress(*columns, console=shown, transient=True, disable=not shown.is_terminal) as progress:
        task = progress.add_task(scenario.name, total=scenario.run.duration_s, note="joining")
        began = time.perf_counter()

        def on_progress(tick: int, fired: Mapping[str, int]) -> None:
            simulated = tick / scenario.run.ticks_per_second
            speed = simulated / max(time.perf_counter() - began, 1e-9)
            triggers = f"{sum(fired.values())} triggers, " if fired else ""
            note = f"{triggers}{speed:.0f} x real time"
            progress.update(task, completed=simulated, note=note)

        return run_over_ros(scenario, bag, options, on_progress, lambda pids: load_tables())

"""How fast a scenario runs: over DDS, in process, and over DDS in lock-step, side by side.

    ./scripts/bench                     # wu2018, five rounds
    ./scripts/bench --scenario wu2018 --runs 9 --no-lock-step
    ./scripts/bench --scenario all --runs 5 --write     # the five systems beside each other, into docs/performance.md

Rounds are interleaved (a b c, a b c, ...), so a machine that changes its speed changes it for all alike; the table
gives minimum and median of each, and the ratios of the medians. Lock-step means windows of one sample: an exchange
a sample, as a co-simulation without windows would need.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import track
from rich.table import Table
from section import Section

from etac_ros.cli.show import make_console
from etac_ros.runs import RosOptions, Run, run_in_process, run_over_ros
from etac_ros.scenario.load import load
from etac_ros.tables import table as tables
from etac_ros.tables.table import Row

LOCK_STEP = "windows={first: 1, longest: 1}"
_INPROCESS_REPEATS = 5
SYSTEMS = ("wu2018", "qi2022", "flexible", "shi2022", "xie2021")


def main(
    scenario: Annotated[str, typer.Option(help="Which scenario; all: the five systems beside each other.")] = "wu2018",
    variant: Annotated[str | None, typer.Option(help="Which variant.")] = None,
    runs: Annotated[int, typer.Option(help="Rounds.")] = 5,
    processes: Annotated[str, typer.Option(help="node, namespace or one.")] = "node",
    lock_step: Annotated[bool, typer.Option(help="Measure lock-step, too (slow).")] = True,
    write: Annotated[bool, typer.Option("--write", help="Of all: into docs/performance.md.")] = False,
) -> None:
    """Measure and print."""
    console = make_console()
    if scenario == "all":
        section = Section("speed", "The five systems", f"./scripts/bench --scenario all --runs {runs}", console)
        _all_systems(section, runs)
        if write:
            section.write()
        return
    usual = load(scenario, variant)
    stepped = load(scenario, variant, [LOCK_STEP])
    loops: dict[str, list[float]] = {"ros": [], "inprocess": [], "ros, lock-step": []}
    whole: list[float] = []
    last: Run | None = None
    run_in_process(usual)  # compiles
    with tempfile.TemporaryDirectory() as folder:
        for number in track(range(runs), "measuring", console=console, transient=True):
            last = run_over_ros(usual, Path(folder) / f"ros{number}", RosOptions(processes))
            loops["ros"].append(last.summary.timing.loop_s)
            for _ in range(_INPROCESS_REPEATS):  # the first finds caches that processes of the other engine have filled
                loops["inprocess"].append(run_in_process(usual).summary.timing.loop_s)
            if lock_step and number == 0:
                run = run_over_ros(stepped, Path(folder) / "stepped", RosOptions(processes))
                loops["ros, lock-step"].append(run.summary.timing.loop_s)
            whole.append(_whole_command(scenario, variant, Path(folder) / f"command{number}"))
    assert last is not None
    duration = usual.run.duration_s
    table = Table("", "runs", "loop, least [s]", "loop, median [s]", "simulated s a second", "ratio to ros")
    base = statistics.median(loops["ros"])
    for name, values in loops.items():
        if values:
            median = statistics.median(values)
            table.add_row(
                name,
                str(len(values)),
                f"{min(values):.3f}",
                f"{median:.3f}",
                f"{duration / median:,.0f}",
                f"{median / base:.3g}",
            )
    console.print(f"\n{usual.run.title}, {duration:g} s, {os.cpu_count()} cores")
    console.print(table)
    console.print(
        f"whole command `etac run {scenario}`: least {min(whole):.2f} s, median {statistics.median(whole):.2f} s"
    )
    _print_messages(last)


def _all_systems(section: Section, runs: int) -> None:
    """The loop of each system over DDS and by calls, in turns."""
    scenarios = {name: load(name) for name in SYSTEMS}
    loops: dict[tuple[str, str], list[float]] = {}
    last: dict[str, Run] = {}
    for scenario in scenarios.values():
        run_in_process(scenario)  # compiles
    with tempfile.TemporaryDirectory() as folder:
        for number in range(runs):
            for name, scenario in scenarios.items():
                last[name] = run_over_ros(scenario, Path(folder) / f"{name}{number}", RosOptions())
                loops.setdefault((name, "ros"), []).append(last[name].summary.timing.loop_s)
                for _ in range(_INPROCESS_REPEATS):
                    loops.setdefault((name, "calls"), []).append(run_in_process(scenario).summary.timing.loop_s)
    section.say(
        f"The loop alone, without start-up, of {runs} rounds in which all take turns. Over DDS with a process a node, "
        "the coordinator beside the only plant, and the recorder; in process, the same modules by calls, with the same "
        "bits. A trigger is an instant at which a rule held; periodic loops beside it have theirs at every tick."
    )
    rows = []
    for name, scenario in scenarios.items():
        over, by_calls = loops[name, "ros"], loops[name, "calls"]
        triggers = sum(figures.count for figures in last[name].summary.triggers.values())
        duration = scenario.run.duration_s
        cells = (f"{duration:g}", f"{triggers:,}", f"{min(over):.3f}", f"{statistics.median(over):.3f}")
        cells += (f"{min(by_calls):.4f}", f"{statistics.median(by_calls):.4f}")
        rows.append(Row((name, *cells, f"{duration / min(over):,.0f}", f"{duration / min(by_calls):,.0f}")))
    heads = ("system", "simulated [s]", "triggers", "over DDS, least [s]", "median [s]", "in process, least [s]")
    heads += ("median [s] ", "x real time over DDS", "x real time in process")
    section.show(tables.Table("", heads, tuple(rows)))


def _whole_command(scenario: str, variant: str | None, bag: Path) -> float:
    command = [sys.executable, "-m", "etac_ros", "run", scenario, "--bag", str(bag)]
    command += ["--variant", variant] if variant else []
    began = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - began


def _print_messages(run: Run) -> None:
    console = make_console()
    summary = run.summary
    triggers = sum(figures.count for figures in summary.triggers.values())
    table = Table("emulation topic", "messages", "a trigger", "CDR bytes")
    for name, topic in summary.topics.items():
        if topic.kind == "emulation":
            table.add_row(name, f"{topic.messages:,}", f"{topic.messages / triggers:.2f}", f"{topic.cdr_bytes:,}")
    table.add_section()
    total = summary.emulation
    table.add_row("all", f"{total.messages:,}", f"{total.messages / triggers:.2f}", f"{total.cdr_bytes:,}")
    console.print(f"\nemulation messages over {triggers} triggers")
    console.print(table)
    memory = Table("node", "peak memory of its process [MiB]")
    for name, kib in summary.memory_kib.items():
        memory.add_row(name, f"{kib / 1024:.0f}")
    console.print(memory)


if __name__ == "__main__":
    typer.run(main)

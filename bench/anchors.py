"""What others take for the same work, side by side: a loop by hand, scipy, Basilisk, drake, HELICS and mosaik.

    ./scripts/bench anchors --set-up         # once: an environment of their own, .venv-anchors, about 2 GB
    ./scripts/bench anchors
    ./scripts/bench anchors --slow 1000      # also the slow ones over the whole duration

The work is said in bench/others/workload.py: the rigid body of wu2018 over 1000 s on the grid of 32 Hz, with its rule,
law and hold. Everybody's own plant, rule and law are the same compiled formulas of a user; what differs is who carries
values and time. Only loops are timed, after one that compiles. What is not installed is said; who has other triggering
instants has not done the same work, which is an error.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import track
from section import Section

from etac_ros.runs import RosOptions, run_in_process, run_over_ros
from etac_ros.scenario.load import Scenario, load
from etac_ros.tables.table import Row, Table
from etac_ros.tables.terminal import make_console

BENCH = Path(__file__).resolve().parent
VENV = BENCH.parent / ".venv-anchors"
DURATION_S = 1000.0
START = [0.9899494936611666, 0.1, -0.08, 0.06]
OVERRIDES = [f"plant.dynamics.attitude_q={START}", "plant.dynamics.attitude_euler_deg=null"]
REPEATS = 3
"""Loops of one process, after the one that compiles; a process is started anew in each round."""


@dataclass
class Way:
    """Somebody who does the work.

    ``program`` is a file of bench/others and its arguments; ``distribution`` what it needs that etac_ros does not.
    """

    label: str
    program: tuple[str, ...] = ()
    distribution: str = ""
    over_processes: bool = False
    slow: bool = False
    duration_s: float = DURATION_S
    loops_s: list[float] = field(default_factory=list)
    triggers: set[int] = field(default_factory=set)
    version: str = ""

    @property
    def speed(self) -> float:
        """Simulated seconds a second of wall time, in the least loop."""
        return self.duration_s / min(self.loops_s)


IN_PROCESS, OVER_DDS = Way("etac_ros, in process"), Way("etac_ros, over DDS, a process a node", over_processes=True)
BY_HAND = Way("numba, a loop by hand", ("by_hand.py",))
OTHERS = (
    BY_HAND,
    Way("scipy DOP853, dense output at each tick", ("dop853.py",)),
    Way("Basilisk, modules compiled", ("basilisk.py",), "bsk"),
    Way("Basilisk, modules in Python", ("basilisk.py", "python"), "bsk", slow=True),
    Way("drake, systems in Python", ("drake_diagram.py",), "drake"),
    Way("HELICS, 4 federates over tcp", ("helics_federates.py",), "helics", over_processes=True, slow=True),
    Way("mosaik, 4 processes", ("mosaik_processes.py",), "mosaik", over_processes=True, slow=True),
)


def main(
    rounds: Annotated[int, typer.Option(min=1, help="Rounds.")] = 3,
    slow: Annotated[float, typer.Option(min=1.0, help="Simulated seconds of the slow ones.")] = 100.0,
    set_up: Annotated[bool, typer.Option(help="Install what is compared with, and end.")] = False,
    write: Annotated[bool, typer.Option(help="Write its section of docs/performance.md.")] = False,
) -> None:
    """Measure and print."""
    if set_up:
        subprocess.run([sys.executable, "-m", "venv", VENV], env=plain_environment(), check=True)
        command = [VENV / "bin/python", "-m", "pip", "install", "--requirement", BENCH / "anchors.txt"]
        raise typer.Exit(subprocess.run(command, env=plain_environment(), check=False).returncode)
    console = make_console()
    scenario = load("wu2018", None, OVERRIDES)
    there = [way for way in OTHERS if not way.distribution or installed(way.distribution)]
    for way in there:
        way.duration_s = slow if way.slow else DURATION_S
    run_in_process(scenario)  # compiles
    with tempfile.TemporaryDirectory() as folder:
        for number in track(range(rounds), "measuring", console=console, transient=True):
            ours(scenario, Path(folder) / str(number))
            for way in there:
                theirs(way)
    expected = {way.duration_s: triggers_by_hand(way.duration_s) for way in (*there, IN_PROCESS)}
    wrong = [way for way in (IN_PROCESS, OVER_DDS, *there) if way.triggers != {expected[way.duration_s]}]
    show(console, there, rounds, write and not wrong)
    for way in wrong:
        counts = ", ".join(map(str, sorted(way.triggers)))
        print(f"{way.label}: {counts} triggers, where a loop by hand has {expected[way.duration_s]}", file=sys.stderr)
    raise typer.Exit(bool(wrong))


def show(console: Console, there: list[Way], rounds: int, write: bool) -> None:
    """The table, and what it means."""
    part = min(way.duration_s for way in there)
    command = f"./scripts/bench anchors --rounds {rounds} --slow {part:g}"
    section = Section("anchors", "What others take for the same work", command, console)
    section.say(
        f"The rigid body of wu2018 over {DURATION_S:,.0f} s on the grid of 32 Hz, at rest and turned by q_v = (0.1, "
        f"-0.08, 0.06), with its rule, law and hold: {max(BY_HAND.triggers)} triggering instants. Loop only; every "
        "program has the same compiled formulas of a user, and carries values and time in its own way. Slow ones run "
        f"a part of it. All in turns, {rounds} rounds with {REPEATS} loops each, one of etac_ros over DDS and of slow "
        "ones."
    )
    rows = []
    for way in (IN_PROCESS, OVER_DDS, *there):
        ours_of_its_kind = OVER_DDS if way.over_processes else IN_PROCESS
        rows.append(
            Row(
                (
                    f"{way.label} {way.version}".strip(),
                    f"{way.duration_s:,.0f}",
                    ", ".join(map(str, sorted(way.triggers))),
                    f"{min(way.loops_s):.4f}",
                    f"{statistics.median(way.loops_s):.4f}",
                    f"{way.speed:,.0f}" if way.speed >= 100.0 else f"{way.speed:.1f}",
                    f"{ours_of_its_kind.speed / way.speed:.3g}",
                )
            )
        )
    columns = (
        "who",
        "simulated [s]",
        "triggers",
        "loop, least [s]",
        "loop, median [s]",
        "simulated s a second",
        "etac_ros: times as fast",
    )
    missing = sorted({way.distribution for way in OTHERS} - {way.distribution for way in there})
    notes = (f"Not installed, so not measured: {', '.join(missing)}.",) if missing else ()
    section.show(Table("", columns, tuple(rows), notes))
    section.say(
        "Speeds are of the least loop. The last column compares who runs in one process with etac_ros in process, and "
        "who runs over several with etac_ros over DDS. The loop by hand is the floor: it has no modules, messages, "
        "counts or bag. etac_ros gives its figures with all of them, and over DDS with a recorded bag. Programs that "
        "exchange values at every tick pay for 32 exchanges a second; windows are why etac_ros does not."
    )
    if write:
        section.write()


def ours(scenario: Scenario, bag: Path) -> None:
    """A round of etac_ros in both engines."""
    for way, runs in (
        (OVER_DDS, [run_over_ros(scenario, bag, RosOptions())]),
        (IN_PROCESS, [run_in_process(scenario) for _ in range(REPEATS)]),
    ):
        way.loops_s += [run.summary.timing.loop_s for run in runs]
        way.triggers |= {sum(figures.count for figures in run.summary.triggers.values()) for run in runs}


def theirs(way: Way) -> None:
    """A round of somebody else."""
    found = outcome(way, 1 if way.slow else REPEATS, way.duration_s)
    way.loops_s += found["loops_s"]
    way.triggers |= set(found["triggers"])
    way.version = ", ".join(found["versions"].values())


def triggers_by_hand(duration_s: float) -> int:
    """What everybody is to have after so long."""
    (count,) = outcome(BY_HAND, 1, duration_s)["triggers"]
    return int(count)


def outcome(way: Way, repeats: int, duration_s: float) -> dict[str, list[float]]:
    """What a program of bench/others reports."""
    python = VENV / "bin/python" if way.distribution else Path(sys.executable)
    name, *more = way.program
    command = [python, BENCH / "others" / name, str(duration_s), str(repeats), *more]
    environment = plain_environment() if way.distribution else None
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    lines = [line for line in done.stdout.splitlines() if line.startswith("outcome ")]
    if done.returncode or not lines:
        raise SystemExit(f"{way.label} failed:\n{done.stdout}{done.stderr}")
    return json.loads(lines[-1].removeprefix("outcome "))


def installed(distribution: str) -> bool:
    """Whether the environment of the others has it."""
    code = f"from importlib.metadata import version; version('{distribution}')"
    python = VENV / "bin/python"
    if not python.exists():
        return False
    done = subprocess.run([python, "-c", code], env=plain_environment(), capture_output=True, check=False)
    return done.returncode == 0


def plain_environment() -> dict[str, str]:
    """Without what the environment of etac_ros sets for ROS: other programs bring libraries of their own."""
    ours_only = ("LD_LIBRARY_PATH", "PYTHONPATH", "VIRTUAL_ENV", "_ROS_WHEELS_BOOTSTRAP_COMPLETE")
    return {name: value for name, value in os.environ.items() if name not in ours_only}


if __name__ == "__main__":
    typer.run(main)

"""What a run makes of a process that is killed or stopped: every process, in every phase, for three systems.

    ./scripts/bench faults                                  # about 20 minutes
    ./scripts/bench faults --systems wu2018 --jobs 1
    ./scripts/bench faults --write docs/faults.md

Each cell of the matrix is one run, in which one process gets SIGKILL, or SIGSTOP and after 3 or 30 s SIGCONT, while it
starts, while the run is under way, or while it drains (all is simulated, and the recorder still has to take what was
sent; it is held up for that moment). ``--quiet-s`` of these runs is 5 s, so 3 s are a pause, which must only cost
time, and 30 s are not. A cell is judged by what the user sees: is the right process named, how soon, what stays behind,
and what of the run is in the bag.
"""

from __future__ import annotations

import multiprocessing
import os
import shutil
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Annotated

import psutil
import typer
from rich.progress import Progress
from rich.table import Table

from etac_ros.bag.read import read_bag
from etac_ros.cli.main import FAILED_RUN
from etac_ros.cli.show import make_console
from etac_ros.engines.ros.launcher import Processes, groups
from etac_ros.engines.ros.plan import RECORDER, Plan
from etac_ros.errors import EtacError
from etac_ros.runs import RosOptions, run_over_ros, warm_up, windows_of
from etac_ros.scenario.load import Scenario, load

SYSTEMS = {
    "wu2018": ("periodic", ["duration_s=1000.0", "sensor.trigger.period_s=0.25"]),
    "qi2022": (None, ["duration_s=30.0", "baseline=null"]),
    "xie2021": (None, ["duration_s=10.0", "baseline=null"]),
}
"""Long enough for something to happen in the middle: a second or two."""
PHASES = ("starting", "running", "draining")
ACTS = {"KILL": 0.0, "STOP 3 s": 3.0, "STOP 30 s": 30.0}
ALIKE = ("/sc2", "/sc3", "/sc4")
"""Spacecraft of the formation that are made from the same templates as the first."""
QUIET_S = 5.0
NOTHING_YET = "cut off before its first message"
LIMIT_S = 90.0
"""A run that takes longer hangs."""


@dataclass
class Undisturbed:
    """What the run gives if nobody disturbs it."""

    last_told: int = 0
    ticks: dict[str, list[int]] = field(default_factory=dict)
    """By link: the ticks of its messages."""


@dataclass
class Cell:
    """One run of the matrix, and what came of it."""

    system: str
    names: tuple[str, ...]
    phase: str
    act: str
    error: str = ""
    named: bool = True
    after_s: float = 0.0
    exit_code: int = 0
    left: list[str] = field(default_factory=list)
    bag: str = "complete"
    lost_s: float = 0.0
    lost_messages: int = 0

    @property
    def pause(self) -> bool:
        """Whether this must only cost time."""
        return self.act == "STOP 3 s"

    @property
    def as_it_should_be(self) -> bool:
        """Whether nothing is to be complained of."""
        may_be_done = self.phase == "draining"  # all had been said before the signal came
        ends_well = self.exit_code == 0 if self.pause else self.exit_code == FAILED_RUN or may_be_done
        killed_recorder = self.act == "KILL" and RECORDER in self.names
        early = self.phase == "starting" or killed_recorder
        bag = self.bag == "complete" or (self.bag in ("none", NOTHING_YET) and early)
        return ends_well and self.named and not self.left and bag and self.lost_s <= 1.0 and not self.lost_messages


def main(
    systems: Annotated[str, typer.Option(help="Which, with commas.")] = ",".join(SYSTEMS),
    phases: Annotated[str, typer.Option(help="Which, with commas.")] = ",".join(PHASES),
    acts: Annotated[str, typer.Option(help="Which, with commas.")] = ",".join(ACTS),
    nodes: Annotated[str, typer.Option(help="Only processes with one of these nodes, with commas.")] = "",
    every: Annotated[bool, typer.Option("--every", help="Every spacecraft of a formation, not one for all.")] = False,
    jobs: Annotated[int, typer.Option(help="Runs at the same time.")] = 2,
    write: Annotated[Path | None, typer.Option(help="Write the tables as Markdown.")] = None,
) -> None:
    """Run the matrix and print it; exit code 1 if anything is not as it should be."""
    console = make_console()
    wanted = set(nodes.split(",")) - {""}
    cells: list[Cell] = []
    scenarios = {name: load(name, *SYSTEMS[name]) for name in systems.split(",")}
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder, Progress(console=console, transient=True) as progress:
        for name, scenario in scenarios.items():
            warm_up(scenario)
            plan = Plan(scenario.name, scenario.digest, scenario.build(), windows_of(scenario))
            for names in groups(plan, Processes.NODE, plan.nodes):
                alike = not every and names[0].startswith(ALIKE)
                if names[0] not in wanted if wanted else alike:
                    continue
                cells += [Cell(name, names, phase, act) for phase in phases.split(",") for act in acts.split(",")]
        references = {name: undisturbed(scenario, Path(folder) / name) for name, scenario in scenarios.items()}
        task = progress.add_task("runs", total=len(cells))

        def judge(numbered: tuple[int, Cell]) -> Cell:
            number, cell = numbered
            found = in_a_fork(scenarios[cell.system], references[cell.system], cell, Path(folder) / f"{number}")
            progress.advance(task)
            return found

        with ThreadPoolExecutor(jobs) as pool:
            cells = list(pool.map(judge, enumerate(cells)))
    for table in (summary_table(cells), complaints_table(cells)):
        console.print(to_rich(*table))
    wrong = sum(not cell.as_it_should_be for cell in cells)
    console.print(f"{len(cells)} runs in {time.monotonic() - began:.0f} s, {wrong} not as they should be")
    if write is not None:
        write.write_text(document(cells), encoding="utf-8")
        console.print(f"written: {write}")
    raise typer.Exit(1 if wrong else 0)


def undisturbed(scenario: Scenario, bag: Path) -> Undisturbed:
    """One run without any disturbance, in a process of its own like all others."""
    ours, theirs = multiprocessing.get_context("fork").Pipe(duplex=False)

    def play() -> None:
        reference = Undisturbed()

        def on_progress(tick: int, fired: dict[str, int]) -> None:
            reference.last_told = tick

        run = run_over_ros(scenario, bag, on_progress=on_progress)
        messages = run.recording.messages
        reference.ticks = {link: [message.tick for message in messages[link]] for link in messages}
        theirs.send(reference)

    process = multiprocessing.get_context("fork").Process(target=play)
    process.start()
    theirs.close()
    found: Undisturbed = ours.recv()
    process.join()
    shutil.rmtree(bag)
    return found


def in_a_fork(scenario: Scenario, reference: Undisturbed, cell: Cell, bag: Path) -> Cell:
    """One cell, in a process of its own: a run belongs into a main thread, and one that hangs must be ended."""
    ours, theirs = multiprocessing.get_context("fork").Pipe(duplex=False)
    process = multiprocessing.get_context("fork").Process(
        target=play_cell, args=(scenario, reference, cell, bag, theirs)
    )
    process.start()
    theirs.close()
    found = cell
    if ours.poll(LIMIT_S):
        try:
            found = ours.recv()
        except EOFError:
            found.error, found.named, found.exit_code = "the launcher died", False, -1
    else:
        found.error, found.named, found.exit_code = f"hung for {LIMIT_S:g} s", False, -1
        for child in psutil.Process(process.pid).children(recursive=True):
            child.kill()
        process.kill()
    process.join()
    ours.close()
    shutil.rmtree(bag, ignore_errors=True)
    return found


def play_cell(scenario: Scenario, reference: Undisturbed, cell: Cell, bag: Path, pipe: Connection) -> None:
    """One run with its disturbance."""
    pids: dict[str, int] = {}
    told: list[tuple[float, int]] = []  # wall time and tick of what the coordinator told
    struck: list[float] = []
    held: list[int] = []

    def strike() -> None:
        if struck:
            return
        struck.append(time.monotonic())
        victim = pids[cell.names[0]]
        if cell.act == "KILL":
            os.kill(victim, signal.SIGKILL)
        else:
            os.kill(victim, signal.SIGSTOP)
            timer = threading.Timer(ACTS[cell.act], resume, [victim])
            timer.daemon = True
            timer.start()
        for process in held:
            if process != victim:
                resume(process)

    def on_start(found: dict[str, int]) -> None:
        pids.update(found)
        if cell.phase == "starting":
            strike()

    def on_progress(tick: int, fired: dict[str, int]) -> None:
        told.append((time.monotonic(), tick))
        if cell.phase == "running" and 0 < tick < reference.last_told:
            strike()
        if cell.phase == "draining" and tick >= reference.last_told:
            if RECORDER not in cell.names:
                held.append(pids[RECORDER])
                os.kill(pids[RECORDER], signal.SIGSTOP)
            strike()

    memory_before = set(os.listdir("/dev/shm"))
    devnull = os.open(os.devnull, os.O_WRONLY)
    os.dup2(devnull, sys.stderr.fileno())
    try:
        run_over_ros(scenario, bag, RosOptions(quiet_s=QUIET_S), on_progress, on_start)
    except EtacError as error:
        cell.error = str(error).splitlines()[0]
        cell.exit_code = FAILED_RUN
        cell.named = any(name in error.where for name in cell.names)
    if not struck:
        cell.error, cell.named = "the phase was missed", False
    cell.after_s = time.monotonic() - struck[0] if struck else 0.0
    cell.left = [f"process of {name}" for name, pid in pids.items() if psutil.pid_exists(pid)]
    cell.left += sorted(name for name in set(os.listdir("/dev/shm")) - memory_before if "fast" in name)
    look_into(bag, cell, reference, told, struck)
    pipe.send(cell)
    pipe.close()


def resume(process: int) -> None:
    """Let a stopped process go on, if it is still there."""
    if psutil.pid_exists(process):
        os.kill(process, signal.SIGCONT)


def look_into(
    bag: Path, cell: Cell, reference: Undisturbed, told: Sequence[tuple[float, int]], struck: Sequence[float]
) -> None:
    """What of the run, as far as the coordinator had told of it, is in the bag."""
    if not bag.exists():
        cell.bag = "none"
        if told and struck:
            cell.lost_s = struck[0] - told[0][0]
        elif cell.exit_code == 0:
            cell.lost_s = float("inf")
        return
    try:
        recording = read_bag(bag).recording()
    except EtacError as error:
        nothing = cell.act == "KILL" and RECORDER in cell.names and "cut off" in str(error)
        cell.bag = NOTHING_YET if nothing else str(error).splitlines()[0]
        cell.lost_s = struck[0] - told[0][0] if struck and told else 0.0
        return
    cell.bag = "complete" if (bag / "metadata.yaml").exists() else "no metadata"
    known = [(wall, tick) for wall, tick in told if struck and wall <= struck[0]] or [(0.0, 0)]
    last = known[-1][1] if cell.exit_code else reference.last_told
    for link, ticks in reference.ticks.items():
        here = sum(message.tick < last for message in recording.messages.get(link, []))
        cell.lost_messages += max(0, sum(tick < last for tick in ticks) - here)
    for plant in recording.truth:
        first, samples = recording.samples(plant)
        end = first + samples.shape[0]
        missed = [wall for wall, tick in known if tick > end]
        if missed:
            cell.lost_s = max(cell.lost_s, struck[0] - missed[0])


TableText = tuple[str, list[str], list[list[str]]]


def summary_table(cells: Sequence[Cell]) -> TableText:
    """One line for each system, phase and act."""
    head = ["system", "phase", "act", "runs", "error after [s]", "right one named", "exit", "left behind",
            "bag complete", "lost [s]", "lost messages", "as it should be"]  # fmt: skip
    rows = []
    for (system, phase, act), group in grouped(cells):
        failed = [cell.after_s for cell in group if cell.exit_code]
        rows.append(
            [
                system,
                phase,
                act,
                str(len(group)),
                f"{min(failed):.1f} to {max(failed):.1f}" if failed else "-",
                f"{sum(cell.named for cell in group if cell.exit_code)} of {len(failed)}" if failed else "-",
                ", ".join(sorted({str(cell.exit_code) for cell in group})),
                str(sum(len(cell.left) for cell in group)),
                f"{sum(cell.bag == 'complete' for cell in group)} of {sum(cell.bag != 'none' for cell in group)}",
                f"{max(cell.lost_s for cell in group):.2f}",
                str(max(cell.lost_messages for cell in group)),
                f"{sum(cell.as_it_should_be for cell in group)} of {len(group)}",
            ]
        )
    return "faults", head, rows


def complaints_table(cells: Sequence[Cell]) -> TableText:
    """The runs of which there is something to complain."""
    head = ["system", "process", "phase", "act", "error", "after [s]", "exit", "left", "bag", "lost [s]", "messages"]
    rows = [
        [
            cell.system,
            cell.names[0],
            cell.phase,
            cell.act,
            cell.error or "none",
            f"{cell.after_s:.1f}",
            str(cell.exit_code),
            ", ".join(cell.left) or "-",
            cell.bag,
            f"{cell.lost_s:.2f}",
            str(cell.lost_messages),
        ]
        for cell in cells
        if not cell.as_it_should_be
    ]
    return "not as it should be", head, rows


def grouped(cells: Sequence[Cell]) -> Iterator[tuple[tuple[str, str, str], list[Cell]]]:
    """Cells by system, phase and act, in the order of their first."""
    found: dict[tuple[str, str, str], list[Cell]] = {}
    for cell in cells:
        found.setdefault((cell.system, cell.phase, cell.act), []).append(cell)
    yield from found.items()


def to_rich(title: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """For the terminal."""
    table = Table(*head, title=title)
    for row in rows:
        table.add_row(*row)
    return table


def to_markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """For a file."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(text.replace("|", "/") for text in line) + " |" for line in lines)


def document(cells: Sequence[Cell]) -> str:
    """The page in docs/."""
    _, head, rows = summary_table(cells)
    _, worse_head, worse = complaints_table(cells)
    rest = to_markdown(worse_head, worse) if worse else "None."
    return f"""# Processes that are killed or stopped

Written by `./scripts/bench faults --write docs/faults.md`: {len(cells)} runs, one for every process of three systems
in each phase (of the formation's spacecraft, which are alike, the first stands for all). While a run starts, while it
is under way, and when it drains (everything is simulated, and the recorder still has to take what was sent), one
process gets SIGKILL, or SIGSTOP and 3 or 30 s later SIGCONT. `--quiet-s` is {QUIET_S:g} s here, so that 3 s are a pause
- the run has to finish as if nothing had been - and 30 s are not. A signal that comes when a process has already done
its part of the drain changes nothing: exit 0, and a complete bag.

- *error after*: from the signal to the end of the command, all processes gone and the bag complete.
- *right one named*: the error begins with the process that got the signal.
- *bag complete*: it has its metadata, and reads. A recorder that is killed within its first second may leave none.
- *left behind*: processes and files in shared memory.
- *lost*: wall time of samples that the coordinator had told of and that are not in the bag; and messages that it knew
  to be delivered and that are not. (The goal is one second and none.) Only a recorder that is killed loses anything:
  what it had not acknowledged yet, and what nobody can send it any more. What it acknowledges is in the file.

{to_markdown(head, rows)}

## Not as it should be

{rest}
"""


if __name__ == "__main__":
    typer.run(main)

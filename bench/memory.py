"""How much memory a run takes: the whole graph, and each of its processes; and whether a long one takes more.

    ./scripts/bench memory                                  # five scenarios: over DDS, spread two ways, and in process
    ./scripts/bench memory --scenarios wu2018
    ./scripts/bench memory --growth 1000000                 # wu2018 that long: does any process grow?
    ./scripts/bench memory --growth 1000000 --write

Memory is PSS, the proportional set size of ``/proc/PID/smaps_rollup``: a page that several processes share counts
among them in equal parts, so the sum over all processes is what the graph takes of the machine. (The sum of their
resident sizes counts what they were forked with once a process.) Each run starts from a Python of its own, the
launcher, which is part of the graph and of the sum.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import track
from section import Section

from etac_ros.engines.ros.plan import COORDINATOR, RECORDER
from etac_ros.runs import RosOptions, run_in_process, run_over_ros
from etac_ros.scenario.load import load
from etac_ros.tables.table import Row, Table
from etac_ros.tables.terminal import make_console

SCENARIOS = "wu2018,qi2022,flexible,shi2022,xie2021"
IN_PROCESS = "in process"
SPREADS = ("node", "namespace", IN_PROCESS)
GROWN = ("node", IN_PROCESS)
"""How the long run is spread."""
LAUNCHER = "launcher"
SHORT_S, LONG_S = 1.0, 10_000.0
"""A run of less than so much simulated time lasts a second at least [wall s]: else it is over before anybody looks."""
_THIRDS = 3
_LOOK_EVERY_S = 0.2


def pss_mib(pid: int) -> float:
    """Proportional set size of a process [MiB]."""
    for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines():
        if line.startswith("Pss:"):
            return int(line.split()[1]) / 1024.0
    raise ValueError(f"process {pid} says nothing of its memory")


@dataclass
class Watch:
    """Memory of each process of a run at its latest, and in each third of the run at its largest."""

    end_tick: int
    pids: dict[str, int] = field(default_factory=lambda: {LAUNCHER: os.getpid()})
    latest: dict[str, float] = field(default_factory=dict)
    thirds: list[dict[str, float]] = field(default_factory=lambda: [{} for _ in range(_THIRDS)])
    looked: float = 0.0

    @contextmanager
    def beside(self) -> Iterator[None]:
        """Looks at this process alone while it works, and takes its thirds for those of the run."""
        seen: list[float] = []
        over = threading.Event()

        def look() -> None:
            while not over.wait(_LOOK_EVERY_S):
                seen.append(pss_mib(os.getpid()))

        looker = threading.Thread(target=look, daemon=True)
        looker.start()
        try:
            yield
        finally:
            over.set()
            looker.join()
        for number, one in enumerate(seen):
            third = self.thirds[_THIRDS * number // len(seen)]
            third[LAUNCHER] = max(third.get(LAUNCHER, 0.0), one)
        self.latest = {LAUNCHER: seen[-1] if seen else pss_mib(os.getpid())}

    def on_start(self, pids: dict[str, int]) -> None:
        # Nodes that share a process stand together.
        by_pid: dict[int, list[str]] = {}
        for name, pid in pids.items():
            if name != COORDINATOR or pid not in by_pid:
                by_pid.setdefault(pid, []).append(name)
        self.pids |= {", ".join(names): pid for pid, names in by_pid.items()}

    def on_progress(self, tick: int, fired: object = None) -> None:
        now = time.monotonic()
        if now - self.looked < _LOOK_EVERY_S and self.latest:
            return
        self.looked = now
        try:
            found = {name: pss_mib(pid) for name, pid in self.pids.items()}
        except OSError:
            return  # somebody has left: the run is over
        self.latest = found
        third = self.thirds[min(_THIRDS - 1, _THIRDS * tick // max(1, self.end_tick))]
        for name, value in found.items():
            third[name] = max(third.get(name, 0.0), value)


def measured(scenario: str, spread: str, overrides: list[str]) -> dict[str, Any]:
    """What one run takes, run from this process."""
    what = load(scenario, None, ["baseline=null", *overrides])
    watch = Watch(what.graph.end_tick)
    began = time.perf_counter()
    with tempfile.TemporaryDirectory(dir=os.environ.get("ETAC_BENCH_FOLDER")) as folder:
        bag = Path(folder, "bag")
        if spread == IN_PROCESS:
            with watch.beside():
                run = run_in_process(what, bag)
        else:
            pace = what.run.duration_s / SHORT_S if what.run.duration_s < LONG_S else None
            run = run_over_ros(what, bag, RosOptions(spread, pace=pace), watch.on_progress, watch.on_start)
        size = sum(path.stat().st_size for path in bag.glob("*.mcap"))
    peaks = Path("/proc/self/status").read_text()
    (peak,) = (line.split()[1] for line in peaks.splitlines() if line.startswith("VmHWM"))
    return {
        "latest": watch.latest or {LAUNCHER: pss_mib(os.getpid())},
        "thirds": watch.thirds,
        "after": pss_mib(os.getpid()),
        "peak": int(peak) / 1024.0,
        "bag_mib": size / 2**20,
        "wall_s": time.perf_counter() - began,
        "loop_s": run.summary.timing.loop_s,
        "messages": sum(topic.messages for topic in run.summary.topics.values()),
    }


def from_fresh_process(scenario: str, spread: str, overrides: list[str] = []) -> dict[str, Any]:  # noqa: B006
    """The same from a Python of its own, which holds nothing of an earlier run."""
    command = [sys.executable, __file__, "--alone", json.dumps([scenario, spread, overrides])]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


READERS = {
    "etac info": ["info"],
    "etac report": ["report"],
    "etac export --to parquet --rate 0.1": ["export", "--to", "parquet", "--rate", "0.1"],
}


def from_bag(growth: float, overrides: list[str]) -> dict[str, tuple[float, float, float]]:
    """Of each reader of one long bag: its largest resident memory [MiB], how long it took [s], and the bag [MiB]."""
    what = load("wu2018", None, ["baseline=null", f"duration_s={growth}", *overrides])
    found = {}
    with tempfile.TemporaryDirectory(dir=os.environ.get("ETAC_BENCH_FOLDER")) as folder:
        bag = Path(folder, "bag")
        run_in_process(what, bag)
        size = sum(path.stat().st_size for path in bag.glob("*.mcap")) / 2**20
        for name, (verb, *options) in READERS.items():
            output = ["--output", str(Path(folder, verb))] if verb != "info" else []
            command = [sys.executable, "-c", _PEAK, sys.executable, "-m", "etac_ros", verb, str(bag), *options, *output]
            began = time.perf_counter()
            done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
            found[name] = float(done.stdout.splitlines()[-1]), time.perf_counter() - began, size
    return found


_PEAK = (
    "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True); "
    "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024)"
)


def table_of_readers(found: Mapping[str, tuple[float, float, float]]) -> Table:
    """Who reads a long bag."""
    rows = tuple(
        Row((name, f"{size:,.0f}", f"{peak:.0f}", f"{took:.0f}")) for name, (peak, took, size) in found.items()
    )
    return Table("readers of that bag", ("command", "bag [MiB]", "largest resident memory [MiB]", "took [s]"), rows)


def table_of_runs(found: Mapping[tuple[str, str], Mapping[str, Any]]) -> Table:
    """The graph in total, and its processes."""
    rows = []
    for (scenario, spread), one in found.items():
        of_nodes = {name: value for name, value in one["latest"].items() if name != LAUNCHER}
        nodes = [value for name, value in of_nodes.items() if name != RECORDER]
        rows.append(
            Row(
                (
                    scenario,
                    spread if spread == IN_PROCESS else f"a process a {spread}",
                    str(len(one["latest"])),
                    f"{sum(one['latest'].values()):.0f}",
                    f"{one['latest'][LAUNCHER]:.0f}",
                    f"{min(nodes):.0f} to {max(nodes):.0f}" if nodes else "",
                    f"{of_nodes[RECORDER]:.0f}" if RECORDER in of_nodes else "",
                    f"{one['peak']:.0f}",
                )
            )
        )
    heads = ("scenario", "run", "processes", "in total", "launcher", "a node", "recorder", "launcher's peak")
    return Table("memory (PSS) while the run lasts [MiB]", heads, tuple(rows), texts=frozenset({"run"}))


def table_of_growth(title: str, found: Mapping[str, Mapping[str, Any]]) -> Table:
    """Every process in each third of a long run."""
    rows = []
    for spread, one in found.items():
        for name in one["latest"]:
            largest = [third.get(name) for third in one["thirds"]]
            rows.append(Row((spread, name, *("" if value is None else f"{value:.1f}" for value in largest))))
        rows.append(Row((spread, "launcher, summary made", "", "", f"{one['after']:.1f}"), ends=True))
    heads = ("run", "process", "first third", "second", "last")
    return Table(title, heads, tuple(rows), texts=frozenset({"process"}))


def main(
    scenarios: Annotated[str, typer.Option(help="Which, with commas.")] = SCENARIOS,
    spreads: Annotated[str, typer.Option(help="node, namespace, one, 'in process'; with commas.")] = ",".join(SPREADS),
    growth: Annotated[float, typer.Option(help="Run wu2018 for so many simulated seconds, too; 0: do not.")] = 0.0,
    override: Annotated[list[str], typer.Option("--set", help="As of etac run.")] = [],  # noqa: B006
    write: Annotated[bool, typer.Option(help="Write its section of docs/performance.md.")] = False,
    alone: Annotated[str, typer.Option(hidden=True)] = "",
) -> None:
    """Measure and print."""
    if alone:
        scenario, spread, overrides = json.loads(alone)
        print(json.dumps(measured(scenario, spread, overrides)))
        return
    console = make_console()
    section = Section("memory", "Memory", "./scripts/bench memory", console, packages=("mcap",))
    section.say(
        "Memory is PSS, the proportional set size: a page that several processes share counts among them in equal "
        "parts, so the total is what the graph takes of the machine, the launcher included. Each run starts from a "
        "Python of its own, and its nodes are forked after everything is imported and compiled: most is shared. "
        "Libraries that other programs have loaded meanwhile are shared with these, too: on a machine that runs other "
        "things from the same environment totals are lower."
    )
    wanted = [(scenario, spread) for scenario in scenarios.split(",") for spread in spreads.split(",")]
    one_each = {
        (scenario, spread): from_fresh_process(scenario, spread, override)
        for scenario, spread in track(wanted, "measuring", console=console, transient=True)
    }
    section.show(table_of_runs(one_each))
    if write:
        section.write()
    if growth:
        section = Section(
            "long", "A very long run", f"./scripts/bench memory --growth {growth:.0f}", console, ("mcap",)
        )
        some = {
            spread: from_fresh_process("wu2018", spread, [f"duration_s={growth}", *override])
            for spread in track(GROWN, "a long run", console=console, transient=True)
        }
        title = f"wu2018, {growth:,.0f} simulated seconds: memory (PSS) of each process [MiB], largest of each third"
        section.show(table_of_growth(title, some))
        for spread, one in some.items():
            section.say(
                f"{spread}: {one['messages']:,} messages, a bag of {one['bag_mib']:,.0f} MiB, loop {one['loop_s']:.0f} "
                f"s, in all {one['wall_s']:.0f} s; the launcher's resident memory never exceeded {one['peak']:.0f} MiB."
            )
        section.say(
            f"Committed samples of such a run are {growth * 32 * 56 / 2**20:,.0f} MiB; they are on disk. What still "
            "grows is what is kept of each message of the links, and the index that an MCAP file has at its end."
        )
        readers = from_bag(growth, override)
        section.show(table_of_readers(readers))
        if write:
            section.write()


if __name__ == "__main__":
    typer.run(main)

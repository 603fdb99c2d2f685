"""How long a command takes from a fresh process to its end, once everything is set up.

    ./scripts/bench command                          # ten rounds
    ./scripts/bench command --beside ../other        # and those of another checkout (with its .venv) in the same rounds

Rounds are interleaved (a b c, a b c, ...), so a machine that changes its speed changes it for all alike. The first
round fills caches (compiled kernels, byte code) and is not counted. "Processor" is the time of the command's own
processes, all of them: it says what an idle machine would do, also where others work.
"""

from __future__ import annotations

import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import track
from section import Section

from etac_ros.tables.table import Row, Table
from etac_ros.tables.terminal import make_console

ROOT = Path(__file__).resolve().parent.parent
COMMANDS = {
    "etac --help": ["--help"],
    "etac list": ["list"],
    "etac info BAG": ["info", "KEPT"],
    "etac run wu2018 --engine inprocess": ["run", "wu2018", "--engine", "inprocess", "--bag", "NEW"],
    "etac run wu2018": ["run", "wu2018", "--bag", "NEW"],
    "etac report BAG": ["report", "KEPT", "--output", "NEW"],
}
"""KEPT is the bag of a run of wu2018, NEW a folder that is not there yet."""
BOUNDS_S = {"etac --help": 0.3, "etac list": 0.3, "etac run wu2018": 1.0, "etac report BAG": 2.5}
"""What each is to take at most, on a quiet machine with two cores."""


def main(
    rounds: Annotated[int, typer.Option(min=1, help="Rounds that count.")] = 10,
    beside: Annotated[list[Path] | None, typer.Option(help="Another checkout; repeatable.")] = None,
    only: Annotated[list[str] | None, typer.Option(help="Commands with this word in them; repeatable.")] = None,
    write: Annotated[bool, typer.Option(help="Write its section of docs/performance.md.")] = False,
) -> None:
    """Measure and print."""
    console = make_console()
    checkouts = {"": Path(sys.executable)}
    for folder in beside or []:
        checkouts[folder.resolve().name] = folder.resolve() / ".venv" / "bin" / "python"
    chosen = {name: words for name, words in COMMANDS.items() if not only or any(word in name for word in only)}
    found: dict[tuple[str, str], list[tuple[float, float]]] = defaultdict(list)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for where, python in checkouts.items():
            timed(python, ["run", "wu2018", "--bag", str(folder / f"kept{where}")])
        for number in track(range(rounds + 1), "measuring", console=console, transient=True):
            for label, words in chosen.items():
                for where, python in checkouts.items():
                    new = folder / "new"
                    places = {"KEPT": str(folder / f"kept{where}"), "NEW": str(new)}
                    took = timed(python, [places.get(word, word) for word in words])
                    shutil.rmtree(new, ignore_errors=True)
                    if number:
                        found[label, where].append(took)
    section = Section("command", "A command from a fresh process", "./scripts/bench command", console)
    section.say(
        "What somebody at the prompt waits for: start of Python, imports, the work and the leaving of all processes. "
        f"Of a run, the loop itself is a part only. Least and median of {rounds} rounds."
    )
    rows = []
    for label in chosen:
        for where in checkouts:
            wall, processor = zip(*found[label, where], strict=True)
            bound = f"{BOUNDS_S[label]:.1f}" if label in BOUNDS_S else ""
            cells = (f"`{label}`{f' in {where}' if where else ''}", *_figures(wall), *_figures(processor), bound)
            rows.append(Row(cells))
    columns = ("command", "least [s]", "median [s]", "processor, least [s]", "processor, median [s]", "at most [s]")
    section.show(Table("", columns, tuple(rows)))
    section.say("The last column is what the command is to take on a quiet machine with two cores.")
    if write:
        section.write()


def timed(python: Path, words: list[str]) -> tuple[float, float]:
    """Wall time and processor time [s] of a command and all that it starts."""
    checkout = ROOT if python == Path(sys.executable) else python.parents[2]  # what Python finds first
    before, began = os.times(), time.perf_counter()
    done = subprocess.run([python, "-m", "etac_ros", *words], cwd=checkout, capture_output=True, text=True, check=False)
    took, after = time.perf_counter() - began, os.times()
    if done.returncode:
        raise SystemExit(f"etac {' '.join(words)} ended with {done.returncode}:\n{done.stderr}")
    spent = after.children_user - before.children_user + after.children_system - before.children_system
    return took, spent


def _figures(values: tuple[float, ...]) -> tuple[str, str]:
    return f"{min(values):.2f}", f"{statistics.median(values):.2f}"


if __name__ == "__main__":
    typer.run(main)

"""``etac theorems``: what the papers prove, computed for a scenario and checked along a run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from etac_ros.cli.outputs import check_output, write_output
from etac_ros.cli.progress import steps
from etac_ros.errors import ScenarioError
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import Scenario, load
from etac_ros.tables.markdown import markdown_lines
from etac_ros.tables.table import Row, Table
from etac_ros.tables.terminal import show
from etac_ros.theorems.bound import Bound, Theorems
from etac_ros.theorems.papers import PAPERS, theorems_of

_COLUMNS = ("equation", "what", "bound", "measured", "unit", "standing", "note")
_HEAD = """# What the papers prove

Written by `./scripts/etac theorems --write docs/theorems.md`, from one run of each scenario in process. Every bound
that a theorem or its proof states is computed from the scenario, and checked along the run. **vacuous**: it holds, and
would hold whatever the law did, such as an attitude bound beyond every attitude, or a least interval below the tick.
Where the paper only says that a constant exists, the least that this run allows is taken, which flatters the theorem;
an inequality at every sample is shown as the share of samples at which it holds. Reports draw the Lyapunov functions.
"""


def theorems(
    name: str | None, variant: str | None, overrides: Sequence[str], console: Console, page: Path | None = None
) -> None:
    """Run scenarios in process, and show what becomes of their theorems.

    Parameters
    ----------
    name
        A scenario; None takes every one with theorems, as its file stands.
    variant, overrides
        Of the scenario.
    console
        Where to.
    page
        File for Markdown.

    Raises
    ------
    EtacError
        If a scenario cannot be loaded or run, or has no theorems, or the file cannot be written.
    """
    check_output("--write", page)
    sections = []
    for one in PAPERS if name is None else (name,):
        scenario = load(one, variant, overrides)
        with steps(console, f"{scenario.name}: one run in process"):
            found = _found(scenario)
        title = f"{scenario.name} {scenario.variant or ''}".strip()
        table = _table(title, found)
        show(table, console)
        sections.append("\n".join([f"## {title}", "", *markdown_lines(table), ""]))
    if page is not None:
        write_output("--write", page, "\n".join([_HEAD, *sections]))


def _found(scenario: Scenario) -> Theorems:
    found = theorems_of(scenario, run_in_process(scenario).recording)
    if found is None:
        raise ScenarioError(
            f"{scenario.path}: {scenario.variant or 'as the file stands'}",
            "is not the event-triggered loop of a paper whose theorems are known",
            f"one of: {', '.join(PAPERS)}, in a variant with the paper's law and trigger rule",
        )
    return found


def _cells(bound: Bound) -> tuple[str, ...]:
    return (
        bound.equation,
        bound.says,
        f"{bound.bound:.4g}",
        f"{bound.measured:.4g}",
        bound.unit,
        bound.standing.value,
        bound.note,
    )


def _table(title: str, found: Theorems) -> Table:
    rows = tuple(Row(_cells(bound)) for bound in found.bounds)
    return Table(
        title, _COLUMNS, rows, texts=frozenset({"what", "unit", "standing", "note"}), spare=frozenset({"note"})
    )

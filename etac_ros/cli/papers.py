"""``etac papers``: every numbered item of the papers, with its command or the reason why it has none."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from etac_ros.cli.outputs import check_output, write_output
from etac_ros.reproduce.papers import PaperItems, items_table, paper_items
from etac_ros.tables.markdown import markdown_lines
from etac_ros.tables.terminal import show

_HEAD = """# Every item of the papers

Written by `etac papers --write docs/papers.md` from etac_ros/reproduce/papers.yaml. Each equation, figure, table,
theorem, remark and assumption has the command that computes, shows or checks it, or the reason why none does. What
comes of the figures and tables stands in [reproduction.md](reproduction.md), of the bounds in
[theorems.md](theorems.md), of the readings in [readings.md](readings.md).
"""


def papers(console: Console, page: Path | None = None) -> None:
    """Show the lists, and write them.

    Parameters
    ----------
    console
        Where to.
    page
        File for Markdown.

    Raises
    ------
    ScenarioError
        If the file cannot be written.
    """
    check_output("--write", page)
    for name, paper in paper_items().items():
        console.print(f"\n{name}: {_tally(paper)}", style="bold", soft_wrap=True)
        show(items_table(paper), console)
    if page is not None:
        write_output("--write", page, markdown())


def markdown() -> str:
    """The page."""
    sections = [
        "\n".join([f"## {name}", "", f"{paper.title}. {_tally(paper)}.", "", *markdown_lines(items_table(paper)), ""])
        for name, paper in paper_items().items()
    ]
    return "\n".join([_HEAD, *sections])


def _tally(paper: PaperItems) -> str:
    with_command = sum(len(item.numbers) for item in paper.items if item.command)
    return f"{with_command} of {sum(paper.numbered.values())} items have a command, the others a reason"

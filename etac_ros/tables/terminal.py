"""A table in a terminal: rows stay whole, however narrow it is."""

from __future__ import annotations

from collections.abc import Iterator

from rich import box
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table as RichTable

from etac_ros.tables.table import Table

_GAP = 3
_WIDE = 170
"""Columns where output goes to no terminal, so that a table in a file stays in one piece."""


def make_console() -> Console:
    """A console that leaves brackets alone."""
    console = Console(markup=False, emoji=False)
    if not console.is_terminal:
        console.width = max(console.width, _WIDE)
    return console


def show(table: Table, console: Console) -> None:
    """Print a table with its title and notes.

    Where it is wider than the terminal, columns that it can spare are left out, which is said; if that is not enough,
    the others follow in blocks below each other, each with the first column.
    """
    if table.title:
        console.print(table.title, style="bold")
    shown, spared = _without_spare(table, console.width)
    for number, block in enumerate(_blocks(shown, console.width)):
        if number:
            console.print()
        console.print(_rich(block))
    for note in table.notes:
        console.print(note, soft_wrap=True, style="italic" if console.is_terminal else "")
    if spared:
        console.print(f"left out, for want of room: {', '.join(spared)}", soft_wrap=True, style="dim")


def _without_spare(table: Table, width: int) -> tuple[Table, list[str]]:
    spared: list[str] = []
    shown = table
    for heading in (heading for heading in reversed(table.columns) if heading in table.spare):
        if _width(shown) <= width:
            break
        spared.insert(0, heading)
        shown = shown.select(tuple(place for place, one in enumerate(shown.columns) if one != heading))
    return shown, spared


def _blocks(table: Table, width: int) -> Iterator[Table]:
    """The table cut into parts that are no wider than the terminal, where columns are."""
    widths = _widths(table)
    places: list[int] = []
    for place in range(1, len(table.columns)):
        taken = sum(widths[one] + _GAP for one in (0, *places, place)) - _GAP
        if places and taken > width:
            yield table.select((0, *places))
            places = []
        places.append(place)
    yield table.select((0, *places))


def _widths(table: Table) -> list[int]:
    return [
        max(cell_len(text) for text in (heading, *(row.cells[place] for row in table.rows)))
        for place, heading in enumerate(table.columns)
    ]


def _width(table: Table) -> int:
    return sum(width + _GAP for width in _widths(table)) - _GAP


def _rich(table: Table) -> RichTable:
    made = RichTable(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, 1))
    for place, heading in enumerate(table.columns):
        made.add_column(heading, justify="left" if table.is_text(place) else "right", no_wrap=True)
    for row in table.rows:
        style = " ".join(word for word in (row.style, "bold" if row.strong else "") if word)
        made.add_row(*row.cells, style=style or None, end_section=row.ends)
    return made

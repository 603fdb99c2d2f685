"""A table in a terminal: rows stay whole, however narrow it is."""

from __future__ import annotations

from collections.abc import Iterator

from rich import box
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table as RichTable

from etac_ros.tables.table import Table

_GAP, _SMALL_GAP = 3, 2
"""Blanks between two columns, and where the terminal is narrow."""
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

    Where it is wider than the terminal its columns move together, then those that it can spare are left out, which is
    said; if that is not enough, the others follow in blocks below each other, each with the first column. A text that
    alone is too long for the terminal goes on below itself.
    """
    if table.title:
        console.print(table.title, style="bold")
    gap = _GAP if _width(table, _GAP) <= console.width else _SMALL_GAP
    shown, spared = _without_spare(table, console.width)
    for number, block in enumerate(_blocks(shown, console.width)):
        if number:
            console.print()
        console.print(_rich(block, gap, too_wide=_width(block, gap) > console.width))
    for note in table.notes:
        console.print(note, style="italic" if console.is_terminal else "", soft_wrap=not console.is_terminal)
    if spared:
        console.print(f"left out, for want of room: {', '.join(spared)}", style="dim")


def _without_spare(table: Table, width: int) -> tuple[Table, list[str]]:
    spared: list[str] = []
    shown = table
    for heading in (heading for heading in reversed(table.columns) if heading in table.spare):
        if _width(shown, _SMALL_GAP) <= width:
            break
        spared.insert(0, heading)
        shown = shown.select(tuple(place for place, one in enumerate(shown.columns) if one != heading))
    return shown, spared


def _blocks(table: Table, width: int) -> Iterator[Table]:
    """The table cut into parts that are no wider than the terminal, where columns are."""
    places: list[int] = []
    for place in range(1, len(table.columns)):
        if places and _width(table.select((0, *places, place)), _SMALL_GAP) > width:
            yield table.select((0, *places))
            places = []
        places.append(place)
    yield table.select((0, *places))


def _width(table: Table, gap: int) -> int:
    columns = zip(table.columns, *(row.cells for row in table.rows), strict=True)
    return sum(max(map(cell_len, column)) + gap for column in columns) - gap


def _rich(table: Table, gap: int, too_wide: bool = False) -> RichTable:
    # The box itself parts two columns by one blank.
    right = 1
    made = RichTable(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, right, 0, gap - 1 - right))
    for place, heading in enumerate(table.columns):
        left, folds = table.is_text(place), too_wide and place > 0
        made.add_column(heading, justify="left" if left else "right", no_wrap=not folds, overflow="fold")
    for row in table.rows:
        style = " ".join(word for word in (row.style, "bold" if row.strong else "") if word)
        made.add_row(*row.cells, style=style or None, end_section=row.ends)
    return made

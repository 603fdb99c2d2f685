"""A table as Markdown."""

from __future__ import annotations

from etac_ros.tables.table import Table


def markdown_lines(table: Table) -> list[str]:
    """The lines of a table; title and notes are left to the page around it."""
    head = [_escaped(heading) for heading in table.columns]
    rule = ["---" if table.is_text(place) else "---:" for place in range(len(table.columns))]
    rows = [[_escaped(cell) for cell in row.cells] for row in table.rows]
    return [f"| {' | '.join(head)} |", f"|{'|'.join(rule)}|", *(f"| {' | '.join(cells)} |" for cells in rows)]


def _escaped(cell: str) -> str:
    return cell.replace("|", "&#124;").replace("\n", " ")

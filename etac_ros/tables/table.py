"""A table as rows of text; how it looks is its renderer's business."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Row:
    """One line of a table.

    Attributes
    ----------
    cells
        As many as the table has columns.
    strong
        Whether it is a total.
    ends
        Whether something ends with it, so that a line is drawn below.
    style
        A colour for terminals; empty for the usual one.
    """

    cells: tuple[str, ...]
    strong: bool = False
    ends: bool = False
    style: str = ""


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes
    ----------
    title
        Heads its section; empty where it needs none.
    columns
        Headings; the first column is text, all others are numbers unless they are named in ``texts``.
    rows
        Its lines.
    notes
        Sentences below it.
    texts
        Headings of further columns of text.
    groups
        Headings above the headings, each with the number of columns that it spans.
    spare
        Headings of columns that a narrow terminal leaves out first.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    notes: tuple[str, ...] = ()
    texts: frozenset[str] = frozenset()
    groups: tuple[tuple[str, int], ...] = ()
    spare: frozenset[str] = frozenset()

    def is_text(self, place: int) -> bool:
        """Whether a column is text, and not numbers."""
        return place == 0 or self.columns[place] in self.texts

    def select(self, places: tuple[int, ...]) -> Table:
        """The table with these columns alone; headings above the headings are given up."""
        rows = tuple(replace(row, cells=tuple(row.cells[place] for place in places)) for row in self.rows)
        columns = tuple(self.columns[place] for place in places)
        texts = frozenset(self.columns[place] for place in places if self.is_text(place))
        return replace(self, columns=columns, rows=rows, texts=texts, groups=())

    def without_empty_columns(self) -> Table:
        """The table without columns in which nothing stands."""
        full = tuple(place for place in range(len(self.columns)) if any(row.cells[place] for row in self.rows))
        return self if len(full) == len(self.columns) or not self.rows else self.select(full)

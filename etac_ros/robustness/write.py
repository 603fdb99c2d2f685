"""Maps of robustness as tables, for a terminal and for a page."""

from __future__ import annotations

from collections.abc import Sequence

from etac_ros.robustness.grid import Cell, Map, Robustness
from etac_ros.tables.markdown import markdown_lines
from etac_ros.tables.table import Row, Table

_HEAD = """# Networks

Written by `etac robustness --write docs/networks.md`; the numbers are those of the runs.

How much loss and delay a law bears: every network link of a scenario loses messages one by one with the same
probability, and delivers the others after the same delay, rounded up to whole ticks. Nothing is sent again. Each cell
is one run with the scenario's seed, in process: network messages, and the largest attitude error of any spacecraft over
the steady part [deg]. **{mark}** marks runs that do not hold: a watch ended them, or that error is more than {factor:g}
times the one of the same loop over ideal links. One draw of losses is one draw: near the edge another seed may fall on
the other side.
"""
_FAILS = "fails"


def map_table(found: Robustness, which: Map) -> Table:
    """One map: a row for each loss, a column for each delay."""
    rows = tuple(
        Row((f"{loss:.3g}", *(_words(which.at(loss, delay)) for delay in found.delays_s))) for loss in found.losses
    )
    columns = ("loss", *(f"{delay:g} s" for delay in found.delays_s))
    notes = ("Network messages; largest steady attitude error [deg].",)
    return Table(f"{found.scenario.name}, {which.variant}", columns, rows, notes)


def furthest_table(all_found: Sequence[Robustness]) -> Table:
    """Up to what loss and what delay each loop holds."""
    rows = []
    for found in all_found:
        for place, which in enumerate(found.maps):
            loss, delay = which.furthest_loss(), which.furthest_delay()
            cells = ("none" if loss is None else f"{loss:.3g}", "none" if delay is None else f"{delay:g}")
            rows.append(Row((found.scenario.name if place == 0 else "", which.variant, *cells)))
    columns = ("scenario", "loop", "loss, without delay", "delay [s], without loss")
    notes = ("The largest of the grid up to which every run holds.",)
    return Table("How far each loop holds", columns, tuple(rows), notes, frozenset({"loop"}))


def page(all_found: Sequence[Robustness]) -> str:
    """The page ``networks.md``."""
    parts = [_HEAD.format(mark=_FAILS, factor=all_found[0].factor)]
    parts.append(_section(furthest_table(all_found)))
    parts += [_section(map_table(found, which)) for found in all_found for which in found.maps]
    return "\n".join(parts)


def _section(table: Table) -> str:
    notes = [*table.notes, ""] if table.notes else []
    return "\n".join([f"## {table.title}", "", *markdown_lines(table), "", *notes])


def _words(cell: Cell) -> str:
    error = "" if cell.error_deg is None else f"; {cell.error_deg:.2g}"
    return f"{cell.messages:,}{error}" + ("" if cell.holds else f" {_FAILS}")

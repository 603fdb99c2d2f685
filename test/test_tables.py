"""One table, three renderers: nothing is lost, and rows stay whole in a terminal of any width."""

from __future__ import annotations

from io import StringIO

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from etac_ros.cli.show import run_tables
from etac_ros.metrics.summary import with_measured
from etac_ros.runs import baseline_of, run_in_process
from etac_ros.scenario.load import load
from etac_ros.tables.html import html_section
from etac_ros.tables.markdown import markdown_lines
from etac_ros.tables.numbers import band, number
from etac_ros.tables.table import Row, Table
from etac_ros.tables.terminal import show

WORDS = st.text("abc|<&", min_size=1, max_size=9)


def printed(table: Table, width: int) -> list[str]:
    out = StringIO()
    show(table, Console(file=out, width=width, markup=False, emoji=False))
    return out.getvalue().splitlines()


@st.composite
def tables(draw: st.DrawFn) -> Table:
    columns = draw(st.lists(WORDS, min_size=2, max_size=6, unique=True))
    rows = draw(st.lists(st.lists(WORDS, min_size=len(columns), max_size=len(columns)), min_size=1, max_size=4))
    return Table("title", tuple(columns), tuple(Row(tuple(cells)) for cells in rows))


@given(tables(), st.integers(24, 120))
def test_every_cell_is_printed_and_no_line_is_wider_than_the_terminal(table: Table, width: int) -> None:
    lines = printed(table, width)
    assert max(map(len, lines)) <= width
    found = [cell for line in lines for cell in line.split()]
    for cell in (*table.columns, *(cell for row in table.rows for cell in row.cells)):
        assert cell in found


def test_blocks_repeat_the_first_column() -> None:
    table = Table("", ("name", "a" * 20, "b" * 20), (Row(("row", "1", "2")),))
    assert sum(line.startswith("row") for line in printed(table, 40)) == 2
    assert sum(line.startswith("row") for line in printed(table, 80)) == 1


def test_what_can_be_spared_is_left_out_first_and_named() -> None:
    table = Table("", ("name", "a" * 20, "b" * 20), (Row(("row", "1", "2")),), spare=frozenset({"a" * 20}))
    lines = printed(table, 40)
    assert sum(line.startswith("row") for line in lines) == 1
    assert f"left out, for want of room: {'a' * 20}" in " ".join(line.strip() for line in lines)


@given(tables())
def test_markdown_has_a_cell_for_a_cell(table: Table) -> None:
    for line in markdown_lines(table):
        assert line.count("|") == len(table.columns) + 1


@given(tables())
def test_html_escapes_what_stands_in_cells(table: Table) -> None:
    text = html_section(table)
    assert text.count("<tr") == len(table.rows) + 1
    assert text.count("<td") == len(table.rows) * (len(table.columns) - 1)


def test_columns_in_which_nothing_stands_are_left_out() -> None:
    table = Table("", ("plant", "angle", "energy"), (Row(("/servo", "", "1")),), texts=frozenset({"energy"}))
    slim = table.without_empty_columns()
    assert slim.columns == ("plant", "energy")
    assert slim.rows[0].cells == ("/servo", "1")
    assert slim.is_text(1)


def test_numbers() -> None:
    assert [number(value) for value in (84.0, 1e6, 0.12345678, 2.5e-6)] == ["84", "1,000,000", "0.1235", "2.5e-06"]
    assert (band(1.0, 1.0), band(72.0, 96.0)) == ("", "72 to 96")


@pytest.mark.parametrize("width", [80, 100, 160])
@pytest.mark.parametrize(("name", "overrides"), [("wu2018", ["duration_s=20"]), ("xie2021", ["duration_s=0.5"])])
def test_tables_of_a_run_fit_the_terminal(name: str, overrides: list[str], width: int) -> None:
    scenario = load(name, None, overrides)
    baseline = baseline_of(scenario)
    assert baseline is not None
    summary = with_measured(run_in_process(scenario).summary, run_in_process(baseline).summary)
    for table in run_tables(scenario, summary):
        lines = printed(Table("", table.columns, table.rows, (), table.texts, (), table.spare), width)
        assert max(map(len, lines)) <= width
        assert not any("…" in line for line in lines)

"""The rows as Markdown and as JSON."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from itertools import groupby

from etac_ros import __version__
from etac_ros.reproduce.rows import Effort, Row
from etac_ros.reproduce.verdict import RULE, Verdict
from etac_ros.tables.markdown import markdown_lines
from etac_ros.tables.numbers import number
from etac_ros.tables.table import Row as TableRow
from etac_ros.tables.table import Table

_HEAD = ("figure", "where", "published", "measured", "5 to 95 %", "runs", "verdict", "why")
_TEXTS = frozenset({"where", "verdict", "why"})


def rows_table(rows: Sequence[Row]) -> Table:
    """The rows as a table."""
    return Table("", _HEAD, tuple(TableRow(_cells(row)) for row in rows), texts=_TEXTS)


def _cells(row: Row) -> tuple[str, ...]:
    return (
        row.label,
        row.where,
        f"{'≤ ' if row.is_limit else ''}{number(row.published)}",
        "-" if row.measured is None else number(row.measured),
        "" if row.spread is None else f"{number(row.spread.low)} to {number(row.spread.high)}",
        "" if row.spread is None else f"{row.spread.runs}",
        row.verdict.value,
        row.reason,
    )


def tally(rows: Sequence[Row]) -> str:
    """How many figures there are of each verdict."""
    counts = Counter(row.verdict for row in rows)
    parts = [f"{counts[verdict]} {verdict.value}" for verdict in Verdict if counts[verdict]]
    return f"{len(rows)} published figures: {', '.join(parts)}"


def markdown(rows: Sequence[Row], effort: Effort, command: str) -> str:
    """The whole table as a page.

    Parameters
    ----------
    rows
        In the order in which they are shown.
    effort
        What was run.
    command
        The command that writes this very page.
    """
    lines = [
        "# Every published figure beside a measured one",
        "",
        f"Written by `{command}`, etac_ros {__version__}. Measured: one run with the engine `{effort.engine}`. Band: "
        f"up to {effort.runs} runs in process, dispersed as the scenario's section `dispersion` says; fewer where a "
        "run takes long.",
        "",
        RULE,
        "",
        f"{tally(rows)}.",
    ]
    for scenario, of_scenario in groupby(rows, key=lambda row: row.scenario):
        lines += ["", f"## {scenario}"]
        for variant, of_variant in groupby(of_scenario, key=lambda row: row.variant):
            lines += ["", f"### {variant or 'as the file stands'}", ""]
            lines += markdown_lines(rows_table(list(of_variant)))
    return "\n".join(lines) + "\n"


def as_json(rows: Sequence[Row], effort: Effort) -> str:
    """The rows for programs."""
    content = {"version": __version__, "effort": asdict(effort), "rule": RULE, "rows": [asdict(row) for row in rows]}
    return json.dumps(content, indent=2) + "\n"

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

_HEAD = ("figure", "where", "published", "measured", "5 to 95 %", "runs", "verdict", "why")


def number(value: float) -> str:
    """A figure for people: whole numbers whole, others to four digits."""
    return f"{value:,.0f}" if float(value).is_integer() and abs(value) < 1e9 else f"{value:,.4g}"


def cells(row: Row) -> tuple[str, ...]:
    """The columns of a row as text, in the order of the head."""
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
            lines += [f"| {' | '.join(_HEAD)} |", f"|{'---|' * len(_HEAD)}"]
            lines += [f"| {' | '.join(cell.replace('|', '&#124;') for cell in cells(row))} |" for row in of_variant]
    return "\n".join(lines) + "\n"


def as_json(rows: Sequence[Row], effort: Effort) -> str:
    """The rows for programs."""
    content = {"version": __version__, "effort": asdict(effort), "rule": RULE, "rows": [asdict(row) for row in rows]}
    return json.dumps(content, indent=2) + "\n"

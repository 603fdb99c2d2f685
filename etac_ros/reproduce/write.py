"""The rows as Markdown and as JSON."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from itertools import groupby

from etac_ros import __version__
from etac_ros.metrics.cells import BAND, printed, spread_cell
from etac_ros.metrics.stored import Stored
from etac_ros.metrics.verdict import RULE, Verdict
from etac_ros.reproduce.headline import HEADLINE, headline
from etac_ros.reproduce.rows import Row
from etac_ros.tables.markdown import markdown_lines
from etac_ros.tables.numbers import number
from etac_ros.tables.table import Row as TableRow
from etac_ros.tables.table import Table

_HEAD = ("figure", "where", "kind", "paper", "measured", BAND, "in sd", "off [%]", "verdict", "why")
_TEXTS = frozenset({"where", "kind", "verdict", "why"})


def rows_table(rows: Sequence[Row]) -> Table:
    """The rows as a table."""
    return Table("", _HEAD, tuple(TableRow(_cells(row)) for row in rows), texts=_TEXTS)


def _cells(row: Row) -> tuple[str, ...]:
    sds, percent = row.judgement.sds, row.judgement.percent
    return (
        row.label,
        row.paper.where,
        row.paper.kind.value,
        printed(row.paper),
        "-" if row.measured is None else number(row.measured),
        spread_cell(row.paper.spread),
        "" if sds is None else f"{sds:+.1f}",
        "" if percent is None else _percent(percent),
        row.verdict.value,
        row.reason,
    )


def _percent(value: float) -> str:
    return f"{value:+,.0f}" if abs(value) >= 1000.0 else f"{value:+.1f}"


def tally(rows: Sequence[Row]) -> str:
    """The headline, then how many rows there are of each verdict."""
    counts = Counter(row.verdict for row in rows)
    parts = [f"{counts[verdict]} {verdict.value}" for verdict in Verdict if counts[verdict]]
    return f"{headline(rows)}: {', '.join(parts)}"


def markdown(rows: Sequence[Row], engine: str, command: str, stored: Stored | None) -> str:
    """The whole table as a page.

    Parameters
    ----------
    rows
        In the order in which they are shown.
    engine
        What measured.
    command
        The command that writes this very page.
    stored
        The sweeps from which the spreads are.
    """
    lines = [
        "# Every published figure beside a measured one",
        "",
        f"**{headline(rows)}.**",
        "",
        f"Written by `{command}`, etac_ros {__version__}. Measured: one run with the engine `{engine}`. "
        + _spread(stored),
        "",
        RULE,
        "",
        HEADLINE,
        "",
        "Rows by verdict - " + tally(rows).rpartition(": ")[2] + ".",
        "",
        *_by_scenario(rows),
    ]
    for scenario, of_scenario in groupby(rows, key=lambda row: row.scenario):
        lines += ["", f"## {scenario}"]
        if scenario in _NOTES:
            lines += ["", _NOTES[scenario]]
        for variant, of_variant in groupby(of_scenario, key=lambda row: row.variant):
            lines += ["", f"### {variant or 'as the file stands'}", ""]
            lines += markdown_lines(rows_table(list(of_variant)))
    return "\n".join(lines) + "\n"


_NOTES = {
    "xie2021": "A correction was published, Applied Sciences 12 (2022) 2352. Its text was not at hand, so that the "
    "figures below are those of the first print.",
    "flexible": "Tables 1 to 5 are lost from the text that was at hand; what stands here is quoted in its prose.",
}
"""What a reader has to know of a paper before its figures."""


def _spread(stored: Stored | None) -> str:
    if stored is None or not stored.sweeps:
        return "No dispersed runs are stored."
    runs = sorted({one.runs for one in stored.sweeps})
    seeds = sorted({one.seed for one in stored.sweeps})
    versions = ", ".join(f"{name} {version}" for name, version in stored.versions.items())
    return (
        f"{BAND}, and the standard deviation: {' or '.join(map(str, runs))} dispersed runs of each variant with seed "
        f"{', '.join(map(str, seeds))}, stored in etac_ros/metrics/stored.json by `{stored.made_by}` ({versions}); "
        f"{stored.dispersion}. `in sd`: how far the mean of these is from the paper, in standard deviations; `off`: "
        "how far the measured figure is, in per cent."
    )


def _by_scenario(rows: Sequence[Row]) -> list[str]:
    found = []
    for scenario, group in groupby(rows, key=lambda row: row.scenario):
        of_scenario = list(group)
        one = headline(of_scenario)
        fits = dict.fromkeys(row.paper.fitted_to for row in of_scenario if row.paper.fitted_to)
        figures = (f"{count:,}" for count in (one.figures, one.reproduced, one.near, one.limits, one.kept))
        found.append(TableRow((scenario, *figures, "; ".join(fits))))
    columns = ("system", "independent figures", "reproduced", "near", "limits", "kept", "fitted")
    return markdown_lines(Table("", columns, tuple(found), texts=frozenset({"fitted"})))


def as_json(rows: Sequence[Row], engine: str) -> str:
    """The rows for programs."""
    content = {
        "version": __version__,
        "engine": engine,
        "rule": RULE,
        "headline": asdict(headline(rows)),
        "rows": [
            {
                "scenario": row.scenario,
                "variant": row.variant,
                "label": row.label,
                "paper": row.paper.model_dump(mode="json"),
                "measured": row.measured,
                "verdict": row.verdict.value,
                "sds": row.judgement.sds,
                "percent": row.judgement.percent,
                "reason": row.reason,
            }
            for row in rows
        ],
    }
    return json.dumps(content, indent=2) + "\n"

"""``etac compare``: the variants of a scenario beside each other and beside the paper."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.progress import track

from etac_ros.errors import ScenarioError
from etac_ros.metrics.cells import BAND, energy_heading, falls_short, paper_cells
from etac_ros.metrics.summary import Summary, Totals, traffic_by_namespace, with_measured
from etac_ros.runs import baseline_summary, run_in_process
from etac_ros.scenario.load import Scenario, load
from etac_ros.tables.numbers import number, optional
from etac_ros.tables.table import Row, Table
from etac_ros.tables.terminal import show

_MOST_COLUMNS = 5


def compare(name: str, variants: Sequence[str], overrides: Sequence[str], console: Console) -> None:
    """Run variants in process and show them beside each other.

    Parameters
    ----------
    name
        The scenario.
    variants
        Which; none takes those that the scenario names under ``compare``, or all.
    overrides
        ``key=value`` assignments for all of them.
    console
        Where to.

    Raises
    ------
    ScenarioError
        If there is no such variant, or nothing to compare.
    """
    scenario = load(name, None, overrides)
    chosen = list(variants or scenario.run.compare or scenario.variants)
    if not chosen:
        raise ScenarioError(str(scenario.path), "has no variants to compare")
    scenarios = [load(name, variant, overrides) for variant in chosen]
    baselines: dict[str, Summary | None] = {}
    summaries = [
        with_measured(run_in_process(one).summary, baseline_summary(one, baselines))
        for one in track(scenarios, f"{scenario.name}: running variants", console=console, transient=True)
    ]
    console.print(f"\n{scenario.run.title or scenario.name}: variants beside each other", style="bold")
    published = _figures(scenarios, summaries)
    if published.rows:
        console.print(
            "against the paper, where it publishes the figure (! not the paper's: etac reproduce says how far)"
        )
        show(published, console)
        console.print()
    for reason in dict.fromkeys(summary.published_not for summary in summaries if summary.published_not):
        console.print(f"no figures of the paper: {reason}\n", soft_wrap=True)
    show(_own_figures(scenarios, summaries), console)
    traffic = _traffic(scenarios, summaries)
    if traffic is not None:
        console.print("\nwhat crosses the network, and what stays inside each namespace (messages / payload bytes)")
        show(traffic, console)


def _figures(scenarios: Sequence[Scenario], summaries: Sequence[Summary]) -> Table:
    rows: list[Row] = []
    for scenario, summary in zip(scenarios, summaries, strict=True):
        figures = summary.figures
        shown = [(key, figure) for key, figure in summary.paper.items() if key in figures]
        for place, (key, figure) in enumerate(shown):
            value = figures[key]
            published, band = paper_cells(figure)
            cells = (number(value), published, band + ("!" if falls_short(value, figure) else " "))
            name = scenario.variant or "" if place == 0 else ""
            rows.append(Row((name, summary.label_of(key), *cells), ends=place == len(shown) - 1))
    return Table("", ("variant", "figure", "this run", "paper", BAND), tuple(rows), texts=frozenset({"figure"}))


def _own_figures(scenarios: Sequence[Scenario], summaries: Sequence[Summary]) -> Table:
    """What every run has, for variants beside which nothing published stands."""
    rows = []
    for scenario, summary in zip(scenarios, summaries, strict=True):
        instants = " / ".join(f"{triggers.count:,}" for triggers in summary.triggers.values())
        network = summary.network
        counts = (network.messages, network.deliveries, network.payload_bytes, summary.internal.messages)
        energy = summary.value("energy_n2m2s")
        rows.append(Row((scenario.variant or "", instants, *(f"{count:,}" for count in counts), optional(energy))))
    columns = (
        "variant", "triggering instants", "messages", "deliveries", "payload [bytes]", "internal messages",
        energy_heading(one for summary in summaries for one in summary.performance.values()),
    )  # fmt: skip
    return Table("", columns, tuple(rows), spare=frozenset({"internal messages"}))


def _traffic(scenarios: Sequence[Scenario], summaries: Sequence[Summary]) -> Table | None:
    """Traffic between and inside namespaces; None where there are too many pairs of them for a column each."""
    parts = [
        traffic_by_namespace(scenario.build(), summary) for scenario, summary in zip(scenarios, summaries, strict=True)
    ]
    columns = sorted({column for part in parts for column in part})
    if len(columns) > _MOST_COLUMNS:
        return None
    nothing = Totals(messages=0, deliveries=0, payload_bytes=0, cdr_bytes=0)
    rows = []
    for scenario, part in zip(scenarios, parts, strict=True):
        cells = [part.get(column, nothing) for column in columns]
        counts = (f"{cell.messages:,} / {cell.payload_bytes:,}" for cell in cells)
        rows.append(Row((scenario.variant or "", *counts)))
    return Table("", ("variant", *columns), tuple(rows))

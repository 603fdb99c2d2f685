"""``etac compare``: the variants of a scenario beside each other and beside the paper."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.progress import track

from etac_ros.cli.show import band, figure_label, number, plain_table
from etac_ros.errors import RunHalted, ScenarioError
from etac_ros.metrics.summary import Summary, Totals, traffic_by_namespace, with_measured
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import Scenario, baseline_of, load

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
        with_measured(run_in_process(one).summary, _baseline(one, baselines))
        for one in track(scenarios, f"{scenario.name}: running variants", console=console, transient=True)
    ]
    console.print(f"\n{scenario.run.title or scenario.name}: variants beside each other", style="bold")
    console.print("against the paper, where it publishes the figure")
    _show_figures(scenarios, summaries, console)
    console.print("\nwhat crosses the network, and what stays inside each namespace (messages / payload bytes)")
    _show_traffic(scenarios, summaries, console)


def _baseline(scenario: Scenario, known: dict[str, Summary | None]) -> Summary | None:
    """What a variant's own baseline did; many variants share one. None where a watch ended it, or there is none."""
    baseline = baseline_of(scenario)
    if baseline is None:
        return None
    if baseline.digest not in known:
        try:
            known[baseline.digest] = run_in_process(baseline).summary
        except RunHalted:
            known[baseline.digest] = None
    return known[baseline.digest]


def _show_figures(scenarios: Sequence[Scenario], summaries: Sequence[Summary], console: Console) -> None:
    table = plain_table("variant", "figure")
    for column in ("this run", "paper", "band"):
        table.add_column(column, justify="right", no_wrap=True)
    for scenario, summary in zip(scenarios, summaries, strict=True):
        rows = [name for name in scenario.published if name in summary.measured]
        for place, name in enumerate(rows):
            figure = summary.published[name]
            table.add_row(
                scenario.variant or "" if place == 0 else "",
                figure_label(name, summary),
                number(summary.measured[name]),
                number(figure.value),
                band(figure),
                end_section=place == len(rows) - 1,
            )
    console.print(table)


def _show_totals(scenarios: Sequence[Scenario], summaries: Sequence[Summary], console: Console) -> None:
    """All of a formation together: a column for each pair of namespaces would be too many."""
    table = plain_table("variant")
    for column in ("triggering instants", "network messages", "deliveries", "network payload", "internal messages"):
        table.add_column(column, justify="right", no_wrap=True)
    for scenario, summary in zip(scenarios, summaries, strict=True):
        instants = " / ".join(f"{triggers.count:,}" for triggers in summary.triggers.values())
        network = summary.network
        cells = (network.messages, network.deliveries, network.payload_bytes, summary.internal.messages)
        table.add_row(scenario.variant or "", instants, *(f"{cell:,}" for cell in cells))
    console.print(table)


def _show_traffic(scenarios: Sequence[Scenario], summaries: Sequence[Summary], console: Console) -> None:
    parts = [
        traffic_by_namespace(scenario.build(), summary) for scenario, summary in zip(scenarios, summaries, strict=True)
    ]
    columns = sorted({column for part in parts for column in part})
    if len(columns) > _MOST_COLUMNS:
        _show_totals(scenarios, summaries, console)
        return
    table = plain_table("variant")
    for column in columns:
        table.add_column(column, justify="right", no_wrap=True)
    for scenario, part in zip(scenarios, parts, strict=True):
        cells = [part.get(column, Totals(messages=0, deliveries=0, payload_bytes=0, cdr_bytes=0)) for column in columns]
        table.add_row(scenario.variant or "", *(f"{cell.messages:,} / {cell.payload_bytes:,}" for cell in cells))
    console.print(table)

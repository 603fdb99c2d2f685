"""One row for each published figure: measured over one run, with its stored spread, judged by the one rule."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from etac_ros.metrics.figures import FigureKey, label
from etac_ros.metrics.summary import PublishedValue, Summary, published_values, with_measured
from etac_ros.metrics.verdict import Judgement, Verdict
from etac_ros.reproduce.kept import Kept
from etac_ros.reproduce.variants import title_of
from etac_ros.runs import RosOptions, baseline_summary, run_in_process, run_over_ros
from etac_ros.scenario.load import Scenario

Say = Callable[[str], None]
Baselines = dict[str, Summary | None]
"""What baselines did, by digest; None where a watch ended one."""


@dataclass(frozen=True)
class Row:
    """A published figure and what became of it.

    Attributes
    ----------
    scenario, variant
        What was run; an empty variant is the scenario as it stands.
    key, label
        Which figure, and what it is called.
    paper
        The published figure.
    measured
        None where the run has no such figure.
    judgement
        By the rule.
    reason
        Why it does not come out, or what was fitted.
    of_formation
        Whether several spacecraft have the figure, each its own.
    """

    scenario: str
    variant: str
    key: FigureKey
    label: str
    paper: PublishedValue
    measured: float | None
    judgement: Judgement
    reason: str
    of_formation: bool

    @property
    def verdict(self) -> Verdict:
        """By the rule."""
        return self.judgement.verdict


def rows_of(
    scenario: Scenario,
    engine: str,
    folder: Path,
    say: Say,
    baselines: Baselines | None = None,
    kept: Kept | None = None,
) -> list[Row]:
    """Measure a variant and judge its published figures.

    Parameters
    ----------
    scenario
        The variant.
    engine
        ``ros`` or ``inprocess``.
    folder
        Where bags go.
    say
        Told what is being done.
    baselines
        Those that were run before, by digest: many variants share one. Added to.
    kept
        What was measured before an interruption. Added to.
    """
    measured = None if kept is None else kept.of(scenario)
    if measured is None:
        say(f"{title_of(scenario)}: one run over {engine}")
        measured = _measured(scenario, engine, folder, {} if baselines is None else baselines).figures
        if kept is not None:
            kept.add(scenario, measured)
    graph = scenario.build()
    return [
        _row(scenario, figure, measured.get(key), len(graph.plants) > 1)
        for key, figure in published_values(scenario, graph).items()
    ]


def _measured(scenario: Scenario, engine: str, folder: Path, baselines: Baselines) -> Summary:
    if engine == "ros":
        summary = run_over_ros(scenario, folder / title_of(scenario).replace(" ", "_"), RosOptions()).summary
    else:
        summary = run_in_process(scenario).summary
    return with_measured(summary, baseline_summary(scenario, baselines))


def _row(scenario: Scenario, figure: PublishedValue, measured: float | None, of_formation: bool) -> Row:
    judgement = figure.judge(measured)
    return Row(
        scenario=scenario.name,
        variant=scenario.variant or "",
        key=figure.key,
        label=label(figure.key, figure.label),
        paper=figure,
        measured=measured,
        judgement=judgement,
        reason=_reason(figure, judgement),
        of_formation=of_formation,
    )


def _reason(figure: PublishedValue, judgement: Judgement) -> str:
    verdict = judgement.verdict
    fitted = f"fitted: {figure.fitted_to}" if figure.fitted_to else ""
    if verdict in (Verdict.REPRODUCED, Verdict.KEPT, Verdict.FITTED, Verdict.CONSTRUCTED):
        return fitted
    if figure.changed:
        return f"declared otherwise than in the stored sweep: {figure.changed}"
    alone = verdict is Verdict.NOT_REPRODUCED and judgement.percent is not None and abs(judgement.percent) <= _CLOSE
    why = figure.reason or (
        "this run is close to it, the mean of the dispersed ones is not" if alone else _UNEXPLAINED[verdict]
    )
    return "; ".join(part for part in (fitted, why) if part)


_CLOSE = 10.0
"""Per cent."""
_UNEXPLAINED = {
    Verdict.NEAR: "",
    Verdict.NOT_REPRODUCED: "no reading of the paper that was tried gives it",
    Verdict.NOT_KEPT: "no reading of the paper that was tried keeps it",
    Verdict.MISSED: "",
    Verdict.NOT_TESTABLE: "a run does not give it",
}

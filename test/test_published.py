"""Published figures stand beside the run that they were published for, and beside no other."""

from __future__ import annotations

import pytest

from etac_ros.errors import ScenarioError
from etac_ros.metrics.figures import FigureKey
from etac_ros.metrics.published import for_others, stands_beside_paper
from etac_ros.metrics.summary import Summary, Topic, Totals, with_measured
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load

MINE = "published.{}={{value: 1, {}}}"


def test_an_unchanged_scenario_or_variant_stands_beside_the_paper() -> None:
    assert stands_beside_paper(load("wu2018")) is None
    assert stands_beside_paper(load("flexible", "rho1e-5")) is None
    assert stands_beside_paper(load("wu2018", None, ["windows.first=7", "title=mine"])) is None


@pytest.mark.parametrize("change", ["duration_s=10", "sensor.trigger.alpha=0.4", "seed=3", "wire=stamped"])
def test_whatever_bears_on_the_run_does_not(change: str) -> None:
    summary = run_in_process(load("wu2018", None, ["duration_s=10", change])).summary
    assert summary.published == []
    assert change.partition("=")[0] in summary.published_not


@pytest.mark.parametrize("n", [2, 3, 5])
def test_a_formation_of_any_size_runs_and_has_no_figures_of_the_paper(n: int) -> None:
    summary = run_in_process(load("xie2021", None, ["duration_s=0.1", f"formation.n={n}"])).summary
    assert set(summary.triggers) == {f"/sc{i + 1}/sensor" for i in range(n)}
    assert summary.published == []
    assert "formation.n" in summary.published_not
    assert {one.node for one in summary.own} <= {f"/sc{i + 1}/plant" for i in range(n)}


def test_a_formation_as_it_stands_has_its_figures_by_name_and_node() -> None:
    scenario = load("xie2021", None, ["published.source=paper"])
    paper = {key for key in run_in_process(scenario).summary.paper if key.name == "triggers"}
    assert paper == {FigureKey("triggers", f"/sc{i}/sensor") for i in (1, 2, 3, 4)}


@pytest.mark.parametrize(
    ("figure", "found"),
    [
        (MINE.format("mine", "node: /sc9/sensor"), "/sc9/sensor"),
        (MINE.format("triggers", "label: mine"), "is missing"),
        (MINE.format("mine", "figure: triggers, node: /sc1/sensor"), "stands beside the figure"),
    ],
)
def test_a_figure_that_belongs_to_nobody_or_is_there_twice_is_refused(figure: str, found: str) -> None:
    with pytest.raises(ScenarioError, match=found):
        run_in_process(load("xie2021", None, [figure]))


def summary_of(like: Summary, messages: int, size: int) -> Summary:
    counts = {"messages": messages, "deliveries": messages, "payload_bytes": messages * size, "cdr_bytes": 0}
    topic = Topic(kind="network", type="", first_s=None, last_s=None, **counts)
    return like.model_copy(update={"topics": {"/air": topic}, "network": Totals(**counts)})


def test_bytes_are_compared_as_sent_and_at_equal_content() -> None:
    some = run_in_process(load("wu2018", None, ["duration_s=1"])).summary
    torques, measurements = summary_of(some, 210, 12), summary_of(some, 2000, 60)
    found = with_measured(torques, measurements)
    assert found.value("reduction_percent") == pytest.approx(100.0 * (1.0 - 210 * 12 / (2000 * 60)))  # 97.9
    assert found.value("equal_content_reduction_percent") == pytest.approx(89.5)
    # Where messages are equally large there is one answer.
    alike = with_measured(torques, summary_of(some, 2000, 12))
    assert alike.value("reduction_percent") == pytest.approx(89.5)
    assert alike.value("equal_content_reduction_percent") is None


def test_a_changed_scenario_is_given_away_without_the_papers_figures() -> None:
    changed, unchanged = load("wu2018", None, ["sensor.trigger.alpha=0.4"]), load("wu2018")
    assert for_others(changed).published == {}
    assert for_others(changed).digest == changed.digest
    assert for_others(unchanged).published == unchanged.published

"""Figures of a run: intervals, settling, energy and what is watched, from recordings worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from etac_ros.errors import ScenarioError
from etac_ros.graph.recording import Message, Recording
from etac_ros.metrics.figures import FigureKey, families, key_of, label
from etac_ros.metrics.published import check_measure, held_torque, measure
from etac_ros.metrics.summary import _payload_of
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load
from etac_ros.scenario.schema import Measure, PublishedFigure, Statistic


@pytest.fixture(scope="module")
def wu2018():  # type: ignore[no-untyped-def]
    scenario = load("wu2018", overrides=["duration_s=2"])
    graph = scenario.build()
    states = np.tile(graph.modules["/plant"].plant.initial_state(), (65, 1))  # type: ignore[attr-defined]
    states[:, 4:7] = 0.0
    states[:32, 4] = np.radians(np.linspace(1.0, 0.0, 32))  # below 0.5 deg/s from row 16 on
    torque = [Message(1, 0, 3, np.array([1.0, 0.0, 0.0])), Message(2, 32, 3, np.array([0.0, 2.0, 0.0]))]
    signal = [Message(n + 1, tick, 0, np.zeros(3)) for n, tick in enumerate([0, 8, 40, 48, 60])]
    names = {link.sender: name for name, link in graph.links.items()}
    messages = {name: [] for name in graph.links} | {names["/actuator"]: torque, names["/sensor"]: signal}
    return graph, Recording(messages=messages, truth={"/plant": [(0, states)]})


def value(run, **wanted):  # type: ignore[no-untyped-def]
    return measure(Measure(**wanted), *run)


def test_instants(wu2018) -> None:  # type: ignore[no-untyped-def]
    assert value(wu2018, statistic="count") == 5.0
    assert value(wu2018, statistic="count", from_s=1.25, until_s=1.5) == 2.0
    assert value(wu2018, statistic="min_interval_s") == 8 / 32
    assert value(wu2018, statistic="max_interval_s") == 1.0
    assert value(wu2018, statistic="mean_interval_s") == 60 / 32 / 4
    assert value(wu2018, statistic="mean_interval_s", from_s=1.25) == pytest.approx((8 + 12) / 2 / 32)
    assert value(wu2018, statistic="mean_interval_s", from_s=1.6) is None  # one instant has no interval


def test_energy_is_exact_for_held_torques(wu2018) -> None:  # type: ignore[no-untyped-def]
    assert value(wu2018, statistic="energy_n2m2s") == pytest.approx(1.0 * 1.0 + 4.0 * 1.0)
    assert value(wu2018, statistic="energy_n2m2s", from_s=0.5, until_s=1.5) == pytest.approx(0.5 + 4.0 * 0.5)


def test_the_held_torque_acts_from_its_tick_on(wu2018) -> None:  # type: ignore[no-untyped-def]
    torque = held_torque(*wu2018, "/plant")
    assert torque[31].tolist() == [1.0, 0.0, 0.0]
    assert torque[32].tolist() == [0.0, 2.0, 0.0]


def test_quantities(wu2018) -> None:  # type: ignore[no-untyped-def]
    assert value(wu2018, statistic="largest", quantity="rate") == pytest.approx(1.0)
    assert value(wu2018, statistic="final", quantity="rate") == 0.0
    assert value(wu2018, statistic="largest", quantity="torque") == 2.0
    assert value(wu2018, statistic="largest", quantity="torque", until_s=0.5) == 1.0
    assert value(wu2018, statistic="mean", quantity="torque", until_s=0.5) == 1.0


def test_settling(wu2018) -> None:  # type: ignore[no-untyped-def]
    assert value(wu2018, statistic="settling_time_s", quantity="rate", bound=0.5) == 16 / 32
    assert value(wu2018, statistic="settling_time_s", quantity="rate", bound=2.0) == 0.0
    assert value(wu2018, statistic="settling_time_s", quantity="torque", bound=1.5) is None


def test_a_figure_that_no_run_could_give_is_refused() -> None:
    graph = load("wu2018").build()

    def refused(**wanted) -> str:  # type: ignore[no-untyped-def]
        with pytest.raises(ScenarioError) as caught:
            check_measure(Measure(**wanted), graph, "my.yaml: published.mine.measure")
        return str(caught.value)

    text = refused(statistic="final", quantity="mood")
    assert "my.yaml: published.mine.measure.quantity" in text
    assert "'mood'" in text
    assert "attitude error" in text
    assert "'/plants'" in refused(statistic="final", quantity="rate", node="/plants")
    assert "/sensor" in refused(statistic="count", node="/actuator")


def test_it_is_refused_before_a_run_begins(tmp_path) -> None:  # type: ignore[no-untyped-def]
    figure = "published.mine={value: 1, measure: {statistic: final, quantity: mood}}"
    with pytest.raises(ScenarioError, match="mood"):
        run_in_process(load("wu2018", overrides=[figure]))


def test_a_measure_is_checked_by_itself() -> None:
    with pytest.raises(ValueError, match="bound"):
        Measure(statistic=Statistic.SETTLING_TIME, quantity="rate")
    with pytest.raises(ValueError, match="until_s"):
        Measure(statistic=Statistic.COUNT, from_s=3.0, until_s=2.0)
    with pytest.raises(ValueError, match="printed digits are '2'"):
        PublishedFigure(value=1.0, printed="2")
    for band in ({"low": 0.0}, {"high": 2.0}):  # typed by hand
        with pytest.raises(ValueError, match="Extra inputs"):
            PublishedFigure.model_validate({"value": 1.0, **band})


def test_printed_digits_keep_their_zeros() -> None:
    figure = PublishedFigure.model_validate({"value": "97.50"})
    assert (figure.value, figure.printed) == (97.5, "97.50")
    assert PublishedFigure.model_validate(figure.model_dump()).printed == "97.50"
    assert [PublishedFigure(value=value).printed for value in (84.0, 97.5, 2.0e-5)] == ["84", "97.5", "2e-05"]


def test_labels() -> None:
    assert label(FigureKey("triggers")) == "triggering instants"
    assert label(FigureKey("triggers", "/pm/sensor")) == "triggering instants, /pm/sensor"
    assert label(FigureKey("settled_s"), "settled [s]") == "settled [s]"
    assert label(FigureKey("some_figure")) == "some figure"


def test_figures_of_nodes_whose_names_look_alike_are_kept_apart() -> None:
    nodes = ("/a/b_c", "/a_b/c", "/a_b_c")
    keys = [key_of("triggers", node, nodes) for node in nodes]
    assert len(set(keys)) == len({str(key) for key in keys}) == 3
    assert [FigureKey.parse(str(key)) for key in keys] == keys
    assert key_of("triggers", "/a/b_c", ["/a/b_c"]) == FigureKey("triggers") == FigureKey.parse("triggers")


def test_families_are_figures_of_nodes_of_the_same_name() -> None:
    keys = [FigureKey("triggers", f"/{sc}/sensor") for sc in ("sc1", "sc2")]
    others = [FigureKey("triggers", "/sc1/other"), FigureKey("energy", "/sc1/sensor"), FigureKey("energy")]
    assert families([*keys, *others]) == [{"/sc1": keys[0], "/sc2": keys[1]}]


def test_steady_figures_begin_where_the_scenario_says() -> None:
    usual = run_in_process(load("wu2018", overrides=["duration_s=200"])).summary
    assert usual.steady_from_s == 120.0
    late = run_in_process(load("wu2018", overrides=["duration_s=200", "steady_from_s=10"])).summary
    assert late.steady_from_s == 10.0
    assert late.performance["/plant"].max_attitude_error_deg > usual.performance["/plant"].max_attitude_error_deg
    times = np.array(late.triggers["/sensor"].times_s)
    assert late.triggers["/sensor"].steady_mean_interval_s == pytest.approx(np.diff(times[times >= 10.0]).mean())


def test_the_graph_decides_who_is_meant() -> None:
    graph = load("qi2022").build()
    with pytest.raises(ScenarioError, match="/pm/relative_sensor"):
        check_measure(Measure(statistic=Statistic.COUNT), graph, "my.yaml")


def test_the_payload_of_equal_content_is_that_of_the_network_with_other_sizes() -> None:
    summary = run_in_process(load("wu2018", overrides=["duration_s=20"])).summary
    topics = {name: topic for name, topic in summary.topics.items() if topic.kind == "network"}
    assert len(topics) == 2
    sizes = {name: 8.0 + place for place, name in enumerate(topics)}
    wanted = sum(sizes[name] * topic.messages for name, topic in topics.items())
    (first, second) = topics.values()
    assert _payload_of(summary, sizes) == wanted == 8.0 * first.messages + 9.0 * second.messages > 0.0

"""What a replayed recording says of arrivals, held inputs and energy, held against the run that made it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from toy import toy

from etac_ros.engines.inprocess import InProcess
from etac_ros.graph import replay
from etac_ros.graph.graph import Graph
from etac_ros.graph.module import Arrivals
from etac_ros.graph.plant import PlantModule
from etac_ros.graph.recording import Recording
from etac_ros.metrics.curves import energy as energy_curve
from etac_ros.metrics.summary import Timing, summarise
from etac_ros.parameters import FloatArray
from etac_ros.scenario.load import Scenario, load
from etac_ros.timing.windows import WindowPolicy

LATE = {"delay_ticks": 3, "loss": 0.3}


class Watched:
    """A run whose receivers write down what they were given and what its plants held at each tick."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self.graph: Graph = scenario.build()
        self.given: dict[str, list[tuple[int | None, Arrivals]]] = {name: [] for name in self.graph.modules}
        self._held: dict[str, dict[int, FloatArray]] = {name: {} for name in self.graph.plants}
        for name, module in self.graph.modules.items():
            self._listen(name, module)
        self.recording: Recording = InProcess(self.graph, WindowPolicy(1, 1)).run()

    def _listen(self, name: str, module: Any) -> None:
        receive = module.receive

        def noted(tick: int | None, arrivals: Arrivals, sample: FloatArray | None) -> Any:
            self.given[name].append((tick, arrivals))
            return receive(tick, arrivals, sample)

        module.receive = noted
        if isinstance(module, PlantModule):
            open_window = module.open

            def opened(length: int, stop: Any = None) -> Any:
                # Windows are of one tick: what is held now holds until the next, unless the plant opens anew before.
                self._held[name][module.tick] = module.held.copy()
                return open_window(length, stop)

            module.open = opened  # type: ignore[method-assign]

    def held(self, plant: str) -> FloatArray:
        """What a plant held at each tick."""
        assert list(self._held[plant]) == list(range(self.graph.end_tick))
        return np.array(list(self._held[plant].values()))


def two_actuators(folder: Path, **links: dict[str, Any]) -> Scenario:
    """wu2018 with its controller answered by two actuators, whose links lead to the same input of the plant."""
    base = load("wu2018", None, ["duration_s=40"])
    tree = yaml.safe_load(base.text)
    everywhere = tree["/**"]["ros__parameters"]
    everywhere["links"]["torque_command"]["to"] = ["/actuator", "/second"]
    everywhere["links"]["second_torque"] = {"from": "/second", "to": ["/plant"], "kind": "physical"}
    for name, changes in links.items():
        everywhere["links"][name].update(changes)
    del everywhere["published"]
    tree["/second"] = {"ros__parameters": dict(tree["/actuator"]["ros__parameters"])}
    path = folder / "two.yaml"
    path.write_text(yaml.safe_dump(tree, sort_keys=False))
    return load(str(path))


SCENARIOS = {
    "ideal": {},
    "late and lossy": {"torque": LATE},
    "two links at different ticks": {"second_torque": {"delay_ticks": 5}},
    "two lossy links": {"torque": {"loss": 0.4}, "second_torque": {"delay_ticks": 2, "loss": 0.5}},
}


@pytest.mark.parametrize("links", SCENARIOS.values(), ids=SCENARIOS)
def test_held_inputs_and_energy_are_those_that_the_plant_had(links: dict[str, dict[str, Any]], tmp_path: Path) -> None:
    run = Watched(two_actuators(tmp_path, **links))
    held = replay.held_inputs(run.graph, run.recording, "/plant")["torque"]
    np.testing.assert_array_equal(held.over(0, run.graph.end_tick), run.held("/plant"))
    truth = float((run.held("/plant") ** 2).sum()) / run.graph.ticks_per_second
    assert truth > 0.0
    summary = summarise(
        run.scenario, run.graph, run.recording, "inprocess", Timing(startup_s=0.0, loop_s=0.0, total_s=0.0)
    )
    assert summary.performance["/plant"].energy_n2m2s == pytest.approx(truth, rel=1e-12)
    assert energy_curve(run.graph, run.recording, "/plant").values[-1, 0] == pytest.approx(truth, rel=1e-12)


def test_energy_of_a_part_of_a_run(tmp_path: Path) -> None:
    run = Watched(two_actuators(tmp_path))
    part = (run.held("/plant")[100:700] ** 2).sum() / run.graph.ticks_per_second
    assert replay.energy(run.graph, run.recording, "/plant", 100, 700) == pytest.approx(part, rel=1e-9)
    assert replay.energy(run.graph, run.recording, "/plant", 700, 100) == 0.0


@pytest.mark.parametrize(
    "says",
    [
        {},
        {"delay_ticks": 2},
        {"loss": 0.5},
        LATE,
        {"outages": {"/a/sensor": [0.0, 1.0]}},
        {"jitter": {"exponential_s": 0.3}, "duplication": 0.5},
        {"jitter": {"exponential_s": 0.3, "overtaking": False}, "duplication": 0.5},
        {"delay_s": 0.15, "bursts": {"good_s": 0.5, "bad_s": 0.5}},
    ],
)
def test_arrivals_are_those_that_each_receiver_was_given(says: dict[str, Any], tmp_path: Path) -> None:
    sensors = {"a": {"at": [1, 4, 5, 9, 19]}, "b": {"at": [4, 5, 17, 18]}}
    run = Watched(toy(tmp_path, sensors, a_says={"loss": 0.2}, b_says=says))
    for name in run.graph.modules:
        replayed = replay.arrivals(run.graph, run.recording, name)
        given = [(tick, some) for tick, some in run.given[name] if some]
        assert len(replayed) == len(given)
        for ((tick, _), arrivals), (own_tick, own_arrivals) in zip(replayed.items(), given, strict=True):
            assert own_tick in (tick, None)
            assert [(one.port, one.link) for one in arrivals] == [(one.port, one.link) for one in own_arrivals]
            assert [one.value.tolist() for one in arrivals] == [one.value.tolist() for one in own_arrivals]


def test_what_would_arrive_at_the_end_tick_has_not_arrived(tmp_path: Path) -> None:
    # The run ends at tick 20: what is sent at 16 over a delay of 3 still arrives, what is sent at 17 does not.
    run = Watched(toy(tmp_path, {"b": {"at": [16, 17, 18]}}, b_says={"delay_ticks": 3}))
    link = run.graph.links["b_says"]
    assert [one.tick for one in replay.deliveries(run.graph, run.recording, link, "/a/sensor")] == [19]
    summary = summarise(
        run.scenario, run.graph, run.recording, "inprocess", Timing(startup_s=0.0, loop_s=0.0, total_s=0.0)
    )
    assert (summary.topics[link.topic].messages, summary.topics[link.topic].deliveries) == (3, 2)


def test_a_triggering_instant_counts_once_however_many_links_carry_it(tmp_path: Path) -> None:
    scenario = toy(tmp_path, {"a": {"at": [2, 5]}})
    tree = yaml.safe_load(Path(scenario.path).read_text())
    tree["/**"]["ros__parameters"]["links"]["a_more"] = {
        "from": "/a/sensor", "to": ["/b/sensor"], "kind": "network",
    }  # fmt: skip
    scenario.path.write_text(yaml.safe_dump(tree, sort_keys=False))
    engine = InProcess(load(str(scenario.path)).build(), WindowPolicy(4, 4))
    recording = engine.run()
    assert len(recording.messages["a_says"]) == len(recording.messages["a_more"]) == 2
    graph = load(str(scenario.path)).build()
    assert replay.trigger_ticks(graph, recording, "/a/sensor").tolist() == [2, 5]
    assert engine.master.fired["/a/sensor"] == 2


def test_a_staircase_holds_each_value_until_the_next() -> None:
    stairs = replay.Staircase(np.array([3, 5]), np.array([[1.0], [2.0]]))
    np.testing.assert_array_equal(stairs.over(2, 5).ravel(), [np.nan, 1.0, 1.0, 2.0, 2.0])


def test_the_input_of_a_plant_is_the_sum_of_what_its_links_hold(tmp_path: Path) -> None:
    """By hand, without the hold that plant and replay share."""
    run = Watched(two_actuators(tmp_path, second_torque={"delay_ticks": 5}))
    total = np.zeros((run.graph.end_tick, 3))
    for link in run.graph.hears["/plant"]:
        for message in run.recording.messages[link.name]:
            total[message.tick + link.channel.delay_ticks :] += message.value - _before(
                run, link.name, message.sequence
            )
    held = replay.held_inputs(run.graph, run.recording, "/plant")["torque"]
    np.testing.assert_allclose(held.over(0, run.graph.end_tick), total, atol=1e-12)


def _before(run: Watched, link: str, sequence: int) -> FloatArray:
    return np.zeros(3) if sequence == 1 else run.recording.messages[link][sequence - 2].value


def test_samples_inside_a_module_are_those_on_which_it_could_act() -> None:
    scenario = load("shi2022", None, ["duration_s=0.5"])
    graph = scenario.build()
    recording = InProcess(graph, WindowPolicy(8, 8)).run()
    summary = summarise(scenario, graph, recording, "inprocess", Timing(startup_s=0.0, loop_s=0.0, total_s=0.0))
    # The sample of the end tick is committed, and nobody acts on it any more.
    assert recording.samples(graph.plants[0])[1].shape[0] == graph.end_tick + 1
    assert list(summary.samples.values()) == [graph.end_tick]

"""Who reads states of one kind of plant is not shown those of another: it would take one quantity for another."""

from __future__ import annotations

import re

import pytest

from etac_ros.errors import ScenarioError
from etac_ros.scenario.load import load

SIGNALS = {
    "wu2018": "etac_ros.laws.flexible:FeedbackVector, alpha: 1.0",
    "flexible": "etac_ros.laws.wu2018:FilteredError, beta: 1.0",
}


@pytest.mark.parametrize(("scenario", "signal"), SIGNALS.items())
def test_a_sensor_refuses_a_signal_of_another_plant(scenario: str, signal: str) -> None:
    name, _, rest = signal.partition(", ")
    with pytest.raises(ScenarioError, match=r"takes states of \d+ components; \w+ has \d+") as refused:
        load(scenario, None, [f'sensor.signal={{class: "{name}", {rest}}}']).build()
    assert "/sensor" in str(refused.value)


def test_a_relative_sensor_refuses_a_law_that_takes_another_measurement() -> None:
    whole = load("qi2022", "panels").nodes["/pm/relative_sensor"]["law"]
    given = ", ".join(f'{key}: "{value}"' if key == "class" else f"{key}: {value}" for key, value in whole.items())
    given = re.sub(r"'(\w+)'", r"\1", given).replace("(", "[").replace(")", "]")
    with pytest.raises(ScenarioError, match="SmLfpdWithPanels takes 21 components, and RelativeMeasurement has 15"):
        load("qi2022", None, [f"pm/relative_sensor.law={{{given}}}"]).build()


READERS = {
    "wu2018": {"/sensor": "signal"},
    "flexible": {"/sensor": "signal"},
    "qi2022": {"/pm/attitude_sensor": "signal", "/pm/relative_sensor": "measurement"},
    "shi2022": {"/controller": "law"},
    "xie2021": {f"/sc{i}/sensor": "signal" for i in range(1, 5)},
}


@pytest.mark.parametrize(("scenario", "readers"), READERS.items())
def test_what_reads_states_says_of_how_many_components(scenario: str, readers: dict[str, str]) -> None:
    modules = load(scenario).build().modules
    for name, part in readers.items():
        plant = modules[name].context.plant
        assert plant is not None
        assert getattr(modules[name], part).state_size == plant.initial_state().size

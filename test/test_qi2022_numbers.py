"""The numbers of qi2022 as the scenario file states them, and what the other qi2022 tests build from them."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from etac_ros.errors import ScenarioError
from etac_ros.laws.law import Signal
from etac_ros.modules.sensor import Sensor
from etac_ros.plants.plant import Plant
from etac_ros.plants.pm_sm import PmSm, PmSmParameters
from etac_ros.scenario.classes import component, import_class, interface, parameters_of, validated
from etac_ros.scenario.document import Tree, read_sections, with_variant
from etac_ros.triggers.rule import TriggerRule

_CONFIG = Path(__file__).resolve().parent.parent / "config"
_FILE = next(path for path in (_CONFIG / "qi2022.yaml", _CONFIG / "qi2022.yaml.draft") if path.is_file())
TICKS_PER_SECOND = 20

patient = settings(deadline=None, max_examples=80, suppress_health_check=[HealthCheck.too_slow])
"""For property tests: the first example may have to compile a kernel, on a busy machine."""

PLANT = ("/sim/plant", "dynamics")
PM_LAW = ("/pm/controller", "law")
MEASUREMENT = ("/pm/relative_sensor", "measurement")
SM_LAW = ("/pm/relative_sensor", "law")
TRIGGER = ("/pm/relative_sensor", "trigger")
SLIDING_MODE = ("/sm/controller", "law")


@cache
def sections(variant: str | None = None) -> Tree:
    """The scenario file with a variant laid over it."""
    tree = read_sections(_FILE)
    return tree if variant is None else with_variant(tree, variant, str(_FILE), tree["/**"])


def made(part: tuple[str, str], variant: str | None = None, changes: Mapping[str, Any] | None = None) -> Any:
    """A component of the scenario file, built as the scenario loader builds it."""
    node, key = part
    values = {**sections(variant)[node][key], **(changes or {})}
    kind: Any = import_class(values.pop("class"), f"{node}.{key}.class")
    wanted = interface(Sensor, "trigger") if key == "trigger" else ()
    where = f"{node}.{key}"
    return component(kind, wanted, validated(parameters_of(kind, wanted), values, where), TICKS_PER_SECOND, where)


def plant_parameters(variant: str | None = None, **changes: Any) -> PmSmParameters:
    """Parameters of the plant in the scenario file, with changes."""
    values = {**sections(variant)[PLANT[0]][PLANT[1]], **changes}
    values.pop("class")
    return validated(PmSmParameters, values, "plant")


def test_the_grid_is_the_papers_step() -> None:
    run = sections()["/**"]
    assert run["ticks_per_second"] == TICKS_PER_SECOND
    assert run["duration_s"] == 100.0


@pytest.mark.parametrize("variant", [None, "measurement", "site-sm", "smc"])
def test_laws_know_what_is_true(variant: str | None) -> None:
    """Every number that a law repeats is the plant's, in every variant."""
    tree = sections(variant)
    truth = tree["/sim/plant"]["dynamics"]
    nodes = [
        ("/pm/controller", "law"),
        ("/pm/relative_sensor", "measurement"),
        ("/pm/relative_sensor", "law"),
    ]
    nodes += [("/sm/controller", "law")] if variant else []
    repeated = 0
    for node, key in nodes:
        for name, value in tree[node][key].items():
            if name in truth and name != "class":
                assert value == truth[name], f"{node}.{key}.{name}"
                repeated += 1
    assert repeated >= 8


def test_both_trigger_sites_have_the_same_law_and_trigger() -> None:
    sensor = sections()["/pm/relative_sensor"]
    on_the_sm = sections("site-sm")["/sm/controller"]
    assert on_the_sm["law"] == sensor["law"]
    assert on_the_sm["trigger"] == sensor["trigger"]
    assert sections("measurement")["/sm/controller"]["law"] == sensor["law"]


def test_orbit_rate_is_the_mean_motion_at_400_km() -> None:
    rate = plant_parameters().orbit_rate_rad_s
    mean_motion = np.sqrt(398600.4418 / (6378.137 + 400.0) ** 3)
    assert rate[0] == rate[2] == 0.0
    assert rate[1] == pytest.approx(-mean_motion, rel=1e-6)


def test_start_is_printed_and_normalised() -> None:
    state = made(PLANT).initial_state()
    for attitude, printed in ((state[0:4], "attitude_pm_q"), (state[7:11], "attitude_sm_q")):
        assert np.linalg.norm(attitude) == pytest.approx(1.0, abs=1e-15)
        given = np.array(sections()["/sim/plant"]["dynamics"][printed])
        assert np.allclose(attitude / attitude[1], given / given[1], rtol=1e-12)
        assert np.abs(attitude - given).max() < 5e-5
    assert state[5] == np.radians(-0.0635)
    assert np.allclose(state[11:14], np.radians([0.0021, 0.0042, -0.0033]), rtol=1e-15)
    assert not state[14:].any()


def test_disturbances_are_the_papers() -> None:
    """Table 1: ``[sin(1 + 0.11 t), cos(1 + 0.13 t), sin(1 + 0.15 t)]`` times 1e-5 on the PM, 1e-3 on the SM."""
    parameters = plant_parameters()
    for torque, size in ((parameters.disturbance_pm, 1e-5), (parameters.disturbance_sm, 1e-3)):
        sine, cosine, phase, frequency = torque.packed().reshape(4, 3)
        for t in (0.0, 7.3, 100.0):
            printed = size * np.array([np.sin(1 + 0.11 * t), np.cos(1 + 0.13 * t), np.sin(1 + 0.15 * t)])
            ours = sine * np.sin(phase + frequency * t) + cosine * np.cos(phase + frequency * t)
            assert np.allclose(ours, printed, rtol=0.0, atol=1e-12 * size)


def test_two_printed_panels_are_refused_with_the_reason() -> None:
    with pytest.raises(ScenarioError) as caught:
        made(PLANT, "printed")
    text = str(caught.value)
    assert "not positive definite" in text
    assert "+3.66 1/s" in text
    assert "panels: 1" in text


def test_two_light_panels_are_accepted() -> None:
    """The refusal is about the mass matrix, not about the number of panels."""
    light = plant_parameters(panels=2, coupling_scale=0.4)
    single = plant_parameters(panels=1, coupling_scale=0.8)
    assert np.allclose(light.mass_matrix_kg_m2, single.mass_matrix_kg_m2, rtol=1e-15, atol=1e-13)


def test_too_heavy_a_single_panel_is_refused_too() -> None:
    with pytest.raises(ScenarioError, match="not positive definite") as caught:
        plant_parameters(coupling_scale=3.0)
    assert "panels: 1" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"attitude_sm_q": [1.0, 0.1, 0.0, 0.0]}, "norm"),
        ({"inertia_pm_kg_m2": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0]}, "positive definite"),
        ({"modal_damping": [0.0, 0.01, 0.01]}, "greater than 0"),
        ({"panels": 3}, "1 or 2"),
        ({"coupling_scale": 0.0}, "greater than 0"),
        ({"panel": 1}, "panels"),
    ],
)
def test_wrong_plants_are_refused(change: dict[str, Any], reason: str) -> None:
    with pytest.raises(ScenarioError, match=reason):
        plant_parameters(**change)


@pytest.mark.parametrize("component", [PM_LAW, SM_LAW])
@pytest.mark.parametrize("gain", ["attitude_gain_nm", "rate_gain_nms"])
def test_the_printed_sign_of_the_gains_is_refused_with_the_reason(component: tuple[str, str], gain: str) -> None:
    negative = [-value for value in sections()[component[0]][component[1]][gain]]
    with pytest.raises(ScenarioError, match="positive feedback"):
        made(component, None, {gain: negative})


def test_a_heartbeat_is_a_whole_number_of_ticks() -> None:
    with pytest.raises(ScenarioError, match="no whole number of ticks"):
        made(TRIGGER, None, {"longest_silence_s": 0.12})


@pytest.mark.parametrize(
    ("protocol", "part"),
    [(Plant, PLANT), (TriggerRule, TRIGGER), (Signal, ("/pm/attitude_sensor", "signal"))],
)
def test_nothing_of_a_protocol_is_missing(protocol: type, part: tuple[str, str]) -> None:
    members = {name for name in (*protocol.__annotations__, *vars(protocol)) if not name.startswith("_")}
    assert members
    assert [name for name in sorted(members) if not hasattr(made(part), name)] == []


def test_the_plant_offers_what_the_modules_ask_for() -> None:
    plant: PmSm = made(PLANT)
    state = plant.initial_state()
    assert len(plant.labels) == state.size
    assert sum(plant.inputs.values()) == 6
    assert plant.attitude_slice == slice(7, 11)
    assert plant.rate_slice == slice(11, 14)

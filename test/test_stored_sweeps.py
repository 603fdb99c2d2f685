"""The stored sweeps are those of the scenarios and of the code as they are: the remedy is `etac reproduce --bands`."""

from __future__ import annotations

import math

import pytest

from etac_ros.metrics.stored import Stored, StoredSweep, stored
from etac_ros.reproduce.bands import COMMAND, make, why_stale
from etac_ros.reproduce.dispersion import SIZE_RAD, common_dispersions
from etac_ros.reproduce.variants import published_variants, title_of
from etac_ros.scenario.load import Scenario, load
from etac_ros.scenario.places import available


def all_stored() -> Stored:
    found = stored()
    assert found is not None, f"no sweeps are stored: {COMMAND}"
    return found


def of(scenario: Scenario) -> StoredSweep:
    (found,) = (one for one in all_stored().sweeps if (one.scenario, one.variant) == (scenario.name, scenario.variant))
    return found


@pytest.mark.parametrize("name", available())
def test_none_is_stale_missing_or_left_over(name: str) -> None:
    variants = published_variants(name)
    kept = {one.variant: one for one in all_stored().sweeps if one.scenario == name}
    assert kept.keys() == {scenario.variant for scenario in variants}
    stale = {title_of(one): why for one in variants if (why := why_stale(one, kept[one.variant]))}
    assert stale == {}, f"{COMMAND} {name}"


@pytest.mark.parametrize("name", available())
def test_every_start_is_dispersed_by_the_same(name: str) -> None:
    found = common_dispersions(load(name))
    assert found
    for one in found.values():
        assert (one.rotation_deg or one.normal) == pytest.approx(math.degrees(SIZE_RAD))


def test_what_has_changed_is_said() -> None:
    scenario = load("wu2018")
    found = of(scenario)
    assert "the scenario" in why_stale(load("wu2018", None, ["sensor.trigger.alpha=0.4"]), found)
    assert "the scenario" in why_stale(load("wu2018", None, ["seed=2"]), found)
    assert "first ticks" in why_stale(scenario, found.model_copy(update={"probe": [*found.probe[:-1], 99.0]}))
    assert "dispersions" in why_stale(scenario, found.model_copy(update={"dispersions": {}}))
    assert "baseline" in why_stale(scenario, found.model_copy(update={"baseline": "0"}))
    assert "other figures" in why_stale(scenario, found.model_copy(update={"figures": {}}))


def test_what_a_scenario_says_of_dispersion_has_no_part() -> None:
    wide = load("wu2018", None, ["dispersion={plant.dynamics.attitude_euler_deg: {normal: 30.0}}"])
    assert why_stale(wide, of(wide)) == ""


def test_only_what_is_stale_is_made_anew() -> None:
    known = all_stored()
    untouched = make(["wu2018"], known, 2, 1, lambda text: pytest.fail(text), lambda made: None)
    assert untouched.sweeps == known.sweeps
    # Figures that are declared otherwise need no runs.
    found = of(load("wu2018"))
    other = found.figures["triggers"].model_copy(update={"printed": "85"})
    changed = found.model_copy(update={"figures": {**found.figures, "triggers": other}})
    sweeps = [changed if one is found else one for one in known.sweeps]
    again = make(
        ["wu2018"], known.model_copy(update={"sweeps": sweeps}), 2, 1, lambda text: pytest.fail(text), lambda _: None
    )
    assert again.sweeps == known.sweeps

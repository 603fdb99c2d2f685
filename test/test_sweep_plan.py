"""A sweep is laid out and checked before anything runs."""

from __future__ import annotations

import pytest
from conftest import SmallScenario

from etac_ros.errors import ScenarioError
from etac_ros.scenario.load import load
from etac_ros.scenario.places import config_folders
from etac_ros.scenario.values import value_at
from etac_ros.sweep.draws import check_target, dispersed
from etac_ros.sweep.plan import make_plan

K = "controller.law.k"
RATE = "plant.dynamics.rate_deg_s"
PERTURB = ("    seed: 3\n", "    seed: 3\n    dispersion: {%s}\n")


def dispersing(text: str) -> tuple[str, str]:
    return PERTURB[0], PERTURB[1] % text


def test_values_make_a_full_grid_and_samples_fill_it_evenly(small: SmallScenario) -> None:
    plan = make_plan(str(small()), 3, None, [f"{K}=1.0,2.0,3.0", "actuator.limit_nm=4.0", "duration_s=5.0,10.0"])
    assert [dict(point.values) for point in plan.points] == [
        {K: k, "duration_s": duration} for k in (1.0, 2.0, 3.0) for duration in (5.0, 10.0)
    ]
    assert len(plan.samples) == 18
    assert [plan.place(sample) for sample in (0, 5, 6, 17)] == [(0, 0), (0, 5), (1, 0), (2, 5)]
    for sample in plan.samples:
        scenario = plan.scenario_of(sample)
        values = plan.points[plan.place(sample)[1]].values
        assert scenario.nodes["/controller"]["law"]["k"] == values[K]
        assert scenario.run.duration_s == values["duration_s"]
        assert scenario.nodes["/actuator"]["limit_nm"] == 4.0


def test_lists_and_mappings_are_single_values(small: SmallScenario) -> None:
    plan = make_plan(str(small()), 1, None, [f"{RATE}=[1.0,2.0,3.0],[4.0,5.0,6.0]", "wire=stamped"])
    assert [point.scenario.nodes["/plant"]["dynamics"]["rate_deg_s"] for point in plan.points] == [
        [1.0, 2.0, 3.0],
        [4.0, 5.0, 6.0],
    ]
    assert {point.scenario.run.wire for point in plan.points} == {"stamped"}


def test_the_same_run_draws_the_same_at_every_grid_point(small: SmallScenario) -> None:
    plan = make_plan(str(small()), 4, None, [f"{K}=1.0,2.0"], [f"{RATE}=normal:2", f"{K}=uniform:0.25"])
    draws = [plan.draws(sample) for sample in plan.samples]
    seeds = [plan.scenario_of(sample).run.seed for sample in plan.samples]
    for run in range(4):
        one, other = draws[2 * run], draws[2 * run + 1]
        assert one[RATE] == other[RATE]
        assert other[K] - one[K] == pytest.approx(1.0, abs=1e-12)  # the same deviate on either value
        assert seeds[2 * run] == seeds[2 * run + 1]
    assert len({str(draw[RATE]) for draw in draws}) == 4
    assert len(set(seeds)) == 4


def test_draws_reach_the_scenario_and_nothing_else_changes(small: SmallScenario) -> None:
    plan = make_plan(str(small()), 2, None, [], [f"{RATE}=normal:2"])
    scenario = plan.scenario_of(1)
    drawn = plan.draws(1)[RATE]
    assert scenario.nodes["/plant"]["dynamics"]["rate_deg_s"] == drawn != [0.0, 0.0, 0.0]
    assert plan.scenario.nodes["/plant"]["dynamics"]["rate_deg_s"] == [0.0, 0.0, 0.0]
    assert scenario.overrides[RATE] == drawn
    assert scenario.overrides["seed"] == scenario.run.seed != plan.seed
    assert {name: node for name, node in scenario.nodes.items() if name != "/plant"} == {
        name: node for name, node in plan.scenario.nodes.items() if name != "/plant"
    }


def test_a_scenario_states_its_dispersions(small: SmallScenario) -> None:
    path = small(dispersing(f"{RATE}: {{uniform: 1.5}}, {K}: {{normal: 0.5}}"))
    assert {key: one.model_dump(exclude_none=True) for key, one in make_plan(str(path), 1).dispersions.items()} == {
        RATE: {"uniform": 1.5},
        K: {"normal": 0.5},
    }
    assert dict(make_plan(str(path), 1, dispersion=False).dispersions) == {}
    changed = make_plan(str(path), 1, None, [], [f"{RATE}=none", f"{K}=uniform:0.5"]).dispersions
    assert {key: one.model_dump(exclude_none=True) for key, one in changed.items()} == {K: {"uniform": 0.5}}
    # It bears on sweeps, not on runs: nodes that are started from either file belong together.
    assert load(str(path)).digest == load(str(small())).digest


def test_a_resolved_file_keeps_its_dispersions(small: SmallScenario) -> None:
    path = small(dispersing(f"{RATE}: {{uniform: 1.5}}, {K}: null"))
    text = load(str(path)).text
    path.write_text(text)
    assert list(make_plan(str(path), 1).dispersions) == [RATE]


def test_dispersions_of_shipped_scenarios_fit_in_every_variant() -> None:
    found = 0
    for path in sorted(path for folder in config_folders() for path in folder.glob("*.yaml")):
        for variant in (None, *load(str(path)).variants):
            try:
                scenario = load(str(path), variant)
                scenario.build()
            except ScenarioError:  # a variant that is there to be refused
                continue
            values = {}
            for key, one in scenario.run.dispersion.items():
                assert one is not None
                before = value_at(scenario.nodes, key, str(path))
                check_target(key, before, one, str(path))
                values[key] = dispersed(before, key, one, 1, 1)
                assert values[key] != before
                found += 1
            scenario.with_values(values, 1).build()
    assert found > 20


@pytest.mark.parametrize(
    ("runs", "sets", "wanted", "said"),
    [
        (0, [], [], ["--runs 0", "1 or more"]),
        (1, ["controler.law.k=1.0,2.0"], [], ["controler"]),
        (1, ["controller.law.kk=1.0,2.0"], [], ["kk", "k"]),
        (1, [f"{K}="], [], [K, "empty"]),
        (1, [f"{K}=1.0,-1.0"], [], ["law.k", "-1"]),
        (1, [f"{K}=1.0,1.0"], [], ["twice"]),
        (1, [f"{K}=1.0,2.0", f"{K}=3.0,4.0"], [], [K, "already"]),
        (1, ["seed=1,2"], [], ["seed", "grid"]),
        (1, [K], [], ["no assignment"]),
        (1, [], [f"{K}=normal"], ["--dispersion", "KEY=KIND:SIZE"]),
        (1, [], [f"{K}=normal:-1"], ["--dispersion", "-1", "greater than 0"]),
        (1, [], [f"{K}=gauss:1"], ["--dispersion", "normal, uniform, rotation_deg"]),
        (1, [], [f"{K}:normal"], ["--dispersion"]),
        (1, [], ["controler.law.k=normal:1"], ["--dispersion", "controler", "'controller'?"]),
        (1, [], ["controller.law.kk=normal:1"], ["--dispersion", "kk", "'k'?"]),
        (1, [], ["controller=normal:1"], ["whole node"]),
        (1, [], ["plant.module=normal:1"], ["plant.module", "number"]),
        (1, [], ["plant.dynamics.inertia_kg_m2=normal:1"], ["every draw", "symmetric"]),
        (1, [], [f"{K}=uniform:1e-9", f"{RATE}=rotation_deg:1"], ["rotation_deg cannot turn"]),
    ],
)
def test_bad_input_is_refused_before_anything_runs(
    small: SmallScenario, runs: int, sets: list[str], wanted: list[str], said: list[str]
) -> None:
    with pytest.raises(ScenarioError) as caught:
        make_plan(str(small()), runs, None, sets, wanted)
    for words in said:
        assert words in str(caught.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f"{K}: {{gauss: 1.0}}", [f"dispersion.{K}", "gauss"]),
        (f"{K}: {{normal: 0.0}}", [f"dispersion.{K}", "greater than 0"]),
        (f"{K}: {{normal: 1.0, uniform: 1.0}}", [f"dispersion.{K}", "normal and uniform"]),
        (f"{K}: 1.0", [f"dispersion.{K}", "found 1.0"]),
        ("plant.module: {normal: 1.0}", ["dispersion.plant.module", "number"]),
        ("plnt.module: {normal: 1.0}", ["dispersion.plnt.module", "'plant'?"]),
    ],
)
def test_a_wrong_dispersion_in_a_file_names_file_and_key(small: SmallScenario, text: str, said: list[str]) -> None:
    with pytest.raises(ScenarioError) as caught:
        make_plan(str(small(dispersing(text))), 1)
    for words in ("small.yaml: /**.dispersion", *said):
        assert words in str(caught.value)


def test_no_dispersion_stands_alone(small: SmallScenario) -> None:
    with pytest.raises(ScenarioError, match="--no-dispersion"):
        make_plan(str(small()), 1, None, [], [f"{K}=normal:1"], dispersion=False)


@pytest.mark.parametrize("sample", [-1, 6])
def test_a_sample_that_is_not_there_is_refused(small: SmallScenario, sample: int) -> None:
    plan = make_plan(str(small()), 3, None, [f"{K}=1.0,2.0"])
    with pytest.raises(ScenarioError, match="0 to 5"):
        plan.scenario_of(sample)

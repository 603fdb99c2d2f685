"""Which value holds: file, variant, --set and baseline, each against each, and what the output says of it."""

from __future__ import annotations

from pathlib import Path

import pytest
from conftest import SmallScenario
from hypothesis import given
from hypothesis import strategies as st

from etac_ros.errors import ScenarioError
from etac_ros.runs import simulate
from etac_ros.scenario.load import Scenario, baseline_of, load

PERIODIC = "etac_ros.triggers.periodic:Periodic"
START = "attitude_q: [0.8, 0.6, 0.0, 0.0]"
VARIANTS = f"""\
    baseline: clocked
    variants:
      patient: {{duration_s: 30.0, sensor: {{trigger: {{alpha: 0.9}}, low_pass_s: 1.0}}}}
      turned: {{plant: {{dynamics: {{attitude_q: [0.6, 0.0, 0.8, 0.0]}}}}}}
      clocked: {{sensor: {{trigger: {{class: "{PERIODIC}", period_s: 0.5}}, low_pass_s: 2.0}}, seed: 7}}
      other-law:
        controller: {{module: "etac_ros.modules.tracking:TimedController", law: {{class: "x:Y"}}}}
"""


@pytest.fixture
def file(small: SmallScenario) -> Path:
    """The small scenario with a baseline that changes a trigger as a whole, a key of the sensor, and the seed."""
    path = small()
    text = path.read_text()
    begin, end = text.index("    variants:"), text.index("/plant:\n  ros")
    path.write_text(text[:begin] + VARIANTS + text[end:])
    return path


def baseline(file: Path, variant: str | None = None, *overrides: str) -> Scenario:
    found = baseline_of(load(str(file), variant, overrides))
    assert found is not None
    assert found.variant == "clocked"
    return found


def test_variant_over_file(file: Path) -> None:
    scenario = load(str(file), "patient")
    assert scenario.run.duration_s == 30.0
    assert scenario.nodes["/sensor"]["trigger"] == {
        "class": "etac_ros.triggers.relative:RelativeThreshold", "alpha": 0.9, "gamma": 1e-6,
    }  # fmt: skip


def test_set_over_file_and_over_variant(file: Path) -> None:
    assert load(str(file), None, ["duration_s=5"]).run.duration_s == 5.0
    assert load(str(file), "patient", ["duration_s=5"]).run.duration_s == 5.0
    assert load(str(file), "patient", ["sensor.trigger.alpha=0.1"]).nodes["/sensor"]["trigger"]["alpha"] == 0.1
    assert load(str(file), "patient", ["seed=1", "seed=2"]).run.seed == 2


def test_baseline_over_file(file: Path) -> None:
    found = baseline(file)
    assert found.nodes["/sensor"]["trigger"] == {"class": PERIODIC, "period_s": 0.5}
    assert (found.nodes["/sensor"]["low_pass_s"], found.run.seed) == (2.0, 7)
    assert found.notes == ()
    plain = load(str(file))
    assert {name: found.nodes[name] for name in ("/plant", "/controller", "/actuator")} == {
        name: plain.nodes[name] for name in ("/plant", "/controller", "/actuator")
    }


def test_baseline_keeps_what_the_variant_changes_elsewhere(file: Path) -> None:
    found = baseline(file, "turned")
    assert found.nodes["/plant"]["dynamics"]["attitude_q"] == [0.6, 0.0, 0.8, 0.0]
    assert found.nodes["/sensor"]["trigger"]["class"] == PERIODIC
    assert found.notes == ()


def test_baseline_over_variant_where_both_change_the_same(file: Path) -> None:
    found = baseline(file, "patient")
    assert found.run.duration_s == 30.0
    assert found.nodes["/sensor"]["trigger"] == {"class": PERIODIC, "period_s": 0.5}
    assert found.nodes["/sensor"]["low_pass_s"] == 2.0
    assert found.notes == (
        "baseline 'clocked' keeps its own sensor.trigger, sensor.low_pass_s, whatever variant 'patient' says",
    )


@pytest.mark.parametrize(
    "assignment",
    [
        "sensor.trigger.alpha=0.3",
        f"sensor.trigger={{class: '{PERIODIC}', period_s: 4.0}}",
        "sensor.trigger={class: 'etac_ros.triggers.one_norm:OneNormThreshold', epsilon: 0.5, r_rad_s: 1.0e-6}",
    ],
)
def test_baseline_over_set_of_its_trigger(assignment: str, file: Path) -> None:
    found = baseline(file, None, assignment)
    assert found.nodes["/sensor"]["trigger"] == {"class": PERIODIC, "period_s": 0.5}
    assert found.overrides == {}
    assert found.notes == (
        f"baseline 'clocked' keeps its own sensor.trigger, whatever --set {assignment.partition('=')[0]} says",
    )


def test_set_of_a_whole_trigger_leaves_something_to_compare(file: Path) -> None:
    # It replaced the baseline's trigger, too: "fewer messages 0 %".
    change = f"sensor.trigger={{class: '{PERIODIC}', period_s: 4.0}}"
    run = simulate(load(str(file), None, [change])).summary
    compared = simulate(baseline(file, None, change)).summary
    assert (run.triggers["/sensor"].count, compared.triggers["/sensor"].count) == (5, 40)


def test_baseline_keeps_what_set_changes_elsewhere(file: Path) -> None:
    changes = ["duration_s=5", "controller.law.k=3", "plant.dynamics.attitude_q=[1, 0, 0, 0]", "links.signal.loss=0.1"]
    found = baseline(file, None, *changes)
    assert found.run.duration_s == 5.0
    assert found.nodes["/controller"]["law"]["k"] == 3.0
    assert found.nodes["/plant"]["dynamics"]["attitude_q"] == [1.0, 0.0, 0.0, 0.0]
    assert found.run.links["signal"].loss == 0.1
    assert list(found.overrides) == [change.partition("=")[0] for change in changes]
    assert found.notes == ()


def test_a_mapping_of_which_the_baseline_takes_a_part_keeps_the_rest(file: Path) -> None:
    text = file.read_text().replace(", low_pass_s: 2.0}, seed", ", noise: {enters: both}}, seed")
    file.write_text(text)
    noise = baseline(file, None, "sensor.noise={enters: trigger, rate_deg_s: 0.5}").nodes["/sensor"]["noise"]
    assert noise == {"enters": "both", "attitude_deg": 0.0, "rate_deg_s": 0.5}


def test_of_a_formation_a_set_for_one_spacecraft_comes_last_but_for_the_baseline() -> None:
    changes = ["sc1/sensor.trigger.c1=0.01", "sc1/sensor.signal.r=3.0", "*/sensor.signal.r=2.5", "duration_s=1"]
    scenario = load("xie2021", None, changes)
    assert [scenario.nodes[f"/sc{i}/sensor"]["signal"]["r"] for i in (1, 2)] == [3.0, 2.5]
    found = baseline_of(scenario)
    assert found is not None
    assert [found.nodes[f"/sc{i}/sensor"]["signal"]["r"] for i in (1, 2)] == [3.0, 2.5]
    assert {found.nodes[f"/sc{i}/sensor"]["trigger"]["class"] for i in (1, 2, 3, 4)} == {PERIODIC}
    assert set(found.overrides) == {"sc1/sensor.signal.r", "*/sensor.signal.r", "duration_s"}
    assert found.notes == (
        "baseline 'periodic' keeps its own */sensor.trigger, whatever --set sc1/sensor.trigger.c1 says",
    )


def test_a_node_that_the_baseline_names_anew_is_its_own_as_a_whole() -> None:
    # qi2022's site-sm gives the controller a trigger, which the baseline's kind of controller does not have.
    found = baseline_of(load("qi2022", "site-sm"))
    assert found is not None
    assert "trigger" not in found.nodes["/sm/controller"]
    assert found.nodes["/sm/controller"] == load("qi2022", "smc").nodes["/sm/controller"]


def test_figures_of_a_variant_that_are_no_mapping_are_refused(file: Path) -> None:
    text = file.read_text().replace("turned: {plant", "turned: {published: [1], plant")
    file.write_text(text.replace("    seed: 3\n", "    seed: 3\n    published: {source: x}\n"))
    with pytest.raises(ScenarioError, match=r"variants\.turned\.published: found \[1\]\n.*a mapping"):
        load(str(file), "turned")


def test_no_baseline(file: Path, tmp_path: Path) -> None:
    assert baseline_of(load(str(file), "clocked")) is None
    assert baseline_of(load(str(file), None, ["baseline=null"])) is None
    resolved = tmp_path / "resolved.yaml"
    resolved.write_text(load(str(file)).text)
    assert baseline_of(load(str(resolved))) is None


def test_a_baseline_that_does_not_fit_names_itself(file: Path) -> None:
    with pytest.raises(ScenarioError, match=r"^baseline 'other-law' of .*/controller"):
        baseline_of(load(str(file), None, ["baseline=other-law"]))


@pytest.mark.parametrize(
    ("scenario", "variant", "energy"),
    [("flexible", "large-angle", 2476.0), ("shi2022", "rate-0.9", 7.695)],
)
def test_the_baseline_of_a_variant_starts_where_the_variant_does(scenario: str, variant: str, energy: float) -> None:
    # 2.925 and 2.267 from the usual start.
    found = baseline_of(load(scenario, variant))
    assert found is not None
    assert simulate(found).summary.performance["/plant"].energy_n2m2s == pytest.approx(energy, rel=1e-3)


def test_the_baseline_of_a_noisy_run_is_noisy() -> None:
    noisy = load("wu2018", "noise")
    found = baseline_of(noisy)
    assert found is not None
    assert found.nodes["/sensor"]["noise"] == noisy.nodes["/sensor"]["noise"]
    assert found.nodes["/sensor"]["noise"]["enters"] == "both"


def test_the_baseline_of_a_drawn_sample_starts_where_the_sample_does() -> None:
    sample = load("wu2018").with_values({"plant.dynamics.attitude_euler_deg": [3.0, 2.0, 1.0]}, 12)
    found = baseline_of(sample)
    assert found is not None
    assert (found.nodes["/plant"], found.run.seed) == (sample.nodes["/plant"], 12)


KEYS = {
    "sensor.trigger.alpha": [0.2, 0.4], "sensor.low_pass_s": [0.5, 1.5], "seed": [11, 12],
    "controller.law.k": [1.0, 4.0], "duration_s": [3.0, 4.0],
}  # fmt: skip
assignments = st.lists(
    st.sampled_from([(key, value) for key, values in KEYS.items() for value in values]), unique=True, max_size=5
)


@given(st.sampled_from([None, "patient", "turned"]), assignments)
def test_baseline_differs_from_its_run_in_the_places_of_its_block_only(
    tmp_path_factory: pytest.TempPathFactory, variant: str | None, given_: list[tuple[str, float]]
) -> None:
    from conftest import SMALL

    path = tmp_path_factory.mktemp("precedence") / "small.yaml"
    begin, end = SMALL.index("    variants:"), SMALL.index("/plant:\n  ros")
    path.write_text(SMALL[:begin] + VARIANTS + SMALL[end:])
    scenario = load(str(path), variant, [f"{key}={value}" for key, value in given_])
    found = baseline_of(scenario)
    assert found is not None
    run = scenario.run.model_copy(update={"seed": 7, "variant": "clocked"})
    sensor = {**scenario.nodes["/sensor"], "trigger": {"class": PERIODIC, "period_s": 0.5}, "low_pass_s": 2.0}
    assert found.run == run
    assert found.nodes == {**scenario.nodes, "/sensor": sensor}
    for key, value in given_:  # the last of a key holds
        last = [other for name, other in given_ if name == key][-1]
        if value == last and key == "duration_s":
            assert scenario.run.duration_s == value

"""Scenario files: what is read from them, and what variants and overrides change."""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from etac_ros.engines.inprocess import InProcess
from etac_ros.errors import ScenarioError
from etac_ros.scenario.document import (
    merged,
    parse_value,
    read_sections,
    with_override,
    with_variant,
    write_sections,
)
from etac_ros.scenario.load import load
from etac_ros.scenario.places import config_folders

Small = Callable[..., Path]
REFUSED = {
    ("qi2022", "printed"): "not positive definite",
    ("shi2022", "rate-1.5"): "outside the performance bound",
    ("shi2022", "rate-1.8"): "outside the performance bound",
}
"""Variants that show why a paper's printed values cannot be."""
PERIODIC = "etac_ros.triggers.periodic:Periodic"


def test_defaults_are_filled_in(small: Small) -> None:
    scenario = load(str(small()))
    assert scenario.name == "small"
    assert list(scenario.nodes) == ["/plant", "/sensor", "/controller", "/actuator"]
    assert scenario.nodes["/sensor"]["noise"] == {"enters": "nowhere", "attitude_deg": 0.0, "rate_deg_s": 0.0}
    assert scenario.nodes["/plant"]["dynamics"]["substeps"] == 1
    assert (scenario.run.seed, scenario.end_tick, scenario.variants) == (3, 200, ("patient", "clocked"))


def test_a_graph_stands_as_in_the_file(small: Small) -> None:
    graph = load(str(small())).build()
    assert list(graph.modules) == ["/plant", "/sensor", "/controller", "/actuator"]
    assert {name: (link.sender, dict(link.receivers)) for name, link in graph.links.items()} == {
        "signal": ("/sensor", {"/controller": "signal"}),
        "command": ("/controller", {"/actuator": "command"}),
        "torque": ("/actuator", {"/plant": "torque"}),
    }
    assert [link.topic for link in graph.links.values()] == ["/signal", "/command", "/emulation/torque"]
    assert graph.plants == ("/plant",)
    assert graph.reads == {"/sensor": "/plant"}


def test_every_graph_is_fresh(small: Small) -> None:
    scenario = load(str(small()))
    runs = [InProcess(scenario.build()).run() for _ in range(2)]
    assert runs[0].samples("/plant")[1].tobytes() == runs[1].samples("/plant")[1].tobytes()


def test_every_shipped_scenario_loads_in_every_variant() -> None:
    for path in sorted(path for folder in config_folders() for path in folder.glob("*.yaml")):
        scenario = load(path.stem)
        assert scenario.name == path.stem
        for variant in scenario.variants:
            if (path.stem, variant) in REFUSED:
                with pytest.raises(ScenarioError, match=REFUSED[path.stem, variant]):
                    load(path.stem, variant)
            else:
                assert load(path.stem, variant).variant == variant
        if scenario.run.baseline is not None:
            assert scenario.run.baseline in scenario.variants


def test_variant_lays_its_block_over_the_file(small: Small) -> None:
    scenario = load(str(small()), "patient")
    assert scenario.variant == "patient"
    assert scenario.run.duration_s == 30.0
    trigger = scenario.nodes["/sensor"]["trigger"]
    assert (trigger["alpha"], trigger["gamma"]) == (0.9, 1e-6)


def test_variant_with_another_class_replaces_the_mapping(small: Small) -> None:
    assert load(str(small()), "clocked").nodes["/sensor"]["trigger"] == {"class": PERIODIC, "period_s": 0.5}


@pytest.mark.parametrize(
    ("assignment", "place", "value"),
    [
        ("sensor.trigger.alpha=0.25", ("/sensor", "trigger", "alpha"), 0.25),
        ("/sensor.trigger.alpha=0.25", ("/sensor", "trigger", "alpha"), 0.25),
        ("sensor.trigger.gamma=2e-6", ("/sensor", "trigger", "gamma"), 2e-6),
        ("sensor.trigger.gamma = 1", ("/sensor", "trigger", "gamma"), 1.0),
        ("sensor.noise={enters: both, rate_deg_s: 0.1}", ("/sensor", "noise", "rate_deg_s"), 0.1),
        ("plant.dynamics.attitude_q=[0.0, 0.0, 0.6, 0.8]", ("/plant", "dynamics", "attitude_q"), [0.0, 0.0, 0.6, 0.8]),
        ("plant.dynamics.disturbance.sine_nm=[1, 2, 3]", ("/plant", "dynamics", "disturbance", "sine_nm"), [1, 2, 3]),
        ("actuator.limit_nm=0.3", ("/actuator", "limit_nm"), 0.3),
    ],
)
def test_override_sets_one_value(small: Small, assignment: str, place: tuple[str, ...], value: Any) -> None:
    plain = load(str(small()))
    changed = load(str(small()), overrides=[assignment])
    found: Any = changed.nodes
    for part in place:
        found = found[part]
    assert found == value
    others = [name for name in plain.nodes if name != place[0]]
    assert all(plain.nodes[name] == changed.nodes[name] for name in others)
    assert changed.digest != plain.digest


def test_overrides_of_the_whole_run_need_not_stand_in_the_file(small: Small) -> None:
    overrides = ["duration_s=5", "wire=stamped", "links.signal.delay_ticks=2", "links.command={loss: 0.5}"]
    scenario = load(str(small()), overrides=overrides)
    assert scenario.end_tick == 50
    links = scenario.build().links
    assert links["signal"].wire.type_name == "geometry_msgs/msg/Vector3Stamped"
    assert (links["signal"].channel.delay_ticks, links["command"].channel.loss) == (2, 0.5)
    assert scenario.overrides == {
        "duration_s": 5,
        "wire": "stamped",
        "links.signal.delay_ticks": 2,
        "links.command": {"loss": 0.5},
    }


def test_override_with_another_class_replaces_the_mapping(small: Small) -> None:
    change = f"sensor.trigger={{class: '{PERIODIC}', period_s: 2}}"
    assert load(str(small()), overrides=[change]).nodes["/sensor"]["trigger"] == {
        "class": PERIODIC,
        "period_s": 2.0,
    }


def test_override_with_the_same_class_merges(small: Small) -> None:
    change = "sensor.trigger={class: 'etac_ros.triggers.relative:RelativeThreshold', alpha: 0.1}"
    trigger = load(str(small()), overrides=[change]).nodes["/sensor"]["trigger"]
    assert (trigger["alpha"], trigger["gamma"]) == (0.1, 1e-6)


def test_later_overrides_win_and_all_come_after_the_variant(small: Small) -> None:
    overrides = ["sensor.trigger.alpha=0.1", "sensor.trigger.alpha=0.2"]
    scenario = load(str(small()), "patient", overrides)
    assert scenario.nodes["/sensor"]["trigger"]["alpha"] == 0.2
    assert scenario.run.duration_s == 30.0


def test_null_takes_a_key_away(small: Small) -> None:
    overrides = ["plant.dynamics.attitude_q=null", "plant.dynamics.attitude_euler_deg=[10, 0, 0]"]
    dynamics = load(str(small()), overrides=overrides).nodes["/plant"]["dynamics"]
    assert "attitude_q" not in dynamics
    assert dynamics["attitude_euler_deg"] == [10.0, 0.0, 0.0]


def test_overrides_leave_the_file_and_each_other_alone(small: Small) -> None:
    path = small()
    before = path.read_bytes()
    plain = load(str(path)).digest
    load(str(path), "clocked", ["seed=9", "sensor.low_pass_s=1"])
    assert path.read_bytes() == before
    assert load(str(path)).digest == plain


def test_variants_and_overrides_do_not_change_what_was_read(small: Small) -> None:
    sections = read_sections(small())
    before = deepcopy(sections)
    with_variant(sections, "patient", "small.yaml", ["duration_s"])
    changed, key, value = with_override(sections, "sensor.trigger.alpha=0.1", [])
    assert sections == before
    assert (key, value, changed["/sensor"]["trigger"]["alpha"]) == ("sensor.trigger.alpha", 0.1, 0.1)


RESOLVED: list[tuple[str | None, list[str]]] = [
    (None, []),
    ("periodic", []),
    ("filtered-noise", ["sensor.trigger.gamma=1e-20"]),
    (None, ["duration_s=1e-0", "title='1e6'", "wire=stamped", "links.torque_command.loss=0.25"]),
    (None, ["plant.dynamics.attitude_euler_deg=null", "plant.dynamics.attitude_q=[0.6, 0, 0, 0.8]"]),
]


@pytest.mark.parametrize(("variant", "overrides"), RESOLVED)
def test_resolved_text_is_the_same_scenario(variant: str | None, overrides: list[str], tmp_path: Path) -> None:
    scenario = load("wu2018", variant, overrides)
    path = tmp_path / "resolved.yaml"
    path.write_text(scenario.text)
    again = load(str(path))
    assert again.digest == scenario.digest
    assert again.text == scenario.text
    only_for_many_runs = {"compare": (), "tradeoff": None}
    assert again.run == scenario.run.model_copy(update=only_for_many_runs)
    assert (again.nodes, again.variant) == (scenario.nodes, variant)
    assert list(again.nodes) == list(scenario.nodes)


def test_resolved_text_has_no_aliases_and_no_nested_lists() -> None:
    # rcl's parser of parameter files knows neither.
    text = load("wu2018").text
    assert not [token for token in yaml.scan(text) if isinstance(token, (yaml.AnchorToken, yaml.AliasToken))]

    def lists(value: Any) -> list[list[Any]]:
        if isinstance(value, dict):
            return [found for below in value.values() for found in lists(below)]
        return [value] if isinstance(value, list) else []

    for found in lists(yaml.safe_load(text)):
        assert len({type(element) for element in found}) == 1, found
        assert not isinstance(found[0], (list, dict)), found


@pytest.mark.parametrize(
    ("change", "matters"),
    [
        ("seed=4", True),
        ("duration_s=999", True),
        ("wire=stamped", True),
        ("links.torque.delay_ticks=1", True),
        ("sensor.low_pass_s=0.5", True),
        ("title=another", False),
        ("windows.first=1", False),
        ("baseline=noise", False),
        ("published.triggers.value=1", False),
    ],
)
def test_digest_tells_runs_with_other_results_apart(change: str, matters: bool) -> None:
    assert (load("wu2018").digest != load("wu2018", overrides=[change]).digest) is matters


def test_digest_knows_the_order_of_nodes(small: Small) -> None:
    # It is the order of sums and bags.
    path = small()
    plain = load(str(path)).digest
    sections = read_sections(path)
    path.write_text(write_sections(dict(reversed(sections.items()))))
    assert load(str(path)).digest != plain


plain_values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**9), 10**9)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=12)
    | st.from_regex(r"[-+]?\d+(\.\d*)?e[-+]?\d", fullmatch=True),
    lambda below: (
        st.lists(below, max_size=3) | st.dictionaries(st.from_regex(r"[a-z]{1,4}", fullmatch=True), below, max_size=3)
    ),
    max_leaves=8,
)


@given(st.dictionaries(st.from_regex(r"[a-z]{1,6}", fullmatch=True), plain_values, max_size=4))
def test_written_sections_read_back(tmp_path_factory: pytest.TempPathFactory, body: dict[str, Any]) -> None:
    path = tmp_path_factory.mktemp("written") / "x.yaml"
    path.write_text(write_sections({"/**": body, "/node": body}))
    assert read_sections(path) == {"/**": body, "/node": body}


@pytest.mark.parametrize(
    ("text", "value"),
    [("1e-6", 1e-6), ("-2E3", -2e3), (".5e1", 5.0), ("1", 1), ("1.", 1.0), ("[1, 2e0]", [1, 2.0]), ("e5", "e5")],
)
def test_numbers_are_those_of_yaml_1_2(text: str, value: Any) -> None:
    found = parse_value(text, "here")
    assert found == value
    assert type(found) is type(value)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_float_is_read_as_python_prints_it(value: float) -> None:
    found = parse_value(repr(value), "here")
    assert isinstance(found, float)
    assert math.copysign(1.0, found) == math.copysign(1.0, value)
    assert found == value


trees = st.recursive(
    st.integers(0, 3),
    lambda below: st.dictionaries(st.sampled_from("abc"), below, max_size=3),
    max_leaves=8,
)


@given(trees, trees)
def test_merging_keeps_what_is_not_named_and_takes_what_is(base: Any, change: Any) -> None:
    result = merged(base, change)
    if not isinstance(base, dict) or not isinstance(change, dict):
        assert result == change
        return
    assert set(result) == set(base) | set(change)
    for key in result:
        assert result[key] == (merged(base.get(key), change[key]) if key in change else base[key])
    assert merged(result, change) == result


def test_name_or_path_of_a_scenario(small: Small, monkeypatch: pytest.MonkeyPatch) -> None:
    path = small()
    monkeypatch.chdir(path.parent)
    assert load("small.yaml").digest == load(str(path)).digest
    with pytest.raises(ScenarioError):
        load("small")


def test_delays_in_seconds_are_rounded_up_to_ticks_and_it_is_said() -> None:
    found = load("wu2018", overrides=["links.filtered_error.delay_s=0.07", "links.torque_command.delay_s=0.0625"])
    assert found.rounded == ("links.filtered_error.delay_s: 0.07 s is 2.24 ticks, rounded up to 3 (0.09375 s)",)
    links = found.graph.links
    assert (links["filtered_error"].channel.delay_ticks, links["torque_command"].channel.delay_ticks) == (3, 2)
    with_jitter = load("wu2018", overrides=["links.filtered_error={delay_s: 0.07, jitter: {uniform_s: 0.1}}"])
    assert with_jitter.graph.links["filtered_error"].channel.delay_ticks == pytest.approx(2.24)
    assert "sum is rounded up" in with_jitter.rounded[0]
    assert with_jitter.rounded[0] in with_jitter.notes

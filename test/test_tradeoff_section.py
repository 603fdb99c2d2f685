"""The section ``tradeoff`` of a scenario: what it takes, and what is said where it is wrong."""

from __future__ import annotations

from pathlib import Path

import pytest
from conftest import SmallScenario

from etac_ros.errors import ScenarioError
from etac_ros.scenario.load import load
from etac_ros.scenario.places import available
from etac_ros.tradeoff.layout import PERIODIC, lay_out

ALPHA = "sensor.trigger.alpha: [0.2, 0.6]"
SECTION = f"""\
    tradeoff:
      paper: [patient]
      curves:
        alpha: {{vary: {{{ALPHA}}}}}
        grid: {{label: both, vary: {{{ALPHA}, sensor.trigger.gamma: [1e-6, 1e-5, 1e-4]}}}}
      periodic: {{variant: clocked, vary: {{sensor.trigger.period_s: [0.2, 0.4]}}}}
"""


@pytest.fixture
def with_section(small: SmallScenario) -> SmallScenario:
    """Write the small scenario with a section ``tradeoff``, with parts of its text replaced."""

    def write(*replacements: tuple[str, str]) -> Path:
        text = SECTION
        for old, new in replacements:
            assert text.count(old) >= 1, old
            text = text.replace(old, new, 1)
        return small(("    variants:\n", f"{text}    variants:\n"), ("patient: {duration_s: 30.0, ", "patient: {"))

    return write


def test_points_are_laid_out_curve_by_curve_and_the_paper_s_last(with_section: SmallScenario) -> None:
    layout = lay_out(str(with_section()), 2)
    names = [place.curve for place in layout.places]
    assert names == ["alpha"] * 2 + ["grid"] * 6 + [PERIODIC] * 2 + [None]
    assert [tuple(place.values.values()) for place in layout.places[2:8]] == [
        (0.2, 1e-6), (0.2, 1e-5), (0.2, 1e-4), (0.6, 1e-6), (0.6, 1e-5), (0.6, 1e-4),
    ]  # fmt: skip
    for place in layout.places:
        trigger = place.scenario.nodes["/sensor"]["trigger"]
        for key, value in place.values.items():
            assert trigger[key.rpartition(".")[2]] == value
    assert layout.places[-1].scenario.variant == "patient"
    assert layout.places[2].label == "both"
    assert layout.deciders == ("/sensor",)
    assert len(layout.plan.samples) == 2 * len(layout.places)


def test_without_a_paper_s_variant_its_point_is_the_file_as_it_stands(with_section: SmallScenario) -> None:
    layout = lay_out(str(with_section(("      paper: [patient]\n", ""))), 1)
    assert layout.places[-1].scenario.variant is None
    assert layout.places[-1].scenario.digest == layout.scenario.digest


def test_the_section_bears_on_no_run(with_section: SmallScenario, small: SmallScenario) -> None:
    varied = load(str(with_section()))
    assert "tradeoff" not in varied.text
    plain = load(str(small(("patient: {duration_s: 30.0, ", "patient: {"))))
    assert varied.run.tradeoff is not None
    assert plain.run.tradeoff is None
    assert varied.digest == plain.digest
    assert varied.text == plain.text


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (ALPHA, "sensor.trigger.alpha: []", [".curves.alpha.vary.sensor.trigger.alpha", "found []", "one number"]),
        (ALPHA, "sensor.trigger.alpha: [0.2, 0.2]", [".curves.alpha.vary.sensor.trigger.alpha", "each once"]),
        (ALPHA, "sensor.trigger.alpha: 0.2", [".curves.alpha.vary.sensor.trigger.alpha", "found 0.2", "a list"]),
        (ALPHA, "sensor.trigger.alpha: [a]", [".curves.alpha.vary.sensor.trigger.alpha[0]", '"a"']),
        (f"{{{ALPHA}}}", "{}", [".curves.alpha.vary", "one key or two"]),
        (f"{{{ALPHA}}}", "{a.a: [1], b.b: [1], c.c: [1]}", [".curves.alpha.vary", "one key or two", "a.a, b.b, c.c"]),
        ("{vary: {", "{vari: {", [".curves.alpha.vari", "unknown key 'vari'", "'vary'?", "variant"]),
        ("      curves:\n", "      kurves:\n", [".tradeoff.kurves", "'curves'?"]),
        ("      paper: [patient]\n", "      paper: patient\n", [".tradeoff.paper", "a list"]),
        ("      periodic: {", "      clock: {", [".tradeoff.periodic", "is missing"]),
    ],
)
def test_a_wrong_form_is_refused_when_the_file_is_loaded(
    with_section: SmallScenario, old: str, new: str, said: list[str]
) -> None:
    path = with_section((old, new))
    with pytest.raises(ScenarioError) as caught:
        load(str(path))
    for words in (f"{path}: /**.tradeoff", *said):
        assert words in str(caught.value)


def test_no_curve_at_all_is_refused(small: SmallScenario) -> None:
    section = "    tradeoff: {curves: {}, periodic: {vary: {sensor.trigger.alpha: [0.5]}}}\n    variants:\n"
    with pytest.raises(ScenarioError, match=r"tradeoff\.curves: .*one curve or more"):
        load(str(small(("    variants:\n", section))))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("sensor.trigger.alpha", "sensor.triger.alpha", [".curves.alpha", "triger", "'trigger'?"]),
        ("sensor.trigger.alpha", "sensr.trigger.alpha", [".curves.alpha", "sensr", "'sensor'?"]),
        ("[0.2, 0.6]", "[0.2, 1.6]", [".curves.alpha", "alpha", "1.6", "less than 1"]),
        ("variant: clocked", "variant: cloked", [".tradeoff.periodic", "cloked", "'clocked'?"]),
        ("[patient]", "[patent]", [".tradeoff.paper", "patent", "'patient'?"]),
        ("        alpha: {", "        periodic: {", [".curves.periodic", "another name"]),
        ("      paper: [patient]\n", "      error: steady\n", [".tradeoff.error", "steady", "max_attitude_error_deg"]),
    ],
)
def test_what_is_not_there_is_refused_before_anything_runs(
    with_section: SmallScenario, old: str, new: str, said: list[str]
) -> None:
    path = with_section((old, new))
    with pytest.raises(ScenarioError) as caught:
        lay_out(str(path), 1)
    for words in (f"{path}: /**.tradeoff", *said):
        assert words in str(caught.value)


def test_a_variant_of_another_length_is_refused(small: SmallScenario) -> None:
    path = small(("    variants:\n", f"{SECTION}    variants:\n"))
    with pytest.raises(ScenarioError, match=r"tradeoff\.paper: its variant lasts another time"):
        lay_out(str(path), 1)


def test_a_scenario_without_the_section_names_those_that_have_it(small: SmallScenario) -> None:
    with pytest.raises(ScenarioError, match="is missing") as caught:
        lay_out(str(small()), 1)
    assert "wu2018" in caught.value.remedy


@pytest.mark.parametrize("name", available())
def test_every_scenario_that_is_shipped_has_one_that_can_be_run(name: str) -> None:
    assert any(place.curve == PERIODIC for place in lay_out(name, 1).places)

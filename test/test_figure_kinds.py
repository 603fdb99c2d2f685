"""What kind of a figure a published one is: said where it matters, so that no band and no fit passes for a result."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from etac_ros.scenario.load import load
from etac_ros.scenario.schema import FigureKind, PublishedFigure


def figure(**given: object) -> PublishedFigure:
    return PublishedFigure.model_validate({"value": 5.0, **given})


def test_a_limit_has_to_be_said() -> None:
    assert figure().kind_as("rate_at_100_s") is FigureKind.CONTINUOUS
    assert figure(kind="limit").kind_as("rate_at_100_s") is FigureKind.LIMIT


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("triggers", FigureKind.COUNT),
        ("network_payload_bytes", FigureKind.COUNT),
        ("message_reduction_percent", FigureKind.PERCENTAGE),
        ("max_interval_s", FigureKind.CONTINUOUS),
    ],
)
def test_other_kinds_follow_from_the_name(name: str, kind: FigureKind) -> None:
    assert figure().kind_as(name) is kind


def test_what_a_parameter_was_fitted_to_is_fitted_whatever_else_is_said() -> None:
    assert figure(fitted_to="delta").kind_as("triggers") is FigureKind.FITTED
    with pytest.raises(ValidationError, match="has the kind fitted, not count"):
        figure(fitted_to="delta", kind="count")
    with pytest.raises(ValidationError, match="needs the key 'fitted_to'"):
        figure(kind="fitted")


@pytest.mark.parametrize(
    ("scenario", "variant", "name"),
    [
        ("shi2022", None, "triggers"),
        ("shi2022", "events", "triggers"),
        ("xie2021", None, "triggers_sc3_sensor"),
        ("qi2022", "smc", "settled_attitude_s"),
        ("qi2022", "smc", "settled_rate_s"),
        ("flexible", "smc", "triggers"),
        ("flexible", None, "triggers"),
        ("flexible", "rho1e-4", "triggers"),
        ("wu2018", None, "triggers"),
        ("wu2018", "noise-gamma-4e-5", "triggers"),
    ],
)
def test_known_fits_are_disclosed(scenario: str, variant: str | None, name: str) -> None:
    assert load(scenario, variant).published[name].kind_as(name) is FigureKind.FITTED


def test_what_a_paper_complains_of_is_no_limit_that_somebody_keeps() -> None:
    for variant in ("smc", "smc-sign"):
        published = load("flexible", variant).published
        for name in ("mrp_at_100_s", "rate_at_100_s", "torque_at_100_s"):
            assert published[name].kind_as(name) is FigureKind.CONTINUOUS


def test_another_reading_takes_the_figures_without_reasons_and_fits() -> None:
    first, other = load("xie2021", "case1").published, load("xie2021", "continuous").published
    assert {name: one.value for name, one in first.items()} == {name: one.value for name, one in other.items()}
    assert not any(one.reason or one.fitted_to for one in other.values())
    assert any(one.reason for one in first.values())
    second = load("xie2021", "renewed-case2").published
    assert {name: one.value for name, one in second.items()} == {
        name: one.value for name, one in load("xie2021", "case2").published.items()
    }

"""The role of a module: contradictions are refused with the reason, whatever the combination."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from etac_ros.graph.role import Acts, Role


@given(
    acts=st.sampled_from(Acts),
    timed=st.booleans(),
    triggers=st.sampled_from(["", "out"]),
    concludes=st.booleans(),
    senses=st.booleans(),
    fires_on=st.sampled_from([None, (), ("out",)]),
    every=st.sampled_from([None, 1, 7]),
)
def test_every_combination_is_a_role_or_refused_with_a_reason(acts: Acts, **said: Any) -> None:
    by_itself, at_once = acts is Acts.BY_ITSELF, acts is Acts.AT_ONCE
    contradiction = (
        (said["timed"] and not at_once)
        or (said["triggers"] and at_once)
        or (said["senses"] and at_once)
        or ((said["concludes"] or said["every"] or said["fires_on"] is not None) and not by_itself)
        or (said["every"] and (said["concludes"] or said["fires_on"] is not None))
        or said["fires_on"] == ()
    )
    if contradiction:
        with pytest.raises(ValueError, match="cannot be together with acts="):
            Role(acts, **said)
    else:
        assert Role(acts, **said).acts is acts


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ({"every": 0}, "every is 0, no whole number of ticks from 1 on"),
        ({"every": True}, "every is True"),
        ({"every": 2.0}, "every is 2.0"),
        ({"fires_on": "out"}, "fires_on is 'out', no tuple"),
        ({"triggers": None}, "triggers is None, no port's name"),
        ({"timed": 1}, "timed is 1, neither True nor False"),
        ({"acts": "at once"}, "none of Acts.BY_ITSELF, Acts.ON_ARRIVAL, Acts.AT_ONCE"),
    ],
)
def test_values_of_another_kind_are_refused(said: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Role(**said)


@pytest.mark.parametrize(
    ("role", "words"),
    [
        (Role(triggers="outt"), "triggers names the port 'outt'; output ports are 'out'"),
        (Role(fires_on=("out", "more")), "fires_on names the port 'more'"),
        (Role(every=3), "every=3 takes nothing, and there are input ports in"),
    ],
)
def test_a_role_fits_the_ports(role: Role, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        role.check_ports({"in": 1}, {"out": 1})
    role.check_ports({}, {"out": 1, "outt": 1, "more": 1})


def test_who_acts_on_arrival_needs_an_input() -> None:
    with pytest.raises(ValueError, match="it acts at once, and there is no input port"):
        Role(Acts.AT_ONCE).check_ports({}, {"out": 1})

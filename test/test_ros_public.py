"""What ROS tools see of a node that is started by hand: parameters to read, and /rosout."""

from __future__ import annotations

import json
import signal
from pathlib import Path

import pytest
from hands import LIMIT_S, Start
from hypothesis import given
from hypothesis import strategies as st

from etac_ros.engines.ros.domain import DomainLease
from etac_ros.engines.ros.public import flattened
from etac_ros.runs import parameters_of
from etac_ros.scenario.load import load
from etac_ros.scenario.places import available


@pytest.mark.parametrize("launched", [False, True])
def test_a_tool_reads_parameters_sets_none_and_hears_what_is_said(
    launched: bool, tmp_path: Path, start: Start, lease: DomainLease
) -> None:
    file = tmp_path / "wu.yaml"
    file.write_text(load("wu2018", None, ["duration_s=50", "controller.external=true"]).text)
    if launched:
        lease.release()  # the run takes it itself; it waits for a controller that does not come
        waiting = start("-m", "etac_ros", "run", str(file), "--parameters", "--processes", "one")
    else:
        waiting = start("-m", "etac_ros", "node", "sensor", str(file), "--quiet-s", "5")
    tool = start(str(Path(__file__).parent / "asks_parameters.py"), "/sensor")
    output, _ = tool.communicate(timeout=LIMIT_S)
    assert tool.returncode == 0, output
    seen = json.loads(output.splitlines()[-1])
    assert seen["values"] == [0.5, "sensor", 32]
    assert {"trigger.alpha", "signal.beta", "duration_s", "links.filtered_error.from"} <= set(seen["names"])
    assert not seen["set"]
    assert "read-only" in seen["why"]
    assert any(line.startswith("sensor: ") for line in seen["heard"])
    assert waiting.poll() is None
    waiting.send_signal(signal.SIGINT)
    waiting.communicate(timeout=LIMIT_S)


def test_every_scenario_is_made_of_what_ros_takes_for_parameters() -> None:
    for name in available():
        for values in parameters_of(load(name)).values():
            for value in values.values():
                kinds = {type(one) for one in (value if isinstance(value, list) else [value])}
                assert len(kinds) == 1
                assert kinds < {bool, int, float, str}


@given(st.dictionaries(st.text("ab", min_size=1), st.lists(st.one_of(st.integers(), st.floats(), st.text()))))
def test_arrays_have_one_type(section: dict[str, list[object]]) -> None:
    flat = dict(flattened({"x": section}))
    assert set(flat) == {f"x.{key}" for key, value in section.items() if value}
    assert all(len({type(one) for one in value}) == 1 for value in flat.values())

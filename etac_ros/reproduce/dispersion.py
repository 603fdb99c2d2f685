"""One size of dispersion for all systems: what a scenario says under ``dispersion`` has no part in a verdict."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from etac_ros.scenario.load import Scenario
from etac_ros.scenario.schema import Dispersion

SIZE_RAD = 1.0e-3
REASON = (
    f"every attitude at the start is turned by {SIZE_RAD:g} rad about each axis (standard deviation), all else is as "
    "printed: about the last digit with which the papers print their starts, the same for all. What so small a change "
    "of the start moves is no property of the experiment that was published"
)
_ATTITUDE, _EULER = "attitude_", "_euler_deg"


def common_dispersions(scenario: Scenario) -> dict[str, Dispersion]:
    """What each run draws, by NODE.KEY: the attitude of every body of every plant."""
    found = {}
    for node, body in scenario.nodes.items():
        dynamics = body.get("dynamics")
        for key, value in (dynamics if isinstance(dynamics, Mapping) else {}).items():
            if key.startswith(_ATTITUDE) and _is_set(value):
                size = math.degrees(SIZE_RAD)
                one = Dispersion(normal=size) if key.endswith(_EULER) else Dispersion(rotation_deg=size)
                found[f"{node.lstrip('/')}.dynamics.{key}"] = one
    return found


def _is_set(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(number, float) for number in value)

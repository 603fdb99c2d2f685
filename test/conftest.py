"""What the tests share."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import settings

# The same examples each time, and no limit on their time: a test fails only when the code is wrong.
settings.register_profile("etac", deadline=None, derandomize=True, database=None, max_examples=60)
settings.load_profile("etac")

SMALL = """\
/**:
  ros__parameters:
    scenario: small
    ticks_per_second: 10
    duration_s: 20.0
    seed: 3
    links:
      signal: {from: /sensor, to: [/controller], kind: network}
      command: {from: /controller, to: [/actuator], kind: network}
      torque: {from: /actuator, to: [/plant], kind: physical}
    variants:
      patient: {duration_s: 30.0, sensor: {trigger: {alpha: 0.9}}}
      clocked: {sensor: {trigger: {class: "etac_ros.triggers.periodic:Periodic", period_s: 0.5}}}
/plant:
  ros__parameters:
    module: plant
    dynamics:
      class: "etac_ros.plants.rigid:RigidBody"
      inertia_kg_m2: [2.0, 0.1, 0.0, 0.1, 3.0, 0.0, 0.0, 0.0, 4.0]
      attitude_q: [0.8, 0.6, 0.0, 0.0]
/sensor:
  ros__parameters:
    module: sensor
    reads: /plant
    signal: {class: "etac_ros.laws.wu2018:FilteredError", beta: 0.5}
    trigger: {class: "etac_ros.triggers.relative:RelativeThreshold", alpha: 0.5, gamma: 1e-6}
/controller:
  ros__parameters:
    module: controller
    law: {class: "etac_ros.laws.wu2018:Proportional", k: 2.0}
/actuator:
  ros__parameters:
    module: actuator
"""

SmallScenario = Callable[..., Path]


@pytest.fixture
def small(tmp_path: Path) -> SmallScenario:
    """Write a small complete scenario, with parts of its text replaced: ``small(("alpha: 0.5", "alpha: 2"))``."""

    def write(*replacements: tuple[str, str]) -> Path:
        text = SMALL
        for old, new in replacements:
            assert text.count(old) == 1, old
            text = text.replace(old, new)
        path = tmp_path / "small.yaml"
        path.write_text(text, encoding="utf-8")
        return path

    return write

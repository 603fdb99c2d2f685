"""What the tests share."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from unittest.mock import patch

import pytest
from hands import Start
from hypothesis import settings

from etac_ros.engines.ros.domain import DomainLease, take_domain
from etac_ros.report.figures.registry import FIGURES

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
FewFigures = Callable[..., None]


@pytest.fixture(autouse=True)
def environment() -> Iterator[None]:
    """Commands that are called in this process may set what holds for theirs; the next test has its own."""
    with patch.dict(os.environ):
        yield


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


@pytest.fixture
def few_figures(monkeypatch: pytest.MonkeyPatch) -> FewFigures:
    """Have reports draw some of their figures only: ``few_figures("torque")``. All of them take seconds."""

    def choose(*names: str) -> None:
        chosen = tuple(kind for kind in FIGURES if kind.name in names)
        assert {kind.name for kind in chosen} == set(names)
        monkeypatch.setattr("etac_ros.report.write.FIGURES", chosen)

    return choose


@pytest.fixture
def lease() -> Iterator[DomainLease]:
    """A ROS domain of the test's own."""
    lease = take_domain()
    yield lease
    lease.release()


@pytest.fixture
def start(tmp_path: Path, lease: DomainLease) -> Iterator[Start]:
    """Starts a process in the domain; all are ended by the test."""
    processes: list[subprocess.Popen[str]] = []
    path = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    # A foreign node has the rmw layer's own transports; shared memory would outlive its end by kill().
    environment = {
        **os.environ,
        "ROS_DOMAIN_ID": str(lease.domain),
        "PYTHONPATH": path,
        "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",
    }

    def begin(*arguments: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, *arguments],
            cwd=tmp_path,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        processes.append(process)
        return process

    yield begin
    for process in processes:
        process.kill()
        process.communicate()

"""A recorder that comes late sees everybody, also in a large formation: 40 participants on one machine."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from etac_ros.engines.ros.domain import take_domain
from etac_ros.engines.ros.environment import dds_environment
from etac_ros.errors import RunError
from etac_ros.runs import run_over_ros
from etac_ros.scenario.load import load

PARTICIPANTS = 40

# In a process of its own: a process that has initialised rclpy must not be forked afterwards.
SCRIPT = """
import sys
from pathlib import Path
import rclpy
import rclpy.executors
from rclpy.context import Context
from rclpy.node import Node
from std_msgs.msg import String

def participant(name):
    context = Context()
    rclpy.init(context=context)
    return Node(name, context=context, start_parameter_services=False, enable_rosout=False)

count = int(sys.argv[1])
nodes = [participant(f"participant_{i}") for i in range(count)]
publishers = [node.create_publisher(String, f"/topic_{i}", 10) for i, node in enumerate(nodes)]
late = participant("late_recorder")
executor = rclpy.executors.SingleThreadedExecutor(context=late.context)
executor.add_node(late)
seen, rounds = 0, 0
while seen < count and rounds < 2000:
    executor.spin_once(timeout_sec=0.01)
    seen = sum(late.count_publishers(f"/topic_{i}") for i in range(count))
    rounds += 1
print(seen)
"""


@pytest.mark.parametrize(
    ("participants", "options"),
    # More than Fast DDS finds where it is told nothing, and as many as a launcher that knows all tells it.
    [(PARTICIPANTS, {}), (8, {"private": True, "peers": 9})],
    ids=["of whom nobody knows how many there are", "of a launched run"],
)
def test_a_late_participant_sees_all(participants: int, options: dict[str, Any]) -> None:
    lease = take_domain()
    environment = {**os.environ, **dds_environment(lease.domain, **options)}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(participants)],
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    lease.release()
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) == participants


def test_more_processes_than_find_each_other_are_refused(tmp_path: Path) -> None:
    crowd = load("xie2021", None, ["formation.n=32", "duration_s=1"])
    with pytest.raises(RunError, match="130 processes") as caught:
        run_over_ros(crowd, tmp_path / "bag")
    assert "--processes namespace" in str(caught.value)
    assert not (tmp_path / "bag").exists()

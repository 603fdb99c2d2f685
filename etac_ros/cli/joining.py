"""How a command joins nodes that others have started: before rclpy is loaded, since the environment decides."""

from __future__ import annotations

import os

from etac_ros.engines.ros.environment import join_by_hand
from etac_ros.engines.ros.several_machines import Machines, find_peers


def join(domain: int, machines: Machines | None) -> None:
    """Look for the peers, and prepare the environment of this process.

    Raises
    ------
    ScenarioError
        If a peer cannot be reached, or with these settings no node could find another.
    """
    find_peers(machines, domain)
    join_by_hand(os.environ, domain, machines)

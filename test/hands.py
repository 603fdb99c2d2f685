"""Processes that a test starts by hand in a ROS domain of its own, and ends."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

Start = Callable[..., "subprocess.Popen[str]"]
LIMIT_S = 90


def foreign(start: Start, *options: str) -> subprocess.Popen[str]:
    """A foreign node that is ready."""
    process = start(str(Path(__file__).parent / "foreign_node.py"), *options)
    assert process.stdout is not None
    assert process.stdout.readline().strip() == "ready"
    return process

"""Processes that a test starts by hand in a ROS domain of its own, and ends."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

Start = Callable[..., "subprocess.Popen[str]"]
LIMIT_S = 90


def what_ros_says(questions: list[tuple[str, list[str]]], folder: Path) -> list[Any]:
    """What rcl makes of command lines, each with the name of its executable, in a folder."""
    script = Path(__file__).parent / "reads_arguments.py"
    done = subprocess.run(
        [sys.executable, script],
        input=json.dumps(questions),
        cwd=folder,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "[rcl]" not in done.stderr  # what it says is said once, by us
    answers: list[Any] = json.loads(done.stdout)
    return answers


def foreign(start: Start, *options: str) -> subprocess.Popen[str]:
    """A foreign node that is ready."""
    process = start(str(Path(__file__).parent / "foreign_node.py"), *options)
    assert process.stdout is not None
    assert process.stdout.readline().strip() == "ready"
    return process

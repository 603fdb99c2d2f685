"""Where scenario files stand, and which there are: known without reading any."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from etac_ros.errors import ScenarioError
from etac_ros.scenario.document import nearest


def find(name: str) -> Path:
    """The file of a scenario, by name or by path.

    Raises
    ------
    ScenarioError
        If there is none; the message names the nearest that exists.
    """
    given = Path(name)
    if given.suffix in (".yaml", ".yml") or len(given.parts) > 1:  # `ros2 launch` gives its files no ending
        return given  # whoever reads it says what is wrong with it
    folders = config_folders()
    for folder in folders:
        path = folder / f"{name}.yaml"
        if path.is_file():
            return path
    known = sorted({path.stem for folder in folders for path in folder.glob("*.yaml")})
    best = nearest(name, known)
    expected = f"'{best}'? (there are: {', '.join(known)})" if best else f"one of: {', '.join(known)}"
    raise ScenarioError(f"scenario '{name}'", "there is none of this name", expected, "or give a path to a .yaml")


def config_folders() -> list[Path]:
    """Where scenario files stand: beside the package in a checkout, or in a share folder once installed."""
    checkout = Path(__file__).resolve().parents[2] / "config"
    prefixes = [*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix]
    shares = [Path(prefix) / "share" / "etac_ros" / "config" for prefix in prefixes if prefix]
    return [folder for folder in [checkout, *dict.fromkeys(shares)] if folder.is_dir()]


def available() -> list[str]:
    """Names of the scenarios that are shipped."""
    return sorted({path.stem for folder in config_folders() for path in folder.glob("*.yaml")})

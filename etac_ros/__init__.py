"""Event-triggered attitude control of spacecraft as a graph of networked modules over ROS 2."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from etac_ros.export import open_bag as open_bag

__version__ = "0.1.0"


def __getattr__(name: str) -> Any:
    """Load what programs use of this package when they ask for it: importing the package alone costs nothing."""
    if name == "open_bag":
        return import_module("etac_ros.export").open_bag
    raise AttributeError(f"module 'etac_ros' has no attribute '{name}'")

"""What a spacecraft looks like in a 3-D view: its axes, a body with two panels, and the torque that it is given.

Nothing of this is simulated: the plants have inertias, not shapes. All is drawn in the body frame, 1 m wide.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from etac_ros.bag.mould import Mould, mark, marked_stamp
from etac_ros.parameters import FloatArray

MARKERS_TYPE = "visualization_msgs/msg/MarkerArray"
_ARROW, _CUBE = 0, 1  # constants of visualization_msgs/Marker
_AXIS_M, _SHAFT_M, _HEAD_M = 0.9, 0.03, 0.08
_AXES = {"x": (1.0, 0.2, 0.2), "y": (0.2, 0.8, 0.2), "z": (0.25, 0.45, 1.0)}
_BODY, _PANEL, _TORQUE = (0.75, 0.75, 0.78), (0.1, 0.25, 0.6), (1.0, 0.75, 0.1)
_DECADES = 4.0
_LARGEST_M = 2.0


def shape_mould(frame: str) -> Mould:
    """A message with body, panels and axes; its values have no columns."""
    markers = [
        _marker(frame, "body", 0, _CUBE, _BODY, scale=(0.5, 0.5, 0.6)),
        _marker(frame, "panels", 0, _CUBE, _PANEL, place=(0.0, 0.75, 0.0), scale=(0.4, 0.9, 0.02)),
        _marker(frame, "panels", 1, _CUBE, _PANEL, place=(0.0, -0.75, 0.0), scale=(0.4, 0.9, 0.02)),
        *(
            _marker(
                frame, f"axis {name}", 0, _ARROW, colour,
                scale=(_SHAFT_M, _HEAD_M, 0.0),
                tip=tuple(_AXIS_M * (axis == place) for axis in range(3)),
            )
            for place, (name, colour) in enumerate(_AXES.items())
        ),
    ]  # fmt: skip
    return _array(markers, 0)


def torque_mould(frame: str) -> Mould:
    """A message with an arrow; its values are the tip of it, see :func:`arrow_tips`."""
    tip = (mark(0), mark(1), mark(2))
    return _array([_marker(frame, "torque", 0, _ARROW, _TORQUE, scale=(0.05, 0.12, 0.0), tip=tip)], 3)


def arrow_tips(torques_nm: FloatArray) -> FloatArray:
    """Where arrows of torques end [m], shape (n, 3): 1 m for 1 N m, a quarter less for each decade less, 2 m at most.

    Control torques span decades between a manoeuvre and the steady state, and have to be seen in both.
    """
    size = np.linalg.norm(torques_nm, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        length = np.clip(1.0 + np.log10(size) / _DECADES, 0.0, _LARGEST_M)
        tips = torques_nm * (length / size)[:, np.newaxis]
    return np.where(size[:, np.newaxis] > 0.0, tips, 0.0)


def _array(markers: list[Any], columns: int) -> Mould:
    return Mould(MARKERS_TYPE, {"markers": markers}, columns)


def _marker(
    frame: str,
    name: str,
    number: int,
    kind: int,
    colour: tuple[float, float, float],
    scale: tuple[float, float, float],
    place: tuple[float, float, float] = (0.0, 0.0, 0.0),
    tip: tuple[float, ...] = (),
) -> dict[str, Any]:
    return {
        "header": {"stamp": marked_stamp(), "frame_id": frame},
        "ns": name,
        "id": number,
        "type": kind,
        "pose": {"position": _xyz(place), "orientation": {"w": 1.0}},
        "scale": _xyz(scale),
        "color": {**dict(zip("rgb", colour, strict=True)), "a": 1.0},
        "frame_locked": True,
        "points": [_xyz((0.0, 0.0, 0.0)), _xyz(tip)] if tip else [],
    }


def _xyz(components: tuple[float, ...]) -> dict[str, float]:
    return dict(zip("xyz", components, strict=True))

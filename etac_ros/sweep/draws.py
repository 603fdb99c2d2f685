"""What a run of a sweep draws: a pure function of (master seed, run, key), whoever computes it and in which order.

The grid point is no part of the key, so runs of the same number draw the same deviates at every grid point (common
random numbers), and differences between grid points are differences of pairs.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from etac_ros.errors import ScenarioError
from etac_ros.maths.mrp import mrp_to_quaternion
from etac_ros.maths.noise import normals, stream_key, uniforms
from etac_ros.maths.quaternion import product
from etac_ros.parameters import FloatArray, vector
from etac_ros.scenario.document import shown
from etac_ros.scenario.schema import Dispersion

_MRP = "_mrp"
_SEED_BITS = 63


def run_seed(master_seed: int, run: int) -> int:
    """The seed of a run's noise and lossy links; it fits into a signed 64-bit number."""
    return stream_key(master_seed, f"sweep/seed/{run}") >> (128 - _SEED_BITS)


def check_target(key: str, value: Any, dispersion: Dispersion, where: str) -> None:
    """Refuse to disperse what cannot be dispersed.

    Parameters
    ----------
    key
        NODE.KEY.
    value
        What stands there.
    dispersion
        What is to be drawn.
    where
        File and key, to begin messages with.

    Raises
    ------
    ScenarioError
        If the value is neither a number nor a list of numbers, or a rotation is asked of what is no attitude.
    """
    numbers = value if isinstance(value, list) else [value]
    if not numbers or not all(isinstance(number, float) for number in numbers):
        whole = all(isinstance(number, int) and not isinstance(number, bool) for number in numbers) and numbers
        found = f"{key} is {shown(value)}, which takes whole numbers only" if whole else f"{key} is {shown(value)}"
        raise ScenarioError(where, found, "the key of a number or of a list of numbers")
    if dispersion.rotation_deg is None:
        return
    length = len(value) if isinstance(value, list) else 1
    if length != 4 and not (length == 3 and key.endswith(_MRP)):
        raise ScenarioError(
            where,
            f"{key} is {shown(value)}, which rotation_deg cannot turn",
            f"a quaternion (4 numbers, scalar first) or an MRP (3 numbers, key ends in {_MRP})",
            "use normal or uniform",
        )


def dispersed(value: Any, key: str, dispersion: Dispersion, master_seed: int, run: int) -> float | list[float]:
    """A value as one run of a sweep has it.

    Parameters
    ----------
    value
        A number or a list of numbers, which :func:`check_target` has let pass.
    key
        NODE.KEY: the stream of the draws.
    dispersion
        How it is drawn.
    master_seed, run
        Which draws.
    """
    stream = stream_key(master_seed, f"sweep/{key}")
    numbers = vector(value if isinstance(value, list) else [value])
    if dispersion.rotation_deg is not None:
        result = _turned(numbers, np.radians(dispersion.rotation_deg) * normals(stream, run, 1, 3)[0])
    elif dispersion.normal is not None:
        result = numbers + dispersion.normal * normals(stream, run, 1, numbers.size)[0]
    else:
        assert dispersion.uniform is not None
        result = numbers + dispersion.uniform * (2.0 * uniforms(stream, run, 1, numbers.size)[0] - 1.0)
    return [float(number) for number in result] if isinstance(value, list) else float(result[0])


def _turned(attitude: FloatArray, rotation: FloatArray) -> FloatArray:
    """An attitude followed in the body by a rotation vector [rad]; a quaternion keeps its norm."""
    angle = float(np.linalg.norm(rotation))
    turn = np.concatenate([[np.cos(angle / 2.0)], np.sinc(angle / (2.0 * np.pi)) * rotation / 2.0])
    before = attitude if attitude.size == 4 else mrp_to_quaternion(attitude)
    after = np.empty(4)
    product(before, turn, after)
    if attitude.size == 4:
        return after
    after = -after if after[0] < 0.0 else after  # of the two MRPs of an attitude, the one that is not longer than 1
    return np.asarray(after[1:] / (1.0 + after[0]))

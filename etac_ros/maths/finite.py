"""Whether all of some numbers are numbers: asked after every step of every module, so it has to cost little."""

from __future__ import annotations

import math

import numpy as np

from etac_ros.parameters import FloatArray

_FEW = 16
"""So many are looked at one by one sooner than numpy has begun."""


def all_finite(values: FloatArray) -> bool:
    """Whether no element is infinite or NaN.

    Parameters
    ----------
    values
        Floating point, any shape.
    """
    if values.size <= _FEW:
        return all(map(math.isfinite, values.ravel().tolist()))
    return bool(np.isfinite(values).all())

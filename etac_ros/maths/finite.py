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
        numbers = (values if values.ndim == 1 else values.ravel()).tolist()
        # With one that is no number the sum is none; if it overflows it says nothing.
        return math.isfinite(sum(numbers)) or all(map(math.isfinite, numbers))
    return 0 not in np.isfinite(values).tobytes()  # in bytes a 0 is found sooner than a reduction has begun

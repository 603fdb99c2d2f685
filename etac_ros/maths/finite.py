"""Whether all of some numbers are numbers: asked after every step of every module, so it has to cost little."""

from __future__ import annotations

import math

import numpy as np

from etac_ros.parameters import FloatArray

_FEW = 16
"""So many are looked at one by one sooner than numpy has begun."""
_SUMMED = 4096
"""The squares of so many are summed sooner than each is looked at; of more, linear algebra would start threads."""


def all_finite(values: FloatArray) -> bool:
    """Whether no element is infinite or NaN.

    Parameters
    ----------
    values
        Floating point, any shape.
    """
    if values.size <= _FEW:
        return all(map(math.isfinite, (values if values.ndim == 1 else values.ravel()).tolist()))
    if values.size <= _SUMMED:
        flat = values.ravel()
        with np.errstate(over="ignore", invalid="ignore"):
            squares = flat.dot(flat)
        if math.isfinite(squares):  # with one that is no number it is none; if it overflows it says nothing
            return True
    return bool(np.isfinite(values).all())

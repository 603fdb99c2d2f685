"""The layout of a truth message: committed samples of one plant in one ``std_msgs/Float64MultiArray``.

``data[0]`` is the tick of the first sample and ``layout.data_offset`` is 1, which is what MultiArrayLayout
has that field for: padding in front of the data. The samples follow row by row; the dimensions are (ticks,
states). The message is logged at the time of its last sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from etac_ros.parameters import FloatArray

DATA_OFFSET = 1
MOST_SAMPLES = 1024
"""Samples in one truth message at most, so that none grows beyond what DDS carries quickly."""


class Dimension(NamedTuple):
    """One ``std_msgs/MultiArrayDimension``."""

    label: str
    size: int
    stride: int


def dimensions(ticks: int, states: int) -> tuple[Dimension, Dimension]:
    """Make the ``layout.dim`` of a truth message."""
    return Dimension("tick", ticks, ticks * states), Dimension("state", states, states)


def unpack_truth(data: FloatArray, data_offset: int, sizes: Sequence[int]) -> tuple[int, FloatArray]:
    """Read the samples back.

    Parameters
    ----------
    data, data_offset
        Fields of the message.
    sizes
        The sizes of its dimensions.

    Returns
    -------
    int, ndarray
        Tick of the first sample, and the samples, shape (ticks, states).

    Raises
    ------
    ValueError
        If the message is not laid out like that.
    """
    if data_offset != DATA_OFFSET or len(sizes) != 2:
        raise ValueError(f"data_offset {data_offset} and {len(sizes)} dimensions instead of {DATA_OFFSET} and 2")
    ticks, states = sizes
    if ticks < 1 or data.shape != (DATA_OFFSET + ticks * states,):
        raise ValueError(f"{data.size} numbers instead of a tick and {ticks} x {states} samples")
    if not (data[0] >= 0.0 and data[0].is_integer()):
        raise ValueError(f"{data[0]} is no tick")
    return int(data[0]), np.array(data[DATA_OFFSET:], dtype=np.float64).reshape(ticks, states)

"""Fewer points for drawing, with every peak kept."""

from __future__ import annotations

import numpy as np

from etac_ros.parameters import FloatArray


def decimated(times_s: FloatArray, values: FloatArray, buckets: int) -> tuple[FloatArray, FloatArray]:
    """Keep the smallest and the largest value of each bucket of neighbouring samples, in their order in time.

    Parameters
    ----------
    times_s, values
        Samples of one curve, shape (n,).
    buckets
        About one a pixel column. A curve of fewer than four points a bucket is returned as it is.

    Returns
    -------
    times_s, values
        At most ``2 buckets + 2`` points; the first and the last one are always among them.
    """
    count = values.size
    if count < 4 * buckets:
        return times_s, values
    size = -(-count // buckets)
    # The last bucket is filled up with copies of the last sample, which cannot become a new extreme.
    filled = np.concatenate([values, np.full(-count % size, values[-1])]).reshape(-1, size)
    starts = np.arange(filled.shape[0]) * size
    chosen = np.concatenate([[0], starts + filled.argmin(axis=1), starts + filled.argmax(axis=1), [count - 1]])
    kept = np.unique(np.minimum(chosen, count - 1))
    return times_s[kept], values[kept]

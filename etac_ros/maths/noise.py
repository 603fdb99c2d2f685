"""Random numbers that belong to a tick: the same draws whatever the windows were.

A counter-based generator (Philox 4x64) is keyed by (seed, stream) and positioned by the tick. Every tick owns
a fixed number of raw words, turned into normal deviates by the inverse distribution; a sampler that rejects
would take a varying number and lose the random access.
"""

from __future__ import annotations

import hashlib
from functools import lru_cache

import numpy as np

from etac_ros.parameters import FloatArray

_WORDS_A_BLOCK = 4
_INDICES_A_BLOCK = 32


@lru_cache(maxsize=4096)
def stream_key(seed: int, stream: str) -> int:
    """128-bit Philox key of a named stream (for instance a sensor's full name) under a seed."""
    return int.from_bytes(hashlib.sha256(f"{seed}/{stream}".encode()).digest()[:16], "little")


def uniforms(key: int, index: int, count: int, width: int) -> FloatArray:
    """Uniform deviates in (0, 1) of consecutive indices.

    Parameters
    ----------
    key
        From :func:`stream_key`.
    index
        First index: a tick, or a message's sequence number.
    count
        Number of consecutive indices.
    width
        Deviates per index.

    Returns
    -------
    ndarray, shape (count, width)
    """
    blocks = -(-width // _WORDS_A_BLOCK)
    generator = np.random.Philox(key=key, counter=index * blocks)
    words = generator.random_raw(count * blocks * _WORDS_A_BLOCK).reshape(count, blocks * _WORDS_A_BLOCK)
    # 52 bits and a half are exact; one bit more would round the largest up to 1, whose deviate is infinite.
    result: FloatArray = ((words[:, :width] >> np.uint64(12)).astype(np.float64) + 0.5) * 2.0**-52
    return result


def uniform(key: int, index: int) -> float:
    """The first deviate of one index, the same bits as ``uniforms(key, index, 1, 1)[0, 0]``.

    Cheap where neighbouring indices are asked for one by one: a generator is made once for a block of them.
    """
    return _block(key, index // _INDICES_A_BLOCK)[index % _INDICES_A_BLOCK]


@lru_cache(maxsize=4096)
def _block(key: int, number: int) -> list[float]:
    found: list[float] = uniforms(key, number * _INDICES_A_BLOCK, _INDICES_A_BLOCK, 1)[:, 0].tolist()
    return found


def normals(key: int, tick: int, count: int, width: int) -> FloatArray:
    """Standard normal deviates of ``count`` ticks from ``tick`` on, shape (count, width)."""
    from scipy.special import ndtri  # here, because only noise needs it and it takes a fifth of a second to load

    return np.ascontiguousarray(ndtri(uniforms(key, tick, count, width)))

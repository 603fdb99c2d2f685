"""Vectors and 3x3 matrices inside kernels: written out, so that windows and single samples give the same bits."""

from __future__ import annotations

from etac_ros.maths.compiled import inlined


@inlined
def cross(a, b, out):  # type: ignore[no-untyped-def]
    """``a x b`` into ``out``, which must be neither of them."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@inlined
def multiply(matrix, v, out):  # type: ignore[no-untyped-def]
    """Row-major 3x3 ``matrix`` (9 numbers) times ``v`` into ``out``, which must not be ``v``."""
    for i in range(3):
        out[i] = matrix[3 * i] * v[0] + matrix[3 * i + 1] * v[1] + matrix[3 * i + 2] * v[2]


@inlined
def multiply_transposed(matrix, v, out):  # type: ignore[no-untyped-def]
    """Transposed row-major 3x3 ``matrix`` (9 numbers) times ``v`` into ``out``, which must not be ``v``."""
    for i in range(3):
        out[i] = matrix[i] * v[0] + matrix[3 + i] * v[1] + matrix[6 + i] * v[2]


@inlined
def turn(C, v, out):  # type: ignore[no-untyped-def]
    """Direction cosine matrix ``C``, shape (3, 3), times ``v`` into ``out``, which must not be ``v``."""
    for i in range(3):
        out[i] = C[i, 0] * v[0] + C[i, 1] * v[1] + C[i, 2] * v[2]

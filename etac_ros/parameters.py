"""The base of every parameter set, and the field types that they share.

A matrix is a row-major list, because ROS parameter files have no nested lists.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
import numpy.typing as npt
from pydantic import AfterValidator, BaseModel, ConfigDict, FiniteFloat, PositiveFloat
from pydantic_core import PydanticCustomError

FloatArray = npt.NDArray[np.float64]


class Parameters(BaseModel):
    """Parameters of one class: unknown keys, NaN and wrong types are refused, and nothing changes later."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


EXACTLY_ONE = "exactly_one"
"""Type of the fault that :func:`exactly_one` raises."""


def exactly_one(parameters: Parameters, *keys: str) -> None:
    """Refuse parameters that do not give exactly one of the keys; for a model validator.

    Raises
    ------
    PydanticCustomError
        Of the type :data:`EXACTLY_ONE`; whoever reads a scenario can tell from it how to take one away.
    """
    given = [key for key in keys if getattr(parameters, key) is not None]
    if len(given) != 1:
        raise PydanticCustomError(
            EXACTLY_ONE, "exactly one of {names}", {"names": ", ".join(keys), "keys": keys, "given": given}
        )


def _inertia(values: tuple[float, ...]) -> tuple[float, ...]:
    matrix = np.array(values).reshape(3, 3)
    if not np.allclose(matrix, matrix.T, rtol=0.0, atol=1e-9 * np.abs(matrix).max()):
        raise ValueError("a symmetric matrix")
    smallest = float(np.linalg.eigvalsh(matrix)[0])
    if smallest <= 0.0:
        raise ValueError(f"a positive definite matrix; the smallest eigenvalue is {smallest:.6g}")
    return values


def _unit(values: tuple[float, ...]) -> tuple[float, ...]:
    norm = float(np.linalg.norm(values))
    if abs(norm - 1.0) > 1e-6:
        raise ValueError(f"a unit quaternion, scalar first; the norm is {norm:.9g}")
    return values


Vector3 = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
Vector4 = tuple[FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat]
Matrix3 = tuple[
    FiniteFloat, FiniteFloat, FiniteFloat,
    FiniteFloat, FiniteFloat, FiniteFloat,
    FiniteFloat, FiniteFloat, FiniteFloat,
]  # fmt: skip
UnitQuaternion = Annotated[Vector4, AfterValidator(_unit)]
Inertia = Annotated[Matrix3, AfterValidator(_inertia)]
PositiveVector3 = tuple[PositiveFloat, PositiveFloat, PositiveFloat]


def vector(values: Sequence[float]) -> FloatArray:
    """The parameter list as a contiguous float64 vector."""
    return np.array(values, dtype=np.float64)


def square(values: Sequence[float]) -> FloatArray:
    """The row-major parameter list as a contiguous square matrix."""
    size = round(len(values) ** 0.5)
    return np.array(values, dtype=np.float64).reshape(size, size)

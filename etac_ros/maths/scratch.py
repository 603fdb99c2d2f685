"""Working memory of kernels: on the stack, where the compiler keeps small arrays in registers.

``np.empty`` inside a kernel is a call of the memory manager, and what lies behind a pointer from there has to be
written and read in the order of the source. A small array on the stack costs nothing, and its elements become
variables as soon as loops over it are unrolled: the same formula, with the same bits, in a fraction of the time.
"""

from __future__ import annotations

import math
from importlib import import_module
from typing import Any

import numpy as np

from etac_ros.maths.compiled import once_numba_is_there
from etac_ros.parameters import FloatArray

_OF_NUMBA = ("llvmlite.ir", "numba.core.cgutils", "numba.core.types", "numba.extending", "numba.np.arrayobj")


def scratch(size: int) -> FloatArray:
    """Make a vector of numbers for use within one kernel, uninitialised.

    It belongs to the function that asks for it, and must not be returned from there. Within a kernel the size is a
    constant; asked for in a loop it is the same memory each time.

    Parameters
    ----------
    size
        Length.
    """
    return np.empty(size)


def scratch_matrix(rows: int, columns: int) -> FloatArray:
    """Make a matrix for use within one kernel: as :func:`scratch`.

    Parameters
    ----------
    rows, columns
        Its shape.
    """
    return np.empty((rows, columns))


def _tell() -> None:
    # Numba and llvmlite say no types of their own.
    ir, cgutils, types, extending, arrays = map(import_module, _OF_NUMBA)

    def array_of(*sizes: Any) -> Any:
        constant = all(isinstance(size, types.IntegerLiteral) for size in sizes)
        return types.Array(types.float64, len(sizes), "C") if constant else None

    extending.type_callable(scratch)(lambda context: lambda size: array_of(size))
    extending.type_callable(scratch_matrix)(lambda context: lambda rows, columns: array_of(rows, columns))

    # Written into the frame of whoever calls: a function of its own would hand out memory of a frame that has ended.
    def on_stack(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        shape = [size.literal_value for size in signature.args]
        item = np.dtype(np.float64).itemsize
        number = context.get_value_type(types.float64)
        memory = cgutils.alloca_once(builder, ir.ArrayType(number, math.prod(shape)))
        made = arrays.make_array(signature.return_type)(context, builder)

        def constants(values: list[int]) -> list[Any]:
            return [context.get_constant(types.intp, value) for value in values]

        arrays.populate_array(
            made,
            data=builder.bitcast(memory, number.as_pointer()),
            shape=constants(shape),
            strides=constants([item * math.prod(shape[place + 1 :]) for place in range(len(shape))]),
            itemsize=context.get_constant(types.intp, item),
            meminfo=None,
        )
        return made._getvalue()

    literal = types.IntegerLiteral
    extending.lower_builtin(scratch, literal)(on_stack)
    extending.lower_builtin(scratch_matrix, literal, literal)(on_stack)


once_numba_is_there(_tell)

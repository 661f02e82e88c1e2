"""Counting on several threads at once."""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic


def _instruction(function: Callable[..., Any]) -> Any:
    """Let kernels call what a function of the types of its arguments describes."""
    return intrinsic(function)


@_instruction
def take_number(_: Any, counters: types.Array, place: types.Integer) -> Any:
    """Raise one of some counters, an array of int64, by one; returns what it was.

    Threads that do so at the same time get different numbers.
    """

    def code(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        from numba.np.arrayobj import make_array

        array = make_array(counters)(context, builder, arguments[0])
        index = context.cast(builder, arguments[1], place, types.intp)
        one = ir.Constant(ir.IntType(64), 1)
        return builder.atomic_rmw("add", builder.gep(array.data, [index]), one, "monotonic")

    return types.int64(counters, place), code

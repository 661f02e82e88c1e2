"""Arrays carved out of one buffer: for kernels that would take longer to allocate than to count."""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from kinarm.kernels.lanes import LANES, NUMBERS, lanes


def _instruction(function: Callable[..., Any]) -> Any:
    """Let kernels call what a function of the types of its arguments describes."""
    return intrinsic(function)


def _carved(buffer: types.Array, entry: types.Type, used: types.Array, shape: Any) -> Any:
    """Type of a carved array, and the code that carves it."""
    view = types.Array(entry, len(shape), "C", aligned=False)
    each = LANES if entry == lanes else 1

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        from numba.core import cgutils
        from numba.core.imputils import impl_ret_borrowed
        from numba.np.arrayobj import make_array, populate_array

        given = make_array(buffer)(context, builder, arguments[0])
        counter = make_array(used)(context, builder, arguments[1]).data
        lengths = cgutils.unpack_tuple(builder, arguments[2], len(shape))
        lengths = [
            context.cast(builder, length, kind, types.intp)
            for length, kind in zip(lengths, signature.args[2], strict=True)
        ]
        strides = [context.get_constant(types.intp, 8 * each)]
        for length in lengths[:0:-1]:
            strides.insert(0, builder.mul(strides[0], length))
        start = builder.load(counter)
        taken = builder.mul(strides[0], lengths[0])
        shift = context.get_constant(types.intp, 3)
        builder.store(builder.add(start, builder.lshr(taken, shift)), counter)
        pointer = builder.gep(given.data, [start])
        made = make_array(view)(context, builder)
        element = NUMBERS if entry == lanes else ir.DoubleType()
        populate_array(
            made,
            data=builder.bitcast(pointer, element.as_pointer()),
            shape=lengths,
            strides=strides,
            itemsize=context.get_constant(types.intp, 8 * each),
            meminfo=given.meminfo,
            parent=given.parent,
        )
        return impl_ret_borrowed(context, builder, view, made._getvalue())

    return view(buffer, used, shape), code


@_instruction
def carve_lanes(_: Any, buffer: types.Array, used: types.Array, shape: types.BaseTuple) -> Any:
    """View the next entries of a buffer of float64 as an array of lanes.

    ``used``, an array of one whole number, counts the numbers that are in use; the buffer has to
    have room for as many more as the array takes.
    """
    return _carved(buffer, lanes, used, shape)


@_instruction
def carve_numbers(_: Any, buffer: types.Array, used: types.Array, shape: types.BaseTuple) -> Any:
    """View the next entries of a buffer as an array of float64; see `carve_lanes`."""
    return _carved(buffer, types.float64, used, shape)

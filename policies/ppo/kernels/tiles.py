"""Products of matrices whose sums stay in vector registers."""

from collections.abc import Callable, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.cgutils import alloca_once_value, for_range
from numba.extending import intrinsic
from numba.np.arrayobj import make_array
from numpy.typing import NDArray

from kinarm.kernels.compiling import helper

Numbers = NDArray[np.float32]

LANES = 16
"""Numbers of single precision that the widest vector registers hold."""
ROWS = 8
"""Rows of a tile: with two columns of vectors, its sums fill half of the widest registers."""

NUMBER, WORD = ir.FloatType(), ir.IntType(64)
VECTOR = ir.VectorType(NUMBER, LANES)

Pointers = Callable[[Any, Any], Any]
"""Pointers to the entries of a matrix, by row and column."""


class Matrix(NamedTuple):
    """A matrix in an array of numbers: where it begins, and how far apart rows and columns are."""

    numbers: Numbers
    first: int
    row: int
    column: int


def _tile(columns: int) -> Any:
    """Make a kernels' function for `ROWS` rows and so many columns, counted in vectors."""

    @intrinsic
    def tile(
        _: Any, left: types.Type, right: types.Type, start: types.Type, sink: types.Type, depth: Any
    ) -> Any:
        def code(context: Any, builder: Any, signature: Any, arguments: Any) -> None:
            *matrices, depth = arguments
            entries = [
                _pointers(context, builder, kind, given)
                for kind, given in zip(signature.args, matrices, strict=False)
            ]
            _multiply(builder, columns, entries, depth)

        return types.void(left, right, start, sink, depth), code

    return tile


def _pointers(context: Any, builder: Any, kind: Any, given: Any) -> Pointers:
    """Make a function that gives pointers to entries of a `Matrix`, by row and column."""
    numbers, first, *strides = (builder.extract_value(given, k) for k in range(4))
    array: Any = make_array(kind.types[0])
    data = array(context, builder, numbers).data

    def pointer(*place: Any) -> Any:
        row, column = (
            builder.mul(WORD(number) if isinstance(number, int) else number, stride)
            for number, stride in zip(place, strides, strict=True)
        )
        return builder.gep(data, [builder.add(first, builder.add(row, column))])

    return pointer


def _multiply(builder: Any, columns: int, matrices: Sequence[Pointers], depth: Any) -> None:
    """Emit the loop over the depth: in each round, a column of tiles times a row of vectors."""
    left, right, start, sink = matrices

    def vector(matrix: Pointers, row: Any, column: int) -> Any:
        return builder.bitcast(matrix(row, column * LANES), VECTOR.as_pointer())

    sums = {
        place: alloca_once_value(builder, builder.load(vector(start, *place), align=4))
        for place in product(range(ROWS), range(columns))
    }
    form = ir.FunctionType(VECTOR, [VECTOR] * 3)
    fused = builder.module.declare_intrinsic(f"llvm.fma.v{LANES}f32", (), form)
    nothing = ir.Constant(VECTOR, ir.Undefined)
    lanes = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    with for_range(builder, depth) as loop:
        vectors = [builder.load(vector(right, loop.index, k), align=4) for k in range(columns)]
        for row in range(ROWS):
            number = builder.load(left(row, loop.index), align=4)
            single = builder.insert_element(nothing, number, ir.IntType(32)(0))
            factor = builder.shuffle_vector(single, nothing, lanes)
            for column, other in enumerate(vectors):
                total = sums[row, column]
                builder.store(builder.call(fused, [factor, other, builder.load(total)]), total)
    for place, total in sums.items():
        builder.store(builder.load(total), vector(sink, *place), align=4)


_wide, _narrow = _tile(2), _tile(1)


@helper
def multiply(
    rows: int, columns: int, depth: int, left: Matrix, right: Matrix, start: Matrix, sink: Matrix
) -> None:
    """Fill ``sink`` with ``start`` plus the product of ``left`` and ``right``.

    Parameters
    ----------
    rows, columns : int
        Size of ``sink``: multiples of `ROWS` and `LANES`.
    depth : int
        How many products make up an entry; they are added one after the other.
    left, right, start, sink : Matrix
        The columns of all but ``left`` are adjacent.
    """
    for row in range(0, rows, ROWS):
        for column in range(0, columns, 2 * LANES):
            a = Matrix(left.numbers, left.first + row * left.row, left.row, left.column)
            b = Matrix(right.numbers, right.first + column, right.row, 1)
            s = Matrix(start.numbers, start.first + row * start.row + column, start.row, 1)
            c = Matrix(sink.numbers, sink.first + row * sink.row + column, sink.row, 1)
            if column + LANES < columns:
                _wide(a, b, s, c, depth)
            else:
                _narrow(a, b, s, c, depth)

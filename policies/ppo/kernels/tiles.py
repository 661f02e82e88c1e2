"""Products of matrices whose sums stay in vector registers."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from kinarm.kernels.compiling import helper

Numbers = NDArray[np.float32]

LANES = 16
"""Numbers of single precision that the widest vector registers hold."""
ROWS = 8
"""Rows of a tile: with two columns of vectors, its sums fill half of the widest registers."""

NUMBER, WORD = ir.FloatType(), ir.IntType(64)
VECTOR = ir.VectorType(NUMBER, LANES)


class Matrix(NamedTuple):
    """A matrix in an array of numbers.

    Attributes
    ----------
    numbers : ndarray of float32, shape (n,)
        What holds it.
    first : int
        Index of its first entry.
    row, column : int
        How far apart rows and columns are.
    """

    numbers: Numbers
    first: int
    row: int
    column: int


def _tile(columns: int) -> Any:
    """Make a kernels' function for `ROWS` rows and so many columns, counted in vectors."""

    @intrinsic
    def product(
        _: Any, left: types.Type, right: types.Type, start: types.Type, sink: types.Type, depth: Any
    ) -> Any:
        def code(context: Any, builder: Any, signature: Any, arguments: Any) -> None:
            *matrices, depth = arguments
            entries = [
                _Entries(context, builder, kind, given)
                for kind, given in zip(signature.args, matrices, strict=False)
            ]
            _multiply(builder, columns, entries, depth)

        return types.void(left, right, start, sink, depth), code

    return product


class _Entries:
    """Where the entries of a `Matrix` lie in memory."""

    def __init__(self, context: Any, builder: Any, kind: Any, given: Any) -> None:
        from numba.np.arrayobj import make_array

        numbers, self._first, self._row, self._column = (
            builder.extract_value(given, k) for k in range(4)
        )
        array: Any = make_array(kind.types[0])
        self._data = array(context, builder, numbers).data
        self._builder = builder

    def number(self, row: Any, column: Any) -> Any:
        """Pointer to an entry."""
        builder = self._builder
        across = builder.add(builder.mul(row, self._row), builder.mul(column, self._column))
        return builder.gep(self._data, [builder.add(self._first, across)])

    def vector(self, row: Any, column: int) -> Any:
        """Pointer to `LANES` entries of a row."""
        at = self.number(row, ir.Constant(WORD, column * LANES))
        return self._builder.bitcast(at, VECTOR.as_pointer())


def _multiply(builder: Any, columns: int, matrices: Sequence[_Entries], depth: Any) -> None:
    """Emit the loop over the depth: in each round, a column of tiles times a row of vectors."""
    left, right, start, sink = matrices
    places = [(row, column) for row in range(ROWS) for column in range(columns)]
    whole = [ir.Constant(WORD, row) for row in range(ROWS)]
    begun = [builder.load(start.vector(whole[r], c), align=4) for r, c in places]
    fused = builder.module.declare_intrinsic(
        f"llvm.fma.v{LANES}f32", (), ir.FunctionType(VECTOR, [VECTOR] * 3)
    )
    before = builder.block
    head, body, after = (builder.append_basic_block(name) for name in ("head", "body", "after"))
    builder.branch(head)

    builder.position_at_end(head)
    k = builder.phi(WORD)
    k.add_incoming(ir.Constant(WORD, 0), before)
    sums = [builder.phi(VECTOR) for _ in places]
    for total, value in zip(sums, begun, strict=True):
        total.add_incoming(value, before)
    builder.cbranch(builder.icmp_signed("<", k, depth), body, after)

    builder.position_at_end(body)
    vectors = [builder.load(right.vector(k, column), align=4) for column in range(columns)]
    nothing = ir.Constant(VECTOR, ir.Undefined)
    lanes = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    for row in range(ROWS):
        number = builder.load(left.number(whole[row], k), align=4)
        single = builder.insert_element(nothing, number, ir.Constant(ir.IntType(32), 0))
        factor = builder.shuffle_vector(single, nothing, lanes)
        for column in range(columns):
            total = sums[row * columns + column]
            total.add_incoming(builder.call(fused, [factor, vectors[column], total]), body)
    k.add_incoming(builder.add(k, ir.Constant(WORD, 1)), body)
    builder.branch(head)

    builder.position_at_end(after)
    for total, (row, column) in zip(sums, places, strict=True):
        builder.store(total, sink.vector(whole[row], column), align=4)


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

"""Forward and backward passes of dense networks over a block of samples.

Matrices are multiplied tile by tile; sums stay in vector registers. Loops run over slices from zero
on: only then are they compiled to vectors.
"""

from collections.abc import Callable, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.cgutils import alloca_once_value, for_range
from numba.extending import intrinsic, register_jitable
from numba.np.arrayobj import make_array
from numpy.typing import NDArray

from kinarm.kernels.compiling import helper, inlined, kernel

Numbers = NDArray[np.float32]

LANES = 16
"""Single-precision numbers in the widest vector registers."""
ROWS = 8
"""Rows of a tile: with two columns of vectors, sums fill half the registers."""

NUMBER, WORD = ir.FloatType(), ir.IntType(64)
VECTOR = ir.VectorType(NUMBER, LANES)

Pointers = Callable[[Any, Any], Any]
"""Pointers to the entries of a matrix, by row and column."""


class Matrix(NamedTuple):
    """A matrix in an array: where it begins, and strides of rows and columns."""

    numbers: Numbers
    first: int
    row: int
    column: int


def _tile(columns: int) -> Any:
    """Make a function for tiles of `ROWS` rows and so many vectors."""

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
    """Make a function that returns pointers to entries of a `Matrix`."""
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
    """Emit the loop over the depth: a column of numbers times a row of vectors."""
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
        How many products make up an entry; they are added in order.
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


BLOCK = 64
"""Samples that pass together; their activations stay in the cache."""

ONE = np.float32(1.0)

N_IN, N_OUT, WEIGHTS, TURNED, INPUTS, OUTPUTS = range(6)
"""Columns of a table of layers: widths and places."""


class Network(NamedTuple):
    """A dense network with tanh between its layers.

    ``layers`` holds per layer its widths, and where its weights begin in ``weights`` (inputs x
    outputs, then the bias) and, transposed, in ``turned``, and values in a work space. Rows are
    padded with zeros to whole vectors. ``work`` is the least length of the work space, ``widest``
    the largest padded width.
    """

    layers: NDArray[np.int64]
    weights: Numbers
    turned: Numbers
    work: int
    widest: int


@register_jitable
def padded(width: int) -> int:
    """The width in whole vectors."""
    return (width + LANES - 1) // LANES * LANES


@inlined
def hyperbolic_tangent(x: np.float32) -> np.float32:
    """Hyperbolic tangent to within 5e-7, as in Eigen and XLA."""
    bound = np.float32(7.90531110763549805)
    x = min(max(x, -bound), bound)
    z = x * x
    p = z * np.float32(-2.76076847742355e-16) + np.float32(2.00018790482477e-13)
    p = z * p + np.float32(-8.60467152213735e-11)
    p = z * p + np.float32(5.12229709037114e-08)
    p = z * p + np.float32(1.48572235717979e-05)
    p = z * p + np.float32(6.37261928875436e-04)
    p = z * p + np.float32(4.89352455891786e-03)
    q = z * np.float32(1.19825839466702e-06) + np.float32(1.18534705686654e-04)
    q = z * q + np.float32(2.26843463243900e-03)
    q = z * q + np.float32(4.89352518554385e-03)
    return x * p / q


@helper
def forward(network: Network, rows: int, work: Numbers) -> None:
    """Pass samples through all layers, in rows of a work space.

    Their number is a multiple of `ROWS`, at most `BLOCK`.
    """
    layers, weights = network.layers, network.weights
    for layer in range(layers.shape[0]):
        n_in = layers[layer, N_IN]
        wide_in, wide_out = padded(n_in), padded(layers[layer, N_OUT])
        first, sink = layers[layer, WEIGHTS], layers[layer, OUTPUTS]
        multiply(
            rows,
            wide_out,
            n_in,
            Matrix(work, layers[layer, INPUTS], wide_in, 1),
            Matrix(weights, first, wide_out, 1),
            Matrix(weights, first + wide_in * wide_out, 0, 1),
            Matrix(work, sink, wide_out, 1),
        )
        if layer < layers.shape[0] - 1:
            outputs = work[sink : sink + rows * wide_out]
            for k in range(len(outputs)):
                outputs[k] = hyperbolic_tangent(outputs[k])


@helper
def backward(
    network: Network, rows: int, samples: int, work: Numbers, behind: Numbers, gradient: Numbers
) -> None:
    """Add the gradient of a sum over samples that `forward` has seen.

    Parameters
    ----------
    network, rows, work
        As for `forward`; derivatives replace outputs: those of the network
        before the call, those of the other layers in it.
    samples : int
        The number of samples that count.
    behind : ndarray of float32
        Work space for the widest layer, and a row of zeros.
    gradient : ndarray of float32
        Derivatives by the weights; changed.
    """
    layers = network.layers
    for layer in range(layers.shape[0] - 1, -1, -1):
        wide_in, wide_out = padded(layers[layer, N_IN]), padded(layers[layer, N_OUT])
        first, source = layers[layer, WEIGHTS], layers[layer, INPUTS]
        delta = Matrix(work, layers[layer, OUTPUTS], wide_out, 1)
        into = Matrix(gradient, first, wide_out, 1)
        inputs = Matrix(work, source, 1, wide_in)
        multiply(wide_in, wide_out, samples, inputs, delta, into, into)
        bias = gradient[first + wide_in * wide_out : first + (wide_in + 1) * wide_out]
        for s in range(samples):
            row = work[delta.first + s * wide_out : delta.first + (s + 1) * wide_out]
            for j in range(len(bias)):
                bias[j] += row[j]
        if layer > 0:
            turned = Matrix(network.turned, layers[layer, TURNED], wide_in, 1)
            zeros = Matrix(behind, behind.shape[0] - wide_in, 0, 1)
            back = Matrix(behind, 0, wide_in, 1)
            multiply(rows, wide_in, layers[layer, N_OUT], delta, turned, zeros, back)
            outputs = work[source : source + rows * wide_in]
            for k in range(len(outputs)):
                outputs[k] = behind[k] * (ONE - outputs[k] * outputs[k])


@inlined
def load_sample(
    observations: Numbers, i: int, layers: NDArray[np.int64], work: Numbers, s: int
) -> None:
    """Copy an observation into a work space."""
    wide = padded(layers[0, N_IN])
    seen, taken = observations[i], work[s * wide : (s + 1) * wide]
    for j in range(len(seen)):
        taken[j] = seen[j]


@inlined
def whole_tiles(samples: int) -> int:
    """Rows of a block that holds so many samples."""
    return (samples + ROWS - 1) // ROWS * ROWS


@kernel
def evaluate(
    first: int, last: int, network: Network, observations: Numbers, outputs: Numbers
) -> None:
    """Evaluate a network.

    Parameters
    ----------
    first, last : int
        Range of the rows.
    observations, outputs : ndarray of float32, shape (n, n_observations) and (n, n_out)
        Inputs, and what is filled in.
    """
    layers = network.layers
    work = np.zeros(network.work, dtype=np.float32)
    end = layers.shape[0] - 1
    sink, wide_out = layers[end, OUTPUTS], padded(layers[end, N_OUT])
    for begin in range(first, last, BLOCK):
        samples = min(BLOCK, last - begin)
        for s in range(samples):
            load_sample(observations, begin + s, layers, work, s)
        forward(network, whole_tiles(samples), work)
        for s in range(samples):
            for j in range(outputs.shape[1]):
                outputs[begin + s, j] = work[sink + s * wide_out + j]


@kernel
def transpose(network: Network) -> None:
    """Fill in the transposed matrices of a network."""
    layers = network.layers
    for layer in range(1, layers.shape[0]):
        n_in, n_out = layers[layer, N_IN], layers[layer, N_OUT]
        first, sink = layers[layer, WEIGHTS], layers[layer, TURNED]
        wide_in, wide_out = padded(n_in), padded(n_out)
        for j in range(n_out):
            for i in range(n_in):
                network.turned[sink + j * wide_in + i] = network.weights[first + i * wide_out + j]

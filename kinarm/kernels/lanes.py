"""Several episodes in one SIMD value: a type for kernels, and functions of it or numbers.

A value of type ``lanes`` holds a number for each of `LANES` episodes. Arithmetic, comparisons,
``min``, ``max``, ``abs`` and ``math.sqrt`` act on all at once, and lanes mix with numbers. Elements
of an array from `as_lanes` are such values. So formulas without branches on values serve single
episodes and blocks, with the same bits: nothing is reordered or contracted.
"""

import math
import operator
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.typeconv.castgraph import Conversion
from numba.core.typing.arraydecl import GetItemBuffer, SetItemBuffer
from numba.core.typing.templates import AbstractTemplate, Signature, infer_global, signature
from numba.extending import intrinsic, lower_builtin, lower_cast, models, register_model

from kinarm.kernels.views import FIRST, WORD, ViewType, view_at

LANES = 8
"""Episodes in a value: doubles of the widest vector registers."""

NUMBERS = ir.VectorType(ir.DoubleType(), LANES)
BITS = ir.VectorType(ir.IntType(1), LANES)
WHOLE = ir.VectorType(ir.IntType(64), LANES)


class LanesType(types.Type):
    """Type of a number for each episode."""

    vector = NUMBERS

    def __init__(self) -> None:
        super().__init__(name=f"lanes{LANES}")

    def can_convert_from(self, _: Any, other: types.Type) -> Conversion | None:
        """Numbers convert to one number for all episodes."""
        return Conversion.safe if isinstance(other, types.Float | types.Integer) else None

    def unify(self, _: Any, other: types.Type) -> types.Type | None:
        """Numbers on one path and lanes on another are lanes."""
        return self if isinstance(other, types.Float | types.Integer) else None


class MaskType(types.Type):
    """Type of a truth value for each episode."""

    vector = BITS

    def __init__(self) -> None:
        super().__init__(name=f"mask{LANES}")


lanes, mask = LanesType(), MaskType()


@register_model(LanesType)
@register_model(MaskType)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, kind.vector)


@lower_cast(types.Float, lanes)
@lower_cast(types.Integer, lanes)
def _broadcast(_: Any, builder: Any, given: types.Type, __: types.Type, value: Any) -> Any:
    """Repeat a number for all episodes."""
    if isinstance(given, types.Integer):
        value = builder.sitofp(value, ir.DoubleType())
    elif given == types.float32:
        value = builder.fpext(value, ir.DoubleType())
    nothing = ir.Constant(NUMBERS, ir.Undefined)
    first = builder.insert_element(nothing, value, ir.Constant(ir.IntType(32), 0))
    places = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(first, nothing, places)


for _access, _template in ((operator.getitem, GetItemBuffer), (operator.setitem, SetItemBuffer)):
    # Most of what kernels do is to read and write elements.
    infer_global(_access)(type(_template.__name__, (_template,), {"metadata": FIRST}))


def _is_number(kind: types.Type) -> bool:
    return kind == lanes or isinstance(kind, types.Float | types.Integer)


def _teach(
    function: Callable[..., Any],
    given: types.Type,
    result: types.Type,
    arity: int,
    instruction: Callable[..., Any],
    known: Mapping[Any, types.Type] = MappingProxyType({}),
) -> None:
    """Let a Python function or operator act on lanes or masks.

    Its results for types of Numba's own may be ``known``: Numba asks many others before it knows.
    """

    class Template(AbstractTemplate):
        metadata = FIRST

        def generic(self, arguments: tuple[types.Type, ...], _: Any) -> Signature | None:
            if arguments[0] in known and arguments == (arguments[0],) * arity:
                return signature(known[arguments[0]], *arguments)
            fits = all(kind == given or (given == lanes and _is_number(kind)) for kind in arguments)
            if len(arguments) == arity and given in arguments and fits:
                return signature(result, *[given] * arity)
            return None

    infer_global(function)(Template)
    lower_builtin(function, *[given] * arity)(
        lambda _context, builder, _signature, arguments: instruction(builder, *arguments)
    )


def _combine(name: str) -> Callable[..., Any]:
    """LLVM's arithmetic of two values."""
    return lambda builder, x, y: getattr(builder, name)(x, y)


def _compare(symbol: str) -> Callable[..., Any]:
    """Comparison that NaN makes false, except for ``!=``."""
    if symbol == "!=":
        return lambda builder, x, y: builder.fcmp_unordered(symbol, x, y)
    return lambda builder, x, y: builder.fcmp_ordered(symbol, x, y)


def _choose(symbol: str) -> Callable[..., Any]:
    """The first argument where a comparison holds, else the second."""
    return lambda builder, x, y: builder.select(builder.fcmp_ordered(symbol, x, y), x, y)


def _call(name: str) -> Callable[..., Any]:
    """LLVM's function of a number, for each episode."""
    form = ir.FunctionType(NUMBERS, [NUMBERS])

    def instruction(builder: Any, value: Any) -> Any:
        function = builder.module.declare_intrinsic(f"llvm.{name}.v{LANES}f64", (), form)
        return builder.call(function, [value])

    return instruction


_sums = {kind: kind for kind in (types.float64, types.int64)}
_truths = dict.fromkeys(_sums, types.boolean)

for _operator, _name in (
    *((operator.add, "fadd"), (operator.iadd, "fadd")),
    *((operator.sub, "fsub"), (operator.isub, "fsub")),
    *((operator.mul, "fmul"), (operator.imul, "fmul")),
    *((operator.truediv, "fdiv"), (operator.itruediv, "fdiv")),
):
    _known = dict.fromkeys(_sums, types.float64) if _name == "fdiv" else _sums
    _teach(_operator, lanes, lanes, 2, _combine(_name), _known)
for _operator, _symbol in (
    *((operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">=")),
    *((operator.eq, "=="), (operator.ne, "!=")),
):
    _teach(_operator, lanes, mask, 2, _compare(_symbol), _truths)
_teach(operator.neg, lanes, lanes, 1, lambda builder, x: builder.fneg(x), _sums)
_teach(operator.and_, mask, mask, 2, lambda builder, x, y: builder.and_(x, y))
_teach(operator.or_, mask, mask, 2, lambda builder, x, y: builder.or_(x, y))
_teach(operator.invert, mask, mask, 1, lambda builder, x: builder.not_(x))
_teach(min, lanes, lanes, 2, _choose("<"))
_teach(max, lanes, lanes, 2, _choose(">"))
_teach(abs, lanes, lanes, 1, _call("fabs"))
_teach(math.sqrt, lanes, lanes, 1, _call("sqrt"))


instruction: Any = intrinsic
"""Kernels call what it writes for the types of their arguments."""


@instruction
def power_of_two(_: Any, exponent: types.Type) -> Any:
    """2 to the power of a whole number between -1022 and 1023, or of lanes."""

    def code(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        (value,) = arguments
        many = isinstance(value.type, ir.VectorType)
        whole, number = (WHOLE, NUMBERS) if many else (ir.IntType(64), ir.DoubleType())
        magic = 1.5 * 2.0**52 + 1023.0
        # In the sum, the lowest bits of the significand are the biased exponent.
        biased = builder.fadd(value, ir.Constant(number, [magic] * LANES if many else magic))
        places = ir.Constant(whole, [52] * LANES if many else 52)
        bits = builder.shl(builder.bitcast(biased, whole), places)
        return builder.bitcast(bits, number)

    return exponent(exponent), code


@instruction
def select(_: Any, condition: types.Type, first: types.Type, second: types.Type) -> Any:
    """``first`` where a condition holds, else ``second``, without a branch."""
    many = condition == mask
    if not many and condition != types.boolean:
        return None
    result: types.Type = lanes if many or lanes in (first, second) else types.float64
    if condition == mask and first == mask:
        result = mask

    def code(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.select(*arguments)

    return result(condition, result, result), code


@instruction
def any_lane(_: Any, condition: types.Type) -> Any:
    """Whether a condition holds for some episode."""

    def code(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        (value,) = arguments
        if not isinstance(value.type, ir.VectorType):
            return value
        bits = builder.bitcast(value, ir.IntType(LANES))
        return builder.icmp_unsigned("!=", bits, ir.Constant(ir.IntType(LANES), 0))

    return types.boolean(condition), code


@instruction
def is_number(_: Any, value: types.Type) -> Any:
    """Whether a value is a number rather than lanes, which is known when kernels are compiled."""
    truth = ir.Constant(ir.IntType(1), value != lanes)
    return types.boolean(value), lambda *_: truth


@instruction
def least_lane(_: Any, values: types.Type) -> Any:
    """Least number in lanes."""

    def code(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        form = ir.FunctionType(ir.DoubleType(), [NUMBERS])
        name = f"llvm.vector.reduce.fmin.v{LANES}f64"
        return builder.call(builder.module.declare_intrinsic(name, (), form), arguments)

    return types.float64(values), code


@instruction
def lane_bits(_: Any, condition: types.Type) -> Any:
    """Truth values of a mask as bits of a whole number."""

    def code(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        bits = builder.bitcast(arguments[0], ir.IntType(LANES))
        return builder.zext(bits, ir.IntType(64))

    return types.int64(condition), code


@instruction
def as_lanes(_: Any, array: Any) -> Any:
    """View a contiguous array of float64, with `LANES` in its last axis, as lanes."""
    return _viewed(array, lanes, array.ndim - 1)


@instruction
def as_numbers(_: Any, array: Any) -> Any:
    """View a contiguous array of lanes as one of float64, with one axis more."""
    return _viewed(array, types.float64, array.ndim + 1)


def _viewed(array: Any, dtype: types.Type, ndim: int) -> Any:
    """Signature and code of a view that adds or drops the last axis."""
    # NumPy's arrays keep their owner.
    owned = isinstance(array, types.Array)
    kept = types.Array(dtype, ndim, "C", aligned=dtype != lanes)
    view: Any = kept if owned else ViewType(dtype, ndim)

    def code(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        from numba.core import cgutils
        from numba.core.imputils import impl_ret_borrowed
        from numba.np.arrayobj import make_array, populate_array

        (given,) = arguments
        if not owned:
            shape = [*cgutils.unpack_tuple(builder, builder.extract_value(given, 1)), WORD(LANES)]
            return view_at(context, builder, view, builder.extract_value(given, 0), shape[:ndim])
        given = make_array(array)(context, builder, given)
        shape = [*cgutils.unpack_tuple(builder, given.shape), WORD(LANES)][:ndim]
        made, entry = make_array(view)(context, builder), context.get_data_type(dtype)
        strides = [WORD(context.get_abi_sizeof(entry))]
        for length in shape[:0:-1]:
            strides.insert(0, builder.mul(strides[0], length))
        populate_array(
            made,
            data=builder.bitcast(given.data, entry.as_pointer()),
            shape=shape,
            strides=strides,
            itemsize=strides[-1],
            meminfo=given.meminfo,
            parent=given.parent,
        )
        return impl_ret_borrowed(context, builder, view, made._getvalue())

    return view(array), code

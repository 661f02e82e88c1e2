"""Arrays of records, as kernels see them: an address and a shape.

Numba's own arrays also have owners, sizes and strides, and indices from the end, which makes most
of the code of a kernel. A view is in C order, is indexed by numbers from 0, and its record owns it.
"""

import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, infer_global, signature
from numba.extending import infer_getattr, lower_builtin, lower_getattr, models, register_model
from numba.np.numpy_support import as_dtype

WORD = ir.IntType(64)
"""A whole number: an index, a length, or an entry of a record's table."""

FIRST = {"target": "cpu"}
"""Makes Numba try an operator on such types before others: it asks what is specific
to a target first."""


class ViewType(types.Type):
    """Numba's type of an array of a record: the type of its entries, and its number of axes."""

    def __init__(self, dtype: types.Type, ndim: int) -> None:
        self.dtype, self.ndim = dtype, ndim
        # Lanes need not be aligned to their size.
        scalar = isinstance(dtype, types.Number | types.Boolean)
        self.alignment = as_dtype(dtype).alignment if scalar else 8
        super().__init__(f"view{ndim}({dtype})")


@register_model(ViewType)
class _Model(models.StructModel):
    def __init__(self, manager: Any, kind: ViewType) -> None:
        shape = types.UniTuple(types.intp, kind.ndim)
        members = [("data", types.CPointer(kind.dtype)), ("shape", shape)]
        super().__init__(manager, kind, members)


@infer_getattr
class _Attributes(AttributeTemplate):
    key = ViewType

    def resolve_shape(self, kind: ViewType) -> types.Type:
        return types.UniTuple(types.intp, kind.ndim)


@lower_getattr(ViewType, "shape")
def _shape(_context: Any, builder: Any, _kind: ViewType, view: Any) -> Any:
    return builder.extract_value(view, 1)


def view_at(context: Any, builder: Any, kind: ViewType, data: Any, shape: list[Any]) -> Any:
    """Make a view of a type and shape, at an address."""
    view = ir.Constant(context.get_value_type(kind), ir.Undefined)
    entry = context.get_data_type(kind.dtype)
    view = builder.insert_value(view, builder.bitcast(data, entry.as_pointer()), 0)
    for axis, length in enumerate(shape):
        view = builder.insert_value(view, length, (1, axis))
    return view


def _indexed(view: types.Type, index: types.Type) -> tuple[int, types.Type]:
    """How many axes of a view an index of whole numbers is for, and its type; 0 for any other."""
    several = isinstance(index, types.BaseTuple)
    numbers: Any = index if several else (index,)
    whole = all(isinstance(number, types.Integer) for number in numbers)
    axes = len(numbers) if isinstance(view, ViewType) and whole else 0
    return axes, types.UniTuple(types.intp, axes) if several else types.intp


@infer_global(operator.getitem)
class _Read(AbstractTemplate):
    metadata = FIRST

    def generic(self, arguments: tuple[types.Type, ...], _: Any) -> Any:
        view: Any = arguments[0]
        axes, index = _indexed(*arguments)
        if axes == 0:
            return None
        left = view.ndim - axes
        return signature(ViewType(view.dtype, left) if left else view.dtype, view, index)


@infer_global(operator.setitem)
class _Write(AbstractTemplate):
    metadata = FIRST

    def generic(self, arguments: tuple[types.Type, ...], _: Any) -> Any:
        view: Any = arguments[0]
        axes, index = _indexed(*arguments[:2])
        if axes == 0 or axes < view.ndim:
            return None
        return signature(types.none, view, index, view.dtype)


def _entry(builder: Any, kind: ViewType, view: Any, index: Any) -> tuple[Any, list[Any]]:
    """Address of an entry, or of all with an index of fewer axes, and their shape."""
    numbers = [index]
    if isinstance(index.type, ir.ArrayType):
        numbers = [builder.extract_value(index, k) for k in range(index.type.count)]
    shape = [builder.extract_value(view, (1, axis)) for axis in range(kind.ndim)]
    offset = numbers[0]
    for axis, length in enumerate(shape[1:], 1):
        offset = builder.mul(offset, length)
        offset = builder.add(offset, numbers[axis]) if axis < len(numbers) else offset
    where = builder.gep(builder.extract_value(view, 0), [offset], inbounds=True)
    return where, shape[len(numbers) :]


@lower_builtin(operator.getitem, ViewType, types.Any)
def _read(context: Any, builder: Any, signed: Any, arguments: Any) -> Any:
    kind = signed.args[0]
    where, shape = _entry(builder, kind, *arguments)
    if shape:
        return view_at(context, builder, signed.return_type, where, shape)
    return context.unpack_value(builder, kind.dtype, where, kind.alignment)


@lower_builtin(operator.setitem, ViewType, types.Any, types.Any)
def _write(context: Any, builder: Any, signed: Any, arguments: Any) -> Any:
    kind = signed.args[0]
    where, _ = _entry(builder, kind, *arguments[:2])
    context.pack_value(builder, kind.dtype, arguments[2], where, kind.alignment)
    return context.get_dummy_value()

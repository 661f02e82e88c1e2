"""Arrays and numbers by one address, instead of array by array.

Numba hands over all that is in a named tuple, to kernels and to each helper. A `Record` is a table
of addresses, shapes and numbers, made once. Kernels take its address, and read its attributes as of
a named tuple.
"""

import hashlib
import struct
from collections.abc import Mapping
from ctypes import addressof, c_char
from functools import cache
from math import prod
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np
from numba import from_dtype, types
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_getattr_generic,
    models,
    register_model,
    unbox,
)
from numpy.typing import NDArray

from kinarm.kernels.lanes import LANES, lanes
from kinarm.kernels.views import WORD, ViewType, view_at

CACHE_LINE = 8 * LANES
"""Bytes of a line of the cache, and of lanes."""

from_buffer: Any = (c_char * 0).from_buffer

Shapes: TypeAlias = dict[str, tuple[types.Type, tuple[int, ...]]]


class Fixed(int):
    """A length in an array's type, for which kernels are compiled."""


class RecordType(types.Type):
    """Numba's type of a record: names, types and fixed lengths."""

    def __init__(
        self,
        name: str,
        fields: tuple[tuple[str, types.Type], ...],
        fixed: Mapping[str, tuple[int | None, ...]] = MappingProxyType({}),
    ) -> None:
        self.fields, self.fixed = dict(fields), dict(fixed)
        self.places, end = {}, 0
        for field, kind in fields:
            self.places[field] = end
            end += 1 + (kind.ndim if isinstance(kind, ViewType) else 0)
        self.length = end
        # The name is part of the names of functions that take such a record.
        digest = hashlib.sha256(repr((fields, self.fixed)).encode()).hexdigest()
        super().__init__(f"{name}-{digest[:12]}")


class Record:
    """Named arrays, numbers and records for kernels, by `recorded` or `Layout`.

    What is in an array may change, but not which array it is.

    Attributes
    ----------
    address : int
        Of the table.
    values : named tuple or ndarray
        What is recorded, or the buffer of its arrays.
    """

    def __init__(self, kind: RecordType, words: NDArray[np.int64], values: Any) -> None:
        self._numba_type_, self._words, self.values = kind, words, values
        self.address = _address(words)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name == "values":
            raise AttributeError(name)
        return getattr(self.values, name)

    def __reduce__(self) -> tuple[Any, ...]:
        return recorded, (self.values,)


def recorded(values: Any) -> Any:
    """Record of a named tuple of arrays, records and numbers, which it keeps alive.

    Kernels take it instead of the tuple. Arrays must be contiguous, in C order. Records are
    returned themselves.
    """
    return values if isinstance(values, Record) else Record(*table(values), values)


def table(values: Any) -> tuple[RecordType, NDArray[np.int64]]:
    """Type and table of a named tuple's record."""
    named: Any = type(values)
    words: list[int] = []
    kinds: list[Any] = []
    for value in values:
        if isinstance(value, np.ndarray):
            shape = value.shape
            kinds.append((value.dtype.char, len(shape)))
            words += (_address(value) if 0 not in shape else 0, *shape)
        elif isinstance(value, Record):
            kinds.append(value._numba_type_)
            words.append(value.address)
        elif isinstance(value, float):
            kinds.append(types.float64)
            words += struct.unpack("q", struct.pack("d", value))
        else:
            kinds.append(types.int64)
            words.append(int(value))
    return _record_type(named, *kinds), np.array(words, dtype=np.int64)


class Layout:
    """Arrays side by side in one buffer.

    Parameters
    ----------
    name : str
        Name of the type.
    shapes : mapping
        Type of entries, `lanes`, float64 or int64, and shape of each array;
        lengths may be `Fixed`.
    """

    def __init__(self, name: str, shapes: Shapes) -> None:
        words: list[int] = []
        moved: list[bool] = []
        end = 0
        for entry, shape in shapes.values():
            words += (end, *shape)
            moved += (True, *(False for _ in shape))
            end += (CACHE_LINE if entry == lanes else 8) * prod(shape)
        self._words, self._size = np.array(words, dtype=np.int64), end // 8
        self._moved = np.array(moved, dtype=np.int64)
        kinds = [(field, ViewType(entry, len(shape))) for field, (entry, shape) in shapes.items()]
        fixed = {
            field: tuple(int(length) if isinstance(length, Fixed) else None for length in shape)
            for field, (_, shape) in shapes.items()
        }
        self._kind = RecordType(name, tuple(kinds), fixed)

    def record(self) -> Any:
        """Record of new arrays of zeros, whose values are their buffer."""
        buffer = np.zeros(self._size + LANES)
        # Aligned lanes lie in one line of the cache.
        start = _address(buffer) + -_address(buffer) % CACHE_LINE
        return Record(self._kind, self._words + start * self._moved, buffer)


def _address(array: NDArray[Any]) -> int:
    """Address of an array, which must be contiguous."""
    try:
        return addressof(from_buffer(array))  # three times as fast as other ways
    except TypeError:  # It is read-only, or has gaps.
        if not array.flags.c_contiguous:
            raise
    return int(array.__array_interface__["data"][0])


@cache
def _record_type(named: Any, *kinds: Any) -> RecordType:
    """Type of a named tuple's record, with arrays given by types and axes."""
    return RecordType(
        named.__name__,
        tuple(
            (name, ViewType(from_dtype(np.dtype(kind[0])), kind[1]))
            if isinstance(kind, tuple)
            else (name, kind)
            for name, kind in zip(named._fields, kinds, strict=True)
        ),
    )


@register_model(RecordType)
class _RecordModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: types.Type) -> None:
        super().__init__(manager, kind, WORD.as_pointer())


@unbox(RecordType)
def _unboxed(_: RecordType, value: Any, c: Any) -> NativeValue:
    """Take the address of a record."""
    address = c.pyapi.object_getattr_string(value, "address")
    pointer = c.pyapi.long_as_voidptr(address)
    c.pyapi.decref(address)
    return NativeValue(c.builder.bitcast(pointer, WORD.as_pointer()))


def _field_type(_: Any, record: RecordType, name: str) -> types.Type | None:
    """Type of a record's field."""
    return record.fields.get(name)


_resolved = {"key": RecordType, "generic_resolve": _field_type}
infer_getattr(type("RecordAttribute", (AttributeTemplate,), _resolved))


@lower_getattr_generic(RecordType)
def _read_field(context: Any, builder: Any, record: RecordType, table: Any, name: str) -> Any:
    """Read from the table, uncounted: the record keeps its fields alive."""
    kind, place = record.fields[name], record.places[name]

    def word(offset: int, form: Any) -> Any:
        where = builder.gep(table, [WORD(place + offset)])
        value = builder.load(builder.bitcast(where, form.as_pointer()))
        # Tables never change.
        value.set_metadata("invariant.load", builder.module.add_metadata([]))
        return value

    if isinstance(kind, RecordType):
        # Tables may be read ahead of loops.
        inner, whole = word(0, WORD.as_pointer()), builder.module.add_metadata
        inner.set_metadata("dereferenceable", whole([WORD(8 * kind.length)]))
        inner.set_metadata("align", whole([WORD(8)]))
        return inner
    if not isinstance(kind, ViewType):
        return word(0, context.get_value_type(kind))
    shape = [
        word(1 + axis, WORD) if length is None else WORD(length)
        for axis, length in enumerate(record.fixed.get(name, (None,) * kind.ndim))
    ]
    data = word(0, context.get_data_type(kind.dtype).as_pointer())
    return view_at(context, builder, kind, data, shape)

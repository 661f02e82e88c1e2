"""Counting the floating-point operations that kernels carry out.

While an `OperationCounter` is active, whatever Numba compiles counts along: each instruction on
doubles adds to a counter of the function that it stands in, one for a number and one per lane for
lanes. So loops, branches and early exits count as often as they are taken. What LLVM leaves out
afterwards, because it finds it to be known or unused, is counted all the same.
"""

import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any
from unittest import mock

import numpy as np
from llvmlite import ir
from numpy.typing import NDArray

KINDS = ("sums", "products", "quotients", "roots", "comparisons")
"""Kinds of operations; a difference is a sum, and so is rounding to a whole number."""

INSTRUCTIONS = {
    **dict.fromkeys(("fadd", "fsub"), "sums"),
    "fmul": "products",
    "fdiv": "quotients",
    **dict.fromkeys(("fcmp_ordered", "fcmp_unordered"), "comparisons"),
}
"""Instructions by the names of llvmlite's methods."""
CALLED = {"llvm.sqrt": "roots", "sqrt": "roots", "llvm.rint": "sums"}
"""Functions that are instructions on most machines, by how their names begin."""

MOST_FUNCTIONS = 1 << 14


class OperationCounter:
    """Counters of the functions that are compiled while it is `active`.

    Kernels that were compiled before, or that come from Numba's disk cache, do not count.
    """

    def __init__(self) -> None:
        self._counts: NDArray[np.int64] = np.zeros((MOST_FUNCTIONS, len(KINDS)), dtype=np.int64)
        self._rows: dict[str, int] = {}

    @contextmanager
    def active(self) -> Iterator[None]:
        """Make kernels that are compiled meanwhile count their operations."""
        with ExitStack() as stack:
            for name, method in self._builder_methods().items():
                stack.enter_context(mock.patch.object(ir.IRBuilder, name, method))
            yield

    def reset(self) -> None:
        """Begin at zero."""
        self._counts[:] = 0

    def by_function(self) -> dict[str, dict[str, int]]:
        """Operations of each kind, by the function of the source that they stand in."""
        found: dict[str, dict[str, int]] = {}
        for name, row in self._rows.items():
            counts = found.setdefault(source_name(name), dict.fromkeys(KINDS, 0))
            for kind, count in zip(KINDS, self._counts[row], strict=True):
                counts[kind] += int(count)
        return {name: counts for name, counts in found.items() if any(counts.values())}

    def _builder_methods(self) -> dict[str, Callable[..., Any]]:
        """Methods of llvmlite's builder that count along."""

        def counting(name: str, kind: str) -> Callable[..., Any]:
            method = getattr(ir.IRBuilder, name)
            place = 1 if name.startswith("fcmp") else 0  # comparisons begin with their symbol

            def build(builder: Any, *arguments: Any, **named: Any) -> Any:
                self._count(builder, kind, arguments[place])
                return method(builder, *arguments, **named)

            return build

        call = ir.IRBuilder.call

        def build_call(builder: Any, function: Any, arguments: Any, **named: Any) -> Any:
            for name, kind in CALLED.items():
                if getattr(function, "name", "").startswith(name):
                    self._count(builder, kind, arguments[0])
            return call(builder, function, arguments, **named)

        methods = {name: counting(name, kind) for name, kind in INSTRUCTIONS.items()}
        return {**methods, "call": build_call}

    def _count(self, builder: Any, kind: str, operand: Any) -> None:
        """Let the function under construction add to its counter."""
        width = _width(operand.type)
        if width == 0:
            return
        row = self._rows.setdefault(builder.function.name, len(self._rows))
        counter = self._counts[row, KINDS.index(kind) :]
        whole = ir.IntType(64)
        address = ir.Constant(whole, counter.ctypes.data).inttoptr(whole.as_pointer())
        builder.store(builder.add(builder.load(address), ir.Constant(whole, width)), address)


def _width(kind: Any) -> int:
    """How many doubles a value holds."""
    if isinstance(kind, ir.VectorType):
        return int(kind.count) * _width(kind.element)
    return 1 if isinstance(kind, ir.DoubleType) else 0


def source_name(mangled: str) -> str:
    """Name of a function in the source, such as ``kinarm.kernels.network.act``."""
    rest, parts = mangled.removeprefix("_ZN"), []
    while found := re.match(r"\d+", rest):
        end = found.end() + int(found.group())
        parts.append(rest[found.end() : end])
        rest = rest[end:]
    return ".".join(parts) or mangled

"""Helpers reach kernels as code that is not compiled further than that."""

from typing import NamedTuple

import numpy as np
import pytest
from numba import njit, types

from kinarm.kernels.compiling import Array, KernelCompiler, helper, inlined
from kinarm.kernels.records import Fixed, Layout, Record, recorded


class Parts(NamedTuple):
    """Work space, and numbers."""

    space: Record
    numbers: Array


@inlined
def double(x):
    return 2.0 * x


@helper
def doubled_sum(x, n):
    total = 0.0
    for _ in range(n):
        total += double(x)
    return total


@pytest.fixture(scope="module")
def both():
    """A kernel that is compiled here, whatever a disk cache holds."""

    def both(x, n):
        return doubled_sum(x, 3), doubled_sum(x, n)

    return njit(error_model="numpy", pipeline_class=KernelCompiler)(both)


def test_a_kernel_calls_what_is_linked_and_literals_share_a_helper(both):
    assert both(1.5, 4) == (9.0, 12.0)
    assert len(doubled_sum.signatures) == 1


def test_what_is_inlined_calls_helpers():
    """Numba by itself would inline them as well, since whoever calls them is inlined."""

    @helper
    def long(x):
        return x + 1.0

    @inlined
    def short(x):
        return long(x)

    def two(x):
        return short(x) + short(2.0 * x)

    assert njit(pipeline_class=KernelCompiler)(two)(1.0) == 5.0
    for function, forced in ((long, False), (short, True)):
        (compiled,) = function.overloads.values()
        code = compiled.library.get_function(compiled.fndesc.llvm_func_name)
        assert (b"alwaysinline" in code.attributes) == forced


@pytest.mark.parametrize("length", [0, 1])
def test_branches_that_fixed_lengths_rule_out_are_not_compiled(length):
    parts = recorded(
        Parts(Layout("Space", {"gap": (types.float64, (Fixed(length),))}).record(), np.ones(3))
    )

    @helper
    def ruled_out(x):
        return x

    def total(parts):
        numbers, space, one, two = parts.numbers, parts.space, 1.0, 2.0
        has_gap = space.gap.shape[0] > 0
        if has_gap and numbers[0] > 0.0:
            return ruled_out(one)
        return two

    assert njit(pipeline_class=KernelCompiler)(total)(parts) == (1.0 if length else 2.0)
    assert len(ruled_out.overloads) == length

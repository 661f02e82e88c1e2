"""Helpers reach kernels as code that is not compiled further than that."""

import pytest
from numba import njit

from kinarm.kernels.compiling import KernelCompiler, helper, inlined


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

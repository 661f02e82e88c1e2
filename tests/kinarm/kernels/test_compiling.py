"""Helpers reach kernels as code that is not compiled further than that."""

import gc

import pytest
from numba import njit
from numba.core.errors import TypingError

from kinarm.kernels.compiling import KernelCompiler, helper, inlined, kernel


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


@kernel
def misspelt(x):
    return x.missing


def test_kernel_calls_what_is_linked(both):
    assert both(1.5, 4) == (9.0, 12.0)


def test_literals_and_numbers_share_a_helper(both):
    both(1.5, 4)
    assert len(doubled_sum.signatures) == 1


@pytest.mark.parametrize("collects", [True, False])
def test_garbage_is_collected_as_before(collects):
    before = gc.isenabled()
    (gc.enable if collects else gc.disable)()
    try:
        with pytest.raises(TypingError, match="missing"):
            misspelt(1.0)
        assert gc.isenabled() == collects
    finally:
        (gc.enable if before else gc.disable)()

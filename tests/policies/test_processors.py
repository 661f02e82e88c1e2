"""Results have the same bits whatever the processor, and whatever is compiled for it, can do."""

import platform

import pytest
from computed_bits import computed_bits, usual_bits
from numpy._core import _multiarray_umath as numpy_core

pytestmark = pytest.mark.skipif(
    platform.machine() != "x86_64", reason="the instruction sets are x86-64's"
)

CAN = {name for name, present in numpy_core.__cpu_features__.items() if present}
PLAIN_LIBRARIES = {
    "OPENBLAS_CORETYPE": "Prescott",
    "NPY_DISABLE_CPU_FEATURES": " ".join(CAN.intersection(numpy_core.__cpu_dispatch__)),
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX,-AVX2,-FMA,-FMA4,-AVX512F",
}
"""What makes libraries believe to run on a machine of 2004."""


@pytest.mark.rare
def test_libraries_for_a_plain_processor_give_the_same_bits():
    assert computed_bits(PLAIN_LIBRARIES) == usual_bits()


@pytest.mark.rare
@pytest.mark.skipif("AVX512_SKX" not in CAN, reason="this processor lacks AVX-512")
def test_libraries_with_the_longest_vectors_give_the_same_bits():
    assert computed_bits({"OPENBLAS_CORETYPE": "SkylakeX"}) == usual_bits()


@pytest.mark.rare
def test_kernels_for_a_plain_processor_give_the_same_bits():
    """All kernels are compiled anew; for AVX2, where their instructions are counted."""
    variables = {"NUMBA_CPU_NAME": "x86-64", "NUMBA_CPU_FEATURES": "+sse2"}
    assert computed_bits(variables) == usual_bits()

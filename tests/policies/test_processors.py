"""ARS comes to the same bits whatever the processor, and whatever is compiled for it, can do."""

import os
import platform
import subprocess
import sys

import pytest
from numpy._core import _multiarray_umath as numpy_core

pytestmark = pytest.mark.skipif(
    platform.machine() != "x86_64", reason="the instruction sets are x86-64's"
)

TRAIN_AND_PRINT = """
import hashlib
import numpy as np
from kinarm.policies import train_policy
from kinarm.policies.recipes import recipe
for name, problem in (("paper", "right"), ("tuned", "both")):
    state = train_policy(recipe("ars", name, problem=problem, iterations=10)).state
    curve = np.array([point[:4] for point in state.curve])
    arrays = (state.theta, state.normalizer.mean, state.normalizer.squares, curve)
    print(hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest())
"""

CAN = {name for name, present in numpy_core.__cpu_features__.items() if present}
MACHINES = {
    "BLAS of 2004": ({"OPENBLAS_CORETYPE": "Prescott"}, "SSE3"),
    "BLAS with AVX2": ({"OPENBLAS_CORETYPE": "Haswell"}, "FMA3"),
    "BLAS with AVX-512": ({"OPENBLAS_CORETYPE": "SkylakeX"}, "AVX512_SKX"),
    "plain NumPy": (
        {"NPY_DISABLE_CPU_FEATURES": " ".join(CAN.intersection(numpy_core.__cpu_dispatch__))},
        "SSE3",
    ),
    "plain C library": (
        {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX,-AVX2,-FMA,-FMA4,-AVX512F"},
        "SSE3",
    ),
    "plain kernels": ({"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}, "SSE3"),
}
"""What makes a process believe to run on another machine, and what this one must have for it."""

SLOW = {"plain kernels"}
"""All kernels are compiled anew."""


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """Trains in a process with other environment variables, and returns hashes of the results."""

    def train(variables):
        environment = os.environ | variables
        if "NUMBA_CPU_NAME" in variables:
            environment["NUMBA_CACHE_DIR"] = str(tmp_path_factory.mktemp("numba"))
        command = [sys.executable, "-P", "-c", TRAIN_AND_PRINT]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        return done.stdout.split()

    return train


@pytest.fixture(scope="module")
def usual(trained):
    return trained({})


@pytest.mark.parametrize(
    "machine",
    [pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW)) for name in MACHINES],
)
def test_ten_iterations_are_the_same_bits(machine, trained, usual):
    variables, needs = MACHINES[machine]
    if needs not in CAN:
        pytest.skip(f"this processor lacks {needs}")
    assert len(set(usual)) == 2
    assert trained(variables) == usual

"""Training gives the same bits whatever the processor and the libraries' choice of kernels."""

import os
import subprocess
import sys

import pytest

TRAIN = """
from dataclasses import replace
from kinarm.policies import recipe, train_policy
for name in ("paper", "tuned"):
    config = replace(recipe("ars", name, problem="both", seed=1), iterations=10)
    networks = train_policy(config).policy.networks()
    print(networks.weights.tobytes().hex())
"""


def train(**environment: str) -> str:
    """Weights of two short trainings in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-c", TRAIN],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout


@pytest.fixture(scope="module")
def weights() -> str:
    return train()


@pytest.mark.parametrize("kernel", ["Prescott", "Haswell", "SkylakeX"])
def test_training_does_not_depend_on_blas(kernel: str, weights: str) -> None:
    assert train(OPENBLAS_CORETYPE=kernel) == weights


def test_training_does_not_depend_on_vector_instructions(weights: str) -> None:
    import numpy as np

    found = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    assert train(NPY_DISABLE_CPU_FEATURES=" ".join(found)) == weights

"""PPO gives the same bits whatever the processor and the libraries' choice of kernels."""

import os
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")

TRAIN = """
from dataclasses import replace
from kinarm.policies import recipe, train_policy
settings = dict(n_envs=50, n_steps=6, batch_size=100, n_epochs=2, iterations=3, net_arch=(40, 24))
for name in ("paper", "tuned"):
    config = replace(recipe("ppo", name, problem="both", seed=1), **settings)
    state = train_policy(config).state
    for part in (state.parameters, state.first_moment, state.second_moment, state.episodes.q):
        print(part.tobytes().hex())
"""


def train(**environment: str) -> str:
    """What two short trainings in a process of its own end in."""
    done = subprocess.run(
        [sys.executable, "-c", TRAIN],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout


@pytest.fixture(scope="module")
def ended() -> str:
    return train()


def test_libraries_do_not_matter(ended: str) -> None:
    """The oldest kernels of BLAS and torch, and NumPy without vector instructions."""
    found = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    other = train(
        OPENBLAS_CORETYPE="Prescott",
        ATEN_CPU_CAPABILITY="default",
        MKL_ENABLE_INSTRUCTIONS="SSE4_2",
        NPY_DISABLE_CPU_FEATURES=" ".join(found),
    )
    assert other == ended


@pytest.mark.slow
@pytest.mark.parametrize("name", ["x86-64", "x86-64-v3"])
def test_instructions_do_not_matter(ended: str, name: str) -> None:
    """Compiled for a processor without vectors of eight numbers, and for one without AVX-512."""
    features = {"x86-64": "+sse2", "x86-64-v3": ""}[name]
    assert train(NUMBA_CPU_NAME=name, NUMBA_CPU_FEATURES=features) == ended

"""Shared fixtures: a provenance and policies that were never trained."""

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from kinarm.policies.policy import Layer, Policy
from kinarm.policies.provenance import Provenance
from kinarm.problem import ReachProblem


@pytest.fixture(scope="session")
def provenance() -> Provenance:
    return Provenance(
        algorithm="test",
        recipe="none",
        problem=ReachProblem.load("right").pinned,
        seed=3,
        environment_steps=17,
        config={"alpha": 0.25, "names": ["a", "b"]},
        versions={"python": "3"},
        commit="abc",
    )


@pytest.fixture(scope="session")
def make_policy(provenance: Provenance) -> Callable[..., Policy]:
    """Build a policy with random numbers and the given widths between 48 inputs and 5 outputs."""

    def make(*hidden: int, seed: int = 0, constant: int = 0, **settings: Any) -> Policy:
        rng = np.random.default_rng(seed)
        widths = [48, *hidden, 5]
        std = rng.uniform(0.1, 2, 48)
        std[:constant] = 1e-9
        return Policy(
            mean=rng.normal(size=48),
            std=std,
            layers=tuple(
                Layer(rng.normal(size=(n_out, n_in)) / n_in, rng.normal(size=n_out) / 10)
                for n_in, n_out in itertools.pairwise(widths)
            ),
            provenance=provenance,
            **settings,
        )

    return make

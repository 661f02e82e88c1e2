"""Augmented Random Search, for the registry of learners."""

from typing import TYPE_CHECKING

from kinarm.policies.ars.config import ARSConfig
from kinarm.policies.ars.recipes import RECIPES, adapted
from kinarm.policies.ars.state import ARSState
from kinarm.policies.learners import Learner

if TYPE_CHECKING:
    from kinarm.policies.ars.algorithm import ARSTraining
    from kinarm.policies.policy import Policy


def _begin(config: ARSConfig, threads: int | None = None) -> "ARSTraining":
    from kinarm.policies.ars.algorithm import ARSTraining

    return ARSTraining(config, threads)


def _policy(config: ARSConfig, state: ARSState) -> "Policy":
    from kinarm.policies.ars.algorithm import linear_policy

    return linear_policy(config, state)


LEARNER = Learner(
    name="ars",
    title="Augmented Random Search",
    config=ARSConfig,
    state=ARSState,
    recipes=RECIPES,
    adapt=adapted,
    begin=_begin,
    policy=_policy,
    options=("threads",),
)

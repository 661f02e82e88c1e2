"""Other reach environments of Gymnasium, beside kinarm's single and batch environment."""

from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any

import gymnasium
import numpy as np

from kinarm.envs import ReachVectorEnv
from kinarm.envs.registration import ENVIRONMENTS
from kinarm.evaluation.measurements.environments import VECTOR_ENVS
from kinarm.evaluation.measurements.peers.comparing import Comparison, compared
from kinarm.policies.policy import Policy

STEPS = 500
VECTOR_STEPS = 100


def compare_environment(
    module: ModuleType, name: str, terms: str, policy: Policy, repetitions: int
) -> Iterator[Comparison]:
    """Random actions in an environment that a module registers, and in both of kinarm's."""
    gymnasium.register_envs(module)
    theirs = gymnasium.make(name, disable_env_checker=True)
    single = gymnasium.make(
        next(iter(ENVIRONMENTS)), problem=policy.problem, disable_env_checker=True
    )
    batch = ReachVectorEnv(VECTOR_ENVS, policy.problem)
    step_theirs = stepping(theirs)
    about = {"unit": "steps/s", "terms": terms}
    what = f"{name} and the single environment"
    yield compared(step_theirs, stepping(single), repetitions, what=what, **about)
    what = f"{name} and {VECTOR_ENVS} arms in the batch environment"
    yield compared(step_theirs, batch_stepping(batch), repetitions, what=what, **about)
    theirs.close()


def stepping(env: gymnasium.Env[Any, Any]) -> Callable[[], int]:
    """Steps with random actions, which are drawn beforehand."""
    env.reset(seed=0)
    space = env.action_space
    space.seed(0)
    actions = [space.sample() for _ in range(STEPS)]

    def run() -> int:
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
        return STEPS

    return run


def batch_stepping(env: ReachVectorEnv) -> Callable[[], int]:
    """Steps of all arms with random actions, which are drawn beforehand."""
    env.reset(seed=0)
    shape = (VECTOR_STEPS, env.num_envs, env.simulator.n_actions)
    actions = np.random.default_rng(0).uniform(-1, 1, shape)

    def run() -> int:
        for action in actions:
            env.step(action)
        return VECTOR_STEPS * env.num_envs

    return run

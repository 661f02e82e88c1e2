"""Environments: the batch, the single one, and those for Stable-Baselines3."""

from typing import Any

import gymnasium
import numpy as np

from kinarm.envs import ReachEnv, ReachVectorEnv
from kinarm.errors import MissingExtraError
from kinarm.evaluation.measurements.timing import Timing, timed
from kinarm.policies.sb3.environment import sb3_vec_env
from kinarm.problem import ReachProblem

VECTOR_ENVS = 64
VECTOR_STEPS, SINGLE_STEPS = 200, 2000
DUMMY_STEPS = 20


def measure_vector_env(problem: ReachProblem, repetitions: int) -> Timing:
    """Steps per second of the native batch environment, on random actions."""
    env = ReachVectorEnv(VECTOR_ENVS, problem)
    env.reset(seed=0)
    shape = (VECTOR_STEPS, VECTOR_ENVS, env.simulator.n_actions)
    actions = np.random.default_rng(0).uniform(-1, 1, shape)

    def run() -> int:
        for action in actions:
            env.step(action)
        return VECTOR_STEPS * VECTOR_ENVS

    return timed(run, repetitions)


def measure_single_env(problem: ReachProblem, repetitions: int) -> Timing:
    """Steps per second of the single environment without wrappers, on random actions."""
    env = ReachEnv(problem)
    env.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1, 1, (SINGLE_STEPS, env.simulator.n_actions))

    def run() -> int:
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
        return SINGLE_STEPS

    return timed(run, repetitions)


def measure_sb3(problem: ReachProblem, repetitions: int) -> dict[str, Any]:
    """Steps per second of `sb3_vec_env`, and of single arms in their ``DummyVecEnv``.

    Where Stable-Baselines3 is missing, ``skipped`` says so.
    """
    try:
        native = sb3_vec_env(problem, VECTOR_ENVS, seed=0)
    except MissingExtraError as error:
        return {"skipped": str(error)}
    from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv

    def make() -> gymnasium.Env[Any, Any]:
        return gymnasium.make("kinarm/ReachRight-v0", problem=problem, observation_dtype=np.float32)

    def rate(env: VecEnv, steps: int) -> Timing:
        env.reset()
        shape = (steps, VECTOR_ENVS, native.simulator.n_actions)
        actions = np.random.default_rng(0).uniform(-1, 1, shape).astype(np.float32)

        def run() -> int:
            for action in actions:
                env.step(action)
            return steps * VECTOR_ENVS

        return timed(run, repetitions)

    batch = rate(native, VECTOR_STEPS)
    dummy = rate(DummyVecEnv([make] * VECTOR_ENVS), DUMMY_STEPS)
    return {
        "native": batch._asdict(),
        "dummy": dummy._asdict(),
        "speed_up": batch.median / dummy.median,
    }

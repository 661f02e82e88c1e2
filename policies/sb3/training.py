"""Training with an algorithm of Stable-Baselines3 or sb3-contrib, in steps.

The algorithm's own ``learn`` runs in a thread that waits after every step, so that it can be
evaluated meanwhile. Replay buffer, optimisers and generators cannot all be saved without pickle. A
training therefore goes on by repeating what was done, to the same bits.
"""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.utils import LinearSchedule
from stable_baselines3.common.vec_env import VecEnv, VecNormalize

from kinarm._console import say_why_it_waits
from kinarm._files import first_line
from kinarm._parallel import one_torch_thread
from kinarm.errors import InvalidInputError
from kinarm.policies.learners import CurvePoint
from kinarm.policies.policy import Policy
from kinarm.policies.provenance import Provenance
from kinarm.policies.sb3 import ALGORITHMS, SB3Config, SB3State
from kinarm.policies.sb3.environment import sb3_vec_env
from kinarm.policies.sb3.hindsight import HindsightReplayBuffer

REFUSALS = (
    *(AssertionError, AttributeError, ImportError, KeyError, RuntimeError, TypeError, ValueError),
)
"""Errors of algorithms that refuse a setting or lack a package for it, or diverge."""


@contextmanager
def alone_in_torch() -> Iterator[None]:
    """Keep torch to one thread, and restore global generators afterwards."""
    numpy_state = np.random.get_state()  # noqa: NPY002
    with torch.random.fork_rng(devices=[]), one_torch_thread():
        try:
            yield
        finally:
            np.random.set_state(numpy_state)  # noqa: NPY002


class SteppedLearning:
    """``model.learn`` in a thread, which waits after every step of all arms.

    The last step does all that is left.
    """

    def __init__(self, model: BaseAlgorithm, steps: int) -> None:
        self.model = model
        self.taken, self._steps = 0, steps
        self._may_go_on, self._has_stopped = threading.Semaphore(0), threading.Semaphore(0)
        self._error: BaseException | None = None
        self._abandoned = False
        threading.Thread(target=self._learn, daemon=True).start()

    def step(self) -> None:
        """Let it take one step; refusals are said in one line."""
        self._may_go_on.release()
        self._has_stopped.acquire()
        if isinstance(self._error, REFUSALS):
            raise InvalidInputError(first_line(self._error)) from self._error
        if self._error is not None:
            raise self._error

    def abandon(self) -> None:
        """Let the thread end."""
        self._abandoned = True
        self._may_go_on.release()

    def _learn(self) -> None:
        self._may_go_on.acquire()
        torch.set_num_threads(1)
        try:
            self.model.learn(self._steps * self.model.n_envs, callback=self._after_step)
        except BaseException as error:  # raised in `step`
            self._error = error
        self._has_stopped.release()

    def _after_step(self, *_: object) -> bool:
        """Wait, but after the last step; returns whether to go on."""
        self.taken += 1
        if self.taken < self._steps:
            self._has_stopped.release()
            self._may_go_on.acquire()
        return not self._abandoned


class SB3Training:
    """A training under way, on one thread, whatever it may take."""

    def __init__(self, config: SB3Config, _threads: int | None = None) -> None:
        self.config = config
        self._begin()

    def _begin(self) -> None:
        """Build the algorithm anew, and go back to the beginning."""
        with alone_in_torch():
            self._learning = SteppedLearning(sb3_model(self.config), self.config.iterations)
            self._generators = torch.get_rng_state(), np.random.get_state()  # noqa: NPY002
        self._done = 0

    def initial_state(self) -> SB3State:
        """State before the first iteration."""
        return SB3State(training=self)

    def iterate(self, state: SB3State) -> SB3State:
        """One step of all arms, and updates due before it."""
        model, began = self.model(state.iteration), time.perf_counter()
        self._step()
        episodes, successes = model.ep_info_buffer or (), model.ep_success_buffer or ()
        returns = [episode["r"] for episode in episodes]
        point = CurvePoint(
            mean_return=float(np.mean(returns)) if returns else float("nan"),
            std_return=float(np.std(returns)) if returns else float("nan"),
            success=float(np.mean(successes)) if successes else float("nan"),
            environment_steps=model.num_timesteps,
            wall_time=state.wall_time + time.perf_counter() - began,
        )
        return SB3State(curve=state.curve_with(point), training=self)

    def model(self, iteration: int) -> BaseAlgorithm:
        """The algorithm after an iteration, repeated if need be."""
        if self._done == iteration:
            return self._learning.model
        say_why_it_waits("repeating what was done before")
        if not 0 <= self._done < iteration:
            self._learning.abandon()
            self._begin()
        while self._done < iteration:
            self._step()
        return self._learning.model

    def _step(self) -> None:
        """Take a step with the algorithm's generators."""
        done, self._done = self._done, -1  # until the step is over: it may be interrupted
        with alone_in_torch():
            torch.set_rng_state(self._generators[0])
            np.random.set_state(self._generators[1])  # noqa: NPY002
            self._learning.step()
            self._generators = torch.get_rng_state(), np.random.get_state()  # noqa: NPY002
        self._done = done + 1


def trained_policy(config: SB3Config, state: SB3State) -> Policy:
    """Freeze a state of the training into a policy."""
    training = state.training or SB3Training(config)
    policy = Policy.from_sb3(training.model(state.iteration), config.problem)
    made = Provenance.of(config.algorithm, config, state.environment_steps)
    return replace(policy, provenance=made)


def sb3_model(config: SB3Config) -> BaseAlgorithm:
    """Build the algorithm, with its environment."""
    problem = config.training_problem.replace(tolerance=config.training_tolerance)
    goals = config.hindsight
    env: VecEnv = sb3_vec_env(problem, config.n_envs, goal_conditioned=goals, threads=1)
    if config.normalize:
        keys = ["observation"] if goals else None  # substituted goals would be clipped
        env = VecNormalize(env, norm_reward=False, norm_obs_keys=keys)
    given: dict[str, Any] = {
        "policy": "MultiInputPolicy" if config.hindsight else "MlpPolicy",
        **deepcopy(config.hyperparameters),  # which the algorithm changes
    }
    if config.hindsight:
        given["replay_buffer_class"] = HindsightReplayBuffer
    if config.action_noise:
        zero = np.zeros(env.action_space.shape or ())
        given["action_noise"] = NormalActionNoise(zero, zero + config.action_noise)
    if config.learning_rate_schedule == "linear":
        given["learning_rate"] = LinearSchedule(given["learning_rate"], 0.0, 1.0)
    module, name, _ = ALGORITHMS[config.algorithm]
    algorithm = getattr(import_module(module), name)
    try:
        model: BaseAlgorithm = algorithm(env=env, seed=config.seed, device="cpu", **given)
    except REFUSALS as error:
        raise InvalidInputError(f"{config.algorithm}: {first_line(error)}") from error
    return model

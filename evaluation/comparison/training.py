"""Carry out one training of a comparison, and judge it in the course."""

import time
from collections.abc import Callable
from copy import deepcopy
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kinarm._files import first_line
from kinarm.errors import InvalidInputError
from kinarm.evaluation.comparison.learners import ALGORITHMS, ComparedLearner
from kinarm.evaluation.comparison.runs import CurvePoint, PlannedRun, Protocol
from kinarm.evaluation.trials import trial_set
from kinarm.policies.learners import begin_training, state_policy, thread_options
from kinarm.policies.policy import Policy
from kinarm.policies.sb3.environment import sb3_vec_env
from kinarm.problem import ReachProblem

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm


def carry_out(run: PlannedRun) -> list[CurvePoint]:
    """Train and judge."""
    judge = Judge(run.problem, run.protocol)
    train = train_recipe if run.learner.is_recipe else train_sb3
    train(run, judge)
    return judge.curve


class Judge:
    """Puts policies to the trials in the course of a training, while its clock stands still.

    Parameters
    ----------
    problem : ReachProblem
        What they face.
    protocol : Protocol
        Which trials, and when.

    Attributes
    ----------
    curve : list of CurvePoint
        How they did.
    """

    def __init__(self, problem: ReachProblem, protocol: Protocol) -> None:
        self.curve: list[CurvePoint] = []
        self._protocol = protocol
        self._trials = trial_set(problem, protocol.trials, protocol.seed)
        self._number = 0
        shape = (len(self._trials), problem.task.horizon, self._trials.simulator.n_actions)
        self._trials.simulator.rollout_actions(  # loads what is compiled before the clock runs
            np.zeros(shape), self._trials.starts, self._trials.goals
        )
        self._began = clocks()

    def start(self) -> None:
        """Let the clock begin."""
        self._began = clocks()

    def look(
        self,
        environment_steps: int,
        policy: Callable[[], Policy],
        *,
        last: bool = False,
    ) -> None:
        """Judge what ``policy`` returns, if it is time to, or at the end."""
        due = environment_steps >= self._protocol.checkpoint(self._number)
        if not (due or last) or (self.curve and self.curve[-1][0] == environment_steps):
            return
        now = clocks()
        wall_time, processor_time = now - self._began
        trials = self._trials
        rollouts = trials.simulator.rollout(policy(), trials.starts, trials.goals)
        steps = rollouts.steps[rollouts.success]
        self.curve.append(
            CurvePoint(
                environment_steps=environment_steps,
                seconds=round(float(wall_time), 3),
                processor_seconds=round(float(processor_time), 3),
                successes=int(rollouts.success.sum()),
                collisions=int(rollouts.collision.sum()),
                median_distance=round(float(np.median(rollouts.distance)), 5),
                steps_to_success=float(np.median(steps)) if steps.size else None,
            )
        )
        while environment_steps >= self._protocol.checkpoint(self._number):
            self._number += 1
        self._began += clocks() - now


def clocks() -> NDArray[np.float64]:
    """Wall time and processor time [s]."""
    return np.array([time.perf_counter(), time.process_time()])


def train_recipe(run: PlannedRun, judge: Judge) -> None:
    """Train by a recipe of kinarm on one thread, to its end or the number of steps given.

    The clock runs while the oracle solves what a recipe imitates, and while it is imitated.
    """
    config = run.config
    training = begin_training(config, **thread_options(config, 1))
    judge.start()
    state = training.initial_state()
    over = False
    while not over:
        state = training.iterate(state)
        over = state.iteration == config.iterations or (
            run.steps is not None and state.environment_steps >= run.steps
        )
        judge.look(state.environment_steps, partial(state_policy, config, state), last=over)


def train_sb3(run: PlannedRun, judge: Judge) -> None:
    """Train an algorithm of Stable-Baselines3 or sb3-contrib, on one thread."""
    from kinarm.policies.sb3.training import alone_in_torch

    length = run.learner.environment_steps
    with alone_in_torch():
        model = sb3_model(run.learner, run.problem, run.seed)
        policy = partial(Policy.from_sb3, model, run.problem)

        def on_step(*_: object) -> bool:
            judge.look(model.num_timesteps, policy)
            return True

        judge.start()
        model.learn(length if run.steps is None else min(length, run.steps), callback=on_step)
        judge.look(model.num_timesteps, policy, last=True)


def sb3_model(learner: ComparedLearner, problem: ReachProblem, seed: int) -> "BaseAlgorithm":
    """Build the algorithm of a learner, with its environment.

    Raises
    ------
    InvalidInputError
        If the algorithm refuses its settings.
    """
    from stable_baselines3.common.noise import NormalActionNoise
    from stable_baselines3.common.utils import LinearSchedule
    from stable_baselines3.common.vec_env import VecEnv, VecNormalize

    kind = "sparse" if learner.hindsight else None
    env: VecEnv = sb3_vec_env(
        problem, learner.n_envs, reward_type=kind, threads=1, **learner.train_on
    )
    if learner.normalize:
        env = VecNormalize(env, norm_reward=False)
    settings: dict[str, Any] = deepcopy(learner.settings)  # which the algorithm changes
    if learner.hindsight:
        from kinarm.policies.sb3.hindsight import HindsightReplayBuffer

        settings["replay_buffer_class"] = HindsightReplayBuffer
    if learner.action_noise:
        zero = np.zeros(env.action_space.shape or ())
        settings["action_noise"] = NormalActionNoise(zero, zero + learner.action_noise)
    if learner.decaying:
        settings["learning_rate"] = LinearSchedule(settings["learning_rate"], 0.0, 1.0)
    algorithm = getattr(import_module(ALGORITHMS[learner.algorithm]), learner.algorithm)
    try:
        model: BaseAlgorithm = algorithm(env=env, seed=seed, device="cpu", **settings)
    except (AssertionError, KeyError, TypeError, ValueError) as error:
        raise InvalidInputError(f"settings of {learner.name}: {first_line(error)}") from error
    return model

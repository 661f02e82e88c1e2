"""Policies that choose actions in Python: with a memory, and in a wrapper of their own."""

import inspect
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Dict
from numpy.typing import ArrayLike, NDArray

from kinarm._parallel import one_torch_thread
from kinarm.envs import ReachEnv
from kinarm.envs.environment import Interface
from kinarm.envs.goal import GoalInterface
from kinarm.episodes import RUNNING, Episodes, Rollouts
from kinarm.evaluation.trials import TrialSet
from kinarm.kernels.compiling import Array
from kinarm.networks import takes_rows
from kinarm.policies.policy import Policy
from kinarm.simulator import Simulator, StepResult

Wrapper = Callable[[Any], Any]
"""Wraps an environment: one of Gymnasium, or ``venv``, a ``VecEnv`` of Stable-Baselines3."""

Memory = Any
"""What a policy remembers of a batch of episodes; None at their start."""


@dataclass(frozen=True, eq=False)
class Actor:
    """Something that chooses actions for a batch of episodes.

    Its policy is a function of observations, or has a ``predict``; statistics, a ``VecNormalize``,
    normalise its observations.
    """

    policy: Any
    statistics: Any = None

    @cached_property
    def _options(self) -> set[str]:
        """Which of its arguments ``predict`` takes."""
        known = inspect.signature(self.policy.predict).parameters
        return {"state", "episode_start", "deterministic"} & {*known}

    def __call__(
        self,
        observations: Any,
        memory: Memory,
        episode_start: NDArray[np.bool_],
        rows: NDArray[np.int64] | None = None,
    ) -> tuple[ArrayLike, Memory]:
        """Choose actions, shape (n, n_actions), and what to remember.

        Parameters
        ----------
        observations : array_like or mapping
            Of n episodes.
        memory, episode_start : object, ndarray of bool, shape (n,)
            What was remembered, and which episodes begin.
        rows : ndarray of int, shape (n,), optional
            Numbers of the episodes, for functions that ask.
        """
        space = getattr(self.policy, "observation_space", None)
        if isinstance(space, Box):
            observations = np.asarray(observations, dtype=space.dtype)
        if self.statistics is not None:
            observations = self.statistics.normalize_obs(observations)
        if not hasattr(self.policy, "predict"):
            numbered = {"rows": rows} if takes_rows(self.policy) else {}
            return self.policy(observations, **numbered), None
        given = {"state": memory, "episode_start": episode_start, "deterministic": True}
        answer = self.policy.predict(observations, **{name: given[name] for name in self._options})
        return answer if isinstance(answer, tuple) else (answer, None)


def run_remembering(actor: Actor, trials: TrialSet, *, record: bool = False) -> Rollouts:
    """Run trials with one memory for all of them, and goals apart where a policy sees them so."""
    n, space = len(trials), getattr(actor.policy, "observation_space", None)
    shown = (GoalInterface if isinstance(space, Dict) else Interface)(trials.simulator)
    seen, memory, start = np.zeros((n, trials.simulator.n_observations)), None, np.ones(n, bool)

    def actions(observations: Array, rows: NDArray[np.int64]) -> Array:
        nonlocal memory, start
        seen[rows] = observations
        chosen, memory = actor(shown.observe(seen), memory, start)
        start = np.zeros(n, bool)
        return np.asarray(chosen)[rows]

    return trials.simulator.rollout(actions, trials.starts, trials.goals, record=record)


@one_torch_thread()
def run_wrapped(
    actor: Actor, wrapper: Wrapper, trials: TrialSet, *, record: bool = False
) -> Rollouts:
    """Run trials in a wrapper, around what a policy sees, and then the actions that arrived."""
    parameters = [*inspect.signature(wrapper).parameters]
    run = _in_batch if parameters[:1] == ["venv"] else _one_by_one
    simulator = trials.simulator
    if isinstance(actor.policy, Policy):
        trials = replace(trials, simulator=simulator.changed(observation=actor.policy.observation))
    actions = np.zeros((len(trials), simulator.task.horizon, simulator.n_actions))
    run(actor, wrapper, trials, actions)
    return simulator.rollout_actions(actions, trials.starts, trials.goals, record=record)


class Recorder(Simulator):
    """Steps arms, and keeps the actions that arrive in the first episode of each.

    They are filled into ``kept``, shape (n, horizon, n_actions), until it is ``over``, shape (n,).
    """

    def keep_in(self, kept: Array) -> None:
        """Fill these in by the next episodes."""
        self.kept, self.over = kept, np.zeros(len(kept), dtype=bool)

    def step(self, episodes: Episodes, actions: ArrayLike) -> StepResult:
        """Advance, and keep the actions of episodes that run."""
        running = (episodes.status == RUNNING) & ~self.over
        steps = episodes.steps[running]
        result = super().step(episodes, actions)
        self.kept[running, steps] = np.asarray(actions)[running]
        self.over |= result.terminated | result.truncated
        return result


def _one_by_one(actor: Actor, wrapper: Wrapper, trials: TrialSet, actions: Array) -> None:
    """Run trials in a wrapped environment of Gymnasium; fill in the actions."""
    arm = ReachEnv(trials.problem)
    arm.simulator = recorder = Recorder(trials.problem, threads=1)
    env = wrapper(arm)
    for trial, (start, goal) in enumerate(zip(trials.starts, trials.goals, strict=True)):
        recorder.keep_in(actions[trial : trial + 1])
        observation, _ = env.reset(seed=trial, options={"start": start, "goal": goal})
        memory, first, over, rows = None, np.ones(1, dtype=bool), False, np.array([trial])
        while not over:
            chosen, memory = actor(_batch(observation), memory, first, rows)
            observation, _, terminated, truncated, _ = env.step(np.asarray(chosen)[0])
            over, first = terminated or truncated, np.zeros(1, dtype=bool)
    env.close()


def _batch(observation: Any) -> Any:
    if isinstance(observation, dict):
        return {key: np.asarray(part)[None] for key, part in observation.items()}
    return np.asarray(observation)[None]


def _in_batch(actor: Actor, wrapper: Wrapper, trials: TrialSet, actions: Array) -> None:
    """Run trials in a wrapped ``VecEnv`` of Stable-Baselines3; fill in the actions."""
    from stable_baselines3.common.vec_env import unwrap_vec_normalize

    from kinarm.policies import sb3_vec_env

    arms = sb3_vec_env(trials.problem, len(trials), seed=0)
    arms.env.simulator = recorder = Recorder(trials.problem)
    recorder.keep_in(actions)
    pairs = zip(trials.starts, trials.goals, strict=True)
    arms.set_options([{"start": start, "goal": goal} for start, goal in pairs])
    venv = wrapper(arms)
    if (own := unwrap_vec_normalize(venv)) is not None:
        own.training, actor = False, replace(actor, statistics=None)
    observations, memory, start = venv.reset(), None, np.ones(len(trials), dtype=bool)
    while not recorder.over.all():
        chosen, memory = actor(observations, memory, start, np.arange(len(trials)))
        observations, _, start, _ = venv.step(np.asarray(chosen))
        recorder.over |= start
    venv.close()

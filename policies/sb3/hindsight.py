"""Hindsight replay for goals whose reaching ends an episode."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3 import HerReplayBuffer
from stable_baselines3.common.type_aliases import DictReplayBufferSamples
from stable_baselines3.common.vec_env import VecNormalize

Indices = NDArray[np.int64]
Goals = NDArray[np.floating[Any]]


class HindsightReplayBuffer(HerReplayBuffer):
    """A ``HerReplayBuffer`` that ends an episode where it reaches a substituted goal.

    In `kinarm.ReachGoalEnv` reaching the goal ends an episode. The buffer of Stable-Baselines3
    keeps the original end, so that a learner would bootstrap a value after the goal, where nothing
    comes. This buffer also keeps the part of a reward that does not depend on the goal, such as the
    penalty for a collision, without ``copy_info_dict``.
    """

    def _sample_goals(self, batch_indices: Indices, env_indices: Indices) -> Goals:
        """Goals to substitute, shape (n, 3) [m]; notes which entries change."""
        goals: Goals = super()._sample_goals(batch_indices, env_indices)
        where = batch_indices, env_indices
        achieved = self.next_observations["achieved_goal"][where]
        desired = self.next_observations["desired_goal"][where]
        self._reached = self._ask("compute_terminated", achieved, goals)
        self._besides = self.rewards[where] - self._ask("compute_reward", achieved, desired)
        return goals

    def _ask(self, method: str, achieved: Goals, desired: Goals) -> NDArray[Any]:
        """Ask the environment about pairs of goals."""
        environment: Any = self.env  # given by every learner
        (answer,) = environment.env_method(method, achieved, desired, {}, indices=[0])
        return np.asarray(answer, dtype=np.float32)

    def _get_virtual_samples(
        self, batch_indices: Indices, env_indices: Indices, env: VecNormalize | None = None
    ) -> DictReplayBufferSamples:
        """Transitions with substituted goals, which end where they are reached."""
        samples = super()._get_virtual_samples(batch_indices, env_indices, env)
        besides = self._normalize_reward(self._besides.reshape(-1, 1), env)
        reached = self.to_torch(self._reached).reshape(-1, 1)
        return samples._replace(
            dones=samples.dones.maximum(reached), rewards=samples.rewards + self.to_torch(besides)
        )

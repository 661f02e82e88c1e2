"""Hindsight replay for goals whose reaching ends an episode."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3 import HerReplayBuffer

if TYPE_CHECKING:
    from stable_baselines3.common.type_aliases import DictReplayBufferSamples


class HindsightReplayBuffer(HerReplayBuffer):
    """`HerReplayBuffer` that also asks anew whether an episode is over when it changes the goal.

    The one of Stable-Baselines3 computes the reward for the substituted goal, but keeps from the
    original one whether the episode ended. Where reaching ends it, as in `ReachGoalEnv`, a learner
    would look for what comes after the goal, of which it never learns anything.
    """

    def _sample_goals(
        self, batch_indices: NDArray[np.int64], env_indices: NDArray[np.int64]
    ) -> NDArray[np.floating[Any]]:
        """Goals to substitute, shape (n, 3) [m]; takes note of those that are reached."""
        goals: NDArray[np.floating[Any]] = super()._sample_goals(batch_indices, env_indices)
        achieved = self.next_observations["achieved_goal"][batch_indices, env_indices]
        (self._reached,) = self.env.env_method(
            "compute_terminated", achieved, goals, {}, indices=[0]
        )
        return goals

    def _get_virtual_samples(self, *given: Any, **named: Any) -> "DictReplayBufferSamples":
        """Transitions with substituted goals, which end where these are reached."""
        samples = super()._get_virtual_samples(*given, **named)
        reached = self.to_torch(self._reached).reshape(-1, 1)
        return samples._replace(dones=samples.dones.maximum(reached.to(samples.dones.dtype)))

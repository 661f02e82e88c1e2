"""The interface of an environment: observations, rewards and how episodes end.

The single environment, the native batch and the one for Stable-Baselines3 share it.
"""

from typing import Any, NamedTuple, cast

import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import DTypeLike, NDArray

from kinarm.episodes import Episodes
from kinarm.errors import InvalidInputError
from kinarm.observation import Ranges, observation_bounds
from kinarm.rollouts import StepResult
from kinarm.simulator import Simulator

Array = NDArray[np.float64]
Observations = Any
"""An array, or a dictionary of arrays; one row per arm."""

DTYPES = ("float64", "float32")


class StepOutcome(NamedTuple):
    """The outcome of a step, as a learner sees it; arrays of shape (n,).

    Attributes
    ----------
    reward : ndarray
        The reward.
    terminated, truncated : ndarray of bool
        Whether the episode ended by itself, or at the horizon.
    """

    reward: Array
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]


class Interface:
    """The way in which an environment shows its simulator: with its own observation and reward.

    Parameters
    ----------
    simulator : Simulator
        What is shown.
    dtype : dtype_like
        Of observations: float64 or float32.

    Attributes
    ----------
    observation_space : Space
        Bounds of the observation of one arm.
    tells_terms : bool
        Whether the reward is the sum of the problem's reward terms, which infos then tell.
    """

    observation_space: Space[Any]
    tells_terms = True

    def __init__(self, simulator: Simulator, dtype: DTypeLike = np.float64) -> None:
        self._dtype = checked_dtype(dtype)
        self.observation_space = bounded_space(state_bounds(simulator), self._dtype)

    def observe(self, observations: Array) -> Observations:
        """Copy the simulator's observations, shape (n, n_observations), as they are shown."""
        return observations.astype(self._dtype)

    def step_outcome(self, episodes: Episodes, result: StepResult) -> StepOutcome:  # noqa: ARG002
        """Reward a step, and say which episodes are over; may let episodes go on."""
        return StepOutcome(result.reward, result.terminated, result.truncated)


def one_by_one(observations: Observations, count: int) -> list[Any]:
    """Split a batch of observations, as an interface shows them, into those of single arms."""
    if isinstance(observations, dict):
        return [{key: part[k] for key, part in observations.items()} for k in range(count)]
    return list(observations)


def checked_dtype(dtype: DTypeLike) -> np.dtype[Any]:
    """Return a type that observations can have.

    Raises
    ------
    InvalidInputError
        If they cannot have it.
    """
    try:
        name = np.dtype(dtype).name
    except TypeError:
        name = str(dtype)
    if name not in DTYPES:
        raise InvalidInputError(f"observation_dtype must be one of {list(DTYPES)}, got {dtype!r}")
    return np.dtype(name)


def state_bounds(simulator: Simulator) -> tuple[Array, Array]:
    """Bounds of an observation: goals to within the tolerance, quaternions to within rounding."""
    task = simulator.task
    regions = [simulator.scene.goal_region(name) for name in task.goal_regions]
    ranges = Ranges(
        goal_lower=np.min([region.lower for region in regions], axis=0) - task.tolerance,
        goal_upper=np.max([region.upper for region in regions], axis=0) + task.tolerance,
        reach=simulator.arm.reach,
    )
    return observation_bounds(ranges, simulator.arm.n_joints)


def bounded_space(bounds: tuple[Array, Array], dtype: np.dtype[Any]) -> Space[Any]:
    """Space of vectors of a type between a lower and an upper bound, shape (n,) each."""
    lower, upper = (bound.astype(dtype) for bound in bounds)
    return cast("Space[Any]", Box(lower, upper, dtype=dtype.type))

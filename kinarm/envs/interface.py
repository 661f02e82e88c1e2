"""The interface of every environment: observations, rewards and how episodes end."""

from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import DTypeLike, NDArray

from kinarm.envs.rendering import RENDER_MODES
from kinarm.episodes import Episodes, StepResult
from kinarm.errors import InvalidInputError
from kinarm.observation import Ranges, observation_bounds
from kinarm.simulator import Simulator

Array = NDArray[np.float64]
Observations = Any
"""An array, or a dictionary of arrays; one row per arm."""

DTYPES = ("float64", "float32")


class StepOutcome(NamedTuple):
    """The outcome of a step, as a learner sees it; arrays of shape (n,).

    The reward, and whether the episode ended by itself or at the horizon.
    """

    reward: Array
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]


class Interface:
    """The way in which an environment shows its simulator: with its own observation and reward.

    Spaces are those of one arm; observations are float64 or float32, actions fractions of the
    velocity limits. ``tells_terms`` says whether the reward is the sum of the problem's reward
    terms, which infos then tell.
    """

    observation_space: Space[Any]
    action_space: Space[Any]
    tells_terms = True

    def __init__(self, simulator: Simulator, dtype: DTypeLike = np.float64) -> None:
        self.simulator, self._dtype = simulator, checked_dtype(dtype)
        self.action_space = Box(-1.0, 1.0, (simulator.n_actions,), dtype=np.float32)
        rate = round(1 / simulator.problem.stepping.time_step)
        self.metadata = {"render_modes": list(RENDER_MODES), "render_fps": max(rate, 1)}
        self.observation_space = self._space()

    def _space(self) -> Space[Any]:
        """Space of what `observe` returns for one arm."""
        return bounded_space(state_bounds(self.simulator), self._dtype)

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
    """A type that observations can have, or an error."""
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
    return Box(lower, upper, dtype=dtype.type)

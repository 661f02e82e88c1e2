"""What an environment shows of the simulator: observations, rewards and how episodes end.

The single environment, the native batch and the one for Stable-Baselines3 share an interface.
"""

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple, Protocol, cast, get_args

import numpy as np
from gymnasium.spaces import Box, Dict, Space
from numpy.typing import ArrayLike, DTypeLike, NDArray

from kinarm.episodes import TRUNCATED, Episodes
from kinarm.errors import InvalidInputError
from kinarm.observation import OBSERVATION, Ranges, observation_bounds, part_slices
from kinarm.rollouts import StepResult
from kinarm.simulator import Simulator

Array = NDArray[np.float64]
Observations = Any
"""An array, or a dictionary of arrays; one row per arm."""

RewardType = Literal["sparse", "dense"]
DTYPES = ("float64", "float32")


class Verdict(NamedTuple):
    """What a step came to, as a learner sees it; arrays of shape (n,).

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


class Interface(Protocol):
    """What an environment shows.

    Attributes
    ----------
    observation_space : Space
        Bounds of the observation of one arm.
    tells_terms : bool
        Whether the reward is the sum of the problem's reward terms, which infos then tell.
    """

    observation_space: Space[Any]
    tells_terms: bool

    def observe(self, observations: Array) -> Observations:
        """Copy the simulator's observations, shape (n, n_observations), as they are shown."""

    def judge(self, episodes: Episodes, result: StepResult) -> Verdict:
        """Reward a step, and say which episodes are over; may let episodes go on."""


class FlatInterface:
    """The simulator's own observation and reward.

    Parameters
    ----------
    simulator : Simulator
        What is shown.
    dtype : dtype_like
        Of observations: float64 or float32.
    """

    tells_terms = True

    def __init__(self, simulator: Simulator, dtype: DTypeLike = np.float64) -> None:
        self._dtype = checked_dtype(dtype)
        self.observation_space = _box(*_bounds(simulator), self._dtype)

    def observe(self, observations: Array) -> Observations:
        """Copy observations in the type asked for."""
        return observations.astype(self._dtype)

    def judge(self, episodes: Episodes, result: StepResult) -> Verdict:  # noqa: ARG002
        """Take the simulator's reward and endings."""
        return Verdict(result.reward, result.terminated, result.truncated)


class GoalInterface:
    """Goals as a dictionary, and rewards that can be computed for any goals.

    A move that would touch something is refused and costs the problem's reward for a collision.
    The episode goes on, so giving up never pays.

    Parameters
    ----------
    simulator : Simulator
        The simulator that the environment shows.
    dtype : dtype_like
        Type of observations and goals: float64 or float32.
    reward_type : {"sparse", "dense"}
        -1 for every step that does not reach the goal and 0 for the one that does, or minus the
        distance [m].

    Raises
    ------
    InvalidInputError
        If there is no such type.
    """

    tells_terms = False

    def __init__(
        self,
        simulator: Simulator,
        dtype: DTypeLike = np.float64,
        reward_type: RewardType = "sparse",
    ) -> None:
        if reward_type not in get_args(RewardType):
            raise InvalidInputError(
                f"reward_type must be one of {list(get_args(RewardType))}, got {reward_type!r}"
            )
        self._dtype = checked_dtype(dtype)
        self._sparse, self._tolerance = reward_type == "sparse", simulator.task.tolerance
        self._horizon, self._collision = simulator.task.horizon, simulator.task.reward.collision
        n_joints = simulator.arm.n_joints
        self._places = part_slices(n_joints)
        self._own = [self._places[part.name] for part in OBSERVATION if not part.of_goal]
        lower, upper = bounds = _bounds(simulator)
        own_lower, own_upper = (
            np.concatenate([bound[place] for place in self._own]) for bound in bounds
        )
        goals = self._places["goal"]
        reach = np.full(3, simulator.arm.reach)
        self.observation_space: Space[Any] = Dict(
            {
                "observation": _box(own_lower, own_upper, self._dtype),
                "achieved_goal": _box(-reach, reach, self._dtype),
                "desired_goal": _box(lower[goals], upper[goals], self._dtype),
            }
        )

    def observe(self, observations: Array) -> Observations:
        """Split observations into ``observation``, ``achieved_goal`` and ``desired_goal``."""
        own = [observations[:, place] for place in self._own]
        achieved, desired = self._goals(observations)
        return {
            "observation": np.concatenate(own, axis=1, dtype=self._dtype),
            "achieved_goal": achieved,
            "desired_goal": desired,
        }

    def _goals(self, observations: Array) -> tuple[NDArray[Any], NDArray[Any]]:
        """Copy tool points and goals, shape (n, 3) each [m]."""
        goals = observations[:, self._places["goal"]]
        tools = goals - observations[:, self._places["goal_minus_tool"]]
        return tools.astype(self._dtype, copy=False), goals.astype(self._dtype)

    def judge(self, episodes: Episodes, result: StepResult) -> Verdict:
        """Reward by the goals, and let episodes go on whose move was refused."""
        truncated = result.truncated
        if np.count_nonzero(result.collision):
            episodes.resume(result.collision.nonzero()[0], self._horizon)
            truncated = truncated | (episodes.status == TRUNCATED) & result.collision
        info = {"collision": result.collision}
        reward = self.compute_reward(*self._goals(episodes.observation), info)
        return Verdict(reward, result.success, truncated)

    def compute_reward(
        self, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: object
    ) -> Array:
        """Reward of having achieved one goal while another was desired.

        Parameters
        ----------
        achieved_goal, desired_goal : array_like, shape (..., 3)
            Tool point and goal [m].
        info : mapping or sequence of mapping
            That of the step, or one for each: whether there was a ``collision``.

        Returns
        -------
        ndarray, shape (...)
        """
        distance = _distances(achieved_goal, desired_goal)
        reached = np.where(distance <= self._tolerance, 0.0, -1.0) if self._sparse else -distance
        return reached + self._collision * _collisions(info)

    def compute_terminated(
        self,
        achieved_goal: ArrayLike,
        desired_goal: ArrayLike,
        info: object,  # noqa: ARG002
    ) -> NDArray[np.bool_]:
        """Whether the goal is reached; arguments as for `compute_reward`."""
        return _distances(achieved_goal, desired_goal) <= self._tolerance

    def compute_truncated(
        self,
        achieved_goal: ArrayLike,
        desired_goal: ArrayLike,
        info: object,  # noqa: ARG002
    ) -> NDArray[np.bool_]:
        """False: only the number of the step decides; arguments as for `compute_reward`."""
        return np.zeros(_distances(achieved_goal, desired_goal).shape, dtype=bool)


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


def _collisions(info: Any) -> NDArray[np.bool_]:
    """Whether infos tell of a collision; one of a step, of a batch, or a sequence of them."""
    if isinstance(info, Mapping):
        return np.asarray(info.get("collision", False))
    return np.array([each.get("collision", False) for each in info], dtype=bool)


def _distances(first: ArrayLike, second: ArrayLike) -> Array:
    """Distances between points, shape (..., 3) each."""
    apart = np.asarray(first, dtype=np.float64) - np.asarray(second, dtype=np.float64)
    squares = apart**2
    # Term by term, so that the sum does not depend on how many points there are.
    distance: Array = np.sqrt(squares[..., 0] + squares[..., 1] + squares[..., 2])
    return distance


def _bounds(simulator: Simulator) -> tuple[Array, Array]:
    """Bounds of an observation: goals to within the tolerance, quaternions to within rounding."""
    task = simulator.task
    regions = [simulator.scene.goal_region(name) for name in task.goal_regions]
    ranges = Ranges(
        goal_lower=np.min([region.lower for region in regions], axis=0) - task.tolerance,
        goal_upper=np.max([region.upper for region in regions], axis=0) + task.tolerance,
        reach=simulator.arm.reach,
    )
    return observation_bounds(ranges, simulator.arm.n_joints)


def _box(lower: Array, upper: Array, dtype: np.dtype[Any]) -> Space[Any]:
    return cast("Space[Any]", Box(lower.astype(dtype), upper.astype(dtype), dtype=dtype.type))

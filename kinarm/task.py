"""Reaching tasks: where goals lie, when an episode ends and what is rewarded."""

import math
from dataclasses import dataclass, field, fields, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.errors import SceneError, UnknownNameError
from kinarm.scene import Scene
from kinarm.validation import whole_number


@dataclass(frozen=True, kw_only=True)
class RewardWeights:
    """Weights of the five reward terms.

    Parameters
    ----------
    progress : float
        Per metre by which the tool came closer to the goal in a step [1/m].
    closer : float
        Added in every step that brings the tool closer, subtracted in every step that takes it
        farther, however far.
    collision : float
        Added once when a move touches something and the episode ends; usually negative.
    success : float
        Added once when the tool comes within the tolerance.
    step : float
        Added in every step; negative to reward haste.
    """

    progress: float = 1.0
    closer: float = 0.0
    collision: float = -1.0
    success: float = 0.0
    step: float = 0.0

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if not isinstance(value, int | float | np.number) or not math.isfinite(value):
                raise SceneError(f"reward weight {item.name} must be finite, got {value!r}")


class RewardTerms(NamedTuple):
    """Weighted terms of a reward; their sum is the reward.

    Attributes
    ----------
    progress, closer, collision, success, step : ndarray, shape (n,)
        See `RewardWeights`.
    """

    progress: NDArray[np.float64]
    closer: NDArray[np.float64]
    collision: NDArray[np.float64]
    success: NDArray[np.float64]
    step: NDArray[np.float64]

    @property
    def total(self) -> NDArray[np.float64]:
        """The reward."""
        total: NDArray[np.float64] = sum(self[1:], start=self.progress)
        return total


def reward_terms(
    weights: RewardWeights,
    distance_before: NDArray[np.float64],
    distance_after: NDArray[np.float64],
    collided: NDArray[np.bool_],
    reached: NDArray[np.bool_],
) -> RewardTerms:
    """Reward of one step, term by term (paper, section 3.3: closer is positive, farther negative).

    Parameters
    ----------
    weights : RewardWeights
        Weights of the terms.
    distance_before, distance_after : ndarray, shape (n,)
        Distance from the tool to the goal before and after the step [m].
    collided, reached : ndarray of bool, shape (n,)
        How the step ended.

    Returns
    -------
    RewardTerms
        Arrays of shape (n,).
    """
    return RewardTerms(
        progress=weights.progress * (distance_before - distance_after),
        closer=weights.closer * np.sign(distance_before - distance_after),
        collision=np.where(collided, weights.collision, 0.0),
        success=np.where(reached, weights.success, 0.0),
        step=np.full(np.shape(distance_after), weights.step),
    )


@dataclass(frozen=True, kw_only=True)
class ReachTask:
    """Bring the tool to a cube that lies somewhere on a bench.

    Parameters
    ----------
    name : str
        Name of the task.
    benches : tuple of str
        Benches that the cube may lie on, each with the same probability.
    tolerance : float
        The goal counts as reached at this distance or less [m].
    horizon : int
        Steps after which an episode is truncated.
    start_spread : float
        Scales the range of the start configurations about the home pose; 1 is the whole range
        of every actuated axis, 0 always starts at home.
    reward : RewardWeights
        What is rewarded.
    """

    name: str
    benches: tuple[str, ...]
    tolerance: float = 0.05
    horizon: int = 64
    start_spread: float = 1.0
    reward: RewardWeights = field(default_factory=RewardWeights)

    def __post_init__(self) -> None:
        if not self.benches:
            raise SceneError(f"task {self.name!r} names no bench")
        if not (math.isfinite(self.tolerance) and self.tolerance > 0):
            raise SceneError(f"tolerance must be greater than 0 m, got {self.tolerance}")
        whole_number("horizon", self.horizon, 1)
        if not 0 <= self.start_spread <= 1:
            raise SceneError(f"start_spread must lie in [0, 1], got {self.start_spread}")

    def goals(self, scene: Scene, uniforms: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map uniform numbers to goal positions.

        Parameters
        ----------
        scene : Scene
            The scene that holds the benches.
        uniforms : ndarray, shape (n, 3)
            Numbers in [0, 1): which bench, and where along its x and y.

        Returns
        -------
        ndarray, shape (n, 3)
            Centres of the cubes [m].
        """
        regions = np.array([scene.goal_region(name) for name in self.benches])
        chosen = regions[(uniforms[:, 0] * len(self.benches)).astype(int)]
        goals: NDArray[np.float64] = chosen[:, 0].copy()
        goals[:, :2] += uniforms[:, 1:] * (chosen[:, 1, :2] - chosen[:, 0, :2])
        return goals


TASKS = {
    task.name: task
    for task in (
        ReachTask(name="left", benches=("left",)),
        ReachTask(name="right", benches=("right",)),
        ReachTask(name="both", benches=("left", "right")),
    )
}
"""The paper's tasks 1, 2 and 3 by name."""


def load_task(name: str | ReachTask, **settings: Any) -> ReachTask:
    """Look a task up by name and replace some of its settings.

    Parameters
    ----------
    name : str or ReachTask
        ``"left"``, ``"right"`` or ``"both"``: the paper's tasks 1, 2 and 3; or a task to change.
    **settings
        Fields of `ReachTask` to replace; None leaves a field as it is.

    Raises
    ------
    UnknownNameError
        If there is no such task or setting.
    """
    if isinstance(name, str):
        if name not in TASKS:
            raise UnknownNameError("task", name, TASKS)
        name = TASKS[name]
    available = [item.name for item in fields(ReachTask)]
    for setting in settings:
        if setting not in available:
            raise UnknownNameError("task setting", setting, available)
    return replace(name, **{key: value for key, value in settings.items() if value is not None})

"""State of a PPO training between two iterations."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.errors import InvalidInputError
from kinarm.failed_scenarios import FailedScenarios
from kinarm.policies.learners import TrainingState
from kinarm.policies.normalizer import Normalizer


class EpisodeStates(NamedTuple):
    """The state of running episodes; everything else follows from it.

    Attributes
    ----------
    q : ndarray, shape (n, n_joints)
        Configurations [rad or m].
    goal : ndarray, shape (n, 3)
        Goal positions [m].
    steps : ndarray of int, shape (n,)
        Steps taken.
    total : ndarray, shape (n,)
        Sums of rewards so far.
    start : ndarray, shape (n, n_joints)
        Configurations in which they began [rad or m].
    replayed : ndarray of bool, shape (n,)
        Whether they began where an earlier one had failed.
    """

    q: NDArray[np.float64]
    goal: NDArray[np.float64]
    steps: NDArray[np.int64]
    total: NDArray[np.float64]
    start: NDArray[np.float64]
    replayed: NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class PPOState(TrainingState):
    """Everything that the next iteration depends on.

    Parameters
    ----------
    parameters : ndarray of float32, shape (n_parameters,)
        Parameters of actor and critic, in the order of the policy of Stable-Baselines3.
    first_moment, second_moment : ndarray of float32, shape (n_parameters,)
        Adam's running means of the gradients and of their squares.
    normalizer : Normalizer
        Statistics by which observations are normalised.
    episodes : EpisodeStates
        The episodes that are under way.
    failed : FailedScenarios
        What may be replayed.
    simulator_time : float
        Time spent in the simulator so far [s].
    curve : tuple of CurvePoint
        One point per finished iteration.

    Raises
    ------
    InvalidInputError
        If a training could not go on from it.
    """

    parameters: NDArray[np.float32]
    first_moment: NDArray[np.float32]
    second_moment: NDArray[np.float32]
    normalizer: Normalizer
    episodes: EpisodeStates
    failed: FailedScenarios
    simulator_time: float = 0.0

    def __post_init__(self) -> None:
        vectors = (self.parameters, self.first_moment, self.second_moment)
        if len({vector.shape for vector in vectors}) > 1 or self.parameters.ndim != 1:
            raise InvalidInputError(
                f"parameters and moments have the shapes {[vector.shape for vector in vectors]}"
            )
        if not all(vector.dtype == np.float32 and np.isfinite(vector).all() for vector in vectors):
            raise InvalidInputError("parameters and moments must be finite, of single precision")
        if len({len(array) for array in self.episodes}) > 1:
            raise InvalidInputError(
                f"episodes have the shapes {[array.shape for array in self.episodes]}"
            )
        self.failed.check()
        mean, squares = self.normalizer.mean, self.normalizer.squares
        if mean.shape != squares.shape or mean.ndim != 1:
            raise InvalidInputError(f"statistics have the shapes {mean.shape}, {squares.shape}")

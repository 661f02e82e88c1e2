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
    q, start : ndarray, shape (n, n_joints)
        Configurations, and those in which they began [rad or m].
    goal : ndarray, shape (n, 3)
        Goal positions [m].
    steps, total : ndarray, shape (n,)
        Steps taken, and sums of rewards so far.
    replayed : ndarray of bool, shape (n,)
        Whether they began where an earlier one had failed.
    """

    q: NDArray[np.float64]
    goal: NDArray[np.float64]
    steps: NDArray[np.int64]
    total: NDArray[np.float64]
    start: NDArray[np.float64]
    replayed: NDArray[np.bool_]

    @classmethod
    def begun(cls, starts: NDArray[np.float64], goals: NDArray[np.float64]) -> "EpisodeStates":
        """Of new episodes."""
        n = len(starts)
        counts = np.zeros(n, dtype=np.int64)
        return cls(starts, goals, counts, np.zeros(n), starts, np.zeros(n, dtype=bool))


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
        statistics = (self.normalizer.mean, self.normalizer.squares)
        for arrays in (vectors, statistics):
            if len({array.shape for array in arrays}) > 1 or arrays[0].ndim != 1:
                shapes = ", ".join(str(array.shape) for array in arrays)
                raise InvalidInputError(f"parts of the state have the shapes {shapes}")
        if len({len(array) for array in self.episodes}) > 1:
            raise InvalidInputError("parts of the episodes' states are not as many")
        self.failed.check()

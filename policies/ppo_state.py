"""State of a PPO training between two iterations."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.policies.curve import CurvePoint
from kinarm.policies.normalizer import Normalizer


class EpisodeStates(NamedTuple):
    """What running episodes depend on; everything else follows from it.

    Attributes
    ----------
    q : ndarray, shape (n, n_axes)
        Configurations [rad or m].
    goal : ndarray, shape (n, 3)
        Goal positions [m].
    steps : ndarray of int, shape (n,)
        Steps taken.
    total : ndarray, shape (n,)
        Sums of rewards so far.
    """

    q: NDArray[np.float64]
    goal: NDArray[np.float64]
    steps: NDArray[np.int64]
    total: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class PPOState:
    """Everything that the next iteration depends on.

    Attributes
    ----------
    parameters : ndarray of float32, shape (n_parameters,)
        Parameters of actor and critic, in the order of the policy of Stable-Baselines3.
    first_moment, second_moment : ndarray of float32, shape (n_parameters,)
        Adam's running means of the gradients and of their squares.
    normalizer : Normalizer
        Statistics by which observations are normalised.
    episodes : EpisodeStates
        The episodes that are under way.
    curve : tuple of CurvePoint
        One point per finished iteration.
    simulator_time : float
        Time spent in the simulator so far [s].
    """

    parameters: NDArray[np.float32]
    first_moment: NDArray[np.float32]
    second_moment: NDArray[np.float32]
    normalizer: Normalizer
    episodes: EpisodeStates
    curve: tuple[CurvePoint, ...] = field(default=())
    simulator_time: float = 0.0

    @property
    def iteration(self) -> int:
        """Number of finished iterations."""
        return len(self.curve)

    @property
    def environment_steps(self) -> int:
        """Steps taken so far."""
        return self.curve[-1].environment_steps if self.curve else 0

    @property
    def wall_time(self) -> float:
        """Time spent so far [s]."""
        return self.curve[-1].wall_time if self.curve else 0.0

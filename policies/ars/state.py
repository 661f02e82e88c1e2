"""State of an ARS training between two iterations."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinarm.errors import InvalidInputError
from kinarm.failed_scenarios import FailedScenarios
from kinarm.policies.learners import TrainingState
from kinarm.policies.normalizer import Normalizer

_PROBE: np.random.BitGenerator = np.random.PCG64(0)
"""Takes no state but one that a generator can be in; quicker to ask than a new one."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ARSState(TrainingState):
    """Everything that the next iteration depends on.

    Parameters
    ----------
    theta : ndarray, shape (n_actions, n_observations) or (1, n_parameters)
        Parameters of a linear policy, or of a network as `kinarm.Networks` keeps them.
    normalizer : Normalizer
        Statistics mu and Sigma of the observations.
    generator : dict
        State of the random generator.
    failed : FailedScenarios
        What may be replayed.
    curve : tuple of CurvePoint
        One point per finished iteration.

    Raises
    ------
    InvalidInputError
        If a training could not go on from it.
    """

    theta: NDArray[np.float64]
    normalizer: Normalizer
    generator: dict[str, Any]
    failed: FailedScenarios

    def __post_init__(self) -> None:
        widths = {self.normalizer.mean.shape, self.normalizer.squares.shape}
        if len(self.theta) > 1:
            widths.add(self.theta.shape[1:])
        if len(widths) > 1 or self.theta.ndim != 2:
            raise InvalidInputError(
                f"theta of shape {self.theta.shape} needs as many statistics, "
                f"got {self.normalizer.mean.shape} and {self.normalizer.squares.shape}"
            )
        self.failed.check()
        _PROBE.state = self.generator

    def random_generator(self, reused: np.random.Generator | None = None) -> np.random.Generator:
        """A generator in the state that the next iteration begins with.

        One that is given is set to it: making one takes longer than all that it draws.
        """
        rng = np.random.default_rng(0) if reused is None else reused
        rng.bit_generator.state = self.generator
        return rng

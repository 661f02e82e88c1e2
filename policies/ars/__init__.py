"""Augmented Random Search: settings, state of a training, and learner."""

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from kinarm._fields import OPTIONAL
from kinarm.errors import POSITIVE, SHARE, InvalidInputError
from kinarm.failed_scenarios import LARGEST_REPLAY, FailedScenarios
from kinarm.policies.config import MANY, WIDTHS, Schedule, TrainingConfig, scheduled
from kinarm.policies.learners import TrainingState, imported
from kinarm.policies.normalizer import Normalizer
from kinarm.policies.recipes import shipped_learner

Sharing = Literal["none", "pair", "iteration"]


@dataclass(frozen=True, kw_only=True)
class ARSConfig(TrainingConfig):
    """Settings of a training; by default ARS V2-t as in the paper's Table 1.

    Parameters
    ----------
    problem, reward, seed, recipe, iterations
        See `TrainingConfig`.
    step_size : float
        Learning rate alpha.
    step_size_schedule : {"constant", "linear"}
        Whether alpha stays or falls linearly to zero.
    noise : float
        Standard deviation nu of the perturbations.
    directions : int
        Perturbations N per iteration, each with both signs.
    top_directions : int
        Perturbations b that enter the update, the best ones; b = N is V1 or V2.
    symmetric : bool
        Whether the policy treats mirror images alike, if arm and obstacles are
        symmetric; it then learns from goals on the right and mirror images of
        others.
    net_arch : tuple of int
        Widths of hidden layers with tanh; without any, the policy is linear.
    normalize : bool
        Whether observations are normalised (V2) or not (BRS, V1).
    scale_by_deviation : bool
        Whether the step is divided by the standard deviation of the returns
        (ARS) or not (BRS).
    sharing : {"none", "pair", "iteration"}
        Which policies face the same starts and goals: none, the two signs of a
        perturbation, or all of an iteration.
    episodes : int
        Episodes whose mean return judges a perturbed policy.
    replay_share : float
        Probability of replaying a scenario that half of its policies or more
        failed; see `kinarm.failed_scenarios`.
    replay_size : int
        Failed scenarios that are kept.
    initial_policy : str, optional
        Name or file of a policy to begin with; it must see the same and have the
        same layers, and may be for another problem or arm.
    """

    iterations: int = 800
    step_size: float = field(default=0.02, metadata=POSITIVE)
    step_size_schedule: Schedule = "constant"
    noise: float = field(default=0.03, metadata=POSITIVE)
    directions: int = field(default=24, metadata=MANY)
    top_directions: int = 12
    symmetric: bool = False
    net_arch: tuple[int, ...] = field(default=(), metadata=WIDTHS)
    normalize: bool = True
    scale_by_deviation: bool = True
    sharing: Sharing = "none"
    episodes: int = field(default=1, metadata=MANY)
    replay_share: float = field(default=0.0, metadata={**SHARE, **OPTIONAL})
    replay_size: int = field(default=512, metadata={"at_most": LARGEST_REPLAY, **OPTIONAL})
    initial_policy: str | None = field(default=None, metadata=OPTIONAL)

    learner = "ars"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.top_directions > self.directions:
            raise InvalidInputError(
                f"top_directions must be at most directions ({self.directions}), "
                f"got {self.top_directions}"
            )

    def step_size_at(self, iteration: int) -> float:
        """Learning rate of an iteration."""
        return scheduled(self.step_size, self.step_size_schedule, iteration / self.iterations)


@dataclass(frozen=True, kw_only=True, eq=False)
class ARSState(TrainingState):
    """Everything that the next iteration depends on.

    Parameters
    ----------
    theta : ndarray, shape (n_actions, n_observations) or (1, n_parameters)
        Parameters of a linear policy, or of a network as in
        ``kinarm.networks.split_parameters``.
    normalizer : Normalizer
        Statistics mu and Sigma of the observations.
    generator : dict
        State of the random generator.
    failed : FailedScenarios
        What may be replayed.
    """

    theta: NDArray[np.float64]
    normalizer: Normalizer
    generator: dict[str, Any]
    failed: FailedScenarios


LEARNER = shipped_learner(
    "ars",
    ARSConfig,
    title="Augmented Random Search",
    state=ARSState,
    begin=imported("kinarm.policies.ars.algorithm", "ARSTraining"),
    policy=imported("kinarm.policies.ars.algorithm", "trained_policy"),
)

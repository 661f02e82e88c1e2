"""Settings of Augmented Random Search."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, get_args

from kinarm.errors import InvalidInputError
from kinarm.policies.learners import Schedule, scheduled
from kinarm.task import RewardWeights, load_task
from kinarm.validation import whole_number

if TYPE_CHECKING:
    from kinarm.simulator import Simulator

Sharing = Literal["none", "pair", "iteration"]


@dataclass(frozen=True, kw_only=True)
class ARSConfig:
    """Settings of a training; the defaults are the paper's Table 1, that is, ARS V2-t.

    Parameters
    ----------
    task : str
        ``"left"``, ``"right"`` or ``"both"``.
    arm : str
        A shipped arm or the path of a URDF.
    seed : int
        Seed of all randomness.
    recipe : str
        Name of these settings, for the record.
    step_size : float
        Learning rate alpha.
    step_size_schedule : {"constant", "linear"}
        Whether alpha stays or falls linearly to zero.
    noise : float
        Standard deviation nu of the perturbations.
    directions : int
        Perturbations N per iteration, each tried with both signs.
    top_directions : int
        Perturbations b that enter the update, those with the best returns; b = N is V1 or V2.
    iterations : int
        Updates of the parameters.
    horizon : int
        Steps of an episode.
    symmetric : bool
        Whether the policy is to treat mirror images alike, where the task is its own mirror
        image (``both``); see `kinarm.policies.mirror`. It halves the parameters.
    normalize : bool
        Whether observations are normalised (V2) or not (BRS, V1).
    scale_by_deviation : bool
        Whether the step is divided by the standard deviation of the returns (ARS) or not (BRS).
    sharing : {"none", "pair", "iteration"}
        Who faces the same starts and goals: nobody (every episode draws its own), the two signs
        of a perturbation, or all perturbations of an iteration.
    episodes : int
        Episodes whose mean return judges a perturbed policy.
    progress_reward : float
        Reward weight of a metre by which the tool came closer [1/m].
    closer_reward : float
        Reward weight of a step that brings the tool closer, against one that takes it farther.
    collision_penalty : float
        Reward weight of a collision.
    success_bonus : float
        Reward weight of success.
    step_reward : float
        Reward weight of a step.
    start_spread : float
        Scales the range of the start configurations.
    """

    task: str = "right"
    arm: str = "paper"
    seed: int = 0
    recipe: str = "custom"
    step_size: float = 0.02
    step_size_schedule: Schedule = "constant"
    noise: float = 0.03
    directions: int = 24
    top_directions: int = 12
    iterations: int = 800
    horizon: int = 64
    symmetric: bool = False
    normalize: bool = True
    scale_by_deviation: bool = True
    sharing: Sharing = "none"
    episodes: int = 1
    progress_reward: float = 1.0
    closer_reward: float = 0.0
    collision_penalty: float = -1.0
    success_bonus: float = 0.0
    step_reward: float = 0.0
    start_spread: float = 1.0

    def __post_init__(self) -> None:
        for name in ("directions", "top_directions", "iterations", "episodes", "horizon", "seed"):
            number = whole_number(name, getattr(self, name), 0 if name == "seed" else 1)
            object.__setattr__(self, name, number)
        for name in ("step_size", "noise"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise InvalidInputError(f"{name} must be greater than 0, got {value}")
        if self.top_directions > self.directions:
            raise InvalidInputError(
                f"top_directions must be at most directions ({self.directions}), "
                f"got {self.top_directions}"
            )
        for name, choices in (
            ("sharing", get_args(Sharing)),
            ("step_size_schedule", get_args(Schedule)),
        ):
            if getattr(self, name) not in choices:
                raise InvalidInputError(
                    f"{name} must be one of {', '.join(choices)}, got {getattr(self, name)!r}"
                )

    def simulator(self, threads: int | None = None) -> "Simulator":
        """Build the simulator to train in."""
        from kinarm.simulator import Simulator

        reward = RewardWeights(
            progress=self.progress_reward,
            closer=self.closer_reward,
            collision=self.collision_penalty,
            success=self.success_bonus,
            step=self.step_reward,
        )
        task = load_task(
            self.task, horizon=self.horizon, start_spread=self.start_spread, reward=reward
        )
        return Simulator(self.arm, task, threads=threads)

    def step_size_at(self, iteration: int) -> float:
        """Learning rate of an iteration."""
        return scheduled(self.step_size, self.step_size_schedule, iteration / self.iterations)

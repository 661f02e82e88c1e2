"""Augmented Random Search (paper, Algorithm 1 and Table 1; Mania, Guy and Recht 2018)."""

import math
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from kinarm.arm import DEFAULT_ARM, Arm
from kinarm.errors import InvalidInputError
from kinarm.networks import Networks
from kinarm.policies.mirror import Mirror, is_symmetric
from kinarm.policies.normalizer import Normalizer, input_scale
from kinarm.policies.policy import Layer, Policy
from kinarm.policies.provenance import Provenance, package_versions, source_commit
from kinarm.simulator import Simulator
from kinarm.task import RewardWeights, load_task
from kinarm.validation import whole_number

Sharing = Literal["none", "pair", "iteration"]
Schedule = Literal["constant", "linear"]


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
    arm: str = DEFAULT_ARM
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

    def simulator(self, threads: int | None = None) -> Simulator:
        """Build the simulator to train in."""
        reward = RewardWeights(
            collision=self.collision_penalty, success=self.success_bonus, step=self.step_reward
        )
        task = load_task(
            self.task, horizon=self.horizon, start_spread=self.start_spread, reward=reward
        )
        return Simulator(Arm.load(self.arm), task, threads=threads)

    def step_size_at(self, iteration: int) -> float:
        """Learning rate of an iteration."""
        if self.step_size_schedule == "constant":
            return self.step_size
        return self.step_size * (1 - iteration / self.iterations)


class CurvePoint(NamedTuple):
    """What one iteration of the training looked like.

    Attributes
    ----------
    mean_return, std_return : float
        Mean and standard deviation of the returns of the iteration's episodes.
    success : float
        Share of its episodes that reached the goal.
    environment_steps : int
        Steps taken since the training began.
    wall_time : float
        Time spent since the training began [s].
    """

    mean_return: float
    std_return: float
    success: float
    environment_steps: int
    wall_time: float


@dataclass(frozen=True, kw_only=True, eq=False)
class ARSState:
    """Everything that the next iteration depends on.

    Attributes
    ----------
    theta : ndarray, shape (n_actions, n_observations)
        Parameters of the policy.
    normalizer : Normalizer
        Statistics mu and Sigma of the observations.
    generator : dict
        State of the random generator.
    curve : tuple of CurvePoint
        One point per finished iteration.
    """

    theta: NDArray[np.float64]
    normalizer: Normalizer
    generator: dict[str, Any]
    curve: tuple[CurvePoint, ...] = field(default=())

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


class ARSResult(NamedTuple):
    """A trained policy and how it came about.

    Attributes
    ----------
    policy : Policy
        The trained policy.
    curve : tuple of CurvePoint
        One point per iteration.
    """

    policy: Policy
    curve: tuple[CurvePoint, ...]


def train_ars(
    config: ARSConfig,
    *,
    state: ARSState | None = None,
    on_iteration: Callable[[ARSState], object] | None = None,
    threads: int | None = None,
) -> ARSResult:
    """Train a linear policy.

    Parameters
    ----------
    config : ARSConfig
        The settings.
    state : ARSState, optional
        Where to go on; the result equals that of an uninterrupted training bit for bit.
    on_iteration : callable, optional
        Called with the state after every iteration.
    threads : int, optional
        Threads of the simulator; the result does not depend on it.
    """
    simulator = config.simulator(threads)
    state = state or initial_state(config, simulator)
    shape = (simulator.n_actions, simulator.n_observations)
    if state.theta.shape != shape:
        raise InvalidInputError(f"the state to resume has shape {state.theta.shape}, not {shape}")
    mirror = task_mirror(config, simulator)
    began = time.perf_counter() - state.wall_time
    while state.iteration < config.iterations:
        state = ars_iteration(config, simulator, state, began, mirror)
        if on_iteration is not None:
            on_iteration(state)
    return ARSResult(state_policy(config, simulator.arm, state, mirror), state.curve)


def initial_state(config: ARSConfig, simulator: Simulator) -> ARSState:
    """State before the first iteration: theta = 0, mu = 0, Sigma = I."""
    return ARSState(
        theta=np.zeros((simulator.n_actions, simulator.n_observations)),
        normalizer=Normalizer.empty(simulator.n_observations),
        generator=dict(np.random.default_rng(config.seed).bit_generator.state),
    )


def ars_iteration(
    config: ARSConfig,
    simulator: Simulator,
    state: ARSState,
    began: float,
    mirror: Mirror | None = None,
) -> ARSState:
    """One pass through the loop of Algorithm 1.

    Parameters
    ----------
    config : ARSConfig
        The settings.
    simulator : Simulator
        Where episodes are run.
    state : ARSState
        State before the iteration.
    began : float
        Reading of ``time.perf_counter`` when the training began [s].
    mirror : Mirror, optional
        Reflection that the policy has to commute with.

    Returns
    -------
    ARSState
        State after it. The statistics are frozen within an iteration: they are updated at its
        end with all observations of its episodes.
    """
    rng = np.random.default_rng()
    rng.bit_generator.state = state.generator
    N, theta, normalizer = config.directions, state.theta, state.normalizer
    delta = rng.standard_normal((N, *theta.shape))
    if mirror is not None:
        delta *= mirror.weights
    candidates = np.concatenate([theta + config.noise * delta, theta - config.noise * delta])
    starts, goals = draw_scenarios(config, simulator, rng)
    rollouts = simulator.rollout(
        linear_networks(candidates, policy_normalizer(config, normalizer, mirror)),
        starts,
        goals,
        policy_index=np.repeat(np.arange(2 * N), config.episodes),
        shift=normalizer.mean,
    )
    returns = rollouts.returns.reshape(2, N, config.episodes).mean(axis=2)
    theta = theta + ars_step(config, delta, returns, config.step_size_at(state.iteration))
    point = CurvePoint(
        mean_return=float(rollouts.returns.mean()),
        std_return=float(rollouts.returns.std()),
        success=float(rollouts.success.mean()),
        environment_steps=state.environment_steps + int(rollouts.steps.sum()),
        wall_time=time.perf_counter() - began,
    )
    return ARSState(
        theta=theta,
        normalizer=normalizer.updated(rollouts.moments, rollouts.steps),
        generator=dict(rng.bit_generator.state),
        curve=(*state.curve, point),
    )


def draw_scenarios(
    config: ARSConfig, simulator: Simulator, rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Draw the starts and goals of an iteration's episodes, shared as configured.

    Returns
    -------
    starts, goals : ndarray, shape (2 N episodes, n_axes) and (2 N episodes, 3)
        In the order sign, direction, episode.
    """
    copies = {"none": 1, "pair": 2, "iteration": 2 * config.directions}[config.sharing]
    starts, goals = simulator.sample(rng, 2 * config.directions * config.episodes // copies)
    return np.tile(starts, (copies, 1)), np.tile(goals, (copies, 1))


def task_mirror(config: ARSConfig, simulator: Simulator) -> Mirror | None:
    """Reflection that the policy has to commute with, if any."""
    symmetric = config.symmetric and is_symmetric(simulator.scene, simulator.task.benches)
    return Mirror.of(simulator) if symmetric else None


def policy_normalizer(
    config: ARSConfig, seen: Normalizer, mirror: Mirror | None
) -> Normalizer | None:
    """Statistics by which the policy normalises its inputs, if it does."""
    if not config.normalize:
        return None
    return seen if mirror is None else seen.mirrored(mirror.observations)


def linear_networks(theta: NDArray[np.float64], normalizer: Normalizer | None) -> Networks:
    """Policies theta diag(Sigma)^(-1/2) (x - mu) with the normaliser folded in.

    Parameters
    ----------
    theta : ndarray, shape (n, n_actions, n_observations)
        Parameters.
    normalizer : Normalizer or None
        Statistics of the observations; None leaves them as they are.
    """
    if normalizer is None:
        return Networks.linear(theta, np.zeros(theta.shape[:2]))
    weights = theta * input_scale(normalizer.std)
    return Networks.linear(weights, -weights @ normalizer.mean)


def top_directions(returns: NDArray[np.float64], b: int) -> NDArray[np.int64]:
    """Indices of exactly b directions with the largest max(r+, r-); ties keep their order.

    Parameters
    ----------
    returns : ndarray, shape (2, N)
        Returns of the positive and negative perturbations.
    b : int
        How many.
    """
    return np.argsort(-returns.max(axis=0), kind="stable")[:b]


def ars_step(
    config: ARSConfig,
    delta: NDArray[np.float64],
    returns: NDArray[np.float64],
    step_size: float,
) -> NDArray[np.float64]:
    """Update of theta: alpha / (b sigma_R) times the sum of (r+ - r-) delta over the top b.

    sigma_R is the population standard deviation of the returns of all perturbations, as the
    paper defines it in section 2.1; the step is zero when all returns tie.

    Parameters
    ----------
    config : ARSConfig
        The settings.
    delta : ndarray, shape (N, n_actions, n_observations)
        Perturbations.
    returns : ndarray, shape (2, N)
        Returns of theta + nu delta and theta - nu delta.
    step_size : float
        Learning rate alpha.
    """
    b = config.top_directions
    top = top_directions(returns, b)
    sigma = float(returns.std()) if config.scale_by_deviation else 1.0
    if sigma < 1e-12:
        return np.zeros(delta.shape[1:])
    step: NDArray[np.float64] = np.tensordot(returns[0, top] - returns[1, top], delta[top], axes=1)
    return step_size / (b * sigma) * step


def state_policy(
    config: ARSConfig, arm: Arm, state: ARSState, mirror: Mirror | None = None
) -> Policy:
    """Freeze a state of the training into a policy."""
    n_actions, n_observations = state.theta.shape
    normalizer = policy_normalizer(config, state.normalizer, mirror)
    normalizer = normalizer or Normalizer.empty(n_observations)
    return Policy(
        mean=normalizer.mean,
        std=normalizer.std,
        layers=(Layer(state.theta, np.zeros(n_actions)),),
        provenance=Provenance(
            algorithm="ars",
            recipe=config.recipe,
            task=config.task,
            arm=arm.name,
            arm_digest=arm.digest,
            seed=config.seed,
            environment_steps=state.environment_steps,
            config=asdict(config),
            versions=package_versions(),
            commit=source_commit(),
        ),
    )

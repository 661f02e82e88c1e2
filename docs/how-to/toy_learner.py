"""A learner in one file: random search that keeps the best linear policy of all that it tried."""

import time
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from kinarm.errors import POSITIVE
from kinarm.policies import (
    CurvePoint,
    Layer,
    Learner,
    Normalizer,
    Policy,
    Provenance,
    TrainingConfig,
    TrainingState,
)


@dataclass(frozen=True, kw_only=True)
class ToyConfig(TrainingConfig):
    """Settings of a random search.

    Parameters
    ----------
    iterations : int
        Policies that are tried.
    noise : float
        Standard deviation by which the next one differs from the best so far.
    episodes : int
        Episodes whose mean return judges a policy.
    """

    iterations: int = 50
    noise: float = field(default=0.1, metadata=POSITIVE)
    episodes: int = 20


@dataclass(frozen=True, kw_only=True, eq=False)
class ToyState(TrainingState):
    """The best policy so far: its matrix, shape (n_actions, n_observations), and its score."""

    theta: NDArray[np.float64]
    score: float


class ToyTraining:
    """The simulator, and the episodes that every policy faces."""

    def __init__(self, config: ToyConfig, threads: int | None = None) -> None:
        self.config, self.simulator = config, config.simulator(threads)
        rng = np.random.default_rng(config.seed)
        self.starts, self.goals = self.simulator.sample(rng, config.episodes)

    def initial_state(self) -> ToyState:
        shape = (self.simulator.n_actions, self.simulator.n_observations)
        return ToyState(theta=np.zeros(shape), score=-np.inf)

    def iterate(self, state: ToyState) -> ToyState:
        began = time.perf_counter()
        rng = np.random.default_rng([self.config.seed, state.iteration])
        theta = state.theta + self.config.noise * rng.normal(size=state.theta.shape)
        tried = ToyState(theta=theta, score=0.0)
        rollouts = self.simulator.rollout(policy(self.config, tried), self.starts, self.goals)
        score = float(rollouts.returns.mean())
        point = CurvePoint(
            mean_return=score,
            std_return=float(rollouts.returns.std()),
            success=float(rollouts.success.mean()),
            environment_steps=state.environment_steps + int(rollouts.steps.sum()),
            wall_time=state.wall_time + time.perf_counter() - began,
        )
        if score <= state.score:
            theta, score = state.theta, state.score
        return ToyState(theta=theta, score=score, curve=(*state.curve, point))


def policy(config: ToyConfig, state: ToyState) -> Policy:
    """Freeze a state into a policy."""
    raw = Normalizer.empty(state.theta.shape[1])  # observations as they are
    return Policy(
        mean=raw.mean,
        std=raw.std,
        layers=(Layer(state.theta, np.zeros(len(state.theta))),),
        provenance=Provenance.of("toy", config, state.environment_steps),
    )


LEARNER = Learner(
    name="toy",
    title="random search",
    config=ToyConfig,
    state=ToyState,
    recipes={"paper": ToyConfig(recipe="paper"), "wide": ToyConfig(recipe="wide", noise=0.5)},
    begin=ToyTraining,
    policy=policy,
)

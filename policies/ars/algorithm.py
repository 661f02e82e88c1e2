"""Augmented Random Search (paper, Algorithm 1 and Table 1; Mania, Guy and Recht 2018)."""

import math
import time
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.episodes import Rollouts
from kinarm.errors import InvalidInputError
from kinarm.failed_scenarios import FailedScenarios, StartsAndGoals
from kinarm.kernels.compiling import Array
from kinarm.networks import Layer, Networks, split_parameters
from kinarm.policies.ars import ARSConfig, ARSState
from kinarm.policies.ars.networks import (
    initial_network,
    parameters_of,
    perturbations,
    perturbed_networks,
)
from kinarm.policies.learners import CurvePoint
from kinarm.policies.library import layer_widths, starting_policy, statistics
from kinarm.policies.mirror import problem_mirror
from kinarm.policies.normalizer import Normalizer, input_scale
from kinarm.policies.policy import Policy
from kinarm.policies.provenance import Provenance
from kinarm.randomness import Stream, stream_generator


class ARSTraining:
    """A training under way; all that changes is in the `ARSState`.

    The result does not depend on the number of threads.
    """

    def __init__(self, config: ARSConfig, threads: int | None = None) -> None:
        self.config, self.simulator = config, config.simulator(threads)
        self.mirror = problem_mirror(config.problem) if config.symmetric else None
        self._widths = layer_widths(config.problem, config.net_arch)
        self._rng = stream_generator(Stream.ARS, config.seed)

    def initial_state(self) -> ARSState:
        """First state: mu = 0, Sigma = I, and theta = 0 if it is linear."""
        n_observations, *_, n_actions = self._widths
        rng = stream_generator(Stream.ARS, self.config.seed)
        normalizer = Normalizer.empty(n_observations)
        if self.config.initial_policy is not None:
            policy = starting_policy(self.config)
            theta = parameters_of(policy)
            if self.config.normalize:
                normalizer = statistics(policy)
            elif policy.mean.any() or (policy.std != 1).any():
                raise InvalidInputError(
                    "initial_policy normalises observations: without normalize it is another one"
                )
        elif self.config.net_arch:
            theta = initial_network(rng, self.simulator.world.layout, self._widths[1:])
        else:
            theta = np.zeros((n_actions, n_observations))
        return ARSState(
            theta=theta,
            normalizer=normalizer,
            generator=dict(rng.bit_generator.state),
            failed=FailedScenarios.none(
                self.simulator.arm.n_joints, self.simulator.world.goal_width
            ),
        )

    def iterate(self, state: ARSState) -> ARSState:
        """One pass through the loop of Algorithm 1.

        Statistics are frozen within it, and updated at its end with all observations.
        """
        began, config, simulator = time.perf_counter(), self.config, self.simulator
        rng, N = self._rng, config.directions
        theta, normalizer = state.theta, state.normalizer
        rng.bit_generator.state = state.generator
        delta = perturbations(rng, (N, *theta.shape))
        scenarios = self.draw_shared(rng, state.failed)
        seen = policy_normalizer(config, normalizer)
        if config.net_arch:
            policies = perturbed_networks(theta, config.noise * delta, seen, self._widths)
        else:
            policies = perturbed_policies(theta, config.noise * delta, seen)
        if simulator.task.goal.changes:  # to the left, too
            policies = replace(policies, mirror=self.mirror)
        rollouts = simulator.rollout(
            policies,
            *scenarios.of_all_episodes,
            policy_index=np.repeat(np.arange(2 * N), config.episodes),
            shift=normalizer.mean,
        )
        returns = rollouts.returns.reshape(2, N, config.episodes).mean(axis=2)
        theta = theta + ars_step(config, delta, returns, config.step_size_at(state.iteration))
        normalizer = normalizer.updated(rollouts.moments, rollouts.steps)
        failed = state.failed
        if config.replay_share:
            failed = failed.followed_by(*scenarios.missed(rollouts), config.replay_size)
        steps = state.environment_steps + int(rollouts.steps.sum())
        seconds = state.wall_time + time.perf_counter() - began
        point = CurvePoint(*scenarios.outcome_of_new(rollouts), steps, seconds)
        return ARSState(
            theta=theta,
            normalizer=normalizer,
            generator=dict(rng.bit_generator.state),
            failed=failed,
            curve=state.curve_with(point),
        )

    def draw_shared(self, rng: np.random.Generator, failed: FailedScenarios) -> "Scenarios":
        """Draw the scenarios of an iteration, shared, reflected and replayed as configured."""
        config, mirror = self.config, self.mirror
        copies = {"none": 1, "pair": 2, "iteration": 2 * config.directions}[config.sharing]

        def draw(count: int) -> StartsAndGoals:
            drawn = self.simulator.sample(rng, count)
            return drawn if mirror is None else mirror.scenarios_from_the_right(*drawn)

        count = 2 * config.directions * config.episodes // copies
        (starts, goals), replayed = failed.mixed(config.replay_share, rng, count, draw)
        return Scenarios(starts, goals, replayed, copies)


class Scenarios(NamedTuple):
    """Starts (n, n_joints), goals (n, goal_width), which are replayed, and copies of each.

    Repeated, they are those of the episodes in the order sign, direction, episode.
    """

    starts: Array
    goals: Array
    replayed: NDArray[np.bool_]
    copies: int

    @property
    def of_all_episodes(self) -> StartsAndGoals:
        """Starts and goals of all episodes."""
        return np.tile(self.starts, (self.copies, 1)), np.tile(self.goals, (self.copies, 1))

    def outcome_of_new(self, rollouts: Rollouts) -> tuple[float, float, float]:
        """Mean and deviation of returns in new scenarios, and success; or NaN."""
        new = np.tile(~self.replayed, self.copies)
        if not new.any():
            return math.nan, math.nan, math.nan
        returns, success = rollouts.returns[new], rollouts.success[new]
        return *mean_and_deviation(returns), int(np.count_nonzero(success)) / len(success)

    def missed(self, rollouts: Rollouts) -> StartsAndGoals:
        """Those that at least half of their policies failed."""
        reached = np.count_nonzero(rollouts.success.reshape(self.copies, -1), axis=0)
        missed = 2 * reached <= self.copies
        return self.starts[missed], self.goals[missed]


def policy_normalizer(config: ARSConfig, seen: Normalizer) -> Normalizer:
    """Statistics that normalise the policy's inputs; empty if none do."""
    return seen if config.normalize else Normalizer.empty(len(seen.mean))


def perturbed_policies(theta: Array, step: Array, normalizer: Normalizer) -> Networks:
    """Policies (theta + step) diag(Sigma)^(-1/2) (x - mu), then those of theta - step.

    Parameters
    ----------
    theta, step : ndarray, shape (n_actions, n_observations) and (N, n_actions, n_observations)
        Parameters, and what is added to them, and subtracted.
    normalizer : Normalizer
        Statistics mu and Sigma, folded in.
    """
    maps = np.concatenate([theta + step, theta - step]) * input_scale(normalizer.std)
    by_input = np.ascontiguousarray(maps.transpose(2, 0, 1))
    shifts = (by_input * normalizer.mean[:, None, None]).sum(axis=0)
    return Networks((Layer(maps, 0.0 - shifts),))


def mean_and_deviation(values: Array) -> tuple[float, float]:
    """Mean and population standard deviation of numbers, shape (n,), in order."""
    mean = float(np.cumsum(values)[-1]) / len(values)
    return mean, math.sqrt(np.cumsum((values - mean) ** 2)[-1] / len(values))


def top_directions(returns: Array, b: int) -> NDArray[np.int64]:
    """Indices of the b directions with the largest max(r+, r-); ties keep order.

    Returns r+ and r- have the shape (2, N).
    """
    return np.argsort(-returns.max(axis=0), kind="stable")[:b]


def ars_step(config: ARSConfig, delta: Array, returns: Array, step_size: float) -> Array:
    """Update of theta: alpha / (b sigma_R) times the sum of (r+ - r-) delta over the top b.

    sigma_R is the population standard deviation of all returns (paper, section
    2.1); the step is zero when all returns tie.

    Parameters
    ----------
    config, step_size
        The settings, and the learning rate alpha.
    delta, returns : ndarray, shape (N, n_actions, n_observations) and (2, N)
        Perturbations, and mean returns r+ and r-.
    """
    b = config.top_directions
    top = top_directions(returns, b)
    sigma = mean_and_deviation(returns.reshape(-1))[1] if config.scale_by_deviation else 1.0
    if sigma < 1e-12:
        return np.zeros(delta.shape[1:])
    weights = step_size / (b * sigma) * (returns[0, top] - returns[1, top])
    step: Array = (weights[:, None, None] * delta[top]).sum(axis=0)
    return step


def trained_policy(config: ARSConfig, state: ARSState) -> Policy:
    """Freeze a state of the training into a policy."""
    normalizer = policy_normalizer(config, state.normalizer)
    layers: tuple[Layer, ...] = (Layer(state.theta, np.zeros(len(state.theta))),)
    if config.net_arch:
        batches = split_parameters(state.theta, layer_widths(config.problem, config.net_arch))
        layers = tuple(Layer(weights[0], bias[0]) for weights, bias in batches)
    return Policy(
        mean=normalizer.mean,
        std=normalizer.std,
        layers=layers,
        provenance=Provenance.of("ars", config, state.environment_steps),
        mirror=problem_mirror(config.problem) if config.symmetric else None,
    )

"""Augmented Random Search (paper, Algorithm 1 and Table 1; Mania, Guy and Recht 2018)."""

import time

import numpy as np
from numpy.typing import NDArray

from kinarm.failed_scenarios import FailedScenarios
from kinarm.networks import Mirror, Networks
from kinarm.policies.ars.config import ARSConfig
from kinarm.policies.ars.kernels import (
    mean_and_deviation,
    perturbed_weights,
    weighted_sum,
)
from kinarm.policies.ars.networks import (
    first_deviations,
    initial_network,
    network_layers,
    parameters_of,
    perturbations,
    perturbed_networks,
)
from kinarm.policies.ars.scenarios import draw_shared, failed_after
from kinarm.policies.ars.state import ARSState
from kinarm.policies.learners import CurvePoint
from kinarm.policies.mirror import problem_mirror
from kinarm.policies.normalizer import Normalizer, input_scale
from kinarm.policies.policy import Layer, Policy
from kinarm.policies.provenance import Provenance
from kinarm.policies.warm_start import starting_policy, statistics
from kinarm.randomness import Stream, stream_generator
from kinarm.simulator import Simulator


class ARSTraining:
    """A training under way; all that changes is in the `ARSState`.

    The result does not depend on the simulator's number of threads.
    """

    def __init__(self, config: ARSConfig, threads: int | None = None) -> None:
        self.config, self.simulator = config, config.simulator(threads)
        self.mirror = problem_mirror(config.problem) if config.symmetric else None
        self._rng = stream_generator(Stream.ARS, config.seed)

    def initial_state(self) -> ARSState:
        """State before the first iteration: mu = 0, Sigma = I, and theta = 0 if it is linear.

        Or those of the policy to begin with.
        """
        n_actions, n_observations = self.simulator.n_actions, self.simulator.n_observations
        rng = stream_generator(Stream.ARS, self.config.seed)
        normalizer = Normalizer.empty(n_observations)
        widths = (n_observations, *self.config.net_arch, n_actions)
        if self.config.initial_policy is not None:
            policy = starting_policy(self.config.initial_policy, widths)
            theta = parameters_of(policy)
            if self.config.normalize:
                normalizer = statistics(policy)
        elif self.config.net_arch:
            deviations = first_deviations(self.simulator.arm.n_joints)
            theta = initial_network(rng, deviations, widths[1:])
        else:
            theta = np.zeros((n_actions, n_observations))
        return ARSState(
            theta=theta,
            normalizer=normalizer,
            generator=dict(rng.bit_generator.state),
            failed=FailedScenarios.none(self.simulator.arm.n_joints),
        )

    def iterate(self, state: ARSState) -> ARSState:
        """One pass through the loop of Algorithm 1."""
        return ars_iteration(self.config, self.simulator, state, self.mirror, self._rng)


def ars_iteration(
    config: ARSConfig,
    simulator: Simulator,
    state: ARSState,
    mirror: Mirror | None = None,
    rng: np.random.Generator | None = None,
) -> ARSState:
    """One pass through the loop of Algorithm 1.

    With a mirror, scenarios with goals to the left are met reflected. The statistics are frozen
    within an iteration: they are updated at its end with all observations of its episodes. A
    generator can be lent.

    Parameters
    ----------
    config : ARSConfig
        The settings.
    simulator : Simulator
        Where policies are tried.
    state : ARSState
        State before the iteration; it is left as it is.
    mirror : Mirror, optional
        Reflects scenarios with goals to the left.
    rng : numpy.random.Generator, optional
        A generator to be reused; the state says in which state it begins.
    """
    began, rng = time.perf_counter(), state.random_generator(rng)
    N, theta, normalizer = config.directions, state.theta, state.normalizer
    delta = perturbations(rng, (N, *theta.shape))
    scenarios = draw_shared(config, simulator, rng, state.failed, mirror)
    seen = policy_normalizer(config, normalizer)
    if config.net_arch:
        widths = (simulator.n_observations, *config.net_arch, simulator.n_actions)
        policies = perturbed_networks(theta, config.noise * delta, seen, widths)
    else:
        policies = perturbed_policies(theta, config.noise * delta, seen)
    rollouts = simulator.rollout(
        policies,
        *scenarios.of_all_episodes,
        policy_index=np.repeat(np.arange(2 * N), config.episodes),
        shift=normalizer.mean,
    )
    returns = rollouts.returns.reshape(2, N, config.episodes).mean(axis=2)
    theta = theta + ars_step(config, delta, returns, config.step_size_at(state.iteration))
    normalizer = normalizer.updated(rollouts.moments, rollouts.steps)
    mean_return, std_return, success = scenarios.outcome_of_new(rollouts)
    point = CurvePoint(
        mean_return=mean_return,
        std_return=std_return,
        success=success,
        environment_steps=state.environment_steps + int(rollouts.steps.sum()),
        wall_time=state.wall_time + time.perf_counter() - began,
    )
    return ARSState(
        theta=theta,
        normalizer=normalizer,
        generator=dict(rng.bit_generator.state),
        failed=failed_after(config, state.failed, scenarios, rollouts),
        curve=(*state.curve, point),
    )


def policy_normalizer(config: ARSConfig, seen: Normalizer) -> Normalizer:
    """Statistics that normalise the inputs of the policy; empty if it does not normalise."""
    return seen if config.normalize else Normalizer.empty(len(seen.mean))


def perturbed_policies(
    theta: NDArray[np.float64], step: NDArray[np.float64], normalizer: Normalizer
) -> Networks:
    """Policies (theta + step) diag(Sigma)^(-1/2) (x - mu), then those of theta - step.

    Steps have the shape (N, n_actions, n_observations). The normaliser is folded in.

    Parameters
    ----------
    theta : ndarray, shape (n_actions, n_observations)
        Parameters.
    step : ndarray, shape (N, n_actions, n_observations)
        What is added to them, and subtracted.
    normalizer : Normalizer
        Statistics mu and Sigma, which are folded in.
    """
    n_actions, n_observations = theta.shape
    weights = np.empty((2, len(step), (n_observations + 1) * n_actions))
    perturbed_weights(theta, step, input_scale(normalizer.std), normalizer.mean, weights)
    return Networks(np.array([n_observations, n_actions]), weights.reshape(2 * len(step), -1))


def top_directions(returns: NDArray[np.float64], b: int) -> NDArray[np.int64]:
    """Indices of exactly b directions with the largest max(r+, r-); ties keep their order.

    Returns of the positive and of the negative perturbations have the shape (2, N).
    """
    return np.argsort(-returns.max(axis=0), kind="stable")[:b]


def ars_step(
    config: ARSConfig,
    delta: NDArray[np.float64],
    returns: NDArray[np.float64],
    step_size: float,
) -> NDArray[np.float64]:
    """Update of theta: alpha / (b sigma_R) times the sum of (r+ - r-) delta over the top b.

    sigma_R is the population standard deviation of the returns of all perturbations, shape (2, N),
    as the paper defines it in section 2.1; the step is zero when all returns tie. Perturbations
    delta have the shape (N, n_actions, n_observations).

    Parameters
    ----------
    config : ARSConfig
        The settings.
    delta : ndarray, shape (N, n_actions, n_observations)
        Perturbations.
    returns : ndarray, shape (2, N)
        Mean returns r+ and r- of the perturbed policies.
    step_size : float
        Learning rate alpha.
    """
    b = config.top_directions
    top = top_directions(returns, b)
    sigma = mean_and_deviation(returns.reshape(-1))[1] if config.scale_by_deviation else 1.0
    step = np.zeros(delta.shape[1:])
    if sigma >= 1e-12:
        difference = returns[0, top] - returns[1, top]
        weighted_sum(step_size / (b * sigma) * difference, top, delta, step)
    return step


def trained_policy(config: ARSConfig, state: ARSState) -> Policy:
    """Freeze a state of the training into a policy."""
    normalizer = policy_normalizer(config, state.normalizer)
    layers: tuple[Layer, ...] = (Layer(state.theta, np.zeros(len(state.theta))),)
    if config.net_arch:
        layers = network_layers(state.theta, (len(normalizer.mean), *config.net_arch))
    return Policy(
        mean=normalizer.mean,
        std=normalizer.std,
        layers=layers,
        provenance=Provenance.of("ars", config, state.environment_steps),
        mirror=problem_mirror(config.problem) if config.symmetric else None,
    )

"""Proximal Policy Optimization, one iteration at a time (Schulman et al. 2017)."""

import itertools
import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kinarm._parallel import BALANCED_STEPS, available_threads, run_rows
from kinarm.errors import InvalidInputError, whole_number
from kinarm.failed_scenarios import FailedScenarios
from kinarm.policies.config import scheduled
from kinarm.policies.learners import CurvePoint
from kinarm.policies.library import layer_widths, starting_policy, statistics
from kinarm.policies.normalizer import Normalizer
from kinarm.policies.ppo import EpisodeStates, PPOConfig, PPOState
from kinarm.policies.ppo.arms import TrainingArms
from kinarm.policies.ppo.kernels.layers import Numbers
from kinarm.policies.ppo.kernels.update import (
    Experience,
    Objective,
    add_gradients,
    choose,
    descend,
    standardisation,
)
from kinarm.policies.ppo.networks import ActorCritic, initial_parameters, split_parameters
from kinarm.randomness import Stream, stream_generator

NORMALIZED_OVER = 10_000
"""Random starts whose observations the normaliser describes."""

RANDOM_STEPS = 8
"""Random steps before observations that tell of earlier ones, at any time if they tell it."""

PARTS = 8
"""Parts of a minibatch whose gradients are found independently."""


class PPOTraining:
    """A training under way; all that changes is in the `PPOState`.

    Updates take as many threads as there are processors by default; the result does not depend on
    them.
    """

    def __init__(self, config: PPOConfig, threads: int | None = None) -> None:
        self.config, self.arms = config, TrainingArms(config)
        wanted = available_threads() if threads is None else threads
        self.threads = whole_number("threads", wanted, 1)
        self._widths = layer_widths(config.problem, config.net_arch)
        self.networks = ActorCritic(self._widths)

    def initial_state(self) -> PPOState:
        """State before the first iteration; the normaliser has seen random starts."""
        config, arms = self.config, self.arms
        rng, arms.scenarios = stream_generator(Stream.PPO_LEARNER, config.seed, 0), 0
        seen = self._seen(rng)
        starts, goals = arms.next_scenarios(config.n_envs)
        parameters = initial_parameters(rng, self._widths, config.log_std_init)
        normalizer = Normalizer.of(seen)
        if config.initial_policy is not None:
            policy = starting_policy(config)
            normalizer = statistics(policy)
            actor = split_parameters(parameters, self._widths).actor
            for layer, (weights, bias) in zip(policy.layers, actor, strict=True):
                weights[:], bias[:] = layer
        return PPOState(
            parameters=parameters,
            first_moment=np.zeros_like(parameters),
            second_moment=np.zeros_like(parameters),
            normalizer=normalizer,
            episodes=EpisodeStates.begun(starts, goals),
            failed=FailedScenarios.none(starts.shape[1], goals.shape[1]),
            scenarios=arms.scenarios,
        )

    def _seen(self, rng: np.random.Generator) -> NDArray[np.float64]:
        """Observations of random starts; if they tell of earlier steps, after some at random.

        If a joint always starts alike, starts are those of its whole range: inputs that never
        change count for nothing.
        """
        simulator, scenarios = self.arms.simulator, self.arms.sample(rng, NORMALIZED_OVER)
        if not np.ptp(scenarios[0][:, : simulator.n_actions], axis=0).all():
            whole = self.config.problem.replace(starts=(), start_spread=1.0)
            elsewhere = TrainingArms(replace(self.config, problem=whole))
            scenarios = elsewhere.sample(rng, NORMALIZED_OVER)
        if not simulator.world.layout.remembers:
            return simulator.world.observe(*scenarios)
        latest = simulator.task.horizon - RANDOM_STEPS
        timed = latest > 0 and "time_left" in simulator.world.layout.places
        taken = rng.integers(latest, size=NORMALIZED_OVER) if timed else 0
        episodes = simulator.reset(*scenarios, taken=taken)
        for _ in range(RANDOM_STEPS):
            simulator.step(episodes, rng.uniform(-1, 1, (NORMALIZED_OVER, simulator.n_actions)))
        return episodes.observation

    def iterate(self, state: PPOState) -> PPOState:
        """One rollout and one update."""
        began = time.perf_counter()
        config, networks, arms = self.config, self.networks, self.arms
        sizes = (len(state.parameters), len(state.episodes.goal))
        if sizes != (expected := (networks.n_parameters, config.n_envs)):
            raise InvalidInputError(
                f"the state to resume has {sizes[0]} parameters and {sizes[1]} arms, "
                f"not {expected[0]} and {expected[1]}"
            )
        rng = stream_generator(Stream.PPO_LEARNER, config.seed, state.iteration + 1)
        networks.load(state.parameters)
        log_std = config.log_std_at(state.iteration / config.iterations)
        if log_std is not None:
            networks.log_std[:] = log_std
        arms.restore(state, rng)
        vectors = self.update(state, self.collect(rng), rng)
        if not all(np.isfinite(vector).all() for vector in vectors):
            raise InvalidInputError(
                f"iteration {state.iteration + 1} diverged: the parameters are no longer finite; "
                f"learning_rate is {config.learning_rate:g}, a smaller one may help"
            )
        returns = np.concatenate([*arms.returns, []])
        point = CurvePoint(
            mean_return=float(returns.mean()) if len(returns) else float("nan"),
            std_return=float(returns.std()) if len(returns) else float("nan"),
            success=float(np.concatenate(arms.successes).mean()) if len(returns) else float("nan"),
            environment_steps=state.environment_steps + config.steps_per_iteration,
            wall_time=state.wall_time + time.perf_counter() - began,
        )
        return PPOState(
            parameters=vectors[0],
            first_moment=vectors[1],
            second_moment=vectors[2],
            normalizer=state.normalizer,
            episodes=arms.states(),
            failed=arms.failed,
            scenarios=arms.scenarios,
            curve=state.curve_with(point),
        )

    def collect(self, rng: np.random.Generator) -> Experience:
        """Step the arms, with noise from a generator, then judge all steps at once.

        An episode that the time limit cut short would go on: its last reward gets
        the value of its last observation.
        """
        config, networks, arms = self.config, self.networks, self.arms
        log_std = networks.log_std
        least = -np.inf if config.replay_log_std is None else config.replay_log_std
        shape = (config.n_steps, config.n_envs)
        observations = np.empty((*shape, arms.simulator.n_observations), dtype=np.float32)
        actions = np.empty((*shape, len(log_std)), dtype=np.float32)
        scales, densities, rewards, going_on = (np.ones(shape, dtype=np.float32) for _ in range(4))
        for step in range(config.n_steps):
            observations[step] = seen = arms.observe()
            rates, extent = arms.rates(arms.episodes.observation)
            noise = rng.standard_normal(actions[step].shape).astype(np.float32)
            outcome = actions[step], scales[step], densities[step]
            choose(networks.means(seen), log_std, noise, arms.replayed, least, *outcome)
            rewards[step], ended = arms.step(np.clip(rates + extent * actions[step], -1.0, 1.0))
            going_on[step] = ~ended
        steps = np.repeat(np.arange(config.n_steps), [len(rows) for rows in arms.cut_short])
        flat = observations.reshape(-1, observations.shape[-1])
        judged = np.concatenate([flat, arms.observe(), *arms.finals])
        values = networks.values(judged, self.threads)
        end = len(flat) + config.n_envs
        rewards[steps, np.concatenate(arms.cut_short)] += np.float32(config.gamma) * values[end:]
        values = values[:end].reshape(-1, config.n_envs)
        advantages = estimate_advantages(rewards, values, going_on, config.gamma, config.gae_lambda)
        parts = (observations, actions, scales, densities, advantages, advantages + values[:-1])
        # Arm after arm, as in Stable-Baselines3.
        return Experience(*(part.swapaxes(0, 1).reshape(-1, *part.shape[2:]) for part in parts))

    def update(
        self, state: PPOState, experience: Experience, rng: np.random.Generator
    ) -> list[Numbers]:
        """Change the networks; return their parameters, and Adam's two moments.

        Gradients of parts are added up in a fixed order, so that the result does
        not depend on threads.

        Parameters
        ----------
        state, experience, rng
            What was before, what is learnt from, and what draws minibatches.
        """
        config, networks = self.config, self.networks
        moments = networks.scattered(state.first_moment), networks.scattered(state.second_moment)
        n_steps, size = config.steps_per_iteration, config.batch_size
        objective = Objective(config.clip_range, config.ent_coef, config.vf_coef, 1.0 / size)
        done = state.iteration / config.iterations
        learning_rate = scheduled(config.learning_rate, config.learning_rate_schedule, done)
        steps_before = state.iteration * config.n_epochs * (n_steps // size)
        gradients = np.empty((PARTS, len(networks.weights)), dtype=np.float32)
        nets = (networks.actor, networks.critic)
        passes = (rng.permutation(n_steps).reshape(-1, size) for _ in range(config.n_epochs))
        minibatches = itertools.chain.from_iterable(passes)
        for step, chosen in enumerate(minibatches, start=steps_before + 1):
            standard = standardisation(chosen, experience.advantages)
            given = (*nets, experience, chosen, objective, standard, gradients)
            run_rows(add_gradients, PARTS, BALANCED_STEPS, self.threads, *given)
            descend(*nets, *moments, gradients, learning_rate, config.max_grad_norm, step)
        return [networks.gathered(each) for each in (networks.weights, *moments)]


def estimate_advantages(
    rewards: Numbers, values: Numbers, going_on: Numbers, gamma: float, gae_lambda: float
) -> Numbers:
    """Generalised advantage estimation (Schulman et al. 2016).

    Parameters
    ----------
    rewards, going_on : ndarray of float32, shape (n_steps, n_envs)
        ``going_on`` is 0 where an episode ended, else 1.
    values : ndarray of float32, shape (n_steps + 1, n_envs)
        Values before each step and after the last one.
    gamma, gae_lambda : float
        Discount per step, and decay of the estimate.
    """
    advantages = np.empty_like(rewards)
    later = np.zeros_like(rewards[0])
    for step in reversed(range(len(rewards))):
        delta = rewards[step] + gamma * values[step + 1] * going_on[step] - values[step]
        advantages[step] = later = delta + gamma * gae_lambda * going_on[step] * later
    return advantages

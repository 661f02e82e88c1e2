"""Training with PPO, one iteration at a time."""

import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.logger import KVWriter, Logger, TensorBoardOutputFormat

from kinarm._console import doing
from kinarm.errors import InvalidInputError
from kinarm.policies.learners import CurvePoint, learner_of
from kinarm.policies.mirror import problem_mirror, sample_seen
from kinarm.policies.normalizer import Normalizer
from kinarm.policies.ppo.config import PPOConfig
from kinarm.policies.ppo.imitation import demonstrate, imitate
from kinarm.policies.ppo.model import CompiledPPO
from kinarm.policies.ppo.networks import ActorCritic, initial_parameters, split_parameters
from kinarm.policies.ppo.state import PPOState
from kinarm.policies.ppo.training_env import TrainingVecEnv
from kinarm.policies.sb3.training import alone_in_torch
from kinarm.policies.warm_start import starting_policy, statistics
from kinarm.randomness import Stream, stream_generator

IMITATING = "learning from the oracle's motions first"
"""What is told before a training that begins with demonstrations."""

NORMALIZED_OVER = 10_000
"""Random starts whose observations are the statistics of the normaliser."""


def seed_iteration(seed: int, iteration: int) -> tuple[np.random.Generator, np.random.Generator]:
    """Give an iteration its own random numbers, which do not depend on where the training began.

    The first generator is for the learner, the second one for scenarios.
    """
    learner = stream_generator(Stream.PPO_LEARNER, seed, iteration)
    return learner, stream_generator(Stream.PPO_SCENARIOS, seed, iteration)


class PPOTraining:
    """Environment and model of a training; all that changes is in the `PPOState`.

    The model is Stable-Baselines3's, its rollouts and updates compiled; see `CompiledPPO`. The
    result does not depend on the number of ``threads``. On demand, Stable-Baselines3 writes its
    logs to the folder ``tensorboard``.

    Parameters
    ----------
    config : PPOConfig
        The settings.
    tensorboard : str or Path, optional
        Folder of the logs.
    threads : int, optional
        Threads of an update; as many as there are processors by default.
    """

    @alone_in_torch()
    def __init__(
        self,
        config: PPOConfig,
        tensorboard: str | Path | None = None,
        threads: int | None = None,
    ) -> None:
        outputs: list[KVWriter] = []
        if tensorboard is not None:
            learner_of(config).check_installed("tensorboard")
            outputs.append(TensorBoardOutputFormat(str(tensorboard)))
        simulator = config.simulator(threads=1)
        self.config = config
        _, scenarios = seed_iteration(config.seed, 0)
        self.env = TrainingVecEnv(
            simulator,
            config.n_envs,
            rng=scenarios,
            mirror=problem_mirror(config.problem) if config.symmetric else None,
            replay=config.replay,
            stop_at_goal=config.stop_at_goal,
        )
        self.model = CompiledPPO(self.env, config, threads)
        self.model.set_logger(Logger(folder=None, output_formats=outputs))

    def initial_state(self) -> PPOState:
        """State before the first iteration; the normaliser has seen random starts."""
        config, env = self.config, self.env
        rng, scenarios = seed_iteration(config.seed, 0)
        simulator = env.simulator
        env.draw_from(scenarios)
        observations = simulator.world.observe(*env.sample(NORMALIZED_OVER))
        env.draw_from(scenarios, config.start_spread_at(0.0))
        env.reach_within(config.tolerance_at(0.0))
        env.reset()
        widths = (simulator.n_observations, config.net_arch, simulator.n_actions)
        parameters = initial_parameters(rng, *widths, config.log_std_init)
        normalizer = Normalizer.of(observations)
        if config.initial_policy is not None:
            n_observations, hidden, n_actions = widths
            policy = starting_policy(config.initial_policy, (n_observations, *hidden, n_actions))
            normalizer = statistics(policy)
            actor = split_parameters(parameters, *widths).actor
            for layer, (weights, bias) in zip(policy.layers, actor, strict=True):
                weights[:], bias[:] = layer
        if config.demonstrations:
            with doing(IMITATING):
                parameters = self._taught(parameters, normalizer, config.demonstrations)
        return PPOState(
            parameters=parameters,
            first_moment=np.zeros_like(parameters),
            second_moment=np.zeros_like(parameters),
            normalizer=normalizer,
            episodes=env.states(),
            failed=env.failed,
        )

    def _taught(
        self, parameters: NDArray[np.float32], normalizer: Normalizer, count: int
    ) -> NDArray[np.float32]:
        """Parameters of an actor that has imitated so many motions of the oracle."""
        config, simulator = self.config, self.env.simulator
        rng = stream_generator(Stream.PPO_DEMONSTRATIONS, config.seed)
        scenarios = sample_seen(self.env.mirror, simulator, rng, count)
        shown = demonstrate(simulator, scenarios, self.model.threads)
        widths = (simulator.n_observations, config.net_arch, simulator.n_actions)
        networks = ActorCritic(*widths, len(parameters))
        networks.load(parameters)
        imitate(networks, shown, normalizer, rng, self.model.threads)
        return networks.gathered(networks.weights)

    def iterate(self, state: PPOState) -> PPOState:
        """One rollout and one update."""
        began = time.perf_counter()
        config, model, env = self.config, self.model, self.env
        done = state.iteration / config.iterations
        self.env.reach_within(config.tolerance_at(done))
        self.load(state)
        model.rng, scenarios = seed_iteration(config.seed, state.iteration + 1)
        learning_rate = config.learning_rate_at(done)
        model.lr_schedule = lambda _: learning_rate
        env.draw_from(scenarios, config.start_spread_at(done))
        env.punish_by(config.penalty_at(done))
        model.act_with(config.log_std_at(done))
        model.discount_by(config.gamma_at(done))
        model.learn(config.steps_per_iteration, reset_num_timesteps=False)
        returns, successes, simulator_time = env.take_ended()
        point = CurvePoint(
            mean_return=float(np.mean(returns)) if returns else float("nan"),
            std_return=float(np.std(returns)) if returns else float("nan"),
            success=float(np.mean(successes)) if successes else float("nan"),
            environment_steps=model.num_timesteps,
            wall_time=state.wall_time + time.perf_counter() - began,
        )
        vectors = (model.parameters(), *model.moments())
        if not all(np.isfinite(vector).all() for vector in vectors):
            raise InvalidInputError(
                f"iteration {state.iteration + 1} diverged: the parameters are no longer finite; "
                f"learning_rate is {learning_rate:g}, a smaller one may help"
            )
        return PPOState(
            parameters=vectors[0],
            first_moment=vectors[1],
            second_moment=vectors[2],
            normalizer=state.normalizer,
            episodes=env.states(),
            failed=env.failed,
            curve=(*state.curve, point),
            simulator_time=state.simulator_time + simulator_time,
        )

    def load(self, state: PPOState) -> None:
        """Put a state into the model and the environment, if it has as many parameters and arms."""
        config, model = self.config, self.model
        sizes = (len(state.parameters), len(state.episodes.goal))
        expected = (len(model.parameters()), config.n_envs)
        if sizes != expected:
            raise InvalidInputError(
                f"the state to resume has {sizes[0]} parameters and {sizes[1]} arms, "
                f"not {expected[0]} and {expected[1]}"
            )
        moments = (state.first_moment, state.second_moment)
        model.load_vectors(state.parameters, moments, state.iteration * config.n_epochs)
        model.num_timesteps = state.environment_steps
        self.env.normalize_by(state.normalizer)
        model._last_obs = self.env.restore(state.episodes, state.failed)
        model._last_episode_starts = state.episodes.steps == 0

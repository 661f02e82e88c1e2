"""The PPO model of Stable-Baselines3, driven one iteration at a time."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.logger import KVWriter, Logger, TensorBoardOutputFormat
from torch.nn.utils import parameters_to_vector, vector_to_parameters

from kinarm.errors import InvalidInputError
from kinarm.policies.curve import CurvePoint
from kinarm.policies.learners import learner_of
from kinarm.policies.mirror import task_mirror
from kinarm.policies.normalizer import Normalizer
from kinarm.policies.ppo.config import PPOConfig
from kinarm.policies.ppo.state import PPOState
from kinarm.policies.ppo.training_env import TrainingVecEnv

NORMALIZED_OVER = 10_000
"""Random starts whose observations are the statistics of the normaliser."""


@contextmanager
def alone_in_torch() -> Iterator[None]:
    """Keep torch to one thread, and put back the global random states that PPO draws from."""
    threads, numpy_state = torch.get_num_threads(), np.random.get_state()  # noqa: NPY002
    with torch.random.fork_rng(devices=[]):
        torch.set_num_threads(1)
        try:
            yield
        finally:
            torch.set_num_threads(threads)
            np.random.set_state(numpy_state)  # noqa: NPY002


def seed_iteration(seed: int, iteration: int) -> np.random.Generator:
    """Give an iteration random numbers of its own, wherever the training began.

    Stable-Baselines3 samples actions from torch's global generator and shuffles minibatches with
    NumPy's; scenarios come from the generator that is returned.
    """
    children = np.random.SeedSequence(seed, spawn_key=(iteration,)).spawn(3)
    torch.manual_seed(int(children[0].generate_state(1)[0]))
    np.random.seed(int(children[1].generate_state(1)[0]))  # noqa: NPY002
    return np.random.default_rng(children[2])


class PPOTraining:
    """Environment and model of a training; all that changes is in the `PPOState`.

    It runs on one thread: its networks and batches are small, and so the result does not depend
    on the number of processors. Several seeds are best trained by as many processes. On demand,
    Stable-Baselines3 writes its logs to the folder ``tensorboard``.
    """

    @alone_in_torch()
    def __init__(self, config: PPOConfig, tensorboard: str | Path | None = None) -> None:
        outputs: list[KVWriter] = []
        if tensorboard is not None:
            learner_of(config).check_installed("tensorboard")
            outputs.append(TensorBoardOutputFormat(str(tensorboard)))
        rng = seed_iteration(config.seed, 0)
        simulator = config.simulator(threads=1)
        mirror = task_mirror(config.symmetric, simulator.world)
        self.config = config
        self.env = TrainingVecEnv(simulator, config.n_envs, rng=rng, mirror=mirror)
        self._learning_rate = config.learning_rate
        self.model = PPO(
            "MlpPolicy",
            self.env,
            n_steps=config.n_steps,
            batch_size=config.batch_size,
            n_epochs=config.n_epochs,
            learning_rate=lambda _: self._learning_rate,
            gamma=config.gamma,
            gae_lambda=config.gae_lambda,
            clip_range=config.clip_range,
            ent_coef=config.ent_coef,
            vf_coef=config.vf_coef,
            max_grad_norm=config.max_grad_norm,
            policy_kwargs={
                "net_arch": list(config.net_arch),
                "log_std_init": config.log_std_init,
            },
            device="cpu",
        )
        self.model.set_logger(Logger(folder=None, output_formats=outputs))
        self._first_parameters = self.parameters()

    @alone_in_torch()
    def initial_state(self) -> PPOState:
        """State before the first iteration; the normaliser has seen random starts."""
        env, rng = self.env, seed_iteration(self.config.seed, 0)
        observations = env.simulator.world.observe(*env.simulator.sample(rng, NORMALIZED_OVER))
        if env.mirror is not None:
            observations = env.mirror.from_the_right(observations)
        env.rng = rng
        env.start_spread = self.config.start_spread_at(0.0)
        env.reset()
        return PPOState(
            parameters=self._first_parameters,
            first_moment=np.zeros_like(self._first_parameters),
            second_moment=np.zeros_like(self._first_parameters),
            normalizer=Normalizer.of(observations),
            episodes=env.states(),
        )

    @alone_in_torch()
    def iterate(self, state: PPOState) -> PPOState:
        """One rollout and one update."""
        began = time.perf_counter()
        config, model, env = self.config, self.model, self.env
        env.rng = seed_iteration(config.seed, state.iteration + 1)
        self.load(state)
        done = state.iteration / config.iterations
        self._learning_rate = config.learning_rate_at(done)
        env.start_spread = config.start_spread_at(done)
        model.learn(config.steps_per_iteration, reset_num_timesteps=False)
        returns, successes, simulator_time = env.take_ended()
        point = CurvePoint(
            mean_return=float(np.mean(returns)) if returns else float("nan"),
            std_return=float(np.std(returns)) if returns else float("nan"),
            success=float(np.mean(successes)) if successes else float("nan"),
            environment_steps=model.num_timesteps,
            wall_time=state.wall_time + time.perf_counter() - began,
        )
        first_moment, second_moment = self._moments()
        return PPOState(
            parameters=self.parameters(),
            first_moment=first_moment,
            second_moment=second_moment,
            normalizer=state.normalizer,
            episodes=env.states(),
            curve=(*state.curve, point),
            simulator_time=state.simulator_time + simulator_time,
        )

    def load(self, state: PPOState) -> None:
        """Put a state into the model and the environment, if it has as many parameters and arms."""
        config, model = self.config, self.model
        sizes = (len(state.parameters), len(state.episodes.goal))
        expected = (len(self.parameters()), config.n_envs)
        if sizes != expected:
            raise InvalidInputError(
                f"the state to resume has {sizes[0]} parameters and {sizes[1]} arms, "
                f"not {expected[0]} and {expected[1]}"
            )
        epochs = state.iteration * config.n_epochs
        updates = epochs * config.steps_per_iteration // config.batch_size
        weights = list(model.policy.parameters())
        vector_to_parameters(torch.tensor(state.parameters), weights)
        moments = (state.first_moment, state.second_moment)
        lengths = [weight.numel() for weight in weights]
        parts = (torch.split(torch.tensor(moment), lengths) for moment in moments)
        for weight, first, second in zip(weights, *parts, strict=True):
            model.policy.optimizer.state[weight] = {
                "step": torch.tensor(float(updates)),
                "exp_avg": first.view_as(weight),
                "exp_avg_sq": second.view_as(weight),
            }
        model.num_timesteps, model._n_updates = state.environment_steps, epochs
        self.env.normalize_by(state.normalizer)
        model._last_obs = self.env.restore(state.episodes)
        model._last_episode_starts = state.episodes.steps == 0

    def parameters(self) -> NDArray[np.float32]:
        """Parameters of actor and critic, shape (n_parameters,)."""
        return self._flat([weight.detach() for weight in self.model.policy.parameters()])

    def _moments(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Adam's means of the gradients and of their squares, shape (n_parameters,) each."""
        adam = [self.model.policy.optimizer.state[w] for w in self.model.policy.parameters()]
        return self._flat([s["exp_avg"] for s in adam]), self._flat([s["exp_avg_sq"] for s in adam])

    @staticmethod
    def _flat(tensors: list[torch.Tensor]) -> NDArray[np.float32]:
        vector: NDArray[np.float32] = parameters_to_vector(tensors).numpy().copy()
        return vector

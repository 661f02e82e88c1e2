"""Stable-Baselines3's PPO, its rollouts and updates compiled."""

from typing import NamedTuple

import numpy as np
import torch
from gymnasium.spaces import Box
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.preprocessing import get_action_dim, get_flattened_obs_dim
from stable_baselines3.common.utils import explained_variance
from stable_baselines3.common.vec_env import VecEnv

from kinarm._parallel import available_threads
from kinarm._validation import whole_number
from kinarm.policies.ppo.config import PPOConfig
from kinarm.policies.ppo.kernels.loss import HALF_LOG_2_PI, Experience, Objective
from kinarm.policies.ppo.kernels.tiles import Numbers
from kinarm.policies.ppo.kernels.update import Descent, choose, fill_in_scales
from kinarm.policies.ppo.networks import ActorCritic
from kinarm.policies.ppo.update import UpdateRecords, update
from kinarm.randomness import Stream, stream_generator


class CutShort(NamedTuple):
    """An episode that the time limit ended: when, whose, and its last observation."""

    step: int
    row: int
    observation: Numbers


class CompiledPPO(PPO):
    """A PPO of Stable-Baselines3 with an ``MlpPolicy``, which does the same in less time.

    Actions, values, gradients and steps of Adam are computed by kinarm's kernels, not by torch:
    the same bits on every machine and for any number of threads. What they start from and end in
    are the parameters of ``policy`` and the moments of its optimizer, so that the model can be
    used, saved and loaded as any other; ``PPO.load`` makes a plain one of it.

    Parameters
    ----------
    env : VecEnv
        Environment with flat observations and actions.
    config : PPOConfig
        Settings.
    threads : int, optional
        Threads of an update; as many as the processors that this process may use by default.

    Attributes
    ----------
    rng : numpy.random.Generator
        Draws the noise of actions, and minibatches.
    """

    def __init__(self, env: VecEnv, config: PPOConfig, threads: int | None = None) -> None:
        self.rng = stream_generator(Stream.PPO_LEARNER, config.seed, 0)
        self.threads = (
            available_threads() if threads is None else whole_number("threads", threads, 1)
        )
        super().__init__(
            "MlpPolicy",
            env,
            n_steps=config.n_steps,
            batch_size=config.batch_size,
            n_epochs=config.n_epochs,
            learning_rate=config.learning_rate,
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
        self._replay_log_std = config.replay_log_std
        self._replay_noise_steps = config.replay_noise_steps
        self._noise_scales = np.ones((config.n_steps, env.num_envs), dtype=np.float32)
        self._weights = list(self.policy.parameters())
        self._networks = ActorCritic(
            get_flattened_obs_dim(env.observation_space),
            config.net_arch,
            get_action_dim(env.action_space),
            len(self.parameters()),
        )

    def _excluded_save_params(self) -> list[str]:
        """What a plain PPO has no use for."""
        own = ["rng", "threads", "_networks", "_weights", "_noise_scales"]
        settings = ["_replay_log_std", "_replay_noise_steps"]
        return [*super()._excluded_save_params(), *own, *settings]

    def parameters(self) -> Numbers:
        """Parameters of actor and critic, shape (n_parameters,)."""
        return _flat([weight.detach() for weight in self._weights])

    def moments(self) -> tuple[Numbers, Numbers]:
        """Adam's means of the gradients and of their squares, shape (n_parameters,) each."""
        states = [self.policy.optimizer.state[weight] for weight in self._weights]
        if not all(states):
            return np.zeros_like(self.parameters()), np.zeros_like(self.parameters())
        return _flat([s["exp_avg"] for s in states]), _flat([s["exp_avg_sq"] for s in states])

    def load_vectors(
        self, parameters: Numbers, moments: tuple[Numbers, Numbers], epochs: int
    ) -> None:
        """Put parameters and moments, after so many epochs, into policy and optimizer."""
        self._n_updates = epochs
        step = float(epochs * self._minibatches)
        ends = np.cumsum([weight.numel() for weight in self._weights])[:-1]
        parts = (np.split(vector.copy(), ends) for vector in (parameters, *moments))
        with torch.no_grad():
            for weight, values, first, second in zip(self._weights, *parts, strict=True):
                weight.copy_(torch.from_numpy(values).view_as(weight))
                self.policy.optimizer.state[weight] = {
                    "step": torch.tensor(step),
                    "exp_avg": torch.from_numpy(first).view_as(weight),
                    "exp_avg_sq": torch.from_numpy(second).view_as(weight),
                }

    def discount_by(self, gamma: float) -> None:
        """From now on, discount rewards by this factor per step."""
        self.gamma = self.rollout_buffer.gamma = gamma

    def act_with(self, log_std: float | None) -> None:
        """Set the logarithm of the standard deviation of actions, if one is given."""
        if log_std is not None:
            with torch.no_grad():
                self.policy.log_std.fill_(log_std)

    @property
    def _minibatches(self) -> int:
        """Steps of Adam in an epoch."""
        return self.n_steps * self.n_envs // self.batch_size

    def collect_rollouts(
        self,
        env: VecEnv,
        callback: BaseCallback,
        rollout_buffer: RolloutBuffer,
        n_rollout_steps: int,
    ) -> bool:
        """Fill the buffer, as PPO does; values are found at the end, all at once."""
        networks, buffer, box = self._networks, rollout_buffer, env.action_space
        assert isinstance(box, Box)
        networks.load(self.parameters())
        buffer.reset()
        callback.on_rollout_start()
        actions = np.empty((env.num_envs, len(networks.log_std)), dtype=np.float32)
        cut_short: list[CutShort] = []
        for step in range(n_rollout_steps):
            obs = np.asarray(self._last_obs)
            noise = self.rng.standard_normal(actions.shape).astype(np.float32)
            scales = self._noise_scales[step]
            if self._replay_log_std is not None:
                fill_in_scales(self._noisy(env), networks.log_std, self._replay_log_std, scales)
            outcome = actions, buffer.log_probs[step]
            choose(networks.means(obs), networks.log_std, noise, scales, *outcome)
            buffer.observations[step], buffer.actions[step] = obs, actions
            buffer.episode_starts[step] = self._last_episode_starts
            new_obs, rewards, dones, infos = env.step(np.clip(actions, box.low, box.high))
            buffer.rewards[step] = rewards
            self._last_obs, self._last_episode_starts = np.asarray(new_obs), dones
            self.num_timesteps += env.num_envs
            callback.update_locals(locals())
            if not callback.on_step():
                return False
            ended = np.flatnonzero(dones).tolist()
            self._update_info_buffer([infos[row] for row in ended], np.ones(len(ended), dtype=bool))
            cut_short += [
                CutShort(step, row, infos[row]["terminal_observation"])
                for row in ended
                if infos[row].get("TimeLimit.truncated", False)
            ]
        last_values = self._fill_in_values(buffer, cut_short)
        buffer.pos, buffer.full = n_rollout_steps, True
        buffer.compute_returns_and_advantage(last_values, dones)
        callback.update_locals(locals())
        callback.on_rollout_end()
        return True

    def _noisy(self, env: VecEnv) -> NDArray[np.bool_]:
        """Which episodes are to have more noise, shape (n_envs,)."""
        replayed: NDArray[np.bool_] = env.get_attr("replayed", 0)[0]
        if self._replay_noise_steps is None:
            return replayed
        steps: NDArray[np.int64] = env.get_attr("steps", 0)[0]
        return replayed & (steps < self._replay_noise_steps)

    def _fill_in_values(self, buffer: RolloutBuffer, cut_short: list[CutShort]) -> torch.Tensor:
        """Compute all values of a rollout; returns those of the observations after it.

        An episode that the time limit ended would have gone on: its last reward gets the value of
        its last observation.
        """
        seen = buffer.observations.reshape(-1, buffer.observations.shape[-1])
        finals = [end.observation[None] for end in cut_short]
        every = np.concatenate([seen, np.asarray(self._last_obs), *finals])
        ends = [len(seen), len(every) - len(finals)]
        values, after, final = np.split(self._networks.values(every, self.threads), ends)
        buffer.values[:] = values.reshape(buffer.values.shape)
        for end, value in zip(cut_short, final, strict=True):
            buffer.rewards[end.step, end.row] += np.float32(self.gamma) * value
        return torch.from_numpy(after)

    def train(self) -> None:
        """Update actor and critic from the buffer, as PPO does."""
        self._update_learning_rate(self.policy.optimizer)
        networks, experience = self._networks, self._experience()
        networks.load(self.parameters())
        first, second = self.moments()
        moments = networks.scattered(first), networks.scattered(second)
        adam = self.policy.optimizer.param_groups[0]
        first_decay, second_decay = adam["betas"]
        records = update(
            networks,
            moments,
            experience,
            (self._random_minibatches() for _ in range(self.n_epochs)),
            Objective(self._clip_range, self.ent_coef, self.vf_coef, 1.0 / self.batch_size),
            Descent(adam["lr"], first_decay, second_decay, adam["eps"], self.max_grad_norm),
            steps_before=self._n_updates * self._minibatches,
            threads=self.threads,
        )
        first, second = (networks.gathered(moment) for moment in moments)
        parameters = networks.gathered(networks.weights)
        self.load_vectors(parameters, (first, second), self._n_updates + self.n_epochs)
        self._log(records)

    def _random_minibatches(self) -> NDArray[np.int64]:
        """Rows of the experience in a random order, shape (n_minibatches, batch_size)."""
        order = self.rng.permutation(self.n_steps * self.n_envs)
        return order.reshape(self._minibatches, self.batch_size)

    @property
    def _clip_range(self) -> float:
        """How far the probability ratio may leave 1."""
        clip_range = self.clip_range
        assert callable(clip_range)
        return float(clip_range(self._current_progress_remaining))

    def _experience(self) -> Experience:
        """What is in the buffer, arm after arm."""
        buffer = self.rollout_buffer
        arrays = (buffer.observations, buffer.actions, self._noise_scales, buffer.log_probs)
        targets = (buffer.advantages, buffer.returns)
        flat = [buffer.swap_and_flatten(array) for array in (*arrays, *targets)]
        return Experience(*flat[:2], *(array.ravel() for array in flat[2:]))

    def _log(self, records: UpdateRecords) -> None:
        """Log what PPO logs."""
        entropy = len(self._networks.log_std) * (records.log_std + 0.5 + HALF_LOG_2_PI)
        losses = records.policy_loss - self.ent_coef * entropy + self.vf_coef * records.value_loss
        values, returns = self.rollout_buffer.values, self.rollout_buffer.returns
        entries = {
            "entropy_loss": -entropy.mean(),
            "policy_gradient_loss": records.policy_loss.mean(),
            "value_loss": records.value_loss.mean(),
            "approx_kl": records.divergence[-self._minibatches :].mean(),
            "clip_fraction": records.clipped.mean(),
            "loss": losses[-1],
            "explained_variance": explained_variance(values.flatten(), returns.flatten()),
            "std": self.policy.log_std.detach().exp().mean().item(),
            "clip_range": self._clip_range,
        }
        for name, entry in entries.items():
            self.logger.record(f"train/{name}", entry)
        self.logger.record("train/n_updates", self._n_updates, exclude="tensorboard")


def _flat(tensors: list[torch.Tensor]) -> Numbers:
    """The numbers of tensors in one vector, a copy."""
    return np.concatenate([tensor.numpy().ravel() for tensor in tensors])

"""A rollout: what the arms do by the actor, and what came of it by the critic."""

import numpy as np

from kinarm.policies.ppo.arms import TrainingArms
from kinarm.policies.ppo.kernels.loss import Experience
from kinarm.policies.ppo.kernels.tiles import Numbers
from kinarm.policies.ppo.kernels.update import choose
from kinarm.policies.ppo.networks import ActorCritic


def collect(
    networks: ActorCritic,
    arms: TrainingArms,
    rng: np.random.Generator,
    *,
    gamma: float,
    threads: int,
) -> Experience:
    """Step the arms, and judge their steps at the end, all at once.

    An episode that the time limit ended would have gone on: its last reward gets the value of its
    last observation.

    Parameters
    ----------
    networks : ActorCritic
        Choose and judge actions.
    arms : TrainingArms
        What is stepped.
    rng : numpy.random.Generator
        Draws the noise of actions.
    gamma : float
        Discount per step.
    threads : int
        Threads that find values.
    """
    config, log_std = arms.config, networks.log_std
    least = -np.inf if config.replay_log_std is None else config.replay_log_std
    shape = (config.n_steps, config.n_envs)
    observations = np.empty((*shape, arms.simulator.n_observations), dtype=np.float32)
    actions = np.empty((*shape, len(log_std)), dtype=np.float32)
    scales, densities, rewards, going_on = (np.ones(shape, dtype=np.float32) for _ in range(4))
    rows, finals = [], []
    for step in range(config.n_steps):
        observations[step] = seen = arms.observe()
        noise = rng.standard_normal(actions[step].shape).astype(np.float32)
        outcome = actions[step], scales[step], densities[step]
        choose(networks.means(seen), log_std, noise, arms.replaying(), least, *outcome)
        rewards[step], ended, cut_short, last = arms.step(np.clip(actions[step], -1.0, 1.0))
        going_on[step] = ~ended
        rows.append(cut_short)
        finals.append(last)
    steps = np.repeat(np.arange(config.n_steps), [len(each) for each in rows])
    flat = observations.reshape(-1, observations.shape[-1])
    values = networks.values(np.concatenate([flat, arms.observe(), *finals]), threads)
    end = len(flat) + config.n_envs
    rewards[steps, np.concatenate(rows)] += np.float32(gamma) * values[end:]
    values = values[:end].reshape(-1, config.n_envs)
    advantages = estimate_advantages(rewards, values, going_on, gamma, config.gae_lambda)
    parts = (observations, actions, scales, densities, advantages, advantages + values[:-1])
    # Arm after arm, as Stable-Baselines3 has them.
    return Experience(*(part.swapaxes(0, 1).reshape(-1, *part.shape[2:]) for part in parts))


def estimate_advantages(
    rewards: Numbers, values: Numbers, going_on: Numbers, gamma: float, gae_lambda: float
) -> Numbers:
    """Generalised advantage estimation (Schulman et al. 2016).

    Parameters
    ----------
    rewards, going_on : ndarray of float32, shape (n_steps, n_envs)
        ``going_on`` is 0 where an episode ended in the step, else 1.
    values : ndarray of float32, shape (n_steps + 1, n_envs)
        Values of the observations before each step and after the last one.
    gamma, gae_lambda : float
        Discount per step, and decay of the estimate.
    """
    advantages = np.empty_like(rewards)
    later = np.zeros_like(rewards[0])
    for step in reversed(range(len(rewards))):
        delta = rewards[step] + gamma * values[step + 1] * going_on[step] - values[step]
        advantages[step] = later = delta + gamma * gae_lambda * going_on[step] * later
    return advantages

"""A training loop in one file, in the manner of CleanRL, learns on the batch environment.

Nothing of kinarm but the id is used: the batch comes from ``gymnasium.make_vec``, and Gymnasium's
vector wrappers record and normalise.
"""

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("torch")

import torch
from torch import nn, optim
from torch.distributions.normal import Normal

import kinarm

gym.register_envs(kinarm)

NUM_ENVS, NUM_STEPS, ITERATIONS = 64, 32, 45
EPOCHS, MINIBATCHES = 4, 8
GAMMA, GAE_LAMBDA, CLIP = 0.95, 0.9, 0.2


def layer_init(layer, std=2**0.5):
    nn.init.orthogonal_(layer.weight, std)
    nn.init.zeros_(layer.bias)
    return layer


class Agent(nn.Module):
    def __init__(self, envs):
        super().__init__()
        n_observations = envs.single_observation_space.shape[0]
        n_actions = envs.single_action_space.shape[0]

        def network(n_out, std):
            return nn.Sequential(
                layer_init(nn.Linear(n_observations, 64)),
                nn.Tanh(),
                layer_init(nn.Linear(64, 64)),
                nn.Tanh(),
                layer_init(nn.Linear(64, n_out), std),
            )

        self.critic, self.actor_mean = network(1, 1.0), network(n_actions, 0.01)
        self.actor_logstd = nn.Parameter(torch.full((1, n_actions), -0.5))

    def get_action_and_value(self, x, action=None):
        probs = Normal(self.actor_mean(x), self.actor_logstd.exp())
        if action is None:
            action = probs.sample()
        return action, probs.log_prob(action).sum(1), self.critic(x).flatten()


def make_envs():
    envs = gym.make_vec(
        "kinarm/ReachRight-v0",
        num_envs=NUM_ENVS,
        vectorization_mode="vector_entry_point",
        tolerance=0.15,
        reward={"success": 1.0},
        observation_dtype="float32",
    )
    envs = gym.wrappers.vector.RecordEpisodeStatistics(envs)
    envs = gym.wrappers.vector.ClipAction(envs)
    return gym.wrappers.vector.NormalizeObservation(envs)


def collect(envs, agent, obs, done):
    """One rollout; a step after an end begins the next episode, and is left out by its mask."""
    rollout, successes = [], []
    for _ in range(NUM_STEPS):
        with torch.no_grad():
            action, logprob, value = agent.get_action_and_value(obs)
        next_obs, reward, terminated, truncated, infos = envs.step(action.numpy())
        reward = torch.tensor(reward, dtype=torch.float32)
        rollout.append((obs, action, logprob, value, reward, done))
        if "episode" in infos:
            successes += infos["is_success"][infos["_episode"]].tolist()
        obs = torch.tensor(next_obs, dtype=torch.float32)
        done = torch.tensor(np.logical_or(terminated, truncated))
    return [torch.stack(part) for part in zip(*rollout, strict=True)], obs, done, successes


def advantages_of(rewards, values, dones, next_value, next_done):
    advantages, following = torch.zeros_like(rewards), torch.zeros(NUM_ENVS)
    for t in reversed(range(NUM_STEPS)):
        last = t == NUM_STEPS - 1
        running = 1.0 - (next_done if last else dones[t + 1]).float()
        value_after = next_value if last else values[t + 1]
        delta = rewards[t] + GAMMA * value_after * running - values[t]
        advantages[t] = following = delta + GAMMA * GAE_LAMBDA * running * following
    return advantages


def update(agent, optimizer, batch, advantages, returns):
    obs, actions, logprobs, _, _, dones = (part.flatten(0, 1) for part in batch)
    advantages, returns = advantages.flatten(), returns.flatten()
    played = torch.nonzero(~dones).flatten()
    for _ in range(EPOCHS):
        for rows in played[torch.randperm(len(played))].chunk(MINIBATCHES):
            _, logprob, value = agent.get_action_and_value(obs[rows], actions[rows])
            ratio = (logprob - logprobs[rows]).exp()
            gain = advantages[rows]
            gain = (gain - gain.mean()) / (gain.std() + 1e-8)
            clipped = ratio.clamp(1 - CLIP, 1 + CLIP)
            loss = -torch.min(gain * ratio, gain * clipped).mean()
            loss = loss + 0.5 * (value - returns[rows]).square().mean()
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(agent.parameters(), 0.5)
            optimizer.step()


@pytest.mark.slow
def test_it_learns():
    torch.manual_seed(0)
    envs = make_envs()
    agent = Agent(envs)
    optimizer = optim.Adam(agent.parameters(), lr=1e-3, eps=1e-5)
    obs = torch.tensor(envs.reset(seed=0)[0], dtype=torch.float32)
    done, shares = torch.zeros(NUM_ENVS, dtype=torch.bool), []
    for _ in range(ITERATIONS):
        batch, obs, done, successes = collect(envs, agent, obs, done)
        with torch.no_grad():
            next_value = agent.critic(obs).flatten()
        _, _, _, values, rewards, dones = batch
        advantages = advantages_of(rewards, values, dones, next_value, done)
        update(agent, optimizer, batch, advantages, advantages + values)
        shares.append(np.mean(successes))
    envs.close()
    assert np.mean(shares[:5]) < 0.3
    assert np.mean(shares[-5:]) > 0.6

"""PPO held against Stable-Baselines3's own: what it draws, estimates, and makes of a rollout."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.logger import Logger

from kinarm.policies import PPOConfig, recipe, sb3_vec_env
from kinarm.policies.ppo.learner import PPOTraining, estimate_advantages
from kinarm.policies.ppo.networks import initial_parameters, orthogonal, split_parameters
from kinarm.problem import PROBLEMS
from kinarm.task import RewardWeights

AWKWARD = PPOConfig(
    problem=PROBLEMS["right"].replace(horizon=9),
    reward=RewardWeights(success=1.0),
    training_tolerance=0.3,
    n_envs=6,
    n_steps=20,
    batch_size=40,
    n_epochs=3,
    net_arch=(12, 10),
    ent_coef=0.01,
    learning_rate=3e-3,
    seed=5,
)
CONFIGS = {
    "awkward": AWKWARD,
    "paper": recipe("ppo", "paper"),
    "quick": replace(
        recipe("ppo", "quick", problem="both"),
        residual=False,
        replay_share=0.0,
        replay_log_std=None,
    ),
}


@pytest.fixture(autouse=True)
def one_thread_of_torch():
    """Several are slower where other tests run."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture(params=CONFIGS)
def config(request):
    return CONFIGS[request.param]


def twin(config, state=None):
    """A PPO of Stable-Baselines3 with the parameters and moments of a state."""
    names = ("n_steps", "batch_size", "n_epochs", "learning_rate", "gamma", "gae_lambda")
    weights = ("clip_range", "ent_coef", "vf_coef", "max_grad_norm")
    model = PPO(
        "MlpPolicy",
        sb3_vec_env(config.problem, config.n_envs),
        **{name: getattr(config, name) for name in (*names, *weights)},
        policy_kwargs={"net_arch": list(config.net_arch)},
        device="cpu",
        seed=1,
    )
    model.set_logger(Logger(None, []))
    if state is not None:
        parameters = list(model.policy.parameters())
        vectors = (state.parameters, state.first_moment, state.second_moment)
        ends = np.cumsum([parameter.numel() for parameter in parameters])[:-1]
        parts = (np.split(vector.copy(), ends) for vector in vectors)
        with torch.no_grad():
            for parameter, values, first, second in zip(parameters, *parts, strict=True):
                parameter.copy_(torch.from_numpy(values).view_as(parameter))
                model.policy.optimizer.state[parameter] = {
                    "step": torch.tensor(float(steps_before(config, state))),
                    "exp_avg": torch.from_numpy(first).view_as(parameter),
                    "exp_avg_sq": torch.from_numpy(second).view_as(parameter),
                }
    return model


def steps_before(config, state):
    return state.iteration * config.n_epochs * config.steps_per_iteration // config.batch_size


@pytest.fixture
def begun(config):
    """A training after two iterations, its state, and the experience of the next one."""
    training = PPOTraining(config, threads=1)
    state = training.initial_state()
    for _ in range(2):
        state = training.iterate(state)
    training.networks.load(state.parameters)
    training.arms.restore(state, np.random.default_rng(8))
    return training, state, training.collect(np.random.default_rng(7))


def test_rollout(config, begun):
    """Noise, values and densities."""
    _, state, experience = begun
    policy = twin(config, state).policy
    given = (torch.from_numpy(part) for part in (experience.observations, experience.actions))
    with torch.no_grad():
        values, densities, _ = policy.evaluate_actions(*given)
        means = policy.get_distribution(torch.from_numpy(experience.observations)).mode().numpy()
        std = policy.log_std.exp().numpy()
    found = experience.returns - experience.advantages
    np.testing.assert_allclose(found, values.numpy()[:, 0], rtol=0, atol=1e-5)
    np.testing.assert_allclose(experience.densities, densities.numpy(), rtol=0, atol=1e-4)
    drawn = np.random.default_rng(7).standard_normal((config.n_steps, config.n_envs, 5))
    noise = ((experience.actions - means) / std).reshape(config.n_envs, config.n_steps, 5)
    np.testing.assert_allclose(noise.swapaxes(0, 1), drawn, rtol=0, atol=1e-4)


def test_advantages(config):
    """To the last bit."""
    env, rng = sb3_vec_env(config.problem, 4), np.random.default_rng(0)
    spaces = env.observation_space, env.action_space
    buffer = RolloutBuffer(30, *spaces, "cpu", config.gae_lambda, config.gamma, 4)
    rewards, values = (rng.normal(size=(n, 4)).astype(np.float32) for n in (30, 31))
    ended = rng.random((30, 4)) < 0.2
    buffer.rewards[:], buffer.values[:] = rewards, values[:-1]
    buffer.episode_starts[1:] = ended[:-1]
    buffer.compute_returns_and_advantage(torch.from_numpy(values[-1]), ended[-1])
    going_on = (~ended).astype(np.float32)
    found = estimate_advantages(rewards, values, going_on, config.gamma, config.gae_lambda)
    np.testing.assert_array_equal(found, buffer.advantages)


def test_update(config, begun, monkeypatch):
    """Parameters and moments, with the same minibatches in both."""
    training, state, experience = begun
    model = twin(config, state)
    buffer = model.rollout_buffer
    values = experience.returns - experience.advantages
    for name, part in (
        *(("observations", experience.observations), ("actions", experience.actions)),
        *(("log_probs", experience.densities), ("advantages", experience.advantages)),
        *(("returns", experience.returns), ("values", values)),
    ):
        by_arm = part.reshape(config.n_envs, config.n_steps, *part.shape[1:])
        setattr(buffer, name, by_arm.swapaxes(0, 1).copy())
    buffer.full = True
    monkeypatch.setattr("numpy.random.permutation", np.random.default_rng(3).permutation)
    model.train()
    monkeypatch.undo()
    training.networks.load(state.parameters)
    training.config = replace(config, learning_rate_schedule="constant")
    found = training.update(state, experience, np.random.default_rng(3))
    parameters = list(model.policy.parameters())
    optimizer = [model.policy.optimizer.state[parameter] for parameter in parameters]
    theirs = (
        [parameter.detach() for parameter in parameters],
        *([each[name] for each in optimizer] for name in ("exp_avg", "exp_avg_sq")),
    )
    for ours, parts in zip(found, theirs, strict=True):
        expected = torch.cat([part.flatten() for part in parts]).numpy()
        np.testing.assert_allclose(ours, expected, rtol=0, atol=1e-5)
    assert np.abs(found[0] - state.parameters).max() > 1e-3


class TestParameters:
    def test_are_in_the_order_of_the_policy(self):
        state = PPOTraining(AWKWARD).initial_state()
        parts = split_parameters(state.parameters, (48, *AWKWARD.net_arch, 5))
        policy = twin(AWKWARD, state).policy
        theirs = {name: p.detach().numpy() for name, p in policy.named_parameters()}
        ours = {"log_std": parts.log_std}
        nets = (("policy_net", "action_net", parts.actor), ("value_net", "value_net", parts.critic))
        for hidden, last, layers in nets:
            names = [f"mlp_extractor.{hidden}.{2 * k}" for k in range(len(layers) - 1)] + [last]
            for name, (weights, bias) in zip(names, layers, strict=True):
                ours |= {f"{name}.weight": weights, f"{name}.bias": bias}
        assert ours.keys() == theirs.keys()
        for name, values in theirs.items():
            np.testing.assert_array_equal(ours[name], values)

    def test_are_drawn_as_theirs(self):
        """Singular values of every matrix are those of a model that they initialise."""
        drawn = initial_parameters(np.random.default_rng(0), (48, *AWKWARD.net_arch, 5), 0.0)
        vector = torch.nn.utils.parameters_to_vector(twin(AWKWARD).policy.parameters())
        theirs, ours = (
            split_parameters(each, (48, *AWKWARD.net_arch, 5))
            for each in (vector.detach().numpy(), drawn)
        )
        for first, second in zip(
            ours.actor + ours.critic, theirs.actor + theirs.critic, strict=True
        ):
            values = (np.linalg.svd(matrix, compute_uv=False) for matrix in (first[0], second[0]))
            np.testing.assert_allclose(*values, rtol=1e-5)
            assert not first[1].any()
            assert not second[1].any()
        assert not ours.log_std.any()

    @pytest.mark.parametrize("shape", [(12, 48), (48, 12), (10, 10), (1, 5)])
    def test_orthogonal_as_torch_makes_it(self, shape, monkeypatch):
        """Of the same normal numbers; torch decomposes the columns of a matrix or its transpose."""
        normal = np.random.default_rng(0).standard_normal(shape)
        given = torch.tensor(normal)
        monkeypatch.setattr(torch.Tensor, "normal_", lambda self, *_, **__: self.copy_(given))
        matrix = torch.empty(shape, dtype=torch.float64)
        torch.nn.init.orthogonal_(matrix)
        np.testing.assert_allclose(orthogonal(normal), matrix.numpy(), rtol=0, atol=1e-9)

"""The compiled model held against Stable-Baselines3's own PPO, which it is."""

import copy
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.logger import Logger

from kinarm.errors import InvalidInputError
from kinarm.policies import PPOConfig, recipe
from kinarm.policies.ppo.learner import PPOTraining
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
    "tuned": recipe("ppo", "tuned", problem="both"),
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


def plain_twin(training):
    """A PPO of Stable-Baselines3 with the parameters and moments of a training's model."""
    config, model = training.config, training.model
    twin = PPO(
        "MlpPolicy",
        training.env,
        n_steps=config.n_steps,
        batch_size=config.batch_size,
        n_epochs=config.n_epochs,
        learning_rate=model.lr_schedule(1.0),
        gamma=config.gamma,
        gae_lambda=config.gae_lambda,
        clip_range=config.clip_range,
        ent_coef=config.ent_coef,
        vf_coef=config.vf_coef,
        max_grad_norm=config.max_grad_norm,
        policy_kwargs={"net_arch": list(config.net_arch)},
        device="cpu",
    )
    twin.policy.load_state_dict(model.policy.state_dict())
    twin.policy.optimizer.load_state_dict(copy.deepcopy(model.policy.optimizer.state_dict()))
    twin._n_updates = model._n_updates
    twin.set_logger(Logger(None, []))
    return twin


def begun(config, iterations=2, threads=1):
    """A training after some iterations, and its state."""
    training = PPOTraining(config, threads=threads)
    state = training.initial_state()
    for _ in range(iterations):
        state = training.iterate(state)
    training.load(state)
    return training, state


def collect(model, env, n_steps, state):
    """The buffer after a rollout that begins with the episodes of a state."""
    _, callback = model._setup_learn(0, None, reset_num_timesteps=False)
    env.draw_from(np.random.default_rng(8))
    model._last_obs = env.restore(state.episodes, state.failed)
    model._last_episode_starts = state.episodes.steps == 0
    assert model.collect_rollouts(env, callback, model.rollout_buffer, n_steps)
    return model.rollout_buffer


def test_rollout(config, monkeypatch):
    """Observations to advantages, with the same noise in both."""
    config = replace(config, n_steps=12, batch_size=config.n_envs)
    training, state = begun(config)
    model, env = training.model, training.env
    twin, noise = plain_twin(training), np.random.default_rng(7)
    model.rng = np.random.default_rng(7)
    ours = collect(model, env, config.n_steps, state)
    monkeypatch.setattr(
        "torch.distributions.normal._standard_normal",
        lambda shape, **_: torch.tensor(noise.standard_normal(shape), dtype=torch.float32),
    )
    theirs = collect(twin, env, config.n_steps, state)
    names = ("observations", "actions", "rewards", "episode_starts", "values", "log_probs")
    for name in (*names, "advantages", "returns"):
        first, second = getattr(ours, name), getattr(theirs, name)
        assert first.dtype == second.dtype
        np.testing.assert_allclose(first, second, rtol=0, atol=1e-5, err_msg=name)
    assert ours.full
    assert model.num_timesteps - state.environment_steps == twin.num_timesteps
    if config.problem.task.horizon == 9:
        assert ours.episode_starts[1:].any()
    np.testing.assert_allclose(model._last_obs, twin._last_obs, rtol=0, atol=1e-5)
    np.testing.assert_array_equal(model._last_episode_starts, twin._last_episode_starts)


def test_update(config, monkeypatch):
    """Parameters, moments and logs, with the same minibatches in both."""
    training, state = begun(config)
    model, order = training.model, np.random.default_rng(3)
    collect(model, training.env, config.n_steps, state)
    twin = plain_twin(training)
    twin.rollout_buffer = copy.deepcopy(model.rollout_buffer)
    monkeypatch.setattr("numpy.random.permutation", order.permutation)
    twin.train()
    monkeypatch.undo()
    model.rng = np.random.default_rng(3)
    model.train()
    states = [twin.policy.optimizer.state[weight] for weight in twin.policy.parameters()]
    theirs = [
        [weight.detach() for weight in twin.policy.parameters()],
        *([state[name] for state in states] for name in ("exp_avg", "exp_avg_sq")),
    ]
    for ours, parts in zip((model.parameters(), *model.moments()), theirs, strict=True):
        expected = torch.cat([part.flatten() for part in parts]).numpy()
        np.testing.assert_allclose(ours, expected, rtol=0, atol=1e-5)
    assert np.abs(model.parameters() - state.parameters).max() > 1e-3
    assert model._n_updates == twin._n_updates
    assert {float(s["step"]) for s in states} == {
        float(s["step"]) for s in model.policy.optimizer.state.values()
    }
    logged, expected = model.logger.name_to_value, twin.logger.name_to_value
    assert expected.keys() <= logged.keys()
    for name, value in expected.items():
        assert logged[name] == pytest.approx(value, rel=1e-3, abs=1e-5), name


@pytest.mark.parametrize("name", ["awkward", "tuned"])
def test_threads_do_not_matter(name):
    config, states = CONFIGS[name], []
    for threads in (1, 2, 3, 11):
        training, state = begun(config, 2, threads)
        assert training.model.threads == threads
        states.append(state)
    for state in states[1:]:
        for part in ("parameters", "first_moment", "second_moment"):
            assert getattr(state, part).tobytes() == getattr(states[0], part).tobytes()


def test_before_the_first_update_adam_knows_nothing(config):
    model = PPOTraining(config).model
    for moment in model.moments():
        np.testing.assert_array_equal(moment, np.zeros_like(model.parameters()))


def test_a_vector_of_another_network_is_refused():
    """By hand: 1 deviation, 24 + 8 in the layers of each, 3 for the action and 3 for the value."""
    vector = np.arange(71, dtype=np.float32)
    split_parameters(vector, 7, (3, 2), 1)
    with pytest.raises(InvalidInputError, match="expected a state of 71 parameters, got 70"):
        split_parameters(vector[:-1], 7, (3, 2), 1)


class TestModel:
    def test_is_one_of_stable_baselines3_in_file_and_out(self, tmp_path):
        training, state = begun(AWKWARD)
        training.model.save(tmp_path / "model.zip")
        plain = PPO.load(tmp_path / "model.zip", device="cpu")
        assert type(plain) is PPO
        seen = training.env.restore(state.episodes, state.failed)
        for first, second in zip(
            training.model.predict(seen, deterministic=True)[:1],
            plain.predict(seen, deterministic=True)[:1],
            strict=True,
        ):
            np.testing.assert_array_equal(first, second)
        plain.set_env(training.env)
        plain.learn(AWKWARD.steps_per_iteration, reset_num_timesteps=False)
        assert plain.num_timesteps == training.model.num_timesteps + AWKWARD.steps_per_iteration
        steps = {float(state["step"]) for state in plain.policy.optimizer.state.values()}
        assert steps == {3 * 3 * 3}


class TestParameters:
    def test_are_in_the_order_of_the_policy(self):
        training, state = begun(AWKWARD, 0)
        parts = split_parameters(state.parameters, 48, AWKWARD.net_arch, 5)
        theirs = {name: p.detach().numpy() for name, p in training.model.policy.named_parameters()}
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
        training = PPOTraining(AWKWARD)
        drawn = initial_parameters(np.random.default_rng(0), 48, AWKWARD.net_arch, 5, 0.0)
        theirs, ours = (
            split_parameters(vector, 48, AWKWARD.net_arch, 5)
            for vector in (training.model.parameters(), drawn)
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


def deviations_in_replays(**changes):
    """Actions of a rollout less their means, and whether they are the first of an episode."""
    noise = {"log_std_init": -4.0, "final_log_std": -4.0, "replay_log_std": -1.0}
    config = replace(AWKWARD, replay_share=0.5, learning_rate=1e-12, **noise, **changes)
    training = PPOTraining(config)
    state = training.initial_state()
    for _ in range(6):
        state = training.iterate(state)
    model, buffer = training.model, training.model.rollout_buffer
    seen = torch.from_numpy(buffer.observations.reshape(-1, buffer.observations.shape[-1]))
    with torch.no_grad():
        means = model.policy.get_distribution(seen).distribution.mean.numpy()
    return buffer.actions.reshape(means.shape) - means, buffer.episode_starts.reshape(-1) == 1


def is_wide(deviations):
    return np.abs(deviations).max(axis=1) > 0.12  # 6.5 narrow deviations


def test_replays_are_explored_with_more_noise():
    deviations, _ = deviations_in_replays()
    wide = is_wide(deviations)
    assert 0.2 < wide.mean() < 0.8
    assert deviations[wide].std() == pytest.approx(np.exp(-1), rel=0.2)
    assert deviations[~wide].std() == pytest.approx(np.exp(-4), rel=0.2)


def test_the_noise_of_replays_ends_after_some_steps():
    deviations, first = deviations_in_replays(replay_noise_steps=1)
    wide = is_wide(deviations)
    assert wide.any()
    assert not wide[~first].any()
    assert not wide[first].all()  # some are new

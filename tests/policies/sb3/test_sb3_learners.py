"""Algorithms of Stable-Baselines3 as learners: the same as ``learn``, step by step."""

import numpy as np
import pytest

from kinarm.errors import InvalidInputError
from kinarm.evaluation.commands import train
from kinarm.policies import (
    Policy,
    load_checkpoint,
    recipe,
    save_checkpoint,
    sb3_vec_env,
    train_policy,
)

QUICK = {"learning_starts": 40, "batch_size": 16, "policy_kwargs": {"net_arch": [16, 16]}}
LEARNERS = {
    "a2c": {"n_envs": 4, "iterations": 33, "normalize": True},
    "ddpg": {"n_envs": 2, "iterations": 60, "hyperparameters": QUICK},
    "sac": {"n_envs": 2, "iterations": 50, "hyperparameters": QUICK},
    "sb3-ppo": {"n_envs": 4, "iterations": 20, "hyperparameters": {"n_steps": 16, "batch_size": 8}},
    "td3": {"n_envs": 2, "iterations": 60, "action_noise": 0.1, "hyperparameters": QUICK},
    "tqc": {
        "n_envs": 2,
        "iterations": 100,
        "hindsight": True,
        "hyperparameters": {**QUICK, "learning_starts": 150},
    },
    "trpo": {"n_envs": 4, "iterations": 20, "hyperparameters": {"n_steps": 16, "batch_size": 8}},
}


def config_of(name, **changes):
    pytest.importorskip("sb3_contrib" if name in ("tqc", "trpo") else "stable_baselines3")
    return recipe(name, problem="right", seed=5, **{**LEARNERS[name], **changes})


def weights_of(policy):
    return b"".join(layer.weights.tobytes() + layer.bias.tobytes() for layer in policy.layers)


@pytest.mark.parametrize("name", LEARNERS)
def test_every_algorithm_trains_a_policy(name):
    config = config_of(name)
    result = train_policy(config)
    assert [point.environment_steps for point in result.curve[:3]] == [
        config.n_envs * (number + 1) for number in range(3)
    ]
    assert len(result.curve) == config.iterations
    made = result.policy.provenance
    assert (made.algorithm, made.recipe, made.seed) == (name, "default*", 5)
    assert made.config["hyperparameters"] == config.hyperparameters


@pytest.mark.parametrize("name", ["a2c", "sac"])
def test_it_learns_what_the_library_learns_by_itself(name):
    config = config_of(
        name, learning_rate_schedule="linear", hyperparameters={"learning_rate": 0.01}
    )
    import stable_baselines3
    from stable_baselines3.common.utils import LinearSchedule
    from stable_baselines3.common.vec_env import VecNormalize

    from kinarm.policies.sb3.training import alone_in_torch

    env = sb3_vec_env("right", config.n_envs)
    if config.normalize:
        env = VecNormalize(env, norm_reward=False)
    given = {**config.hyperparameters, "learning_rate": LinearSchedule(0.01, 0.0, 1.0)}
    kind = getattr(stable_baselines3, name.upper())
    with alone_in_torch():
        model = kind("MlpPolicy", env, seed=5, device="cpu", **given)
        model.learn(config.iterations * config.n_envs)
    trained = train_policy(config)
    assert trained.curve[-1].environment_steps == model.num_timesteps
    assert weights_of(trained.policy) == weights_of(Policy.from_sb3(model))


def test_it_resumes_exactly_and_leaves_the_global_generators_alone(tmp_path):
    config, states = config_of("sac"), []
    whole = train_policy(config, on_iteration=states.append)
    before = np.random.get_state()[1].tobytes()  # noqa: NPY002
    save_checkpoint(tmp_path / "c.npz", config, states[29])
    loaded, state = load_checkpoint(tmp_path / "c.npz")
    assert (loaded, state.iteration) == (config, 30)
    resumed = train_policy(loaded, state=state)
    assert weights_of(resumed.policy) == weights_of(whole.policy)
    ends = (np.array(result.curve)[-3:, :4] for result in (resumed, whole))  # wall times aside
    np.testing.assert_array_equal(*ends)
    assert np.random.get_state()[1].tobytes() == before  # noqa: NPY002


@pytest.mark.parametrize(("error", "raised"), [(ValueError, InvalidInputError), (OSError, OSError)])
def test_what_goes_wrong_in_a_step_is_raised_where_it_was_asked_for(monkeypatch, error, raised):
    pytest.importorskip("stable_baselines3")
    from kinarm.policies.sb3.vec_env import SB3VecEnv

    def fail(env):
        raise error("no more")

    config = config_of("a2c")
    monkeypatch.setattr(SB3VecEnv, "step_wait", fail)
    with pytest.raises(raised, match="no more"):
        train_policy(config)


def test_goals_that_hindsight_replaces_are_not_normalised():
    config = config_of("tqc", normalize=True)
    from kinarm.policies.sb3.training import sb3_model

    model = sb3_model(config)
    assert model.get_vec_normalize_env().norm_obs_keys == ["observation"]
    assert Policy.from_sb3(model, config.problem).n_observations == 48


def test_the_command_takes_hyperparameters(tmp_path):
    pytest.importorskip("stable_baselines3")
    given = ("--iterations", "12", "--hyperparameters", "gamma = 0.9, n_steps = 3")
    with pytest.raises(SystemExit) as end:
        train.main(["a2c", *given, "--out", str(tmp_path / "p.npz")])
    assert end.value.code == 0
    made = Policy.load(tmp_path / "p.npz").provenance
    assert made.config["iterations"] == 12
    assert made.config["hyperparameters"] == {"gamma": 0.9, "n_steps": 3}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"hyperparameters": {"gama": 1}}, "a2c: .*unexpected keyword argument 'gama'"),
        ({"learning_rate_schedule": "linear"}, "needs hyperparameters.learning_rate"),
        ({"n_envs": 0}, "n_envs must"),
        ({"algorithm": "dqn"}, "unknown algorithm 'dqn'"),
    ],
)
def test_what_is_refused(changes, message):
    pytest.importorskip("stable_baselines3")
    with pytest.raises(InvalidInputError, match=message):
        train_policy(recipe("a2c", **changes))


def test_a_recipe_file_and_a_change_replace_the_hyperparameters_that_they_name(tmp_path):
    (tmp_path / "mine.toml").write_text('base = "tuned"\n[hyperparameters]\ngamma = 0.5\n')
    tuned = recipe("sac", "tuned").hyperparameters
    assert recipe("sac", tmp_path / "mine.toml").hyperparameters == {**tuned, "gamma": 0.5}
    assert recipe("sac", "tuned", hyperparameters={"tau": 1.0}).hyperparameters == {
        **tuned,
        "tau": 1.0,
    }


def test_hyperparameters_of_hyperparameters_keep_the_others(tmp_path):
    (tmp_path / "mine.toml").write_text(
        'base = "hindsight"\nhyperparameters.policy_kwargs.net_arch = [8]\n'
    )
    kept = {**recipe("tqc", "hindsight").hyperparameters["policy_kwargs"], "net_arch": [8]}
    changed = recipe("tqc", "hindsight", hyperparameters={"policy_kwargs": {"net_arch": [8]}})
    for made in (recipe("tqc", tmp_path / "mine.toml"), changed):
        assert made.hyperparameters["policy_kwargs"] == kept
        assert made.hyperparameters["gamma"] == 0.95

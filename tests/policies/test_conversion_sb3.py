"""Models of Stable-Baselines3 and sb3-contrib as policies, against their own predictions."""

import sys
from functools import partial

import gymnasium
import numpy as np
import pytest

from kinarm.envs import ReachEnv, ReachGoalEnv
from kinarm.errors import InvalidInputError, MissingExtraError, PolicyFileError
from kinarm.policies import Policy
from kinarm.policies.conversion.models import sb3_model
from kinarm.problem import PROBLEMS
from kinarm.simulator import Simulator

sb3 = pytest.importorskip("stable_baselines3")
torch = pytest.importorskip("torch")
from stable_baselines3.common import vec_env  # noqa: E402
from torch import nn  # noqa: E402

RIGHT = PROBLEMS["right"].pinned
MAKE = {"MlpPolicy": partial(ReachEnv, "right"), "MultiInputPolicy": partial(ReachGoalEnv, "right")}


def algorithm(name):
    library = pytest.importorskip("sb3_contrib") if name in ("TQC", "TRPO") else sb3
    return getattr(library, name)


def make_model(name, policy="MlpPolicy", env=None, **settings):
    """A model whose parameters are random, as after a long training."""
    if name not in ("PPO", "A2C", "TRPO"):
        settings["buffer_size"] = 10
    env = vec_env.DummyVecEnv([MAKE[policy]]) if env is None else env
    model = algorithm(name)(policy, env, seed=5, device="cpu", **settings)
    torch.manual_seed(0)
    with torch.no_grad():
        for parameter in model.policy.parameters():
            parameter.add_(0.05 * torch.randn_like(parameter))
    return model


def normalized(policy="MlpPolicy", steps=60, **settings):
    """An environment with statistics of random motions."""
    env = vec_env.VecNormalize(vec_env.DummyVecEnv([MAKE[policy]]), **settings)
    env.seed(0)
    env.reset()
    rng = np.random.default_rng(0)
    for _ in range(steps):
        env.step(rng.uniform(-1, 1, (1, 5)))
    env.training = False
    return env


@pytest.fixture(scope="module")
def observations():
    """What 1000 arms see, and the simulator that they are of."""
    simulator = Simulator("right", threads=1)
    return simulator.world.observe(*simulator.sample(np.random.default_rng(1), 1000))


def predictions(model, observations):
    """What a model does, and its environment shows it."""
    env = model.get_env()
    shown = env.get_attr("interface")[0].observe(observations)
    if model.get_vec_normalize_env() is not None:
        shown = model.get_vec_normalize_env().normalize_obs(shown)
    return model.predict(shown, deterministic=True)[0]


def check_same(model, policy, observations):
    expected = predictions(model, observations)
    np.testing.assert_allclose(policy(observations), expected, rtol=0, atol=1e-5)
    assert expected.std(axis=0).min() > 1e-3


@pytest.mark.parametrize(
    ("policy", "normalize"), [("MlpPolicy", True), ("MultiInputPolicy", False)]
)
@pytest.mark.parametrize("name", ["PPO", "A2C", "SAC", "TD3", "DDPG", "TQC", "TRPO"])
def test_acts_as_the_model(name, policy, normalize, observations, tmp_path):
    env = normalized(policy) if normalize else None
    model = make_model(name, policy, env)
    converted = Policy.from_sb3(model)
    check_same(model, converted, observations)
    assert ("hardtanh" in converted.activations) == normalize
    made = converted.provenance
    assert (made.algorithm, made.recipe, made.seed) == (name.lower(), "sb3", 5)
    assert made.problem == RIGHT
    assert made.config["gamma"] == 0.99
    model.save(tmp_path / "model.zip")
    statistics = None
    if normalize:
        statistics = tmp_path / "statistics.pkl"
        env.save(statistics)
    loaded = Policy.from_sb3(str(tmp_path / "model.zip"), "right", statistics)
    np.testing.assert_array_equal(loaded(observations), converted(observations))
    assert (loaded.provenance.algorithm, loaded.provenance.seed) == (name.lower(), 5)


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("PPO", {"net_arch": []}),
        ("PPO", {"net_arch": [7]}),
        ("PPO", {"net_arch": {"pi": [20, 9], "vf": []}, "share_features_extractor": False}),
        ("PPO", {"activation_fn": nn.ELU}),
        ("A2C", {"activation_fn": nn.LeakyReLU}),
        ("SAC", {"net_arch": {"pi": [], "qf": [8]}}),
        ("TD3", {"net_arch": [12], "activation_fn": nn.SiLU}),
        ("TQC", {"net_arch": [12, 6], "activation_fn": nn.Tanh}),
    ],
)
def test_networks_of_any_layers(name, settings, observations, tmp_path):
    model = make_model(name, policy_kwargs=settings)
    check_same(model, Policy.from_sb3(model), observations)
    model.save(tmp_path / "model")
    check_same(model, Policy.from_sb3(tmp_path / "model.zip", "right"), observations)


@pytest.mark.parametrize(
    ("name", "settings"),
    [("PPO", {}), ("PPO", {"squash_output": True}), ("SAC", {}), ("SAC", {"clip_mean": 0.1})],
)
def test_state_dependent_exploration(name, settings, observations, tmp_path):
    model = make_model(name, use_sde=True, policy_kwargs=settings)
    check_same(model, Policy.from_sb3(model), observations)
    model.save(tmp_path / "model.zip")
    check_same(model, Policy.from_sb3(tmp_path / "model.zip", "right"), observations)


def test_a_trained_model_in_compiled_rollouts(observations, tmp_path):
    env = normalized()
    model = make_model("PPO", env=env, n_steps=64, batch_size=32, n_epochs=2)
    env.training = True
    model.learn(128)
    policy = Policy.from_sb3(model)
    check_same(model, policy, observations)
    assert policy.provenance.environment_steps == 128
    assert policy.provenance.config["vec_normalize"] == "VecNormalize of its environment"
    simulator = Simulator("right", threads=1)
    starts, goals = simulator.sample(np.random.default_rng(3), 64)
    compiled = simulator.rollout(policy, starts, goals)
    called = simulator.rollout(lambda seen: predictions(model, seen), starts, goals)
    # Along 64 steps, differences of float32 add up.
    same = compiled.steps == called.steps
    assert same.mean() > 0.95
    np.testing.assert_allclose(compiled.distance[same], called.distance[same], rtol=0, atol=1e-4)
    policy.save(tmp_path / "model.npz")
    np.testing.assert_array_equal(
        Policy.load(tmp_path / "model.npz")(observations), policy(observations)
    )


class TestNormalization:
    def test_some_keys_alone(self, observations):
        env = normalized("MultiInputPolicy", norm_obs_keys=["observation"], clip_obs=2.0)
        model = make_model("PPO", "MultiInputPolicy", env)
        check_same(model, Policy.from_sb3(model), observations)

    def test_a_clip_that_cannot_happen_is_left_out(self, observations):
        model = make_model("PPO", env=normalized(clip_obs=np.inf))
        policy = Policy.from_sb3(model)
        assert "hardtanh" not in policy.activations
        check_same(model, policy, observations)

    def test_a_clip_that_is_often_reached(self, observations):
        model = make_model("PPO", env=normalized(clip_obs=0.5, epsilon=1e-3))
        check_same(model, Policy.from_sb3(model), observations)

    def test_rewards_alone(self, observations):
        model = make_model("PPO", env=normalized(norm_obs=False))
        policy = Policy.from_sb3(model)
        assert "hardtanh" not in policy.activations
        check_same(model, policy, observations)

    def test_what_is_given_comes_before_what_the_environment_has(self, observations):
        model, other = make_model("PPO", env=normalized()), normalized(steps=200)
        policy = Policy.from_sb3(model, vec_normalize=other)
        expected = model.predict(other.normalize_obs(observations), deterministic=True)[0]
        np.testing.assert_allclose(policy(observations), expected, rtol=0, atol=1e-5)

    def test_missing_ones_of_a_loaded_model_are_asked_for(self, tmp_path):
        """Its environment had them, and is not in the file."""
        make_model("PPO", env=normalized(), n_steps=64).learn(64).save(tmp_path / "model.zip")
        loaded = sb3.PPO.load(tmp_path / "model.zip", device="cpu")
        with pytest.raises(InvalidInputError, match="were normalised: give their statistics"):
            Policy.from_sb3(loaded, "right")
        assert Policy.from_sb3(loaded, "right", "none").problem == RIGHT

    def test_that_of_other_observations_is_refused(self):
        model = make_model("PPO")
        with pytest.raises(InvalidInputError, match="statistics of other observations"):
            Policy.from_sb3(model, vec_normalize=normalized("MultiInputPolicy"))


class TestProblem:
    @pytest.mark.parametrize("kind", ["DummyVecEnv", "SubprocVecEnv"])
    def test_is_that_of_the_environment(self, kind):
        harder = PROBLEMS["left"].replace(tolerance=0.03)
        env = getattr(vec_env, kind)([partial(ReachEnv, harder)])
        try:
            policy = Policy.from_sb3(make_model("PPO", env=env))
        finally:
            env.close()
        assert policy.problem.digest == harder.digest

    def test_can_be_another_one(self):
        env = vec_env.DummyVecEnv([partial(ReachEnv, "right", tolerance=0.03)])
        assert Policy.from_sb3(make_model("PPO", env=env), "right").problem == RIGHT

    def test_is_never_guessed(self, tmp_path):
        make_model("PPO").save(tmp_path / "model.zip")
        with pytest.raises(InvalidInputError, match="does not say which problem it is for: give"):
            Policy.from_sb3(tmp_path / "model.zip")


class Wrapped(gymnasium.Wrapper):
    """An arm with other spaces."""

    def __init__(self, observation=None, action=None, env=None):
        super().__init__(env or ReachEnv("right"))
        self.observation_space = observation or self.env.observation_space
        self.action_space = action or self.env.action_space


def box(*shape):
    return gymnasium.spaces.Box(-1.0, 1.0, shape, dtype=np.float64)


class CustomFeatures(sb3.common.torch_layers.FlattenExtractor):
    """Features that are not the observation."""


class CustomPolicy(sb3.common.policies.ActorCriticPolicy):
    """Actions that the network does not show."""

    def _predict(self, observation, deterministic=False):
        return -super()._predict(observation, deterministic)


class TestRefused:
    def check(self, model, message):
        with pytest.raises(InvalidInputError, match=message) as caught:
            Policy.from_sb3(model, "right")
        assert "\n" not in str(caught.value)

    def of_spaces(self, **spaces):
        env = vec_env.DummyVecEnv([partial(Wrapped, **spaces)])
        return sb3.PPO("MlpPolicy", env, device="cpu")

    def test_recurrent(self):
        contrib = pytest.importorskip("sb3_contrib")
        env = vec_env.DummyVecEnv([MAKE["MlpPolicy"]])
        self.check(contrib.RecurrentPPO("MlpLstmPolicy", env, device="cpu"), "recurrent")

    def test_another_family(self):
        contrib = pytest.importorskip("sb3_contrib")
        env = vec_env.DummyVecEnv([MAKE["MlpPolicy"]])
        self.check(contrib.ARS("LinearPolicy", env, device="cpu"), "cannot convert the policy ARS")

    def test_features(self):
        model = make_model("PPO", policy_kwargs={"features_extractor_class": CustomFeatures})
        self.check(model, "computes features of observations .CustomFeatures.")

    def test_another_function(self):
        model = make_model("PPO", policy_kwargs={"activation_fn": nn.GELU})
        self.check(model, "cannot convert GELU.*; what can be converted: Sequential, Linear, Tanh")

    def test_what_the_network_does_not_show(self):
        env = vec_env.DummyVecEnv([MAKE["MlpPolicy"]])
        model = sb3.PPO(CustomPolicy, env, device="cpu")
        with torch.no_grad():
            model.policy.action_net.bias.fill_(0.3)
        self.check(model, "does more than its network shows .CustomPolicy.")

    def test_other_actions(self):
        self.check(self.of_spaces(action=box(4)), "arm 'paper' takes 5 numbers from -1 to 1")
        wide = gymnasium.spaces.Box(-2.0, 2.0, (5,))
        self.check(self.of_spaces(action=wide), "arm 'paper' takes 5 numbers from -1 to 1")

    def test_goals_in_other_boxes(self):
        """Its observations are a dictionary as ours, whose parts are not; or no dictionary."""
        for own in ({"desired_goal": box(2)}, {"observation": box(9)}):
            spaces = {**ReachGoalEnv("right").observation_space.spaces, **own}
            env = vec_env.DummyVecEnv(
                [partial(Wrapped, gymnasium.spaces.Dict(spaces), None, ReachGoalEnv("right"))]
            )
            model = sb3.PPO("MultiInputPolicy", env, device="cpu")
            (name,) = own
            self.check(model, f"the model's observations, .*{name} \\({own[name].shape[0]},\\)")

    def test_an_environment_that_is_none_of_ours(self):
        env = vec_env.DummyVecEnv([lambda: gymnasium.make("Pendulum-v1")])
        assert sb3_model(sb3.PPO("MlpPolicy", env, device="cpu")).problem is None

    def test_a_frame_stack(self):
        env = vec_env.VecFrameStack(vec_env.DummyVecEnv([MAKE["MlpPolicy"]]), 4)
        self.check(sb3.PPO("MlpPolicy", env, device="cpu"), "a wrapper that changes observations")

    @pytest.mark.parametrize("space", [box(7), box(50)])
    def test_other_observations(self, space):
        self.check(self.of_spaces(observation=space), "not those of arm 'paper'")


class TestBadFile:
    @pytest.fixture
    def saved(self, tmp_path):
        make_model("A2C").save(tmp_path / "model.zip")
        return tmp_path / "model.zip"

    def test_no_model(self, tmp_path):
        (tmp_path / "broken.zip").write_bytes(b"PK\x03\x04junk")
        with pytest.raises(PolicyFileError, match="broken.zip' is not a complete"):
            Policy.from_sb3(tmp_path / "broken.zip", "right")
        with pytest.raises(PolicyFileError, match="cannot read model .*gone.zip': No such file"):
            Policy.from_sb3(tmp_path / "gone.zip", "right")

    def test_without_sb3_contrib(self, tmp_path, monkeypatch):
        make_model("TQC").save(tmp_path / "model.zip")
        for name in [each for each in sys.modules if each.startswith("sb3_contrib")]:
            monkeypatch.delitem(sys.modules, name)
        monkeypatch.setitem(sys.modules, "sb3_contrib", None)
        with pytest.raises(MissingExtraError, match="sb3-contrib is not installed.*zoo"):
            Policy.from_sb3(tmp_path / "model.zip", "right")

    def test_without_stable_baselines3(self, saved, monkeypatch):
        monkeypatch.setitem(sys.modules, "stable_baselines3.common.save_util", None)
        with pytest.raises(MissingExtraError, match="stable-baselines3 is not installed.*sb3"):
            Policy.from_sb3(saved, "right")

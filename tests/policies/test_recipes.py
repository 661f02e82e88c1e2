"""Named settings."""

import inspect

import pytest

from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.policies import (
    ARSConfig,
    PPOConfig,
    find_learner,
    recipe,
)

ARS_RECIPES, PPO_RECIPES = find_learner("ars").recipes, find_learner("ppo").recipes


def test_paper_is_table_1():
    config = recipe("ars", "paper")
    assert (config.step_size, config.noise) == (0.02, 0.03)
    assert (config.directions, config.top_directions) == (24, 12)
    assert (config.horizon, config.iterations) == (64, 800)
    assert config.normalize
    assert config.scale_by_deviation
    assert (config.sharing, config.episodes) == ("none", 1)
    assert (config.collision_penalty, config.success_bonus, config.step_reward) == (-1, 0, 0)
    assert config.step_size_schedule == "constant"


def test_paper_is_the_default():
    assert recipe("ars", "paper", recipe="custom") == ARSConfig()


def test_names():
    assert {"paper", "tuned", "v1", "brs"} <= set(ARS_RECIPES)
    for name, config in ARS_RECIPES.items():
        assert config.recipe == name


def test_v1_and_brs_lack_the_augmentations():
    v1, brs = recipe("ars", "v1"), recipe("ars", "brs")
    assert (v1.normalize, v1.scale_by_deviation) == (False, True)
    assert (brs.normalize, brs.scale_by_deviation) == (False, False)
    for config in (v1, brs):
        assert config.top_directions == config.directions


def test_settings_replace_those_of_the_recipe():
    config = recipe("ars", "tuned", task="both", seed=4, iterations=None)
    assert (config.task, config.seed) == ("both", 4)
    assert config.iterations == ARS_RECIPES["tuned"].iterations


def test_unknown_recipe_lists_the_recipes():
    with pytest.raises(UnknownNameError, match="unknown recipe 'best'; available: paper, tuned"):
        recipe("ars", "best")


def test_unknown_learner_lists_the_learners():
    with pytest.raises(UnknownNameError, match="unknown learner 'sac'; available: ars, ppo"):
        recipe("sac", "paper")


def test_unknown_setting_is_refused():
    words = "unknown setting of ars 'learning_rate'; available: task, arm, seed"
    with pytest.raises(UnknownNameError, match=words):
        recipe("ars", "paper", learning_rate=1)


def test_bad_setting_is_refused():
    with pytest.raises(InvalidInputError, match="directions"):
        recipe("ars", "paper", directions=0)


def test_a_changed_recipe_says_so():
    assert recipe("ars", "tuned", task="left", seed=3, arm="paper_flange").recipe == "tuned"
    assert recipe("ars", "tuned", noise=0.5).recipe == "tuned*"
    assert recipe("ars", "tuned", noise=0.5, recipe="mine").recipe == "mine"
    assert recipe("ars", "tuned", noise=ARS_RECIPES["tuned"].noise).recipe == "tuned"


def test_tuned_adapts_to_two_benches():
    assert recipe("ars", "tuned", task="both").collision_penalty == -1
    assert recipe("ars", "tuned", task="right").collision_penalty == -2
    assert recipe("ars", "tuned", task="both", collision_penalty=-3.0).collision_penalty == -3


class TestPPO:
    @pytest.mark.parametrize("name", ["paper", "tuned"])
    def test_all_take_the_papers_steps(self, name):
        config = recipe("ppo", name, task="both", seed=2)
        assert config.environment_steps == 1_200_000
        assert (config.recipe, config.task, config.seed) == (name, "both", 2)
        assert config.horizon == 64

    def test_paper_has_the_papers_reward(self):
        config = recipe("ppo", "paper")
        assert (config.collision_penalty, config.success_bonus, config.step_reward) == (-1, 0, 0)
        assert (config.tolerance, config.start_spread) == (0.05, 1)
        assert config.start_spread_at(0) == 1
        assert not config.symmetric

    def test_paper_has_the_defaults_of_stable_baselines3(self):
        """All but those of arms and batches."""
        sb3 = pytest.importorskip("stable_baselines3")
        defaults = {
            name: parameter.default
            for name, parameter in inspect.signature(sb3.PPO.__init__).parameters.items()
        }
        config = recipe("ppo", "paper")
        for ours, theirs in {
            "learning_rate": "learning_rate",
            "epochs": "n_epochs",
            "gamma": "gamma",
            "gae_lambda": "gae_lambda",
            "clip_range": "clip_range",
            "entropy_weight": "ent_coef",
            "value_weight": "vf_coef",
            "max_grad_norm": "max_grad_norm",
        }.items():
            assert getattr(config, ours) == defaults[theirs], ours
        assert config.hidden == (64, 64)
        assert (config.initial_log_std, config.learning_rate_schedule) == (0, "constant")

    def test_names(self):
        assert set(PPO_RECIPES) == {"paper", "tuned"}
        assert all(config.recipe == name for name, config in PPO_RECIPES.items())
        assert PPO_RECIPES["paper"] == PPOConfig(recipe="paper")

    def test_unknown_recipe_lists_the_recipes(self):
        with pytest.raises(UnknownNameError, match="unknown recipe 'v1'; available: paper, tuned"):
            recipe("ppo", "v1")

    def test_a_changed_recipe_says_so(self):
        assert recipe("ppo", "tuned", gamma=0.5).recipe == "tuned*"
        assert recipe("ppo", "tuned", gamma=None, iterations=600).recipe == "tuned"

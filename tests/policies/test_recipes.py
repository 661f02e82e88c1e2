"""Named settings."""

import pytest

from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.policies import ARS_RECIPES, ARSConfig, ars_recipe


def test_paper_is_table_1():
    config = ars_recipe("paper")
    assert (config.step_size, config.noise) == (0.02, 0.03)
    assert (config.directions, config.top_directions) == (24, 12)
    assert (config.horizon, config.iterations) == (64, 800)
    assert config.normalize
    assert config.scale_by_deviation
    assert (config.sharing, config.episodes) == ("none", 1)
    assert (config.collision_penalty, config.success_bonus, config.step_reward) == (-1, 0, 0)
    assert config.step_size_schedule == "constant"


def test_paper_is_the_default():
    assert ars_recipe("paper", recipe="custom") == ARSConfig()


def test_names():
    assert {"paper", "tuned", "v1", "brs"} <= set(ARS_RECIPES)
    for name, config in ARS_RECIPES.items():
        assert config.recipe == name


def test_v1_and_brs_lack_the_augmentations():
    v1, brs = ars_recipe("v1"), ars_recipe("brs")
    assert (v1.normalize, v1.scale_by_deviation) == (False, True)
    assert (brs.normalize, brs.scale_by_deviation) == (False, False)
    for config in (v1, brs):
        assert config.top_directions == config.directions


def test_settings_replace_those_of_the_recipe():
    config = ars_recipe("tuned", task="both", seed=4, iterations=None)
    assert (config.task, config.seed) == ("both", 4)
    assert config.iterations == ARS_RECIPES["tuned"].iterations


def test_unknown_recipe_lists_the_recipes():
    with pytest.raises(UnknownNameError, match="unknown recipe 'best'; available: paper, tuned"):
        ars_recipe("best")


def test_unknown_setting_is_refused():
    with pytest.raises((InvalidInputError, TypeError), match="learning_rate"):
        ars_recipe("paper", learning_rate=1)


def test_bad_setting_is_refused():
    with pytest.raises(InvalidInputError, match="directions"):
        ars_recipe("paper", directions=0)


def test_a_changed_recipe_says_so():
    assert ars_recipe("tuned", task="left", seed=3, arm="paper_flange").recipe == "tuned"
    assert ars_recipe("tuned", noise=0.5).recipe == "tuned*"
    assert ars_recipe("tuned", noise=0.5, recipe="mine").recipe == "mine"
    assert ars_recipe("tuned", noise=ARS_RECIPES["tuned"].noise).recipe == "tuned"


def test_tuned_adapts_to_two_benches():
    assert ars_recipe("tuned", task="both").collision_penalty == -1
    assert ars_recipe("tuned", task="right").collision_penalty == -2
    assert ars_recipe("tuned", task="both", collision_penalty=-3.0).collision_penalty == -3

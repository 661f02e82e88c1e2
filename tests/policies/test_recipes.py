"""Named settings."""

import inspect
from dataclasses import fields, replace

import pytest

from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.policies import find_learner, recipe
from kinarm.problem import PROBLEMS
from kinarm.task import RewardWeights

ARS_RECIPES, PPO_RECIPES = find_learner("ars").recipes, find_learner("ppo").recipes


def test_paper_is_table_1():
    config = recipe("ars", "paper")
    assert (config.step_size, config.noise) == (0.02, 0.03)
    assert (config.directions, config.top_directions) == (24, 12)
    assert (config.problem.task.horizon, config.iterations) == (64, 800)
    assert config.normalize
    assert config.scale_by_deviation
    assert (config.sharing, config.episodes) == ("none", 1)
    assert config.training_problem == config.problem == PROBLEMS["right"]
    assert config.step_size_schedule == "constant"


def test_v1_and_brs_lack_the_augmentations():
    v1, brs = recipe("ars", "v1"), recipe("ars", "brs")
    assert (v1.normalize, v1.scale_by_deviation) == (False, True)
    assert (brs.normalize, brs.scale_by_deviation) == (False, False)
    for config in (v1, brs):
        assert config.top_directions == config.directions


def test_unknown_setting_is_refused():
    words = "unknown setting of ars 'learning_rate'; available: problem, reward, seed"
    with pytest.raises(UnknownNameError, match=words):
        recipe("ars", "paper", learning_rate=1)


def test_a_changed_recipe_says_so():
    assert recipe("ars", "tuned", problem="left", seed=3).recipe == "tuned"
    assert recipe("ars", "tuned", noise=0.5).recipe == "tuned*"
    assert recipe("ars", "tuned", noise=0.5, recipe="mine").recipe == "mine"
    assert recipe("ars", "tuned", noise=ARS_RECIPES["tuned"].noise).recipe == "tuned"


def test_tuned_is_the_same_on_two_benches():
    both, right = (recipe("ars", "tuned", problem=problem) for problem in ("both", "right"))
    assert both == replace(right, problem=both.problem)
    changed = recipe("ars", "tuned", problem="both", reward={"collision": -3.0})
    assert changed.reward == RewardWeights(collision=-3, success=0.5)
    assert changed.recipe == "tuned*"


def test_weights_replace_those_of_the_task_if_the_recipe_has_none():
    problem = PROBLEMS["left"].replace(reward={"step": -0.5})
    changed = recipe("ars", "paper", problem=problem, reward={"success": 2.0})
    assert changed.reward == RewardWeights(step=-0.5, success=2.0)


class TestPPO:
    def test_paper_takes_the_papers_steps(self):
        config = recipe("ppo", "paper", problem="both", seed=2)
        assert config.iterations * config.steps_per_iteration == 1_200_000
        assert (config.recipe, config.problem, config.seed) == ("paper", PROBLEMS["both"], 2)

    def test_paper_has_the_defaults_of_stable_baselines3(self):
        """All but those of arms and batches."""
        sb3 = pytest.importorskip("stable_baselines3")
        defaults = {
            name: parameter.default
            for name, parameter in inspect.signature(sb3.PPO.__init__).parameters.items()
        }
        config = recipe("ppo", "paper")
        other = {"n_steps", "batch_size", "seed"}
        shared = {item.name for item in fields(config)} & set(defaults) - other
        assert {"learning_rate", "n_epochs", "gamma", "gae_lambda", "clip_range"} <= shared
        assert {"ent_coef", "vf_coef", "max_grad_norm"} <= shared
        assert {name: getattr(config, name) for name in shared} == {n: defaults[n] for n in shared}
        assert config.net_arch == (64, 64)
        assert (config.log_std_init, config.learning_rate_schedule) == (0, "constant")


class TestFile:
    """Settings from TOML."""

    @pytest.fixture
    def write(self, tmp_path):
        def write(text, name="mine.toml"):
            (tmp_path / name).write_text(text)
            return tmp_path / name

        return write

    def test_the_rest_is_that_of_the_base(self, write):
        path = write('base = "tuned"\niterations = 9\nnoise = 1\n[reward]\nsuccess = 2\n')
        config = recipe("ars", path, problem="left", seed=4)
        expected = recipe("ars", "tuned", problem="left", seed=4, iterations=9, noise=1.0)
        weights = RewardWeights(collision=-4, success=2)
        assert config == replace(expected, recipe="mine", reward=weights)

    def test_without_base_it_is_the_papers(self, write):
        assert recipe("ars", write("")) == recipe("ars", "paper", recipe="mine")
        path = write("net_arch = [8, 4]\ntraining_tolerance = 0.02\n")
        expected = recipe("ppo", net_arch=(8, 4), training_tolerance=0.02, recipe="mine")
        assert recipe("ppo", path) == expected

    def test_changes_are_on_top(self, write):
        path = write("noise = 0.5\n")
        assert recipe("ars", path, noise=0.25).recipe == "mine*"
        assert recipe("ars", path, noise=0.5).recipe == "mine"

    @pytest.mark.parametrize(
        ("text", "words"),
        [
            ("speed = 3", "mine.toml: unknown key 'speed' .did you mean 'seed'"),
            ("[reward]\nbonus = 1", "mine.toml: unknown key 'reward.bonus'; available: progress"),
            (
                'base = "taught"',
                "mine.toml: base must be one of paper, tuned, linear, best, v1, brs, got 'taught'",
            ),
            ("seed = 8", "mine.toml: a recipe has no seed; give it as --seed"),
            ("noise =", "mine.toml: not a recipe file: "),
        ],
    )
    def test_one_line_says_what_is_wrong(self, write, text, words):
        with pytest.raises(InvalidInputError, match=words) as caught:
            recipe("ars", write(text))
        assert len(str(caught.value).splitlines()) == 1

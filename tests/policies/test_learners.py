"""The registry of learners, and its contract held by the toy of the docs: one file, one line."""

import importlib
from pathlib import Path

import pytest

from kinarm.errors import InvalidInputError
from kinarm.policies import (
    TrainingConfig,
    find_learner,
    learner_names,
    learners,
    load_checkpoint,
    recipe,
    save_checkpoint,
    train_policy,
)

TOY = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "toy_learner.py"


@pytest.fixture
def toy(monkeypatch):
    """The module of the toy, which an installed package names."""
    monkeypatch.syspath_prepend(TOY.parent)
    monkeypatch.setattr(learners, "_installed", lambda: {"toy": "toy_learner:LEARNER"})
    return importlib.import_module("toy_learner")


def test_names():
    assert {"ars", "ppo", "a2c", "ddpg", "sac", "sb3-ppo", "td3", "tqc", "trpo"} <= set(
        learner_names()
    )
    for name in learner_names():
        learner = find_learner(name)
        assert learner.name == name
        for key, config in learner.recipes.items():
            assert (type(config), config.recipe) == (learner.config, key)
            assert find_learner(config.learner) is learner
        assert list(learner.summaries) == list(learner.recipes)
        assert recipe(name).recipe == learner.first_recipe


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("toy", "unknown learner 'toy'; available: ars, ppo, .*, module:LEARNER"),
        ("nowhere:LEARNER", "cannot import learner 'nowhere:LEARNER': No module named 'nowhere'"),
        ("kinarm.task:LEARNER", "cannot import learner .* has no attribute 'LEARNER'"),
        ("kinarm.task:ReachTask", "learner 'kinarm.task:ReachTask' is no kinarm.policies.Learner"),
    ],
)
def test_what_is_no_learner(name, message):
    with pytest.raises(InvalidInputError, match=message):
        find_learner(name)


def test_settings_of_nobody():
    with pytest.raises(InvalidInputError, match="cannot import learner"):
        train_policy(TrainingConfig())


def test_a_learner_is_found_by_its_module_or_by_the_name_that_a_package_gives_it(toy):
    assert find_learner("toy") is find_learner("toy_learner:LEARNER") is toy.LEARNER
    assert "toy" in learner_names()


def test_the_library_trains_it(toy):
    states = []
    config = recipe("toy", problem="left", seed=4, iterations=5)
    result = train_policy(config, on_iteration=states.append)
    assert [state.iteration for state in states] == [1, 2, 3, 4, 5]
    assert result.policy.provenance.algorithm == "toy"
    assert result.policy.problem.name == "left"
    assert result.state is states[-1]
    assert result.state.score == max(point.mean_return for point in result.curve)


@pytest.mark.parametrize("stopped_after", [0, 2, 5])
def test_its_checkpoints_resume_exactly(toy, tmp_path, stopped_after):
    config = recipe("toy", "wide", iterations=5)
    states = [toy.ToyTraining(config).initial_state()]
    whole = train_policy(config, on_iteration=states.append)
    save_checkpoint(tmp_path / "c.npz", config, states[stopped_after])
    loaded, state = load_checkpoint(tmp_path / "c.npz")
    assert (loaded, state.iteration) == (config, stopped_after)
    assert state.score == states[stopped_after].score
    resumed = train_policy(loaded, state=state)
    assert [point[:4] for point in resumed.curve] == [point[:4] for point in whole.curve]
    assert resumed.policy.layers[0].weights.tobytes() == whole.policy.layers[0].weights.tobytes()
    assert resumed.policy.provenance == whole.policy.provenance

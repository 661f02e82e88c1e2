"""Trial sets: what they depend on, what they do not, and that they are legal."""

import numpy as np
import pytest

from kinarm.errors import ProblemError
from kinarm.evaluation.trials import TrialSet, trial_generator
from kinarm.problem import PROBLEMS
from kinarm.scene import PAPER_BENCHES, Obstacle, Scene


def draw(problem="both", trials=7, seed=3, **overrides):
    return TrialSet.draw(PROBLEMS[problem].replace(**overrides), trials, seed)


def same(one: TrialSet, other: TrialSet) -> bool:
    return np.array_equal(one.starts, other.starts) and np.array_equal(one.goals, other.goals)


def test_a_problem_by_name_file_or_object(tmp_path):
    PROBLEMS["both"].save(tmp_path / "mine.toml")
    for problem in ("both", tmp_path / "mine.toml", PROBLEMS["both"]):
        trials = TrialSet.draw(problem, 7, seed=3)
        assert same(trials, draw())
        assert trials.digest == draw().digest


def test_a_small_set_is_the_beginning_of_a_large_one():
    few, many = draw(trials=3), draw(trials=11)
    np.testing.assert_array_equal(many.starts[:3], few.starts)
    np.testing.assert_array_equal(many.goals[:3], few.goals)


def test_streams_of_randomness_are_independent_of_each_other():
    numbers = [
        trial_generator(seed, trial, stream).random()
        for seed in (0, 1)
        for trial in (0, 1, 2)
        for stream in (0, 1)
    ]
    assert len(set(numbers)) == len(numbers)


@pytest.mark.parametrize("arm", ["paper", "paper_flange", "lrmate200ic_5l"])
def test_starts_are_legal(arm):
    trials = draw(trials=60, arm=arm)
    loaded = trials.simulator.arm
    assert (loaded.lower <= trials.starts).all()
    assert (trials.starts <= loaded.upper).all()
    assert (trials.starts[:, loaded.n_actuated :] == 0).all()
    assert not trials.simulator.world.contact_model.in_contact(trials.starts).any()
    tools = np.array([loaded.tool_position(start) for start in trials.starts])
    assert (np.linalg.norm(tools - trials.goals, axis=1) > 0.05).all()


@pytest.mark.parametrize(("problem", "side"), [("right", -1), ("left", 1)])
def test_goals_lie_in_the_region_of_the_task(problem, side):
    x, y, z = draw(problem, trials=100).goals.T
    assert (np.abs(x) <= 0.5).all()
    assert ((side * y >= 0.55) & (side * y <= 0.75)).all()
    np.testing.assert_allclose(z, 0.325, atol=1e-12)
    assert x.min() < -0.4
    assert x.max() > 0.4


@pytest.mark.parametrize(
    "other",
    [
        {"seed": 4},
        {"problem": "left"},
        {"arm": "lrmate200ic_5l"},
        {"trials": 8},
        {"tolerance": 0.04},
        {"horizon": 65},
    ],
)
def test_digest_tells_different_trials_apart(other):
    assert draw().digest != draw(**other).digest


def test_digest_depends_on_obstacles_that_the_starts_do_not_show():
    far = Obstacle(name="far", lower=(5, 5, 0), upper=(6, 6, 1))
    other = draw(scene=Scene(obstacles=(*PAPER_BENCHES, far)))
    assert same(draw(), other)
    assert draw().digest != other.digest


@pytest.mark.parametrize("other", [{"name": "mine"}, {"reward": {"success": 4}}])
def test_digest_does_not_depend_on_names_and_rewards(other):
    assert draw().digest == draw(**other).digest


def test_a_scene_without_free_starts_is_refused():
    block = Obstacle(name="block", lower=(0.5, -0.1, 0.6), upper=(0.7, 0.1, 0.8))
    with pytest.raises(ProblemError, match=r"no contact-free start .* touches"):
        draw("right", scene=Scene(obstacles=(block,)), start_spread=0.0)

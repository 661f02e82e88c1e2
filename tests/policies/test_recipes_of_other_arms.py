"""Recipes for arms of another size, and for those that are not their own mirror image."""

import re
from dataclasses import replace

import numpy as np
import pytest

from kinarm.policies import find_learner, recipe, train_policy
from kinarm.problem import PROBLEMS, ReachProblem

SCALE = 0.5
"""A power of two, by which lengths are scaled without rounding."""


@pytest.fixture(scope="module")
def half_right(shipped_arms, tmp_path_factory):
    """The problem ``right`` with all lengths halved: those of arm, scene and tolerance."""
    text = shipped_arms["paper"].description.path.read_text()
    lengths = re.compile(r'(?<!<axis )\b(xyz|radius|length|size)="([^"]*)"')
    path = tmp_path_factory.mktemp("half") / "half.urdf"
    path.write_text(lengths.sub(lambda found: f'{found[1]}="{halved(found[2])}"', text))
    right = PROBLEMS["right"]
    parts = {
        name: tuple(
            replace(part, lower=shrunk(part.lower), upper=shrunk(part.upper))
            for part in getattr(right.scene, name)
        )
        for name in ("obstacles", "goal_regions")
    }
    scene = replace(right.scene, cube_edge=SCALE * right.scene.cube_edge, **parts)
    return right.replace(arm=path, scene=scene, tolerance=SCALE * right.task.tolerance)


def halved(numbers):
    return " ".join(repr(SCALE * float(number)) for number in numbers.split())


def shrunk(point):
    return tuple(SCALE * number for number in point)


@pytest.mark.parametrize(("learner", "name"), [("ars", "tuned"), ("ppo", "best")])
@pytest.mark.parametrize("problem", sorted(PROBLEMS))
def test_for_the_papers_arm_nothing_is_scaled(learner, name, problem):
    made, named = recipe(learner, name, problem=problem), find_learner(learner).recipes[name]
    assert made.reward.progress == {"tuned": 1.0, "best": 5.0}[name]
    assert made.net_arch == named.net_arch
    assert made.symmetric
    assert getattr(made, "training_tolerance", 0.0006) == 0.0006


OURS = [
    (learner, name)
    for learner in ("ars", "ppo")
    for name in find_learner(learner).recipes
    if name not in ("paper", "v1", "brs")
]
"""Learners and recipes that are not those of papers."""


@pytest.mark.parametrize(("learner", "name"), OURS)
def test_every_recipe_of_ours_is_adapted(half_right, learner, name):
    half, whole = (recipe(learner, name, problem=problem) for problem in (half_right, "right"))
    assert half.recipe == name
    assert half.reward.progress == whole.reward.progress / SCALE
    of_whole = getattr(whole, "training_tolerance", None)
    expected = None if of_whole is None else pytest.approx(SCALE * of_whole)
    assert getattr(half, "training_tolerance", None) == expected


def test_progress_counts_in_the_arms_reach(half_right):
    assert half_right.load_arm().reach == pytest.approx(SCALE * 1.263671568590896)
    for learner in ("ars", "ppo"):
        made = recipe(learner, "best", problem=half_right)
        original = recipe(learner, "best", problem="right")
        scaled = original.training_problem.task.reward.progress / SCALE
        assert made.reward == replace(original.reward, progress=scaled)


def test_ppo_learns_the_same_in_a_world_of_half_the_size(half_right):
    small = {"iterations": 12, "n_epochs": 2, "seed": 2, "residual": False}
    half = train_policy(recipe("ppo", "quick", problem=half_right, **small))
    whole = train_policy(recipe("ppo", "quick", problem="right", **small))
    for ours, theirs in zip(half.curve, whole.curve, strict=True):
        assert ours.environment_steps == theirs.environment_steps
        assert ours.success == pytest.approx(theirs.success, nan_ok=True)
        assert ours.mean_return == pytest.approx(theirs.mean_return, rel=1e-4, nan_ok=True)
    assert half.curve[-1].mean_return > half.curve[4].mean_return  # it has learnt something
    for ours, theirs in zip(half.policy.layers, whole.policy.layers, strict=True):
        np.testing.assert_allclose(ours.weights, theirs.weights, rtol=0, atol=1e-4)


def test_where_no_reflection_helps():
    scene = PROBLEMS["both"].scene
    lopsided = PROBLEMS["both"].replace(scene=replace(scene, obstacles=scene.obstacles[:1]))
    ars = recipe("ars", "tuned", problem=lopsided)
    assert recipe("ars", "linear", problem=lopsided).net_arch == ()
    assert (ars.recipe, ars.net_arch, ars.symmetric) == ("tuned", (16,), False)
    ours = find_learner("ppo").recipes
    unchanged = replace(ours["best"], problem=lopsided, symmetric=False)
    assert recipe("ppo", "best", problem=lopsided) == unchanged


def test_regions_that_are_images_of_each_other_count_once():
    """However often each is drawn; where none is the other's image, both count."""
    uneven = recipe("ars", "tuned", problem=PROBLEMS["both"].replace(goal_weights=(1.0, 2.0)))
    assert (uneven.symmetric, uneven.net_arch) == (True, ())
    scene = PROBLEMS["both"].scene
    right, left = scene.goal_regions
    shorter = replace(left, upper=(left.upper[0] - 0.1, *left.upper[1:]))
    unlike = PROBLEMS["both"].replace(scene=replace(scene, goal_regions=(right, shorter)))
    assert recipe("ars", "tuned", problem=unlike).net_arch == (16,)


@pytest.mark.parametrize(
    "asked",
    [
        {"goal_noise": (0.0, 0.01)},
        {"goal": {"kind": "pose"}},
        {"goal": {"sequence": 3}},
        {"scene": ReachProblem.load("crossing-paper").scene},
    ],
    ids=str,
)
def test_where_more_is_asked(asked):
    harder = recipe("ppo", "best", problem=PROBLEMS["both"].replace(**asked))
    assert (harder.training_tolerance, harder.training_hold) == (0.03, 1)
    assert harder.reward.collision == -5.0


def test_where_scenes_differ():
    """Bodies that move ask for more, but not for this."""
    scene = ReachProblem.load("obstacles-ur5").scene
    other = PROBLEMS["both"].replace(scene=scene, goal_regions=("around",))
    asked = PROBLEMS["both"], ReachProblem.load("crossing-paper"), other
    rates = [recipe("ppo", "best", problem=problem).learning_rate for problem in asked]
    assert rates == [1e-3, 1e-3, 5e-5]


@pytest.mark.parametrize("asked", [{"noise": 0.01}, {"goal": {"hold": 10}}], ids=str)
def test_where_points_stand(asked):
    problem = PROBLEMS["both"].replace(**asked)
    assert recipe("ppo", "best", problem=problem) == replace(
        recipe("ppo", "best", problem="both"), problem=problem
    )

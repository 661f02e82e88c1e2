"""Benches, scenes and goal regions."""

import dataclasses

import numpy as np
import pytest

from kinarm.errors import ProblemError, UnknownNameError
from kinarm.scene import Bench, Scene


def bench(**changes):
    return Bench(**{"name": "table", "x": (0.0, 1.0), "y": (-1.0, 0.5), "height": 0.4, **changes})


def test_default_scene_is_the_papers():
    scene = Scene()
    assert scene.ground
    assert scene.cube_edge == 0.05
    right, left = scene.bench("right"), scene.bench("left")
    np.testing.assert_array_equal(right.lower, [-0.5, -0.75, 0])
    np.testing.assert_array_equal(right.upper, [0.5, -0.55, 0.3])
    np.testing.assert_array_equal(left.lower, [-0.5, 0.55, 0])
    np.testing.assert_array_equal(left.upper, [0.5, 0.75, 0.3])


def test_benches_are_mirror_images():
    right, left = Scene().bench("right"), Scene().bench("left")
    assert right.x == left.x
    assert right.y == (-left.y[1], -left.y[0])


def test_cube_centre_lies_half_an_edge_above_the_bench():
    lower, upper = Scene().goal_region("left")
    np.testing.assert_allclose(lower, [-0.5, 0.55, 0.325])
    np.testing.assert_allclose(upper, [0.5, 0.75, 0.325])
    high, _ = Scene(benches=(bench(),), cube_edge=0.2).goal_region("table")
    np.testing.assert_allclose(high, [0, -1, 0.5])


def test_unknown_bench_lists_the_benches():
    with pytest.raises(UnknownNameError, match="bench 'middle'; available: right, left"):
        Scene().bench("middle")
    with pytest.raises(UnknownNameError, match="bench 'middle'"):
        Scene().goal_region("middle")


@pytest.mark.parametrize(
    "changes",
    [
        {"x": (1.0, 0.0)},
        {"x": (0.0, 0.0)},
        {"y": (0.5, -1.0)},
        {"height": 0},
        {"height": -0.3},
    ],
)
def test_empty_bench_is_refused(changes):
    with pytest.raises(ProblemError, match="bench 'table' is empty.*expected lower < upper"):
        bench(**changes)


@pytest.mark.parametrize(
    "changes", [{"x": (float("nan"), 1.0)}, {"y": (0.0, float("inf"))}, {"height": float("inf")}]
)
def test_bench_must_be_finite(changes):
    with pytest.raises(ProblemError, match="bench 'table' has a bound that is not finite"):
        bench(**changes)


def test_bench_names_must_differ():
    with pytest.raises(ProblemError, match=r"names must differ, got \['table', 'table'\]"):
        Scene(benches=(bench(), bench(height=1.0)))


@pytest.mark.parametrize("edge", [-0.01, float("nan"), float("inf")])
def test_cube_edge_must_be_a_length(edge):
    with pytest.raises(ProblemError, match="cube_edge"):
        Scene(cube_edge=edge)


@pytest.mark.parametrize("value", [Scene(), Scene().bench("left")])
def test_frozen(value):
    with pytest.raises(dataclasses.FrozenInstanceError):
        value.name = "other"


def test_equal_scenes_compare_and_hash_equal():
    assert Scene(benches=(bench(),)) == Scene(benches=(bench(),))
    assert hash(Scene()) == hash(Scene())
    assert Scene(ground=False) != Scene()

"""Reflection about the x-z plane, and policies that commute with it."""

from dataclasses import replace

import numpy as np
import pytest

from kinarm.errors import InvalidInputError
from kinarm.policies import ARSConfig, train_policy
from kinarm.policies.mirror import Mirror, is_symmetric
from kinarm.policies.normalizer import Normalizer
from kinarm.scene import LEFT_BENCH, RIGHT_BENCH, Bench, Scene
from kinarm.simulator import Simulator

TINY = ARSConfig(
    task="both", symmetric=True, directions=4, top_directions=2, iterations=4, horizon=16
)
OPPOSITE = np.array([1, -1, 1])


@pytest.fixture(scope="module")
def mirror(simulator):
    return Mirror.of(simulator)


def test_axes_about_x_or_z_are_reversed(mirror):
    np.testing.assert_array_equal(mirror.axes, [-1, 1, 1, -1, 1, -1])
    np.testing.assert_array_equal(mirror.actions, [-1, 1, 1, -1, 1])


def test_observations_of_mirror_images(mirror, simulator):
    rng = np.random.default_rng(0)
    starts, goals = simulator.sample(rng, 100)
    seen = simulator.reset(starts, goals).observation
    mirrored = simulator.reset(starts * mirror.axes, goals * OPPOSITE).observation
    np.testing.assert_allclose(mirrored, seen * mirror.observations, rtol=0, atol=1e-12)


def test_arm_that_is_not_symmetric_is_refused(simulators):
    with pytest.raises(InvalidInputError, match="'made' is not its own mirror image"):
        Mirror.of(simulators["sliding"])


def test_scenes_that_are_symmetric():
    scene = Scene()
    assert is_symmetric(scene, ("left", "right"))
    assert not is_symmetric(scene, ("left",))
    higher = Bench(name="right", x=RIGHT_BENCH.x, y=RIGHT_BENCH.y, height=0.4)
    assert not is_symmetric(Scene(benches=(LEFT_BENCH, higher)), ("left", "right"))
    middle = Bench(name="middle", x=(0.5, 0.7), y=(-0.2, 0.2), height=0.3)
    assert is_symmetric(Scene(benches=(middle,)), ("middle",))


def test_statistics_are_those_of_the_data_and_its_mirror_image():
    rng = np.random.default_rng(1)
    data, signs = rng.normal([1, 2, 3], size=(500, 3)), np.array([1.0, -1.0, 1.0])
    seen = Normalizer(500, data.mean(axis=0), 500 * data.var(axis=0)).mirrored(signs)
    both = np.concatenate([data, data * signs])
    np.testing.assert_allclose(seen.mean, both.mean(axis=0), atol=1e-12)
    np.testing.assert_allclose(seen.std, both.std(axis=0), rtol=1e-12)


def test_symmetric_policy_does_on_one_side_what_it_does_on_the_other(mirror):
    policy = train_policy(TINY).policy
    simulator = Simulator("paper", "both", threads=1)
    starts, goals = simulator.sample(np.random.default_rng(2), 100)
    first = simulator.rollout(policy, starts, goals, record=True)
    second = simulator.rollout(policy, starts * mirror.axes, goals * OPPOSITE, record=True)
    np.testing.assert_array_equal(first.steps, second.steps)
    np.testing.assert_array_equal(first.collision, second.collision)
    np.testing.assert_allclose(first.paths * mirror.axes, second.paths, rtol=0, atol=1e-9)


def test_symmetric_policy_has_half_the_parameters(mirror):
    weights = train_policy(TINY).policy.layers[0].weights
    np.testing.assert_array_equal(weights[~mirror.weights], 0)
    assert (weights[mirror.weights] != 0).mean() > 0.8
    assert mirror.weights.mean() == pytest.approx(0.5, abs=0.1)


def test_single_bench_is_trained_without_symmetry(mirror):
    weights = train_policy(replace(TINY, task="right")).policy.layers[0].weights
    assert (weights[~mirror.weights] != 0).any()


def test_observations_reflected_to_the_right(mirror, simulator):
    seen = simulator.world.observe(*simulator.sample(np.random.default_rng(3), 50))
    left = mirror.seen_on_the_left(seen)
    np.testing.assert_array_equal(left, seen[:, 1] > 0)
    assert 10 < left.sum() < 40
    reflected = mirror.to_the_right(seen)
    np.testing.assert_array_equal(reflected[~left], seen[~left])
    np.testing.assert_array_equal(reflected[left], seen[left] * mirror.observations)
    assert not mirror.seen_on_the_left(reflected).any()

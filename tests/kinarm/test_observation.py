"""The observation: its table, held against Pinocchio, the reference and reflections by hand."""

import itertools

import numpy as np
import pinocchio as pin
import pytest
from configurations import random_configurations
from hypothesis import given, settings
from hypothesis import strategies as st

from kinarm.observation_layout import ObservationLayout, observation_layout
from kinarm.observation_part import Ranges
from kinarm.problem import PROBLEMS

REFLECTION = np.array([1.0, -1.0, 1.0])


@pytest.fixture
def situations(any_simulator):
    """Random configurations and goals of an arm, and the observations of them."""
    q = random_configurations(any_simulator, 1, 200)
    goals = np.random.default_rng(2).normal(size=(200, 3))
    return q, goals, any_simulator.world.observe(q, goals)


class TestParts:
    def test_equal_pinocchio(self, any_simulator, situations):
        arm, world = any_simulator.arm, any_simulator.world
        places = world.layout.places
        data = arm.model.createData()
        distances = world.distances(*situations[:2])
        for q, goal, seen, distance in zip(*situations, distances, strict=True):
            pin.forwardKinematics(arm.model, data, q)
            tool = arm.tool_position(q)
            np.testing.assert_array_equal(seen[places["goal"]], goal)
            offset = seen[places["goal_minus_tool"]]
            np.testing.assert_allclose(offset, goal - tool, rtol=0, atol=1e-12)
            positions = np.concatenate([data.oMi[k + 1].translation for k in range(arm.n_joints)])
            np.testing.assert_allclose(seen[places["position"]], positions, rtol=0, atol=1e-12)
            quaternions = seen[places["orientation"]].reshape(-1, 4)
            for k, (w, x, y, z) in enumerate(quaternions):
                rotation = pin.Quaternion(w, x, y, z).matrix()
                np.testing.assert_allclose(rotation, data.oMi[k + 1].rotation, rtol=0, atol=1e-12)
            assert distance == pytest.approx(np.linalg.norm(goal - tool), abs=1e-12)


class TestTable:
    @pytest.mark.parametrize("n_joints", [1, 3, 6, 7])
    def test_parts_fill_the_observation_one_after_the_other(self, n_joints):
        layout = ObservationLayout.sized(PROBLEMS["right"], n_joints, n_joints)
        slices = list(layout.places.values())
        assert slices[0].start == 0
        for before, after in itertools.pairwise(slices):
            assert before.stop == after.start
        assert slices[-1].stop == layout.size == 6 + 7 * n_joints
        assert len(layout.signs(np.ones(n_joints))) == layout.size

    def test_layout_names_version_parts_and_lengths(self):
        layout = "1: goal 3, goal_minus_tool 3, orientation 4n, position 3n"
        assert observation_layout(PROBLEMS["right"]) == layout


class TestSigns:
    def test_are_those_of_the_reflection_by_pinocchio(self, any_simulator, situations):
        """A frame R, p reflected about y = 0 is S R S, S p with S = diag(1, -1, 1)."""
        arm = any_simulator.arm
        layout = any_simulator.world.layout
        places, signs = layout.places, layout.signs(np.ones(arm.n_joints))
        data = arm.model.createData()
        for q, goal, seen in zip(*situations, strict=True):
            reflected = seen * signs
            pin.forwardKinematics(arm.model, data, q)
            np.testing.assert_array_equal(reflected[places["goal"]], REFLECTION * goal)
            offset = REFLECTION * (goal - arm.tool_position(q))
            np.testing.assert_allclose(reflected[places["goal_minus_tool"]], offset, atol=1e-12)
            positions = reflected[places["position"]].reshape(-1, 3)
            quaternions = reflected[places["orientation"]].reshape(-1, 4)
            for k, (w, x, y, z) in enumerate(quaternions):
                rotation = REFLECTION[:, None] * data.oMi[k + 1].rotation * REFLECTION
                np.testing.assert_allclose(
                    pin.Quaternion(w, x, y, z).matrix(), rotation, rtol=0, atol=1e-12
                )
                np.testing.assert_allclose(
                    positions[k], REFLECTION * data.oMi[k + 1].translation, atol=1e-12
                )


class TestBounds:
    @settings(max_examples=40)
    @given(st.integers(0, 2**32 - 1), st.sampled_from(["paper", "lrmate200ic_5l", "sliding"]))
    def test_contain_every_observation(self, simulators, seed, name):
        world, rng = simulators[name].world, np.random.default_rng(seed)
        lower = rng.normal(size=3)
        upper = lower + rng.random(3)
        ranges = Ranges(lower, upper, world.arm.reach, world.arm.lower, world.arm.upper, np.ones(5))
        low, high = world.layout.bounds(ranges)
        q = rng.uniform(world.arm.lower, world.arm.upper, (50, world.arm.n_joints))
        seen = world.observe(q, rng.uniform(lower, upper, (50, 3)))
        assert (seen >= low).all()
        assert (seen <= high).all()

    def test_by_hand(self):
        lower, upper = np.array([0.0, -1, 2]), np.array([1.0, 0, 3])
        layout = ObservationLayout.sized(PROBLEMS["right"], 1, 1)
        low, high = layout.bounds(Ranges(lower, upper, 0.5, *np.ones((3, 1))))
        np.testing.assert_array_equal(low[:6], [0, -1, 2, -0.5, -1.5, 1.5])
        np.testing.assert_array_equal(high[:6], [1, 0, 3, 1.5, 0.5, 3.5])
        np.testing.assert_allclose([low[6:10], high[6:10]], [[-1] * 4, [1] * 4], atol=2e-6)
        np.testing.assert_array_equal([low[10:], high[10:]], [[-0.5] * 3, [0.5] * 3])

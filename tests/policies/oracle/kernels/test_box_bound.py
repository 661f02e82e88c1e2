"""Bounds over boxes, held against configurations in them; lanes, against numbers."""

import numpy as np
import pytest
from configurations import random_configurations
from hanging_chain import LENGTHS, tips
from numba import njit
from proofs import within

from kinarm.chain import MotionBounds
from kinarm.kernels.kinematics import POSE, point_jacobian
from kinarm.kernels.lanes import LANES, as_lanes, select
from kinarm.policies.oracle.kernels.box_proofs import (
    closest_step,
    curved_bound,
    joint_bound,
    offset_from_goal,
    overlaps,
    trim,
)


@njit
def examine(chain, shapes, bounds, goal, cutoff, wanted, q, half, lower, upper, results, work):
    """Distance, bounds, share left, and whether contact is proven, for a box or one in each lane.

    The corners are trimmed, and the centre moves to where the linear model is closest to the goal.
    """
    poses, offset, jacobian, step, scale, slope, least, bend = work
    results[0] = offset_from_goal(chain, q, goal, poses, offset)
    tool = (goal[0] + offset[0], goal[1] + offset[1], goal[2] + offset[2])
    point_jacobian(chain, poses, tool, jacobian)
    direction = closest_step(jacobian, offset, half, step, scale)
    linear = (poses, jacobian, offset, direction, half)
    bound = curved_bound(chain, bounds.curvature, *linear, slope, least, bend)
    results[1] = bound
    results[2] = joint_bound(bounds, poses, goal, half)
    results[3] = trim(max(bound, cutoff), bound, slope, least, bend, q, half, lower, upper)
    for i in range(len(half)):
        q[0, i] = q[0, i] + step[i]
    touching = overlaps(wanted, chain, shapes, poses, half, 1.0, jacobian)
    results[4] = select(touching, 1.0, 0.0)


@njit
def examine_lanes(chain, shapes, bounds, goal, cutoff, arrays, work):
    q, half, lower, upper, results = arrays
    poses, offset, jacobian, step, scale, slope, least, bend = work
    lanes = as_lanes(half)
    examine(
        chain,
        shapes,
        bounds,
        goal,
        cutoff,
        lanes[0] >= 0.0,
        as_lanes(q),
        lanes,
        as_lanes(lower),
        as_lanes(upper),
        as_lanes(results),
        (
            as_lanes(poses),
            as_lanes(offset),
            as_lanes(jacobian),
            as_lanes(step),
            as_lanes(scale),
            as_lanes(slope),
            as_lanes(least),
            as_lanes(bend),
        ),
    )


def work_space(simulator, *lanes):
    n, n_joints = simulator.n_actions, simulator.arm.n_joints
    vectors = [np.zeros((n, *lanes)) for _ in range(5)]
    placed = simulator.world.contact_model.shapes.placed
    poses = np.zeros((n_joints + 1 + len(placed), POSE, *lanes))
    poses[n_joints + 1 :].T[...] = placed.T
    return (poses, np.zeros((3, *lanes)), np.zeros((3, n, *lanes)), *vectors)


def drawn_boxes(simulator, seed, count):
    """Centres, half-widths of all sizes, and goals at any distance."""
    rng, n = np.random.default_rng(seed), simulator.n_actions
    centres = random_configurations(simulator, rng, count)
    halves = 10.0 ** rng.uniform(-4, 0, (count, 1)) * rng.random((count, n))
    halves[rng.random((count, n)) < 0.1] = 0.0
    tools = np.array([simulator.arm.tool_position(q) for q in centres])
    goals = tools + 10.0 ** rng.uniform(-4, 0.3, (count, 1)) * rng.normal(size=(count, 3))
    return centres, halves, goals


def examined(simulator, centre, half, goal, cutoff=0.0):
    """Results of `examine`, and the corners that are left."""
    chain, n = simulator.arm.chain, simulator.n_actions
    bounds, shapes = MotionBounds.of(chain, n), simulator.world.contact_model.shapes
    lower, upper, results = centre[:n] - half, centre[:n] + half, np.zeros(5)
    parts = (centre[None].copy(), half, lower, upper, results, work_space(simulator))
    examine(chain, shapes, bounds, tuple(goal), cutoff, True, *parts)
    return results, lower, upper


def distances(simulator, configurations, goal):
    tools, _ = simulator.world.screen(configurations)
    return np.linalg.norm(tools - goal, axis=1)


class TestBounds:
    def test_no_configuration_is_closer(self, any_simulator):
        simulator, rng = any_simulator, np.random.default_rng(1)
        positive = 0
        for centre, half, goal in zip(*drawn_boxes(simulator, 2, 300), strict=True):
            results, lower, upper = examined(simulator, centre, half, goal, np.inf)
            away = distances(simulator, within(lower, upper, centre, rng, 200), goal).min()
            assert results[1] <= away + 1e-12
            assert results[2] <= away + 1e-12
            positive += results[1] > 0
        assert positive > 100

    def test_small_boxes_are_bounded_to_third_order(self, simulator):
        # Of what the closest configuration is away, a fixed share of the cube of the width is lost.
        rng = np.random.default_rng(3)
        for centre, _, goal in zip(*drawn_boxes(simulator, 4, 40), strict=True):
            goal = goal + 0.5
            lost = []
            for width in (0.02, 0.002):
                half = np.zeros(5)
                half[rng.integers(0, 5)] = width
                results, lower, upper = examined(simulator, centre, half, goal, np.inf)
                line = np.linspace(lower, upper, 2001)
                drawn = np.tile(centre, (len(line), 1))
                drawn[:, :5] = line
                lost.append(distances(simulator, drawn, goal).min() - results[1])
            assert lost[0] < 2e-4
            assert lost[1] < 2e-6

    def test_what_is_of_third_order_is_attained(self, hanging):
        simulator, rng, centre = hanging(), np.random.default_rng(8), np.array([2.0, 0, 0, 0])
        # All axes move the tool towards a goal beside it, or away.
        goal, reaches = np.array([1.0, 0, 2 - LENGTHS.sum()]), np.cumsum(LENGTHS[::-1])[::-1]
        for half in rng.uniform(0.01, 0.05, (60, 4)) * rng.integers(0, 2, (60, 4)) * [0, 1, 1, 1]:
            bound = examined(simulator, centre, half, goal, np.inf)[0][1]
            first, second = reaches @ half[1:], np.square(np.cumsum(half[1:])) @ LENGTHS / 2
            beyond = np.linalg.norm(tips(centre + half) - tips(centre) - [-first, second])
            assert beyond <= 1.0 - first - bound + 1e-15
            assert beyond >= 0.99 * (1.0 - first - bound) - 1e-15

    @pytest.mark.parametrize("joint", [1, 2, 3])
    def test_a_closest_configuration_within_a_box_is_attained(self, hanging, joint):
        # The goal is below a chain that hangs down at nine tenths of a half-width.
        half = 0.02 * (np.arange(4) == joint)
        goal, centre = np.array([0, 0, -8 - LENGTHS.sum()]), [2.0, 0, 0, 0] - 0.9 * half
        bound = examined(hanging(), centre, half, goal, np.inf)[0][1]
        assert 10 - 2.5e-6 < bound <= 10

    @pytest.mark.parametrize("half", [(0, 1e-3, 0, 0), (0, 0, 1e-3, 0), (0, 1e-3, 1e-3, 0)])
    def test_the_bound_by_joints_is_attained(self, hanging, half):
        # The last link points to the goal, and the axes move its origin there.
        centre, goal = np.array([2, 0, 0, np.pi / 2]), np.array([-1, 0, 2 - LENGTHS[:2].sum()])
        bound = examined(hanging(), centre, np.array(half), goal, np.inf)[0][2]
        least = np.linalg.norm(tips(centre + half) - goal[[0, 2]])
        assert least - 1e-5 < bound <= least

    def test_no_configuration_as_close_as_the_cutoff_is_cut_off(self, any_simulator):
        simulator, rng, n = any_simulator, np.random.default_rng(9), any_simulator.n_actions
        for centre, _, goal in zip(*drawn_boxes(simulator, 10, 200), strict=True):
            joint = rng.integers(0, n)
            half = 0.01 * (np.arange(n) == joint)
            for side in (-0.99, 0.99):
                q = centre.copy()
                q[joint] += side * half[joint]
                cutoff = distances(simulator, q[None], goal + 10)[0]
                _, lower, upper = examined(simulator, centre, half, goal + 10, cutoff)
                assert lower[joint] - 1e-12 <= q[joint] <= upper[joint] + 1e-12

    def test_what_is_cut_off_is_beyond_the_cutoff(self, any_simulator):
        simulator, rng, cut = any_simulator, np.random.default_rng(5), 0
        for centre, half, goal in zip(*drawn_boxes(simulator, 6, 400), strict=True):
            bound = examined(simulator, centre, half, goal, np.inf)[0][1]
            cutoff = max(bound, 0.0) + 0.5 * rng.random() * half.max()
            results, lower, upper = examined(simulator, centre, half, goal, cutoff)
            n = len(half)
            assert (lower >= centre[:n] - half).all()
            assert (upper <= centre[:n] + half).all()
            drawn = within(centre[:n] - half, centre[:n] + half, centre, rng, 200)
            inside = (drawn[:, :n] >= lower - 1e-12) & (drawn[:, :n] <= upper + 1e-12)
            outside = ~inside.all(axis=1)
            assert (distances(simulator, drawn[outside], goal) > cutoff - 1e-11).all()
            wide = half > 0
            shares = (upper - lower)[wide] / (2 * half[wide])
            assert results[3] == pytest.approx(np.prod(shares), rel=1e-6, abs=1e-12)
            cut += outside.any()
        assert cut > 50


class TestLanes:
    def test_have_the_bits_of_numbers(self, any_simulator):
        simulator, n = any_simulator, any_simulator.n_actions
        chain = simulator.arm.chain
        bounds, shapes = MotionBounds.of(chain, n), simulator.world.contact_model.shapes
        centres, halves, goals = drawn_boxes(simulator, 7, 40 * LANES)
        touching = 0
        for first in range(0, len(centres), LANES):
            some, goal = slice(first, first + LANES), goals[first]
            q, half = centres[some].T[None].copy(), halves[some].T.copy()
            lower, upper, results = q[0, :n] - half, q[0, :n] + half, np.zeros((5, LANES))
            arrays = (q, half, lower, upper, results)
            examine_lanes(
                chain, shapes, bounds, tuple(goal), 0.1, arrays, work_space(simulator, LANES)
            )
            for lane in range(LANES):
                row = first + lane
                alone = examined(simulator, centres[row], halves[row], goal, 0.1)
                together = (results[:, lane], lower[:, lane], upper[:, lane])
                for expected, found in zip(alone, together, strict=True):
                    np.testing.assert_array_equal(found, expected)
            touching += results[4].sum()
        assert touching > 0 or not shapes.exact[: any_simulator.arm.geometry.ngeoms].any()

"""Bounds over boxes, held against configurations in them; lanes, against numbers."""

from functools import cache

import numpy as np
import pinocchio as pin
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
    trim,
)
from kinarm.policies.oracle.kernels.contact_proofs import overlaps
from kinarm.policies.oracle.kernels.rotation import (
    Turn,
    angle_bound,
    axes_jacobian,
    turn_from_goal,
)


@njit
def examine(chain, shapes, bounds, goal, turn, cutoff, wanted, q, half, box, results, work):
    """Distance, bounds, share left, and whether contact is proven, for a box or one in each lane.

    The corners are trimmed, and the centre moves to where the linear model is closest to the goal.
    """
    poses, offset, jacobian, step, scale, slope, least, bend, spin, turned = work
    results[0] = offset_from_goal(chain, q, goal, poses, offset)
    if spin.shape[0] > 0:
        length = turn_from_goal(turn, q.shape[1], poses, turned[0])
        axes_jacobian(chain, turn, poses, turned[0], spin)
        results[0] = max(results[0], length)
        results[5] = angle_bound(turn, length, half)
    tool = (goal[0] + offset[0], goal[1] + offset[1], goal[2] + offset[2])
    point_jacobian(chain, poses, tool, jacobian)
    direction = closest_step(jacobian, offset, half, step, scale, spin, turned, 0.02)
    linear = (poses, jacobian, offset, direction, half, slope, least, bend)
    bound = curved_bound(chain, bounds.curvature, *linear, turn, spin, turned)
    results[1] = bound
    results[2] = joint_bound(bounds, poses, goal, half)
    results[3] = trim(max(bound, cutoff), bound, slope, least, bend, q, half, box)
    for i in range(len(half)):
        q[0, i] = q[0, i] + step[i]
    touching = overlaps(wanted, chain, shapes, poses, half, 1.0, jacobian)
    results[4] = select(touching, 1.0, 0.0)


@njit
def examine_lanes(chain, shapes, bounds, goal, turn, cutoff, arrays, work):
    q, half, box, results = arrays
    poses, offset, jacobian, step, scale, slope, least, bend, spin, turned = work
    lanes = as_lanes(half)
    examine(
        chain,
        shapes,
        bounds,
        goal,
        turn,
        cutoff,
        lanes[0] >= 0.0,
        as_lanes(q),
        lanes,
        as_lanes(box),
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
            as_lanes(spin),
            as_lanes(turned),
        ),
    )


def work_space(simulator, *lanes, n_axes=0):
    n, n_joints = simulator.n_actions, simulator.arm.n_joints
    vectors = [np.zeros((n, *lanes)) for _ in range(5)]
    placed = simulator.world.contact_model.shapes.placed
    poses = np.zeros((n_joints + 1 + len(placed), POSE, *lanes))
    poses[n_joints + 1 :].T[...] = placed.T
    axes = np.zeros((3 * n_axes, n, *lanes)), np.zeros((3, 3 * n_axes, *lanes))
    return (poses, np.zeros((3, *lanes)), np.zeros((3, n, *lanes)), *vectors, *axes)


def no_turn(n):
    """A goal without rotations."""
    return Turn(np.empty((0, 3)), np.empty((0, 3)), 0.0, np.zeros(n))


def drawn_boxes(simulator, seed, count):
    """Centres, half-widths of all sizes, and goals at any distance."""
    rng, n = np.random.default_rng(seed), simulator.n_actions
    centres = random_configurations(simulator, rng, count)
    halves = 10.0 ** rng.uniform(-4, 0, (count, 1)) * rng.random((count, n))
    halves[rng.random((count, n)) < 0.1] = 0.0
    tools = np.array([simulator.arm.tool_position(q) for q in centres])
    goals = tools + 10.0 ** rng.uniform(-4, 0.3, (count, 1)) * rng.normal(size=(count, 3))
    return centres, halves, goals


@cache
def bounds_of(simulator):
    return MotionBounds.of(simulator.arm.chain, simulator.n_actions)


def examined(simulator, centre, half, goal, cutoff=0.0, turn=None):
    """Results of `examine`, and the corners that are left."""
    chain, n = simulator.arm.chain, simulator.n_actions
    turn = no_turn(n) if turn is None else turn
    bounds, shapes = bounds_of(simulator), simulator.world.contact_model.shapes
    box, results = np.concatenate([centre[:n] - half, centre[:n] + half])[None], np.zeros(6)
    space = work_space(simulator, n_axes=len(turn.axes))
    parts = (centre[None].copy(), half, box, results, space)
    examine(chain, shapes, bounds, tuple(goal), turn, cutoff, True, *parts)
    return results, box[0, :n], box[0, n:]


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


class TestRotations:
    """With axes of the tool, the larger one of two lengths is bounded."""

    WEIGHT = 0.3

    def turn(self, simulator, n_axes, rng):
        """Any axes in the last frame, and any directions wanted of them."""
        axes, wanted = (pin.exp3(3 * rng.normal(size=3)).T[:n_axes].copy() for _ in range(2))
        turning = np.where(simulator.arm.chain.prismatic, 0.0, self.WEIGHT)
        return Turn(axes, wanted, self.WEIGHT, turning[: simulator.n_actions])

    def lengths(self, simulator, configurations, goal, turn):
        """By Pinocchio: of the tool's offset, and of angles by their chord."""
        model, data = simulator.arm.model, simulator.arm.model.createData()
        found = []
        for q in configurations:
            pin.forwardKinematics(model, data, q)
            reached = turn.axes @ data.oMi[model.njoints - 1].rotation.T
            angle = np.arccos(np.clip(reached[0] @ turn.wanted[0], -1, 1))
            if len(turn.axes) == 3:
                angle = np.linalg.norm(pin.log3(reached.T @ turn.wanted))
            found.append(2 * self.WEIGHT * np.sin(angle / 2))
        return np.fmax(distances(simulator, configurations, goal), found)

    @pytest.mark.parametrize("n_axes", [1, 3])
    def test_no_configuration_is_closer(self, any_simulator, n_axes):
        simulator, rng = any_simulator, np.random.default_rng(11)
        positive, n = np.zeros(2), simulator.n_actions
        for centre, half, goal in zip(*drawn_boxes(simulator, 12, 80), strict=True):
            turn = self.turn(simulator, n_axes, rng)
            cutoff = 10.0 ** rng.uniform(-3, 0)
            results, lower, upper = examined(simulator, centre, half, goal, cutoff, turn)
            drawn = within(centre[:n] - half, centre[:n] + half, centre, rng, 60)
            away = self.lengths(simulator, np.vstack([centre, drawn]), goal, turn)
            assert results[0] == pytest.approx(away[0], abs=1e-7)
            assert results[1] <= away.min() + 1e-7
            assert results[5] <= away.min() + 1e-7
            kept = ((drawn[:, :n] >= lower - 1e-9) & (drawn[:, :n] <= upper + 1e-9)).all(axis=1)
            assert (away[1:][~kept] > max(results[1], cutoff) - 1e-7).all()
            positive += results[[1, 5]] > 0
        assert (positive > 20).all()

    def test_the_angle_less_the_half_widths_is_attained(self, hanging):
        # Three parallel axes turn the last link towards where it is wanted, or away.
        simulator, half = hanging(), np.array([0.0, 0.1, 0.2, 0.05])
        centre, axes = np.array([2.0, 0, 0, 0]), np.array([[0.0, 0.0, 1.0]])
        axis = simulator.arm.chain.axis[-1]
        axes = np.cross(axis, [[0.3, 0.5, 0.7]])
        axes /= np.linalg.norm(axes)
        for sign in (-1, 1):
            model, data = simulator.arm.model, simulator.arm.model.createData()
            pin.forwardKinematics(model, data, centre)
            turned = data.oMi[model.njoints - 1].rotation @ pin.exp3(sign * axis)
            turn = Turn(axes, axes @ turned.T, 1.0, np.array([0.0, 1.0, 1.0, 1.0]))
            bound = examined(simulator, centre, half, np.array([0, 0, 1.0]), turn=turn)[0][5]
            assert bound == pytest.approx(2 * np.sin((1 - 0.35) / 2), abs=1e-9)

    @pytest.mark.parametrize("n_axes", [1, 3])
    def test_small_boxes_are_bounded_to_third_order(self, simulator, n_axes):
        # Goals at the tool and opposite rotations: what is lost shrinks with the cube of the width.
        rng, lost = np.random.default_rng(13), []
        for width in (0.02, 0.002):
            turn = self.turn(simulator, n_axes, rng)
            centre = random_configurations(simulator, rng, 1)[0]
            half, goal = width * rng.random(5), simulator.arm.tool_position(centre)
            bound = examined(simulator, centre, half, goal, np.inf, turn)[0][1]
            drawn = within(centre[:5] - half, centre[:5] + half, centre, rng, 3000)
            lost.append(self.lengths(simulator, drawn, goal, turn).min() - bound)
        assert -1e-7 < lost[0] < 2e-3
        assert -1e-7 < lost[1] < 2e-4


class TestLanes:
    def test_have_the_bits_of_numbers(self, any_simulator):
        simulator, n = any_simulator, any_simulator.n_actions
        chain = simulator.arm.chain
        bounds, shapes = bounds_of(simulator), simulator.world.contact_model.shapes
        centres, halves, goals = drawn_boxes(simulator, 7, 40 * LANES)
        touching = 0
        for first in range(0, len(centres), LANES):
            some, goal = slice(first, first + LANES), goals[first]
            q, half = centres[some].T[None].copy(), halves[some].T.copy()
            box = np.concatenate([q[0, :n] - half, q[0, :n] + half])[None]
            results = np.zeros((6, LANES))
            arrays = (q, half, box, results)
            turn, space = no_turn(n), work_space(simulator, LANES)
            examine_lanes(chain, shapes, bounds, tuple(goal), turn, 0.1, arrays, space)
            for lane in range(LANES):
                row = first + lane
                alone = examined(simulator, centres[row], halves[row], goal, 0.1)
                together = (results[:, lane], box[0, :n, lane], box[0, n:, lane])
                for expected, found in zip(alone, together, strict=True):
                    np.testing.assert_array_equal(found, expected)
            touching += results[4].sum()
        assert touching > 0 or not shapes.exact[: any_simulator.arm.geometry.ngeoms].any()

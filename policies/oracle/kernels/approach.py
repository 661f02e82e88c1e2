"""How soon the tool can come close to a goal, by branch and bound.

A box of configurations is excluded, or cut, where a lower bound of the distance exceeds what is
asked for. On demand it is excluded, too, if some pair of bodies is proven to overlap throughout
(`kinarm.policies.oracle.kernels.contact_proofs`). Another box is tried where the linear model of
the arm comes closest to the goal, and halved. Boxes are examined side by side, in lanes.
"""

import math
from functools import cache
from typing import Any

import numpy as np
from numba import types

from kinarm.chain import Chain, MotionBounds
from kinarm.contact_shapes import ContactShapes
from kinarm.kernels.compiling import Array, Vector, inlined, lean_kernel
from kinarm.kernels.kinematics import POSE, place_bodies, point_jacobian
from kinarm.kernels.lane_copies import put, take
from kinarm.kernels.lanes import LANES, any_lane, as_numbers, lane_bits, lanes
from kinarm.kernels.records import Fixed, Layout
from kinarm.kernels.work_space import ONE, THREE
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

WAITING = 4096
"""Boxes that can wait; halving eight until they are too small takes fewer."""

SMALLEST = 1e-6
"""How far the tool can move in the smallest box [m]."""

ROUNDING = 1e-9
"""Added to boxes and distances to cover rounding [rad, m]."""

AIMED = 0.9
"""Share of the tolerance that boxes are separated from, where rotation counts."""

STEP_ROUNDING = 2.0**-51
"""Most that a step rounds a joint's position by, as a share of its largest one."""


@cache
def layout(n: int, n_joints: int, n_placed: int, n_axes: int) -> Layout:
    """Work space for boxes of the first n joints, in a scene of ``n_placed`` bodies.

    ``n_axes`` is 0 where only positions count; kernels are compiled for that.

    All are arrays of lanes, but for ``lever``; `kinarm.kernels.lanes.as_numbers`
    adds an axis, that of the boxes.
    """
    rows = 3 * n_axes if n_axes > 0 else Fixed(0)
    shapes = {
        # A row of the stack: lower and upper corner [rad or m].
        # Half-widths, and the share that is left.
        "box": (ONE, 2 * n),
        "half": (n,),
        "share": (ONE,),
        # Centre, and a configuration tried [rad or m]; their poses.
        **dict.fromkeys(("q", "tried"), (ONE, n_joints)),
        **dict.fromkeys(("poses", "between"), (n_joints + 1 + n_placed, Fixed(POSE))),
        # Distances from the goal of these two [m].
        "distance": (Fixed(2),),
        # Jacobians of the tool and of a point of the arm [m/rad, or m/m].
        **dict.fromkeys(("jacobian", "turns"), (THREE, n)),
        # Vector from the goal to the tool; step, scale, slope, least and bend of `curved_bound`.
        "model": (Fixed(6), max(n, 3)),
        # Entries of axes: Jacobian [m/rad]; apart, aside and twist of `curved_bound`.
        "spin": (rows, n),
        "turned": (Fixed(3), rows),
    }
    arrays = {name: (lanes, shape) for name, shape in shapes.items()}
    # How far each joint moves the tool, or what counts as that [m/rad, or m/m].
    return Layout("Boxes", {**arrays, "lever": (types.float64, (n,))})


@inlined
def drift(chain: Chain, joint: int, steps: int) -> float:
    """How far steps may lead beyond their limits, by rounding [rad or m]."""
    farthest = max(abs(chain.lower[joint]), abs(chain.upper[joint]))
    return max(ROUNDING, steps * STEP_ROUNDING * farthest)


@inlined
def within_steps(
    chain: Chain,
    allowed: Array,
    start: Array,
    step_limit: Array,
    steps: int,
    lower: Array,
    upper: Array,
) -> None:
    """Fill in corners of what joints can reach in some steps, and may."""
    for i in range(step_limit.shape[0]):
        reach = steps * step_limit[i] + drift(chain, i, steps)
        lower[i] = max(allowed[0, i], start[i] - reach)
        upper[i] = min(allowed[1, i], start[i] + reach)


@inlined
def halve(stack: Array, row: int, lane: int, boxes: Any) -> bool:
    """Put the halves of a lane's box into the stack, that of the point tried on top.

    It is cut across the joint that moves the tool farthest. Returns whether it is large enough.
    """
    lever, box = boxes.lever, as_numbers(boxes.box)
    n = lever.shape[0]
    widest, farthest = 0, -1.0
    for i in range(n):
        moved = lever[i] * (box[0, n + i, lane] - box[0, i, lane])
        if moved > farthest:
            widest, farthest = i, moved
    if farthest < SMALLEST:
        return False
    middle = 0.5 * (box[0, widest, lane] + box[0, n + widest, lane])
    take(boxes.box, 0, lane, stack, row)
    take(boxes.box, 0, lane, stack, row + 1)
    # The last box is examined next.
    near_lower = as_numbers(boxes.tried)[0, widest, lane] <= middle
    above, below = (row, row + 1) if near_lower else (row + 1, row)
    stack[above, widest] = middle
    stack[below, n + widest] = middle
    return True


@lean_kernel
def search(
    chain: Chain,
    bounds: MotionBounds,
    shapes: ContactShapes,
    start: Array,
    goal: Vector,
    turn: Turn,
    allowed: Array,
    step_limit: Array,
    fewest: int,
    most: int,
    enough: float,
    contact: bool,
    budget: int,
    lower: Array,
    upper: Array,
    best: Array,
    stack: Array,
    block: Any,
) -> tuple[bool, int]:
    """Search for the configuration close enough to a goal in the fewest steps.

    The distance of a goal with rotations is that of the tool or of its axes,
    whichever is larger.

    Parameters
    ----------
    chain, bounds, shapes
        The arm, bounds of its motion, and what may touch.
    start, goal, turn, step_limit
        The arm's start, shape (n_joints,), the goal [m] and its rotations, and
        moves in a step, shape (n,).
    allowed : ndarray, shape (2, n)
        Limits of the first n joints [rad or m].
    fewest, most : int
        Range of the steps.
    enough : float
        Distance from the goal that is close enough [m].
    contact, budget : bool and int
        Whether to rule out what is proven to touch; boxes examined at most.
    lower, upper : ndarray, shape (n,)
        Filled with the box of the first n joints [rad or m], which becomes
        smaller with every configuration found.
    best : ndarray, shape (n_joints,)
        Filled with the configuration found; joints beyond the n-th stay as at
        the start.
    stack, block : ndarray, shape (WAITING, 2 n), and record of a `layout`
        Work space.

    Returns
    -------
    complete, steps : bool and int
        Whether it is proven that there is nothing better, and the steps of the
        configuration found; more than ``most`` if there is none.
    """
    n, n_joints = lower.shape[0], start.shape[0]
    box, half, lever = block.box, block.half, block.lever
    jacobian, turns, model = block.jacobian, block.turns, block.model
    offset, step, scale = model[0], model[1], model[2]
    slope, least, bend = model[3], model[4], model[5]
    spin, turned, apart = block.spin, block.turned, block.turned[0]
    places = (as_numbers(block.q), as_numbers(block.tried))
    shares = as_numbers(block.share)
    place_bodies(shapes.placed, block.poses)
    place_bodies(shapes.placed, block.between)
    for i in range(n_joints):
        block.q[0, i] = start[i]
        block.tried[0, i] = start[i]
        best[i] = start[i]
    within_steps(chain, allowed, start, step_limit, most, lower, upper)
    for i in range(n):
        lever[i] = turn.turning[i] + (1.0 if chain.prismatic[i] else bounds.curvature[i, i])
        # Joints that hardly move the tool still decide what it touches.
        lever[i] = math.sqrt(lever[i]) if contact else lever[i]
        stack[0, i], stack[0, n + i] = lower[i], upper[i]
    # With axes, boxes are separated from balls that are smaller, since models are not exact.
    aimed = AIMED * enough
    # What is proven to be farther from the goal than this is excluded, whatever is rounded.
    cutoff = enough + max(1.0, turn.weight) * ROUNDING
    steps, waiting, examined, undecided = most + 1, 1, 0, False
    # Depth first: the stack stays short, and leads straight to where the model expects the goal.
    # What is found there lowers the steps for all boxes.
    while waiting > 0 and examined < budget and waiting + LANES < WAITING and steps > fewest:
        count = min(waiting, LANES, budget - examined)
        for lane in range(LANES):  # of which the last ones may hold the same box
            put(stack, waiting - 1 - min(lane, count - 1), box, 0, lane)
        waiting -= count
        examined += count
        # Cut the boxes to what still matters, and find their centres.
        narrowest = 0.0 * box[0, 0]
        for i in range(n):
            box[0, i] = max(box[0, i], lower[i])
            box[0, n + i] = min(box[0, n + i], upper[i])
            half[i] = 0.5 * (box[0, n + i] - box[0, i])
            block.q[0, i] = 0.5 * (box[0, n + i] + box[0, i])
            narrowest = min(narrowest, half[i])
        # Nothing is left of a box that takes no fewer steps.
        empty = narrowest < 0.0
        # Bound the distance over a box by a linear model at its centre and its curvature.
        block.distance[0] = offset_from_goal(chain, block.q, goal, block.poses, offset)
        if spin.shape[0] > 0:
            length = turn_from_goal(turn, n_joints, block.poses, apart)
            axes_jacobian(chain, turn, block.poses, apart, spin)
            at_angle = angle_bound(turn, length, half)
            block.distance[0] = max(block.distance[0], length)
        tool = (goal[0] + offset[0], goal[1] + offset[1], goal[2] + offset[2])
        point_jacobian(chain, block.poses, tool, jacobian)
        direction = closest_step(jacobian, offset, half, step, scale, spin, turned, aimed)
        linear = (block.poses, jacobian, offset, direction, half, slope, least, bend)
        bound = curved_bound(chain, bounds.curvature, *linear, turn, spin, turned)
        # Where the linear model comes closest to the goal, the arm mostly does, too.
        for i in range(n):
            block.tried[0, i] = block.q[0, i] + step[i]
        block.distance[1] = offset_from_goal(chain, block.tried, goal, block.between, offset)
        if spin.shape[0] > 0:
            length = turn_from_goal(turn, n_joints, block.between, apart)
            block.distance[1] = max(block.distance[1], length)
        # Those count that come close enough, and are free.
        at_centre = ~empty & (block.distance[0] <= enough)
        at_step = ~empty & (block.distance[1] <= enough)
        if contact and any_lane(at_centre | at_step):
            work = (half, 0.0, turns)
            at_centre = at_centre & ~overlaps(at_centre, chain, shapes, block.poses, *work)
            at_step = at_step & ~overlaps(at_step, chain, shapes, block.between, *work)
        bits = (lane_bits(at_centre), lane_bits(at_step))
        for index in range(2 * count if bits[0] | bits[1] != 0 else 0):
            lane, attempt = index >> 1, index & 1
            tried = places[attempt]
            if bits[attempt] >> lane & 1 == 0:
                continue
            needed = float(fewest)
            for i in range(n):
                moved = abs(tried[0, i, lane] - start[i]) - 2.0 * drift(chain, i, most)
                needed = max(needed, moved / step_limit[i])
            if np.ceil(needed) >= steps:
                continue
            steps = int(np.ceil(needed))
            within_steps(chain, allowed, start, step_limit, steps - 1, lower, upper)
            for i in range(n):
                best[i] = tried[0, i, lane]
        block.share[0] = trim(cutoff, bound, slope, least, bend, block.q, half, box)
        # The bound of the joints settles large boxes far from the goal.
        bound = max(bound, joint_bound(bounds, block.poses, goal, half))
        if spin.shape[0] > 0:
            bound = max(bound, at_angle)
        beyond = bound > cutoff
        if contact and any_lane(~beyond & ~empty):
            # Contact comes last, since it asks about every pair.
            work = (half, 1.0, turns)
            empty = empty | overlaps(~beyond & ~empty, chain, shapes, block.poses, *work)
        # Put what is left of undecided boxes back, or their halves.
        settled = lane_bits(beyond | empty)
        for lane in range(count - 1, -1, -1):
            if settled >> lane & 1:
                continue
            if shares[0, lane] < 0.5:
                take(box, 0, lane, stack, waiting)
                waiting += 1
            elif halve(stack, waiting, lane, block):
                waiting += 2
            else:
                # Such boxes lie where bounds meet what is asked for, or proofs of contact end.
                undecided = True
    return (waiting == 0 and not undecided) or steps <= fewest, steps

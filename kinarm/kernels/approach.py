"""How close the tool can come to a goal within a box of configurations: proof by branch and bound.

A box of configurations with centre c and half-widths h is excluded by a lower bound of the
distance from the tool p to the goal g. With any unit vector u,

    |p(c + e) - g|  >=  u . (p(c) - g) - sum_i |u . J_i| h_i - 1/2 sum_ij curvature_ij h_i h_j

for all |e_i| <= h_i. A descent to the point of the linear model closest to the goal proposes u;
the bound holds however u was found. A second bound needs no tool: the origin of the k-th joint
moves no farther than its swing, and the tool is no farther from it than its length.

Nor does a motion end where the arm touches something. On demand a box is excluded, too, if two
capsules, or one and a bench or the ground, overlap at its centre by more than they can move within
it; only bodies that are capsules themselves count. A box that is not excluded is tried at its
centre and at the point proposed, then halved.
"""

import math

import numpy as np
from numpy.typing import NDArray

from kinarm.chain import Chain
from kinarm.collision import ContactShapes
from kinarm.kernels.compiling import helper, inlined, kernel
from kinarm.kernels.kinematics import POSE, forward_kinematics, point_jacobian, to_world
from kinarm.kernels.overlap import overlaps
from kinarm.motion_bounds import MotionBounds

LAYOUT = "0236ea918130"
"""Hash of what is compiled in from other files; see `kinarm.kernels.rollout.LAYOUT`."""

FOUND, EXCLUDED, EXHAUSTED = range(3)
"""Outcomes of a search: close enough, proven not to be, or undecided within the budget."""

ROUNDING = 1e-9
"""By how much boxes and distances are enlarged to cover rounding [rad, m]."""

BOXES = 1024
"""Boxes that can wait at a time; halving one to the resolution of numbers takes fewer."""

SWEEPS = 8
"""Passes of the descent over the axes."""


@helper
def tool_offset(
    chain: Chain,
    q: NDArray[np.float64],
    goals: NDArray[np.float64],
    row: int,
    poses: NDArray[np.float64],
    offset: NDArray[np.float64],
) -> float:
    """Fill in poses and the vector from the goal to the tool; return its length [m]."""
    prismatic, translation, rotation, axis, tool = chain[:5]
    forward_kinematics(prismatic, translation, rotation, axis, q, 0, poses)
    x, y, z = to_world(poses, q.shape[1], tool[0], tool[1], tool[2])
    offset[0], offset[1], offset[2] = x - goals[row, 0], y - goals[row, 1], z - goals[row, 2]
    return math.sqrt(offset[0] * offset[0] + offset[1] * offset[1] + offset[2] * offset[2])


@inlined
def joint_bound(
    bounds: MotionBounds,
    poses: NDArray[np.float64],
    goals: NDArray[np.float64],
    row: int,
    half: NDArray[np.float64],
) -> float:
    """Lower bound of the distance over a box, from where the joints can be."""
    swing, length = bounds.swing, bounds.length
    bound = 0.0
    for k in range(half.shape[0]):
        x = poses[k + 1, 13] - goals[row, 0]
        y = poses[k + 1, 14] - goals[row, 1]
        z = poses[k + 1, 15] - goals[row, 2]
        motion = length[k]
        for i in range(k + 1):
            motion += half[i] * swing[i, k]
        bound = max(bound, math.sqrt(x * x + y * y + z * z) - motion)
    return bound


@inlined
def linear_bound(
    jacobian: NDArray[np.float64],
    offset: NDArray[np.float64],
    half: NDArray[np.float64],
    enough: float,
    step: NDArray[np.float64],
) -> float:
    """Lower bound of |offset + J e| over |e_i| <= half_i, and the e that nearly attains it.

    It stops as soon as the bound exceeds ``enough``.
    """
    n = half.shape[0]
    x, y, z = offset[0], offset[1], offset[2]
    bound = 0.0
    for i in range(n):
        step[i] = 0.0
    for _ in range(SWEEPS):
        norm = math.sqrt(x * x + y * y + z * z)
        if norm < 1e-12:
            break
        gap = x * offset[0] + y * offset[1] + z * offset[2]
        for i in range(n):
            gap -= half[i] * abs(x * jacobian[0, i] + y * jacobian[1, i] + z * jacobian[2, i])
        bound = max(bound, gap / norm)
        if bound > enough:
            break
        for i in range(n):
            jx, jy, jz = jacobian[0, i], jacobian[1, i], jacobian[2, i]
            square = jx * jx + jy * jy + jz * jz
            if square > 1e-12:
                moved = step[i] - (x * jx + y * jy + z * jz) / square
                moved = min(max(moved, -half[i]), half[i])
                x += (moved - step[i]) * jx
                y += (moved - step[i]) * jy
                z += (moved - step[i]) * jz
                step[i] = moved
    return bound


@inlined
def model_error(
    curvature: NDArray[np.float64], half: NDArray[np.float64], spread: NDArray[np.float64]
) -> float:
    """Bound of what the linear model misses in a box [m], and what each axis has part in it."""
    error = 0.0
    for i in range(half.shape[0]):
        spread[i] = 0.0
        for j in range(half.shape[0]):
            spread[i] += curvature[i, j] * half[j]
        spread[i] *= half[i]
        error += 0.5 * spread[i]
    return error


@inlined
def halve(
    boxes: NDArray[np.float64],
    last: int,
    bound: float,
    step: NDArray[np.float64],
    spread: NDArray[np.float64],
) -> None:
    """Halve a box along the axis that the model misses most by; the half to come first is last."""
    n = step.shape[0]
    widest = 0
    for i in range(n):
        if spread[i] > spread[widest]:
            widest = i
    middle = 0.5 * (boxes[last, widest] + boxes[last, n + widest])
    boxes[last, 2 * n] = bound
    for i in range(2 * n + 1):
        boxes[last + 1, i] = boxes[last, i]
    # The half in which the proposed point lies comes first.
    above, below = (last, last + 1) if step[widest] <= 0.0 else (last + 1, last)
    boxes[above, widest] = middle
    boxes[below, n + widest] = middle


@inlined
def improves(
    distance: float,
    closest: float,
    contact: bool,
    chain: Chain,
    shapes: ContactShapes,
    poses: NDArray[np.float64],
    half: NDArray[np.float64],
    jacobian: NDArray[np.float64],
) -> bool:
    """Whether a configuration is closer than any before, and not ruled out by contact."""
    if distance >= closest:
        return False
    return not contact or not overlaps(chain, shapes, poses, half, 0.0, jacobian)


@kernel
def search(
    chain: Chain,
    bounds: MotionBounds,
    shapes: ContactShapes,
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    goals: NDArray[np.float64],
    row: int,
    enough: float,
    resolution: float,
    contact: bool,
    budget: int,
    best: NDArray[np.float64],
    boxes: NDArray[np.float64],
) -> tuple[int, float, float]:
    """Search a box for a configuration that brings the tool close to the goal.

    Parameters
    ----------
    chain, bounds, shapes
        The arm and its contact pairs.
    lower, upper : ndarray, shape (n,)
        Corners of the box, in the first n axes [rad or m].
    goals : ndarray, shape (m, 3)
        Goals [m].
    row : int
        Which of them.
    enough : float
        Distance at which the search ends [m].
    resolution : float
        By how much the smallest distance found may exceed the proven one [m]; if it is infinite,
        the search only decides whether some configuration is close enough.
    contact : bool
        Whether configurations that are proven to touch something are ruled out.
    budget : int
        Boxes to examine.
    best : ndarray, shape (1, n_axes)
        A configuration whose axes beyond the first n count. On return, the closest one found.
    boxes : ndarray, shape (BOXES, 2 n + 1)
        Work space.

    Returns
    -------
    outcome : int
        `FOUND`, `EXCLUDED` or `EXHAUSTED`.
    distance : float
        That of the closest configuration found [m].
    proven : float
        Lower bound of the distance over the box [m].
    """
    n, n_axes = lower.shape[0], best.shape[1]
    poses, jacobian, offset = np.empty((n_axes + 1, POSE)), np.empty((3, n)), np.empty(3)
    half, step, spread, q = np.empty(n), np.empty(n), np.empty(n), best.copy()
    boxes[0, :n], boxes[0, n : 2 * n], boxes[0, 2 * n] = lower, upper, 0.0
    waiting, examined = 1, 0
    closest, proven, cutoff = np.inf, np.inf, enough + ROUNDING
    while waiting > 0 and closest > enough:
        if examined >= budget or waiting + 1 >= BOXES:
            for i in range(waiting):
                proven = min(proven, boxes[i, 2 * n])
            return EXHAUSTED, closest, max(min(proven, closest) - ROUNDING, 0.0)
        waiting -= 1
        examined += 1
        for i in range(n):
            q[0, i] = 0.5 * (boxes[waiting, i] + boxes[waiting, n + i])
            half[i] = 0.5 * (boxes[waiting, n + i] - boxes[waiting, i])
        distance = tool_offset(chain, q, goals, row, poses, offset)
        if improves(distance, closest, contact, chain, shapes, poses, half, jacobian):
            closest = distance
            cutoff = max(enough, closest - resolution) + ROUNDING
            best[0, :n] = q[0, :n]
        bound = max(boxes[waiting, 2 * n], joint_bound(bounds, poses, goals, row, half))
        if bound <= cutoff:
            error = model_error(bounds.curvature, half, spread)
            x, y, z = goals[row, 0], goals[row, 1], goals[row, 2]
            tool = (x + offset[0], y + offset[1], z + offset[2])
            point_jacobian(chain.prismatic, chain.axis, poses, tool, jacobian)
            bound = max(bound, linear_bound(jacobian, offset, half, cutoff + error, step) - error)
        if bound > cutoff:
            proven = min(proven, bound)
            continue
        if contact and overlaps(chain, shapes, poses, half, 1.0, jacobian):
            continue
        for i in range(n):
            q[0, i] += step[i]
        distance = tool_offset(chain, q, goals, row, poses, offset)
        if improves(distance, closest, contact, chain, shapes, poses, half, jacobian):
            closest = distance
            cutoff = max(enough, closest - resolution) + ROUNDING
            best[0, :n] = q[0, :n]
        halve(boxes, waiting, bound, step, spread)
        waiting += 2
    outcome = FOUND if closest <= enough else EXCLUDED
    return outcome, closest, max(min(proven, closest) - ROUNDING, 0.0)


@kernel
def steps_floor(
    first: int,
    last: int,
    chain: Chain,
    bounds: MotionBounds,
    shapes: ContactShapes,
    starts: NDArray[np.float64],
    goals: NDArray[np.float64],
    step_limit: NDArray[np.float64],
    tolerance: float,
    contact: bool,
    budget: int,
    fewest: NDArray[np.int64],
    most: NDArray[np.int64],
    floors: NDArray[np.int64],
    tight: NDArray[np.bool_],
    witnesses: NDArray[np.float64],
) -> None:
    """Prove how many steps it takes at least to bring the tool to the goal.

    Parameters
    ----------
    first, last : int
        Range of rows to work on.
    chain, bounds, shapes
        The arm and its contact pairs.
    starts : ndarray, shape (m, n_axes)
        Start configurations [rad or m].
    goals : ndarray, shape (m, 3)
        Goals [m].
    step_limit : ndarray, shape (n,)
        Largest move of each actuated axis in a step [rad or m].
    tolerance : float
        Distance at which a goal is reached [m].
    contact : bool
        Whether configurations that are proven to touch something are ruled out.
    budget : int
        Boxes to examine for each number of steps.
    fewest, most : ndarray of int, shape (m,)
        Numbers of steps to examine; fewer than ``fewest`` are impossible.
    floors : ndarray of int, shape (m,)
        Output: fewer steps are impossible.
    tight : ndarray of bool, shape (m,)
        Output: whether a configuration that counts reaches the goal in that many steps, or none
        does in ``most``; else the budget ran out.
    witnesses : ndarray, shape (m, n_axes)
        Output: that configuration, where there is one.
    """
    n = step_limit.shape[0]
    lower, upper, best = np.empty(n), np.empty(n), np.empty((1, starts.shape[1]))
    boxes = np.empty((BOXES, 2 * n + 1))
    for row in range(first, last):
        floors[row], tight[row] = fewest[row], True
        while floors[row] <= most[row]:
            best[0] = starts[row]
            for i in range(n):
                reach = floors[row] * step_limit[i] + ROUNDING
                lower[i] = max(chain.lower[i], starts[row, i] - reach)
                upper[i] = min(chain.upper[i], starts[row, i] + reach)
            outcome, _, _ = search(
                chain,
                bounds,
                shapes,
                lower,
                upper,
                goals,
                row,
                tolerance,
                np.inf,
                contact,
                budget,
                best,
                boxes,
            )
            if outcome != EXCLUDED:
                tight[row] = outcome == FOUND
                if outcome == FOUND:
                    witnesses[row] = best[0]
                break
            floors[row] += 1


@kernel
def closest_approach(
    first: int,
    last: int,
    chain: Chain,
    bounds: MotionBounds,
    shapes: ContactShapes,
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    starts: NDArray[np.float64],
    goals: NDArray[np.float64],
    resolution: float,
    contact: bool,
    budget: int,
    distances: NDArray[np.float64],
    configurations: NDArray[np.float64],
) -> None:
    """Bound from below how close the tool can come to the goal.

    Parameters
    ----------
    first, last : int
        Range of rows to work on.
    chain, bounds, shapes
        The arm and its contact pairs.
    lower, upper : ndarray, shape (m, n)
        Corners of the boxes that the first n axes can reach [rad or m].
    starts : ndarray, shape (m, n_axes)
        Configurations whose other axes count [rad or m].
    goals : ndarray, shape (m, 3)
        Goals [m].
    resolution : float
        By how much the distance found may exceed the proven one [m].
    contact : bool
        Whether configurations that are proven to touch something are ruled out.
    budget : int
        Boxes to examine.
    distances : ndarray, shape (m, 2)
        Output: the distance proven, and that of the closest configuration found [m].
    configurations : ndarray, shape (m, n_axes)
        Output: the closest configuration found [rad or m].
    """
    best, boxes = np.empty((1, starts.shape[1])), np.empty((BOXES, 2 * lower.shape[1] + 1))
    for row in range(first, last):
        best[0] = starts[row]
        _, found, proven = search(
            chain,
            bounds,
            shapes,
            lower[row],
            upper[row],
            goals,
            row,
            0.0,
            resolution,
            contact,
            budget,
            best,
            boxes,
        )
        distances[row, 0], distances[row, 1] = proven, found
        configurations[row] = best[0]

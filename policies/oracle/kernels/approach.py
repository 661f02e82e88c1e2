"""How close the tool can come to a goal within a box of configurations: proof by branch and bound.

A box is excluded when a lower bound of the distance over it exceeds what is asked for
(`kinarm.policies.oracle.kernels.box_bound`). Nor does a motion end where the arm touches
something: on demand a box is excluded, too, if some pair of bodies is proven to overlap throughout
it (`kinarm.policies.oracle.kernels.overlap`). A box that is not excluded is tried at its centre and
where the linear model of the arm comes closest to the goal, then halved.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.chain import Chain
from kinarm.contact_shapes import ContactShapes
from kinarm.kernels.compiling import inlined, kernel
from kinarm.kernels.kinematics import POSE, point_jacobian
from kinarm.motion_bounds import MotionBounds
from kinarm.policies.oracle.kernels.box_bound import (
    joint_bound,
    linear_bound,
    model_error,
    offset_from_goal,
)
from kinarm.policies.oracle.kernels.overlap import overlaps

LAYOUT = "8398700e37cf"
"""Hash of what is compiled in from other files; see `kinarm.kernels.rollout.LAYOUT`."""

FOUND, EXCLUDED, EXHAUSTED = range(3)
"""Outcomes of a search: close enough, proven not to be, or undecided within the budget."""

ROUNDING = 1e-9
"""By how much boxes and distances are enlarged to cover rounding [rad, m]."""

BOXES = 1024
"""Boxes that can wait at a time; halving one to the resolution of numbers takes fewer."""


class ArmInScene(NamedTuple):
    """What proofs know of an arm in a scene: its kinematics, motion bounds and contact pairs."""

    chain: Chain
    bounds: MotionBounds
    shapes: ContactShapes


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


@inlined
def halve(
    boxes: NDArray[np.float64],
    last: int,
    bound: float,
    step: NDArray[np.float64],
    parts: NDArray[np.float64],
) -> None:
    """Replace a box by its halves, of which the one with the point proposed is examined first.

    It is cut across the joint that has the largest part in what the linear model misses: that is
    what keeps the bound from excluding it.
    """
    n = step.shape[0]
    widest = 0
    for i in range(n):
        if parts[i] > parts[widest]:
            widest = i
    middle = 0.5 * (boxes[last, widest] + boxes[last, n + widest])
    # What is proven of the whole holds for its halves.
    boxes[last, 2 * n] = bound
    for i in range(2 * n + 1):
        boxes[last + 1, i] = boxes[last, i]
    # The last box is examined next.
    above, below = (last, last + 1) if step[widest] <= 0.0 else (last + 1, last)
    boxes[above, widest] = middle
    boxes[below, n + widest] = middle


@kernel
def search(
    arm: ArmInScene,
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    goal: tuple[float, float, float],
    enough: float,
    resolution: float,
    contact: bool,
    budget: int,
    best: NDArray[np.float64],
    boxes: NDArray[np.float64],
) -> tuple[int, float, float]:
    """Search a box for a configuration that brings the tool close to the goal.

    The box, from ``lower`` to ``upper``, is of the first n joints. The search ends at a distance of
    ``enough`` [m], or after ``budget`` boxes. The smallest distance found may exceed the proven one
    by ``resolution`` [m]; if that is infinite, the search only decides whether some configuration
    is close enough. With ``contact``, what is proven to touch something is ruled out.

    ``best``, shape (1, n_joints), brings the other joints and takes the closest configuration.
    ``boxes``, shape (BOXES, 2 n + 1), is work space: corners of the boxes that wait, and the
    distance proven of each.

    Returns
    -------
    outcome : int
        `FOUND`, `EXCLUDED` or `EXHAUSTED`.
    distance, proven : float
        That of the closest configuration found, and a lower bound over the box [m].
    """
    chain, bounds, shapes = arm
    n, n_joints = lower.shape[0], best.shape[1]
    poses, jacobian, offset = np.empty((n_joints + 1, POSE)), np.empty((3, n)), np.empty(3)
    half, step, parts, q = np.empty(n), np.empty(n), np.empty(n), best.copy()
    boxes[0, :n], boxes[0, n : 2 * n], boxes[0, 2 * n] = lower, upper, 0.0
    waiting, examined = 1, 0
    # Boxes are excluded beyond the cutoff. It falls with every closer configuration that is found:
    # what is not closer by the resolution is of no interest.
    closest, proven, cutoff = np.inf, np.inf, enough + ROUNDING
    # Depth first: a stack of halves stays short, one box for each halving, and leads straight
    # to where the model expects the goal. A configuration close enough is met long before the
    # box is searched through, and closer ones lower the cutoff for all boxes that wait.
    while waiting > 0 and closest > enough and examined < budget and waiting + 1 < BOXES:
        waiting -= 1
        examined += 1
        for i in range(n):
            q[0, i] = 0.5 * (boxes[waiting, i] + boxes[waiting, n + i])
            half[i] = 0.5 * (boxes[waiting, n + i] - boxes[waiting, i])
        # Both bounds start from the poses at the centre, so trying the centre costs nothing.
        distance = offset_from_goal(chain, q, goal, poses, offset)
        if improves(distance, closest, contact, chain, shapes, poses, half, jacobian):
            closest, cutoff = distance, max(enough, distance - resolution) + ROUNDING
            best[0, :n] = q[0, :n]
        # The bounds in the order of their cost. That of the joints settles large boxes far from
        # the goal, for which the linear model is of no use; the model settles small ones.
        bound = max(boxes[waiting, 2 * n], joint_bound(bounds, poses, goal, half))
        if bound <= cutoff:
            error = model_error(bounds.curvature, half, parts)
            tool = (goal[0] + offset[0], goal[1] + offset[1], goal[2] + offset[2])
            point_jacobian(chain.prismatic, chain.axis, poses, tool, jacobian)
            bound = max(bound, linear_bound(jacobian, offset, half, cutoff + error, step) - error)
        if bound > cutoff:
            # Nothing in the box comes closer than this.
            proven = min(proven, bound)
            continue
        # Contact comes last, since it asks about every pair. A box that touches something
        # throughout holds no configuration that counts: nothing is to be proven of it.
        if contact and overlaps(chain, shapes, poses, half, 1.0, jacobian):
            continue
        # Where the linear model comes closest to the goal, the arm mostly does, too.
        for i in range(n):
            q[0, i] += step[i]
        distance = offset_from_goal(chain, q, goal, poses, offset)
        if improves(distance, closest, contact, chain, shapes, poses, half, jacobian):
            closest, cutoff = distance, max(enough, distance - resolution) + ROUNDING
            best[0, :n] = q[0, :n]
        halve(boxes, waiting, bound, step, parts)
        waiting += 2
    outcome = FOUND if closest <= enough else EXCLUDED if waiting == 0 else EXHAUSTED
    # Of boxes that still wait, no more is known than of those that they are halves of.
    for i in range(waiting):
        proven = min(proven, boxes[i, 2 * n])
    return outcome, closest, max(min(proven, closest) - ROUNDING, 0.0)


@kernel
def bound_steps(
    first: int,
    last: int,
    arm: ArmInScene,
    starts: NDArray[np.float64],
    goals: NDArray[np.float64],
    step_limit: NDArray[np.float64],
    tolerance: float,
    contact: bool,
    budget: int,
    fewest: NDArray[np.int64],
    most: NDArray[np.int64],
    lower_bounds: NDArray[np.int64],
    tight: NDArray[np.bool_],
    witnesses: NDArray[np.float64],
) -> None:
    """Prove how many steps it takes at least to bring the tool to goals, for some rows.

    Numbers of steps from ``fewest`` to ``most`` are examined, each by a `search` with the budget;
    fewer than ``fewest`` are impossible. Written are ``lower_bounds``, below which no number of
    steps suffices; whether they are ``tight``, that is, some configuration that counts reaches the
    goal in so many steps, or none does in ``most``; and such configurations as ``witnesses``.
    """
    n = step_limit.shape[0]
    lower, upper, best = np.empty(n), np.empty(n), np.empty((1, starts.shape[1]))
    boxes = np.empty((BOXES, 2 * n + 1))
    for row in range(first, last):
        goal = (goals[row, 0], goals[row, 1], goals[row, 2])
        # One step more at a time: boxes that are far too small are excluded at a glance, and none
        # is searched that is larger than need be.
        lower_bounds[row], tight[row] = fewest[row], True
        while lower_bounds[row] <= most[row]:
            best[0] = starts[row]
            for i in range(n):
                reach = lower_bounds[row] * step_limit[i] + ROUNDING
                lower[i] = max(arm.chain.lower[i], starts[row, i] - reach)
                upper[i] = min(arm.chain.upper[i], starts[row, i] + reach)
            outcome, _, _ = search(
                arm, lower, upper, goal, tolerance, np.inf, contact, budget, best, boxes
            )
            if outcome != EXCLUDED:
                tight[row] = outcome == FOUND
                if outcome == FOUND:
                    witnesses[row] = best[0]
                break
            lower_bounds[row] += 1


@kernel
def bound_distance(
    first: int,
    last: int,
    arm: ArmInScene,
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
    """Bound from below how close the tool can come to goals, for some rows; see `search`.

    Written are the distances, shape (m, 2), proven and found [m], and the closest configurations
    found; joints beyond those of the boxes stay as in ``starts``.
    """
    best, boxes = np.empty((1, starts.shape[1])), np.empty((BOXES, 2 * lower.shape[1] + 1))
    for row in range(first, last):
        best[0] = starts[row]
        goal = (goals[row, 0], goals[row, 1], goals[row, 2])
        _, found, proven = search(
            arm, lower[row], upper[row], goal, 0.0, resolution, contact, budget, best, boxes
        )
        distances[row, 0], distances[row, 1] = proven, found
        configurations[row] = best[0]

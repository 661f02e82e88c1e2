"""Boxes of configurations: a stack of those that wait, and a block of them in lanes."""

from functools import cache
from typing import NamedTuple

from numba import types

from kinarm.chain import Chain
from kinarm.kernels.compiling import Array, inlined
from kinarm.kernels.kinematics import POSE
from kinarm.kernels.lanes import as_numbers, lanes
from kinarm.kernels.records import Fixed, Layout
from kinarm.policies.oracle.kernels.overlap import ENDS

WAITING = 4096
"""Boxes that can wait at a time; halving eight until they are too small takes fewer."""

SMALLEST = 1e-6
"""How far the tool can move in a box that is not halved any more [m]."""

ROUNDING = 1e-9
"""By how much boxes and distances are enlarged to cover rounding [rad, m]."""


MODEL = 6
"""Rows of `Boxes.model`."""


class Boxes(NamedTuple):
    """Work space of a block of boxes of the first n joints.

    Its arrays are of lanes; `kinarm.kernels.lanes.as_numbers` views them with one axis more, that
    of the boxes.

    Attributes
    ----------
    lower, upper, half : (n,)
        Corners and half-widths [rad or m].
    q, tried : (1, n_joints)
        Centre, and a configuration that may be close to the goal [rad or m].
    poses, between : (n_joints + 1, POSE)
        Forward kinematics at the centre, and where it is tried.
    proven, share : (1,)
        Distance proven of a box [m], and what is left of it.
    distance : (2,)
        Distances from the goal at the centre and where it is tried [m].
    jacobian, turns : (3, n)
        Jacobian of the tool at the centre, and of a point of the arm [m/rad, or m/m].
    model : (MODEL, n), but at least 3 columns
        Vector from the goal to the tool, and what `kinarm.policies.oracle.kernels.box_bound` fills
        in: step, scale, slope, least and bend.
    ends : (n_shapes, ENDS)
        Capsules in the world.
    lever : (n,) of numbers, not of lanes
        How far each joint moves the tool, or what counts as that [m/rad, or m/m].
    """

    lower: Array
    upper: Array
    half: Array
    q: Array
    tried: Array
    poses: Array
    between: Array
    proven: Array
    distance: Array
    share: Array
    jacobian: Array
    turns: Array
    model: Array
    ends: Array
    lever: Array


@cache
def layout(n: int, n_joints: int, n_shapes: int) -> Layout:
    """How `Boxes` lie in memory."""
    shapes = {
        **dict.fromkeys(("lower", "upper", "half"), (n,)),
        **dict.fromkeys(("q", "tried"), (Fixed(1), n_joints)),
        **dict.fromkeys(("poses", "between"), (n_joints + 1, Fixed(POSE))),
        **dict.fromkeys(("proven", "share"), (Fixed(1),)),
        "distance": (Fixed(2),),
        **dict.fromkeys(("jacobian", "turns"), (Fixed(3), n)),
        "model": (Fixed(MODEL), max(n, 3)),
        "ends": (n_shapes, Fixed(ENDS)),
    }
    arrays = {name: (lanes, shape) for name, shape in shapes.items()}
    return Layout("Boxes", {**arrays, "lever": (types.float64, (n,))})


@inlined
def within_steps(
    chain: Chain, start: Array, step_limit: Array, steps: int, lower: Array, upper: Array
) -> None:
    """Fill in the corners of what the first joints can reach in some steps."""
    for i in range(step_limit.shape[0]):
        reach = steps * step_limit[i] + ROUNDING
        lower[i] = max(chain.lower[i], start[i] - reach)
        upper[i] = min(chain.upper[i], start[i] + reach)


@inlined
def load_boxes(stack: Array, last: int, count: int, boxes: Boxes) -> None:
    """Put the boxes at the end of the stack into lanes; the last one repeats where there is none.

    A row of the ``stack`` holds the corners of a box, and the distance proven of it.
    """
    lower, upper, proven = (
        as_numbers(boxes.lower),
        as_numbers(boxes.upper),
        as_numbers(boxes.proven),
    )
    n, n_lanes = lower.shape
    for lane in range(n_lanes):
        row = last - min(lane, count - 1)
        for i in range(n):
            lower[i, lane] = stack[row, i]
            upper[i, lane] = stack[row, n + i]
        proven[0, lane] = stack[row, 2 * n]


@inlined
def store_box(stack: Array, row: int, lane: int, boxes: Boxes) -> None:
    """Put a box from a lane into the stack."""
    lower, upper = as_numbers(boxes.lower), as_numbers(boxes.upper)
    n = lower.shape[0]
    for i in range(n):
        stack[row, i] = lower[i, lane]
        stack[row, n + i] = upper[i, lane]
    stack[row, 2 * n] = as_numbers(boxes.proven)[0, lane]


@inlined
def halve(stack: Array, row: int, lane: int, lever: Array, boxes: Boxes) -> bool:
    """Put the halves of a box from a lane into the stack, that with the point tried above.

    It is cut across the joint that can move the tool farthest in it. Returns whether it is large
    enough.
    """
    lower, upper = as_numbers(boxes.lower), as_numbers(boxes.upper)
    n = lower.shape[0]
    widest, farthest = 0, -1.0
    for i in range(n):
        moved = lever[i] * (upper[i, lane] - lower[i, lane])
        if moved > farthest:
            widest, farthest = i, moved
    if farthest < SMALLEST:
        return False
    middle = 0.5 * (lower[widest, lane] + upper[widest, lane])
    store_box(stack, row, lane, boxes)
    store_box(stack, row + 1, lane, boxes)
    # The last box is examined next.
    near_lower = as_numbers(boxes.tried)[0, widest, lane] <= middle
    above, below = (row, row + 1) if near_lower else (row + 1, row)
    stack[above, widest] = middle
    stack[below, n + widest] = middle
    return True

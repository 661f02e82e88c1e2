"""Boxes of configurations: a stack of those that wait, and a block of them in lanes."""

from functools import cache
from typing import Any

from numba import types

from kinarm.chain import Chain
from kinarm.kernels.compiling import Array, inlined
from kinarm.kernels.kinematics import POSE
from kinarm.kernels.lanes import as_numbers, lanes
from kinarm.kernels.records import Fixed, Layout
from kinarm.kernels.session import ONE, THREE, take

WAITING = 4096
"""Boxes that can wait at a time; halving eight until they are too small takes fewer."""

SMALLEST = 1e-6
"""How far the tool can move in a box that is not halved any more [m]."""

ROUNDING = 1e-9
"""By how much boxes and distances are enlarged to cover rounding [rad, m]."""


Boxes = Any
"""Record of a `layout`."""


@cache
def layout(n: int, n_joints: int) -> Layout:
    """Work space of a block of boxes of the first n joints: arrays of lanes, but for ``lever``.

    `kinarm.kernels.lanes.as_numbers` views lanes with one axis more, that of the boxes.
    """
    shapes = {
        # Lower and upper corner [rad or m], and the distance proven of the box [m]: what the stack
        # holds of it in a row. Half-widths, and which share is left of it.
        "box": (ONE, 2 * n + 1),
        "half": (n,),
        "share": (ONE,),
        # Centre, and a configuration that may be close to the goal [rad or m]; their poses.
        **dict.fromkeys(("q", "tried"), (ONE, n_joints)),
        **dict.fromkeys(("poses", "between"), (n_joints + 1, Fixed(POSE))),
        # Distances from the goal at the centre and where it is tried [m].
        "distance": (Fixed(2),),
        # Jacobians of the tool at the centre, and of a point of the arm [m/rad, or m/m].
        **dict.fromkeys(("jacobian", "turns"), (THREE, n)),
        # Vector from the goal to the tool; step, scale, slope, least and bend of `box_bound`.
        "model": (Fixed(6), max(n, 3)),
    }
    arrays = {name: (lanes, shape) for name, shape in shapes.items()}
    # How far each joint moves the tool, or what counts as that [m/rad, or m/m].
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
def halve(stack: Array, row: int, lane: int, boxes: Boxes) -> bool:
    """Put the halves of a box from a lane into the stack, that with the point tried above.

    It is cut across the joint that can move the tool farthest in it. Returns whether it is large
    enough.
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

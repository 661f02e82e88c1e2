"""Kernels that screen configurations for contact, and draw and deal starts.

Starts are few numbers, for which NumPy's calls take longer than the sums.
"""

import math

import numpy as np
from numpy.typing import NDArray

from kinarm.chain import Chain
from kinarm.contact_shapes import ContactShapes
from kinarm.kernels.compiling import Array, kernel, lean_kernel
from kinarm.kernels.kinematics import forward_kinematics, to_world
from kinarm.kernels.lanes import LANES, lane_bits
from kinarm.kernels.overlap import DEPTH, deepest_overlap
from kinarm.kernels.proof import prove_configurations
from kinarm.kernels.session import Alone, Block, put, put_scene, take


@kernel
def propose_starts(
    rows: NDArray[np.int64], uniforms: Array, lower: Array, extent: Array, starts: Array
) -> Array:
    """Place the first joints of some starts in their range, and return these starts.

    Parameters
    ----------
    rows, uniforms : ndarray, of int, shape (n_rows,), and (n_rows, n_actuated)
        Which starts, and numbers in [0, 1).
    lower, extent, starts : ndarray, shape (n_joints,), twice, and (n, n_joints)
        Lower ends and widths of the ranges, and all starts, changed in place
        [rad or m].
    """
    for i in range(rows.shape[0]):
        for joint in range(uniforms.shape[1]):
            starts[rows[i], joint] = lower[joint] + uniforms[i, joint] * extent[joint]
    return starts[rows]


@kernel
def rejected_rows(
    rows: NDArray[np.int64],
    goals: Array,
    tools: Array,
    touching: NDArray[np.bool_],
    tolerance: float,
) -> NDArray[np.int64]:
    """Rows of starts that touch something or whose tool is at the goal.

    Parameters
    ----------
    rows, goals : ndarray, of int, shape (n_rows,), and (n, 3)
        Which starts are in question, and all goals [m].
    tools, touching : ndarray, shape (n_rows, 3), and of bool, shape (n_rows,)
        Their tool points [m], and whether they touch.
    tolerance : float
        Distance within which a goal is reached [m].
    """
    rejected, count = np.empty_like(rows), 0
    for i in range(rows.shape[0]):
        e = rows[i]
        x, y, z = tools[i, 0] - goals[e, 0], tools[i, 1] - goals[e, 1], tools[i, 2] - goals[e, 2]
        if touching[i] or math.sqrt(x * x + y * y + z * z) <= tolerance:
            rejected[count] = e
            count += 1
    return rejected[:count]


@kernel
def deal(
    rows: NDArray[np.int64],
    taken: NDArray[np.int64],
    drawn: NDArray[np.int64],
    starts: Array,
    goals: Array,
    q: Array,
    goal: Array,
) -> bool:
    """Copy the next scenario of some arms to their rows of ``q`` and ``goal``.

    If one of them has none left, nothing is dealt, and the result is False.

    Parameters
    ----------
    rows : ndarray of int, shape (n,)
        The arms.
    taken, drawn : ndarray of int, shape (n_arms,)
        How many scenarios were dealt to each arm, and drawn for it.
    starts, goals : ndarray, shape (n_arms, n_kept, n_joints) and (n_arms, n_kept, 3)
        Scenarios; that of number k is at k modulo n_kept.
    q, goal : ndarray, shape (n_arms, n_joints) and (n_arms, 3)
        Where to.
    """
    for row in rows:
        if taken[row] == drawn[row]:
            return False
    for row in rows:
        kept = taken[row] % starts.shape[1]
        taken[row] += 1
        for joint in range(q.shape[1]):
            q[row, joint] = starts[row, kept, joint]
        for axis in range(3):
            goal[row, axis] = goals[row, kept, axis]
    return True


@lean_kernel
def screen(
    first: int,
    last: int,
    block: Block,
    alone: Alone,
    chain: Chain,
    shapes: ContactShapes,
    configurations: Array,
    scenes: Array,
    tools: Array,
    free: NDArray[np.bool_],
    touching: NDArray[np.bool_],
) -> int:
    """Find tool points of configurations, and which surely are free or touch.

    Parameters
    ----------
    first, last : int
        Range of rows.
    block, alone, chain, shapes
        Work space, the arm, and what may touch.
    configurations : ndarray, shape (n, n_joints)
        Joint positions [rad or m].
    scenes : ndarray, shape (n, n_placed, 16) or (0, n_placed, 16)
        Rows of each one's bodies, if they differ.
    tools, free, touching : ndarray, shape (n, 3), and of bool, shape (n,)
        Where tool points go [m], and what is proven.

    Returns
    -------
    int
        Of how many one is proven; Coal decides about the others.
    """
    n_joints, tool = configurations.shape[1], chain.tool
    n_proven = 0
    for start in range(first, last, LANES):
        filled = min(last - start, LANES)
        for lane in range(LANES):
            row = start + min(lane, filled - 1)
            put(configurations, row, block.q, 0, lane)
            put_scene(scenes, row, lane, block.after)
        forward_kinematics(chain, block.q, 0, block.after)
        touched = lane_bits(deepest_overlap(shapes, block.after) > DEPTH)
        apart = prove_configurations(shapes, touched, filled, block, alone)
        x, y, z = to_world(block.after, n_joints, tool[0], tool[1], tool[2])
        block.goal[0, 0], block.goal[0, 1], block.goal[0, 2] = x, y, z
        for lane in range(filled):
            free[start + lane] = apart >> lane & 1 != 0
            touching[start + lane] = touched >> lane & 1 != 0
            n_proven += (apart | touched) >> lane & 1
            take(block.goal, 0, lane, tools, start + lane)
    return n_proven

"""Proof that single configurations are free of contact, or touch; a kernel screens many."""

import math

import numpy as np
from numpy.typing import NDArray

from kinarm.chain import Chain
from kinarm.contact_shapes import WITH_HALFSPACE, ContactShapes
from kinarm.kernels.compiling import Array, helper, inlined, lean_kernel
from kinarm.kernels.kinematics import forward_kinematics, to_world
from kinarm.kernels.lane_copies import put, put_scene, take, take_rows
from kinarm.kernels.lanes import LANES, any_lane, as_numbers, lane_bits, select
from kinarm.kernels.planes import DEPTH, EVERYDAY, GAP, approach, height_above, lay_plane
from kinarm.kernels.proof import is_apart, verdict_of
from kinarm.kernels.rough_bounds import axes_apart, axis_above, place_axes
from kinarm.kernels.work_space import Alone, Block


@helper
def prove_configuration(
    lane: int, shapes: ContactShapes, poses: Array, block: Block, alone: Alone
) -> int:
    """1 if an episode's configuration is proven free, -1 if it touches something, else 0."""
    found, plane, planes = 1, alone.plane, as_numbers(block.planes)
    take_rows(poses, lane, alone.before)
    for pair in range(shapes.travel.shape[1]):
        if is_apart(planes[pair, GAP, lane]):
            continue
        verdict = verdict_of(pair, lane, -1.0, shapes, block, alone)
        put(plane, 0, block.planes, pair, lane)
        if verdict < 0:
            return verdict
        found = min(found, verdict)
    return found


@inlined
def prove_configurations(
    shapes: ContactShapes, filled: int, hasty: bool, block: Block, alone: Alone
) -> tuple[int, int]:
    """Bits of the arms that are proven free, and of those that touch.

    Takes the poses ``after``, and gives all pairs a first plane. If it is ``hasty``, pairs whose
    capsules are apart get none, nor do those of arms that touch.
    """
    poses, planes = block.after, block.planes
    least, depth = 0.0 * block.q[0, 0] + 1.0, 0.0 * block.q[0, 0] - 1.0
    place_axes(shapes, poses, block.axes)
    for pair in range(shapes.travel.shape[1]):
        bound = 0.0 * depth - math.inf
        if hasty:
            bound = axes_apart(shapes, pair, poses, block.axes)
        if any_lane(~is_apart(bound) & (depth <= DEPTH)):
            overlap, along = approach(shapes, pair, poses)
            if hasty:
                depth = max(depth, overlap)
            lay_plane(shapes, pair, poses, along, planes, pair)
            bound = max(bound, axis_above(shapes, pair, poses, block.axes, planes, pair))
            unproven = ~is_apart(bound)
            if any_lane(unproven):
                closer = height_above(shapes, pair, EVERYDAY, poses, planes, pair)
                bound = select(unproven, max(bound, closer), bound)
        least = min(least, bound)
        planes[pair, GAP] = bound
    free, touched = lane_bits(is_apart(least)), lane_bits(depth > DEPTH)
    for lane in range(filled):
        if (free | touched) >> lane & 1 == 0:
            verdict = prove_configuration(lane, shapes, poses, block, alone)
            free |= 1 << lane if verdict > 0 else 0
            touched |= 1 << lane if verdict < 0 else 0
    return free, touched


@lean_kernel
def screen(
    first: int,
    last: int,
    rows: NDArray[np.int64],
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
    rows : ndarray of int, shape (last - first,)
        These; changed.
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
    n_left = last - first
    # Half-spaces first: arms that reach into one fill no lanes later.
    for others in range(2):
        n_rows, n_left = n_left, 0
        for start in range(0, n_rows, LANES):
            filled = min(n_rows - start, LANES)
            for lane in range(LANES):
                row = rows[start + min(lane, filled - 1)]
                put(configurations, row, block.q, 0, lane)
                put_scene(scenes, row, lane, block.after)
            forward_kinematics(chain, block.q, 0, block.after)
            if others:
                apart, touched = prove_configurations(shapes, filled, True, block, alone)
            else:
                depth = 0.0 * block.q[0, 0] - 1.0
                for pair in range(shapes.travel.shape[1]):
                    if shapes.pairs[pair, 0] == WITH_HALFSPACE:
                        depth = max(depth, approach(shapes, pair, block.after)[0])
                apart, touched = 0, lane_bits(depth > DEPTH)
                x, y, z = to_world(block.after, n_joints, tool[0], tool[1], tool[2])
                block.goal[0, 0], block.goal[0, 1], block.goal[0, 2] = x, y, z
            for lane in range(filled):
                row = rows[start + lane]
                if others == 0:
                    take(block.goal, 0, lane, tools, row)
                free[row] = apart >> lane & 1 != 0
                touching[row] = touched >> lane & 1 != 0
                if not free[row] and not touching[row]:
                    rows[n_left] = row
                    n_left += 1
    return last - first - n_left

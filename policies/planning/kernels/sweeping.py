"""Kernel that proves straight motions of an arm free of contact."""

from kinarm.chain import Chain
from kinarm.contact_shapes import ContactShapes
from kinarm.kernels.compiling import Array, lean_kernel
from kinarm.kernels.kinematics import forward_kinematics
from kinarm.kernels.lanes import LANES, any_lane, as_numbers, lane_bits
from kinarm.kernels.planes import EVERYDAY, GAP, height_above, propose
from kinarm.kernels.proof import first_contact, is_apart, prove_alone, twist_step
from kinarm.kernels.rough_bounds import ball_gap
from kinarm.kernels.work_space import Alone, Block

THROUGHOUT = 0
"""No configurations are tested, but all of the motion."""


@lean_kernel
def sweep(
    ends: Array,
    part: int,
    parts: int,
    block: Block,
    alone: Alone,
    chain: Chain,
    shapes: ContactShapes,
) -> int:
    """Prove parts of a motion free, in turn, a lane for each.

    Parameters
    ----------
    ends : ndarray, shape (2, n_joints)
        Where the motion begins and ends [rad or m].
    part, parts : int
        The first part, from 0, and how many equal ones the motion has.
    block, alone, chain, shapes
        Work space, the arm, and what may touch.

    Returns
    -------
    int
        First part that is not proven free, or the number of parts; minus 1 and that part if it
        surely touches.
    """
    q, target = as_numbers(block.q), as_numbers(block.target)
    while part < parts:
        for lane in range(LANES):
            k = min(part + lane, parts - 1)
            for joint in range(ends.shape[1]):
                first, second = ends[0, joint], ends[1, joint]
                q[0, joint, lane] = first + k / parts * (second - first)
                end = second if k + 1 == parts else first + (k + 1) / parts * (second - first)
                target[0, joint, lane] = end
        for joint in range(ends.shape[1]):
            block.former[0, joint] = 0.5 * (block.q[0, joint] + block.target[0, joint])
        forward_kinematics(chain, block.former, 0, block.after)
        for pair in range(shapes.travel.shape[1]):
            motion = 0.0 * block.q[0, 0]
            for moved in range(shapes.planes[pair, 2], shapes.planes[pair, 3]):
                turn = abs(block.target[0, moved] - block.q[0, moved])
                motion += turn * shapes.travel[moved, pair]
            block.bound[pair] = ball_gap(shapes, pair, block.after) - 0.5 * motion
        forward_kinematics(chain, block.q, 0, block.before)
        forward_kinematics(chain, block.target, 0, block.after)
        twist_step(block)
        least, n_open = 0.0 * block.q[0, 0] + 1.0, 0
        for pair in range(shapes.travel.shape[1]):
            far = block.bound[pair]
            if not any_lane(~is_apart(far)):
                continue
            propose(shapes, pair, block.after, block.planes, pair)
            before = height_above(shapes, pair, EVERYDAY, block.before, block.planes, pair)
            after = height_above(shapes, pair, EVERYDAY, block.after, block.planes, pair)
            bend, axis = 0.0 * before, shapes.planes[pair, 2]
            for moved in range(axis, shapes.planes[pair, 3]):
                bend += block.twist[axis, moved] * shapes.travel[moved, pair]
            bound = max(far, min(before, after) - 0.125 * bend)
            block.height[pair], block.bend[pair], block.bound[pair] = before, bend, bound
            block.planes[pair, GAP] = after
            least = min(least, bound)
            block.open[n_open] = pair
            n_open += 1
        block.open[shapes.travel.shape[1]] = n_open
        free = lane_bits(is_apart(least))
        for lane in range(min(LANES, parts - part)):
            if free >> lane & 1:
                continue
            poses = block.before, block.after
            doubt = prove_alone(lane, chain, shapes, THROUGHOUT, *poses, block, alone)
            if doubt != 0:
                known = chain, shapes, THROUGHOUT, block, alone
                return -1 - part - lane if first_contact(lane, doubt, *known) else part + lane
        part += LANES
    return parts

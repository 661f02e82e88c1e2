"""What kernels prove of steps."""

import numpy as np
from numba import njit

from kinarm.kernels.kinematics import forward_kinematics
from kinarm.kernels.lane_copies import put
from kinarm.kernels.lanes import LANES, as_numbers, select
from kinarm.kernels.planes import EVERYDAY, GAP, height_above, propose
from kinarm.kernels.proof import first_contact, is_apart, prove_alone, prove_step, renew_planes
from kinarm.kernels.work_space import furnish, sizes_of, work_space


@njit
def prove(chain, shapes, tested, starts, targets, block, alone, bounds, found):
    for i in range(len(starts)):
        for lane in range(LANES):
            put(starts, i, block.q, 0, lane)
            put(targets, i, block.target, 0, lane)
        forward_kinematics(chain, block.q, 0, block.before)
        forward_kinematics(chain, block.target, 0, block.after)
        for pair in range(shapes.travel.shape[1]):
            propose(shapes, pair, block.before, block.planes, pair)
            height = height_above(shapes, pair, EVERYDAY, block.before, block.planes, pair)
            block.planes[pair, GAP] = height
        first = prove_step(shapes, tested, block.after, block)
        second = renew_planes(shapes, tested, first < 1.0, block.before, block.after, block)
        block.distance[0], block.total[0] = first, select(is_apart(first), first, second)
        bounds[0, i] = as_numbers(block.distance)[0, 0]
        bounds[1, i] = as_numbers(block.total)[0, 0]
        doubt = prove_alone(0, chain, shapes, tested, block.before, block.after, block, alone)
        found[0, i] = doubt
        if doubt != 0:
            found[1, i] = first_contact(0, doubt, chain, shapes, tested, block, alone)


def proofs(simulator, tested, starts, targets):
    """Bounds of the least height in steps, if need be by new planes; doubt, and what touches."""
    chain, shapes, _ = simulator.world.records
    n = simulator.arm.n_joints
    space = work_space(n_joints=n, n_actuated=n, **sizes_of(shapes.values))
    furnish(shapes.values.placed, *space)
    bounds, found = np.zeros((2, len(starts))), np.zeros((2, len(starts)), dtype=np.int64)
    prove(chain, shapes, tested, starts, targets, *space, bounds, found)
    return bounds, found[0], found[1] > 0

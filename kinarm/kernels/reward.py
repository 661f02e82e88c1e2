"""Observation, distance and reward of a step.

The reward is a sum of terms (paper, section 3.3: closer is positive, farther negative). A new
term is a field of `kinarm.task.RewardWeights` and a formula here, in the same order.
"""

import math

from kinarm.kernels.compiling import Array, call_stage, inlined
from kinarm.kernels.kinematics import to_world
from kinarm.kernels.lanes import select
from kinarm.kernels.session import OBSERVE, Session
from kinarm.kernels.work_space import Block

PROGRESS, CLOSER, STEP, COLLISION, SUCCESS, ROTATION = range(6)
"""Columns of the terms; `COLLISION` and `SUCCESS` are paid at the end.

`ROTATION` is there if it counts, and whoever calls `add_reward` fills it in.
"""


@inlined
def add_reward(
    weights: Array,
    before: float,
    after: float,
    collided: bool,
    reached: bool,
    terms: Array,
    total: Array,
    e: int,
) -> None:
    """Fill in the weighted terms of an episode's step, and add them to its return.

    Takes the tool's distances from the goal before and after the step [m].
    """
    sign = select(after < before, 1.0, select(after > before, -1.0, 0.0))
    terms[e, PROGRESS] = weights[PROGRESS] * (before - after)
    terms[e, CLOSER] = weights[CLOSER] * sign
    terms[e, STEP] = weights[STEP]
    terms[e, COLLISION] = select(collided, weights[COLLISION], 0.0)
    terms[e, SUCCESS] = select(reached, weights[SUCCESS], 0.0)
    of_every_step = terms[e, PROGRESS]
    for term in range(PROGRESS + 1, COLLISION):
        of_every_step += terms[e, term]
    total[e] += of_every_step
    for term in range(COLLISION, weights.shape[0]):
        total[e] += terms[e, term]


@inlined
def remember(block: Block) -> None:
    """Keep which joint positions are seen, until after the next step."""
    for joint in range(block.q.shape[1]):
        block.former[0, joint] = block.q[0, joint]
        if block.plant.shape[0] > 0:
            block.former[0, joint] = block.sensed[0, joint]


@inlined
def observe(session: Session, poses: Array) -> float:
    """Write the observation of a block; return the distance to the goal [m].

    Takes the poses of joint frames and bodies.
    """
    call_stage(session.stages[OBSERVE], (session, poses))
    goal, tool = session.block.goal, session.chain.tool
    point = to_world(poses, session.block.q.shape[1], tool[0], tool[1], tool[2])
    dx, dy, dz = goal[0, 0] - point[0], goal[0, 1] - point[1], goal[0, 2] - point[2]
    return math.sqrt(dx * dx + dy * dy + dz * dz)

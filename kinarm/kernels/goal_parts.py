"""Formulas of the observation's parts that depend on the goal.

One is resolved-rate control (Whitney 1969): the step of inverse kinematics from here to the goal.
"""

from kinarm.kernels.compiling import inlined
from kinarm.kernels.goals import CONFIGURATION, DIRECTION, POSE, nearer_sign, write_reached
from kinarm.kernels.inverse import (
    DAMPING,
    LEAST_DAMPING,
    damped_step,
    half_turn_factor,
    take_out_turns,
)
from kinarm.kernels.kinematics import forward_kinematics, point_jacobian, to_world
from kinarm.kernels.plant import COMMAND
from kinarm.kernels.session import Session
from kinarm.kernels.surroundings import Seen


@inlined
def write_goal(session: Session, seen: Seen, start: int, count: int) -> None:
    """Position of the goal.

    Parameters
    ----------
    session, seen : Session and Seen
        What the step is made of, and what is seen after it. The observation,
        ``session.block.observation``, has the shape (1, n_observations).
    start, count : int
        The part's first entry, and how often it is there, one after the other.
    """
    for i in range(3):
        session.block.observation[0, start + i] = seen.goal[0, i]


@inlined
def write_offset(session: Session, seen: Seen, start: int, count: int) -> None:
    """Goal minus tool point."""
    session.block.observation[0, start] = seen.goal[0, 0] - seen.tool[0]
    session.block.observation[0, start + 1] = seen.goal[0, 1] - seen.tool[1]
    session.block.observation[0, start + 2] = seen.goal[0, 2] - seen.tool[2]


@inlined
def write_rest(session: Session, seen: Seen, start: int, count: int) -> None:
    """What a goal has beside its position."""
    for i in range(session.block.goal.shape[1] - 3):
        session.block.observation[0, start + i] = seen.goal[0, 3 + i]


@inlined
def write_rest_error(session: Session, seen: Seen, start: int, count: int) -> None:
    """The same less that of the tool."""
    goal, block = session.rules.goal, session.block
    if block.turn.shape[0] > 0:
        reached = block.seen_reached
        write_reached(goal, seen.tool, seen.frames, seen.joints, reached, 0)
        sign = nearer_sign(goal.kind, reached, 0, seen.goal, 0)
        for i in range(3, block.goal.shape[1]):
            missing = seen.goal[0, i] - sign * reached[0, i]
            block.observation[0, start + i - 3] = missing


@inlined
def write_resolved_rate(session: Session, seen: Seen, start: int, count: int) -> None:
    """Damped Newton step of each actuated joint to the goal, by its limit, at most 1 as a whole.

    It starts from joint positions as they were commanded, to which a step is added.
    """
    if session.block.plant.shape[0] > 0:
        _resolve(session, _as_commanded(session, seen), start, count)
    else:
        _resolve(session, seen, start, count)


@inlined
def _as_commanded(session: Session, seen: Seen) -> Seen:
    """What would be seen if joints were where they are told to be."""
    chain, block = session.chain, session.block
    n_joints, tool = block.q.shape[1], chain.tool
    for joint in range(n_joints):
        block.told[0, joint] = seen.joints[0, joint]
    for axis in range(block.drive.shape[1]):
        block.told[0, axis] = block.drive[COMMAND, axis]
    forward_kinematics(chain, block.told, 0, block.told_poses)
    point = to_world(block.told_poses, n_joints, tool[0], tool[1], tool[2])
    return Seen(seen.poses, block.told_poses, point, seen.goal, block.told, seen.before)


@inlined
def _resolve(session: Session, seen: Seen, start: int, count: int) -> None:
    """The same, from what is given as seen."""
    block, goal, limit = session.block, session.rules.goal, session.rules.step_limit
    step, longest = block.newton[0], 1.0 + 0.0 * seen.tool[0]
    if goal.kind == CONFIGURATION:
        for k in range(count):
            step[k] = seen.goal[0, 3 + k] - seen.joints[0, k]
    else:
        _find_errors(session, seen)
        squares = 0.0 * seen.tool[0]
        for i in range(block.error.shape[0]):
            squares += block.error[i] * block.error[i]
        damping = DAMPING * squares + LEAST_DAMPING
        damped_step(block.jacobian, block.error, damping, block.square, step)
    for k in range(count):
        step[k] = step[k] / limit[k]
        longest = max(longest, abs(step[k]))
    for k in range(count):
        block.observation[0, start + k] = step[k] / longest


@inlined
def _find_errors(session: Session, seen: Seen) -> None:
    """Errors of position [m] and rotation [rad, as twice the sine of half of it], and Jacobian."""
    block, goal, jacobian = session.block, session.rules.goal, session.block.jacobian
    point_jacobian(session.chain, seen.frames, seen.tool, jacobian)
    for i in range(3):
        block.error[i] = seen.goal[0, i] - seen.tool[i]
    if block.turn.shape[0] > 0 and jacobian.shape[0] > 3:
        reached = block.seen_reached
        write_reached(goal, seen.tool, seen.frames, seen.joints, reached, 0)
        if goal.kind == DIRECTION:
            ax, ay, az = reached[0, 3], reached[0, 4], reached[0, 5]
            bx, by, bz = seen.goal[0, 3], seen.goal[0, 4], seen.goal[0, 5]
            longer = half_turn_factor(ax * bx + ay * by + az * bz)
            block.error[3] = longer * (ay * bz - az * by)
            block.error[4] = longer * (az * bx - ax * bz)
            block.error[5] = longer * (ax * by - ay * bx)
            take_out_turns((ax, ay, az), jacobian)
        elif goal.kind == POSE:
            sign = 2.0 * nearer_sign(goal.kind, reached, 0, seen.goal, 0)
            aw, ax, ay, az = reached[0, 3], reached[0, 4], reached[0, 5], reached[0, 6]
            bw, bx, by, bz = seen.goal[0, 3], seen.goal[0, 4], seen.goal[0, 5], seen.goal[0, 6]
            block.error[3] = sign * (bx * aw - bw * ax - by * az + bz * ay)
            block.error[4] = sign * (by * aw - bw * ay - bz * ax + bx * az)
            block.error[5] = sign * (bz * aw - bw * az - bx * ay + by * ax)

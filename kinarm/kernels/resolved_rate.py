"""Resolved-rate control (Whitney 1969): the step of inverse kinematics from here to the goal."""

import math

from kinarm.kernels.compiling import inlined
from kinarm.kernels.goals import CONFIGURATION, DIRECTION, POSE, nearer_sign, write_reached
from kinarm.kernels.inverse import DAMPING, LEAST_DAMPING, damped_step
from kinarm.kernels.kinematics import point_jacobian
from kinarm.kernels.session import Session
from kinarm.kernels.surroundings import Seen


@inlined
def write_resolved_rate(session: Session, seen: Seen, start: int, count: int) -> None:
    """Damped Newton step of each actuated joint to the goal, by its limit, at most 1 as a whole."""
    if session.block.newton.shape[0] > 0:
        _resolve(session, seen, start, count)


@inlined
def _resolve(session: Session, seen: Seen, start: int, count: int) -> None:
    """The same, where there is work space for it."""
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
            # Of the sine of the angle, that of its half, which grows up to a half turn.
            cosine = ax * bx + ay * by + az * bz
            longer = 1.0 / math.sqrt(max(0.5 + 0.5 * cosine, 1e-6))
            block.error[3] = longer * (ay * bz - az * by)
            block.error[4] = longer * (az * bx - ax * bz)
            block.error[5] = longer * (ax * by - ay * bx)
            for k in range(jacobian.shape[1]):  # turns about the axis do not count
                along = ax * jacobian[3, k] + ay * jacobian[4, k] + az * jacobian[5, k]
                jacobian[3, k] -= along * ax
                jacobian[4, k] -= along * ay
                jacobian[5, k] -= along * az
        elif goal.kind == POSE:
            sign = 2.0 * nearer_sign(goal.kind, reached, 0, seen.goal, 0)
            aw, ax, ay, az = reached[0, 3], reached[0, 4], reached[0, 5], reached[0, 6]
            bw, bx, by, bz = seen.goal[0, 3], seen.goal[0, 4], seen.goal[0, 5], seen.goal[0, 6]
            block.error[3] = sign * (bx * aw - bw * ax - by * az + bz * ay)
            block.error[4] = sign * (by * aw - bw * ay - bz * ax + bx * az)
            block.error[5] = sign * (bz * aw - bw * az - bx * ay + by * ax)

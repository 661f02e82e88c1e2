"""Goals beyond standing points: errors of rotation, arriving, and the next goal.

A row of a goal is a position and a rest: nothing, a direction, a quaternion or a configuration
(`kinarm.goals`). What the tool has reached is such a row, too. A goal is reached once its errors
and the tool's speed have been within their limits for some steps in a row. Then the next one
appears, or the episode ends in success.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.chain import Chain
from kinarm.episodes import Episodes, Rules
from kinarm.kernels.compiling import Array, Vector, inlined, lean_kernel
from kinarm.kernels.elementary import TURN, angle_of, sine_cosine
from kinarm.kernels.kinematics import forward_kinematics, rotated, to_world
from kinarm.kernels.lanes import any_lane, as_numbers, select
from kinarm.kernels.reward import ROTATION, add_reward
from kinarm.kernels.work_space import Block

POSITION, DIRECTION, POSE, CONFIGURATION = range(4)
"""Kinds of goals."""


class GoalRules(NamedTuple):
    """What is to be reached, and how, for the kernels.

    Attributes
    ----------
    kind, hold, sequence : int
        Kind of the goals; steps in a row that a goal is to be kept; and goals of an episode.
    tolerance : float
        Error of the rest at which it counts as reached [rad, or rad or m].
    stride : float
        Largest move of the tool in the step that reaches a goal [m].
    axis : ndarray, shape (3,)
        Direction of the tool's axis in the last joint frame.
    frame : ndarray, shape (4,)
        Orientation of the tool frame in the last joint frame: quaternion w x y z.
    moves : ndarray, shape (horizon + 1, 3) or (0, 3)
        Offset of moving goals after each step [m].
    """

    kind: int
    hold: int
    sequence: int
    tolerance: float
    stride: float
    axis: Array
    frame: Array
    moves: Array


@inlined
def write_reached(
    goal: GoalRules, tool: Vector, poses: Array, q: Array, rows: Array, row: int
) -> None:
    """Write what the tool has reached as a row of a goal.

    Parameters
    ----------
    goal, tool
        The rules, and the tool point [m].
    poses, q : ndarray, shape (n_frames, POSE) and (n, n_joints)
        Frames of the joints at a row of the configurations.
    rows, row
        Where it goes, and the row.
    """
    rows[row, 0], rows[row, 1], rows[row, 2] = tool
    last, axis, frame = q.shape[1], goal.axis, goal.frame
    if goal.kind == DIRECTION:
        rows[row, 3], rows[row, 4], rows[row, 5] = rotated(poses, last, axis[0], axis[1], axis[2])
    elif goal.kind == POSE:
        pw, px, py, pz = poses[last, 0], poses[last, 1], poses[last, 2], poses[last, 3]
        w, x, y, z = frame[0], frame[1], frame[2], frame[3]
        rows[row, 3] = pw * w - px * x - py * y - pz * z
        rows[row, 4] = pw * x + px * w + py * z - pz * y
        rows[row, 5] = pw * y - px * z + py * w + pz * x
        rows[row, 6] = pw * z + px * y - py * x + pz * w
    elif goal.kind == CONFIGURATION:
        for joint in range(q.shape[1]):
            rows[row, 3 + joint] = q[row, joint]


@inlined
def nearer_sign(kind: int, reached: Array, r: int, wanted: Array, w: int) -> float:
    """Sign of the reached quaternion that is nearer to the wanted one; 1 for other rests."""
    sign = 1.0
    if kind == POSE:
        same = reached[r, 3] * wanted[w, 3] + reached[r, 4] * wanted[w, 4]
        same += reached[r, 5] * wanted[w, 5] + reached[r, 6] * wanted[w, 6]
        sign = select(same < 0.0, -1.0, 1.0)
    return sign


@inlined
def turn_between(kind: int, reached: Array, r: int, wanted: Array, w: int) -> float:
    """Angle between two rows' directions or rotations, or their largest difference of a joint.

    It is in [rad], or [m] for a sliding joint.
    """
    turn = 0.0
    if kind == DIRECTION:
        ax, ay, az = reached[r, 3], reached[r, 4], reached[r, 5]
        bx, by, bz = wanted[w, 3], wanted[w, 4], wanted[w, 5]
        x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        turn = angle_of(math.sqrt(x * x + y * y + z * z), ax * bx + ay * by + az * bz)
    elif kind == POSE:
        aw, ax, ay, az = reached[r, 3], reached[r, 4], reached[r, 5], reached[r, 6]
        bw, bx, by, bz = wanted[w, 3], wanted[w, 4], wanted[w, 5], wanted[w, 6]
        cosine = abs(aw * bw + ax * bx + ay * by + az * bz)
        x = aw * bx - ax * bw - ay * bz + az * by
        y = aw * by + ax * bz - ay * bw - az * bx
        z = aw * bz - ax * by + ay * bx - az * bw
        turn = 2.0 * angle_of(math.sqrt(x * x + y * y + z * z), cosine)
    elif kind == CONFIGURATION:
        for i in range(3, wanted.shape[1]):
            turn = max(turn, abs(reached[r, i] - wanted[w, i]))
    return turn


@lean_kernel
def fill_reached(chain: Chain, goal: GoalRules, q: Array, poses: Array, rows: Array) -> None:
    """Fill in what is reached at configurations, as rows of goals.

    Parameters
    ----------
    chain, goal, q
        The arm, the rules, and configurations, shape (n, n_joints).
    poses, rows : ndarray, shape (n_joints + 1, POSE) and (n, goal_width)
        Work space, and where it goes.
    """
    for e in range(q.shape[0]):
        forward_kinematics(chain, q, e, poses)
        tool = to_world(poses, q.shape[1], chain.tool[0], chain.tool[1], chain.tool[2])
        write_reached(goal, tool, poses, q, rows, e)


@lean_kernel
def errors_between(
    kind: int, reached: Array, wanted: Array, distances: Array, turns: Array
) -> None:
    """Fill in distances [m] and turns of rows of goals, shape (n, width), from what is reached."""
    for row in range(reached.shape[0]):
        x, y = reached[row, 0] - wanted[row, 0], reached[row, 1] - wanted[row, 1]
        z = reached[row, 2] - wanted[row, 2]
        distances[row] = math.sqrt(x * x + y * y + z * z)
        turns[row] = turn_between(kind, reached, row, wanted, row)


@lean_kernel
def circle_points(shares: Array, cosines: Array, sines: Array) -> None:
    """Fill in cosines and sines of shares of a whole turn, shape (n,)."""
    for row in range(len(shares)):
        sines[row], cosines[row] = sine_cosine(TURN * shares[row])


@inlined
def put_goal(
    e: int, step: int, number: int, lane: int, goal: GoalRules, goals: Array, held: Array
) -> None:
    """Put an episode's goal after so many steps and goals reached into a lane.

    Parameters
    ----------
    e, step, number, lane : int
        Episode, steps taken, goals reached, and lane.
    goal, goals : GoalRules and ndarray, shape (n_episodes, n_goals, goal_width)
        How goals change, and those of all episodes.
    held : lanes, shape (1, goal_width)
        Where it goes.
    """
    wanted, width = as_numbers(held), goals.shape[2]
    number = min(number, goal.sequence - 1)
    for i in range(width):
        wanted[0, i, lane] = goals[e, number, i]
    if goal.moves.shape[0] > 0:
        for i in range(3):
            wanted[0, i, lane] += goal.moves[step, i]


@inlined
def put_goals(row: NDArray[np.int64], goal: GoalRules, episodes: Episodes, block: Block) -> None:
    """Put the present goals of a block's episodes into its lanes."""
    for lane in range(row.shape[0]):
        if row[lane] >= 0:
            step = int(as_numbers(block.steps)[0, lane])
            number = int(as_numbers(block.goals_reached)[0, lane])
            put_goal(row[lane], step, number, lane, goal, episodes.pursuit.goals, block.goal)


@inlined
def measure(chain: Chain, goal: GoalRules, poses: Array, block: Block) -> float:
    """Find what is reached and its turn; return the tool's distances from goals [m].

    Takes poses of the joint frames at the configurations.
    """
    tool = to_world(poses, block.q.shape[1], chain.tool[0], chain.tool[1], chain.tool[2])
    write_reached(goal, tool, poses, block.q, block.reached, 0)
    block.turn[0] = turn_between(goal.kind, block.reached, 0, block.goal, 0)
    x, y, z = block.goal[0, 0] - tool[0], block.goal[0, 1] - tool[1], block.goal[0, 2] - tool[2]
    return math.sqrt(x * x + y * y + z * z)


@inlined
def arrive(
    chain: Chain,
    rules: Rules,
    poses: Array,
    row: NDArray[np.int64],
    episodes: Episodes,
    block: Block,
) -> NDArray[np.bool_]:
    """Measure and reward a step that was made; return which episodes end in success.

    Parameters
    ----------
    chain, rules
        The arm, and what is to be reached.
    poses : ndarray, shape (n_frames, POSE)
        Poses of the joint frames, which come first, after the step.
    row : ndarray of int, shape (LANES,)
        Episode of each lane, -1 for none.
    episodes, block
        All episodes, and the block of those that stepped.
    """
    goal = rules.goal
    before, turn = block.distance[0], block.turn[0]
    if goal.moves.shape[0] > 0:
        put_goals(row, goal, episodes, block)
    x, y, z = block.reached[0, 0], block.reached[0, 1], block.reached[0, 2]
    after = measure(chain, goal, poses, block)
    x, y, z = block.reached[0, 0] - x, block.reached[0, 1] - y, block.reached[0, 2] - z
    within = (after <= rules.tolerance) & (block.turn[0] <= goal.tolerance)
    within = within & (math.sqrt(x * x + y * y + z * z) <= goal.stride)
    block.held[0] = select(within, block.held[0] + 1.0, 0.0)
    reached = block.held[0] >= goal.hold
    if rules.reward.shape[0] > ROTATION:
        block.terms[0, ROTATION] = rules.reward[ROTATION] * (turn - block.turn[0])
    add_reward(rules.reward, before, after, after < 0.0, reached, block.terms, block.total, 0)
    block.goals_reached[0] += select(reached, 1.0, 0.0)
    onward = reached & (block.goals_reached[0] < goal.sequence)
    if any_lane(onward):
        block.held[0] = select(onward, 0.0, block.held[0])
        put_goals(row, goal, episodes, block)
        after = measure(chain, goal, poses, block)
    block.distance[0] = after
    return reached & ~onward

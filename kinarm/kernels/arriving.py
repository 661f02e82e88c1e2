"""Steps towards goals beyond standing points that are reached once touched.

A goal is reached once its errors and the tool's speed have been within their limits for some steps
in a row. Then the next one appears, or the episode ends in success.
"""

import math

import numpy as np
from numpy.typing import NDArray

from kinarm.chain import Chain
from kinarm.episodes import Episodes, Rules
from kinarm.kernels.compiling import Array, inlined
from kinarm.kernels.goals import GoalRules, turn_between, write_reached
from kinarm.kernels.kinematics import to_world
from kinarm.kernels.lanes import any_lane, as_numbers, select
from kinarm.kernels.reward import ROTATION, add_reward
from kinarm.kernels.work_space import Block


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

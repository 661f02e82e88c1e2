"""Proof that a step is free of contact.

A step moves the arm from q to q' and is tested at n configurations q + k/n (q' - q). Each tested
pair of bodies carries a *slack*: a certified lower bound of its distance at q. Slack that
outlasts the largest possible motion of a step proves it; else the pair's distance at q' is bounded
anew, and only if that is not enough, at the configurations between.
"""

import numpy as np
from numpy.typing import NDArray

from kinarm.chain import Chain
from kinarm.collision import ContactShapes
from kinarm.kernels.compiling import Array, inlined
from kinarm.kernels.distance import clearance
from kinarm.kernels.kinematics import forward_kinematics

MARGIN = 1e-6
"""Distance below which freedom is not claimed [m]: the tolerance of Coal's iterations."""


@inlined
def is_apart(bound: float) -> bool:
    """Whether a lower bound of a distance proves freedom from contact; NaN proves nothing."""
    return bound > MARGIN


@inlined
def spend_slack(
    row: int, travel: Array, q: Array, target: Array, slack: Array, motion: Array
) -> bool:
    """Reduce an episode's slack by the motion of a step; return whether some pair has none left.

    Fills in bounds of the relative ``motion`` of the pairs, shape (n_pairs,) [m].
    """
    n_pairs = slack.shape[1]
    for pair in range(n_pairs):
        motion[pair] = 0.0
    for axis in range(travel.shape[0]):
        turn = abs(target[row, axis] - q[row, axis])
        for pair in range(n_pairs):
            motion[pair] += travel[axis, pair] * turn
    least = np.inf
    for pair in range(n_pairs):
        slack[row, pair] -= motion[pair]
        least = min(least, slack[row, pair])
    return not is_apart(least)


@inlined
def prove_step(
    row: int,
    chain: Chain,
    shapes: ContactShapes,
    tested: int,
    q: Array,
    target: Array,
    slack: Array,
    motion: Array,
    poses: Array,
    between: Array,
    middle: Array,
    listed: NDArray[np.int64],
) -> int:
    """Prove the tested configurations of a step free where the slack ran out, and renew it.

    Takes slack and motion as `spend_slack` left them and the poses at the target; ``between``,
    ``middle`` and ``listed`` are work space, shape (n_joints + 1, POSE), (1, n_joints) and
    (2, n_pairs + 1). Returns a number whose bit k - 1 is set if configuration k could not be
    proven free.
    """
    prismatic, translation, rotation, axes = chain[:4]
    link, capsules, boxes, pairs = shapes[:4]
    n_pairs, n_joints = slack.shape[1], q.shape[1]
    doubt, n_spent, n_open, open_between = 0, 0, 0, 0
    for pair in range(n_pairs):
        listed[0, n_spent] = pair
        n_spent += 0 if is_apart(slack[row, pair]) else 1
    for index in range(n_spent):
        pair = listed[0, index]
        before = slack[row, pair] + motion[pair]
        after = clearance(pair, pairs, capsules, link, boxes, poses)
        slack[row, pair] = after
        if not is_apart(after):
            doubt |= 1 << (tested - 1)
        unproven = 0
        for k in range(1, tested):
            share = k / tested
            left = before - share * motion[pair]
            right = after - (1.0 - share) * motion[pair]
            unproven |= 0 if is_apart(max(left, right)) else 1 << (k - 1)
        listed[0, n_open], listed[1, n_open] = pair, unproven
        n_open += 0 if unproven == 0 else 1
        open_between |= unproven
    for k in range(1, tested):
        bit = 1 << (k - 1)
        if open_between & bit:
            for axis in range(n_joints):
                middle[0, axis] = q[row, axis] + k / tested * (target[row, axis] - q[row, axis])
            forward_kinematics(prismatic, translation, rotation, axes, middle, 0, between)
            for index in range(n_open):
                if listed[1, index] & bit and not is_apart(
                    clearance(listed[0, index], pairs, capsules, link, boxes, between)
                ):
                    doubt |= bit
                    break
    return doubt

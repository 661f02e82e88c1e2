"""Proof that steps are free of contact, for a block of episodes.

A step moves the arm from q to q' and is tested at n configurations q + k/n (q' - q). Each tested
pair of bodies carries a *slack*: a certified lower bound of its distance at q. Slack that
outlasts the largest possible motion of a step proves it; else the pair's distance at q' is bounded
anew, and only if that is not enough, at the configurations between.
"""

from kinarm.chain import Chain
from kinarm.collision import ContactShapes
from kinarm.kernels.block import Block
from kinarm.kernels.compiling import Array, inlined
from kinarm.kernels.distance import clearance
from kinarm.kernels.kinematics import forward_kinematics
from kinarm.kernels.lanes import any_lane, lane_bits, select

MARGIN = 1e-6
"""Distance below which freedom is not claimed [m]: the tolerance of Coal's iterations."""


@inlined
def is_apart(bound: float) -> bool:
    """Whether a lower bound of a distance proves freedom from contact; NaN proves nothing."""
    return bound > MARGIN


@inlined
def spend_slack(travel: Array, block: Block) -> bool:
    """Reduce slack by the motion of a step; return where some pair has none left.

    Fills in bounds of the relative ``motion`` of the pairs [m].
    """
    n_pairs = travel.shape[1]
    least = 0.0 * block.distance[0] + 1.0
    for pair in range(n_pairs):
        moved = abs(block.target[0, 0] - block.q[0, 0]) * travel[0, pair]
        for axis in range(1, travel.shape[0]):
            moved += abs(block.target[0, axis] - block.q[0, axis]) * travel[axis, pair]
        block.motion[pair] = moved
        left = block.slack[pair] - moved
        block.slack[pair] = left
        least = min(least, left)
    return ~is_apart(least)


@inlined
def prove_step(chain: Chain, shapes: ContactShapes, tested: int, needed: bool, block: Block) -> int:
    """Prove the tested configurations of a step free where the slack ran out, and renew it.

    Takes slack and motion as `spend_slack` left them and the poses at the target; ``needed`` says
    for which episodes. Returns the bits of the episodes that are in doubt; for them, bit k of
    ``block.doubt[e]`` is set if configuration k + 1 could not be proven free.
    """
    prismatic, translation, rotation, axes = chain[:4]
    link, capsules, boxes, pairs = shapes[:4]
    n_open, open_between, doubtful = 0, 0, 0
    for pair in range(pairs.shape[0]):
        spent = needed & ~is_apart(block.slack[pair])
        if not any_lane(spent):
            continue
        before = block.slack[pair] + block.motion[pair]
        after = clearance(pair, pairs, capsules, link, boxes, block.poses)
        block.slack[pair] = select(needed, max(block.slack[pair], after), block.slack[pair])
        doubtful |= note_doubt(lane_bits(spent & ~is_apart(after)), tested - 1, block)
        opened = 0
        for k in range(1, tested):
            share = k / tested
            left = before - share * block.motion[pair]
            right = after - (1.0 - share) * block.motion[pair]
            bits = lane_bits(spent & ~is_apart(max(left, right)))
            block.open[n_open, k] = bits
            opened |= bits
            open_between |= (bits != 0) << k
        block.open[n_open, 0] = pair
        n_open += 1 if opened != 0 else 0
    for k in range(1, tested):
        if open_between >> k & 1 == 0:
            continue
        for axis in range(block.q.shape[1]):
            way = block.target[0, axis] - block.q[0, axis]
            block.middle[0, axis] = block.q[0, axis] + k / tested * way
        forward_kinematics(prismatic, translation, rotation, axes, block.middle, 0, block.between)
        for index in range(n_open):
            if block.open[index, k] != 0:
                pair = block.open[index, 0]
                gap = clearance(pair, pairs, capsules, link, boxes, block.between)
                bits = block.open[index, k] & lane_bits(~is_apart(gap))
                doubtful |= note_doubt(bits, k - 1, block)
    return doubtful


@inlined
def note_doubt(bits: int, bit: int, block: Block) -> int:
    """Set a bit in the doubts of the episodes with these bits, which are returned."""
    if bits != 0:
        for lane in range(block.doubt.shape[0]):
            block.doubt[lane] |= (bits >> lane & 1) << bit
    return bits

"""Proof that the steps of a block are free: together, by new planes, then one by one."""

from typing import Any

from kinarm.chain import Chain
from kinarm.contact_shapes import ContactShapes
from kinarm.episodes import Episodes, Rules
from kinarm.kernels.compiling import Array, inlined
from kinarm.kernels.kinematics import forward_kinematics, place_bodies
from kinarm.kernels.lanes import any_lane, lane_bits
from kinarm.kernels.proof import first_contact, is_apart, prove_alone, prove_step, renew_planes
from kinarm.kernels.session import Alone, Block


@inlined
def doubtful_steps(
    asked: Any,
    moved: bool,
    row: Array,
    before: Array,
    poses: Array,
    chain: Chain,
    shapes: ContactShapes,
    rules: Rules,
    episodes: Episodes,
    block: Block,
    alone: Alone,
) -> int:
    """Bits of the lanes, of those ``asked``, whose step is not proven free.

    Takes the poses at the target, and those ``before`` if they are known, not ``moved``. Fills in
    the episodes' ``doubt``, and the number of a pair, from 1, that surely touches, or 0.
    """
    found, unproven = 0, ~is_apart(prove_step(shapes, rules.tested, poses, block)) & asked
    if any_lane(unproven):
        if moved:
            forward_kinematics(chain, block.q, 0, before)
        least = renew_planes(shapes, rules.tested, unproven, before, poses, block)
        unproven = unproven & ~is_apart(least)
    if any_lane(unproven):
        still = lane_bits(unproven)
        for lane in range(row.shape[0]):
            if still >> lane & 1 == 0:
                continue
            e = row[lane]
            if episodes.scenes.shape[0] > 0:
                place_bodies(episodes.scenes[e], alone.before)
            doubt = prove_alone(lane, chain, shapes, rules.tested, before, poses, block, alone)
            if doubt != 0:
                found |= 1 << lane
                episodes.doubt[e] = doubt
                episodes.touched[e] = first_contact(
                    lane, doubt, chain, shapes, rules.tested, block, alone
                )
    return found

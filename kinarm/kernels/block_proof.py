"""Proof that the steps of a block are free: together, by new planes, then one by one."""

from typing import Any

from kinarm.kernels.compiling import Array, helper
from kinarm.kernels.kinematics import forward_kinematics, place_bodies
from kinarm.kernels.lanes import any_lane, lane_bits
from kinarm.kernels.proof import first_contact, is_apart, prove_alone, prove_step, renew_planes
from kinarm.kernels.session import Session
from kinarm.kernels.work_space import Block


@helper
def doubtful_steps(
    asked: Any,
    moved: bool,
    named: int,
    one: bool,
    row: Array,
    before: Array,
    poses: Array,
    session: Session,
    block: Block,
) -> int:
    """Bits of the lanes, of those ``asked``, whose step is not proven free.

    Takes the poses at the target, and those ``before`` if they are known, not ``moved``. Fills in
    the episodes' ``doubt``, and for lanes whose bits are ``named`` the number of a pair, from 1,
    that surely touches, or 0. If ``one`` will do, lanes after the first that is free are left open.
    """
    chain, shapes, rules = session.chain, session.shapes, session.rules
    episodes, alone = session.episodes, session.alone
    found, unproven = 0, ~is_apart(prove_step(shapes, rules.tested, poses, block)) & asked
    if any_lane(unproven):
        if moved:
            forward_kinematics(chain, block.q, 0, before)
        least = renew_planes(shapes, rules.tested, unproven, before, poses, block)
        unproven = unproven & ~is_apart(least)
    if any_lane(unproven):
        still, proven = lane_bits(unproven), lane_bits(asked) if one else 0
        for lane in range(row.shape[0]):
            if still >> lane & 1 == 0:
                if proven >> lane & 1:
                    break
                continue
            e = row[lane]
            if episodes.scenes.shape[0] > 0:
                place_bodies(episodes.scenes[e], alone.before)
            given, asks = (chain, shapes, rules.tested), named >> lane & 1
            doubt = prove_alone(lane, *given, before, poses, block, alone, asks == 0)
            if doubt != 0:
                found |= 1 << lane
                episodes.doubt[e] = doubt
                if doubt < 0:
                    alone.suspected[-doubt - 1] = 1
                if asks:
                    episodes.touched[e] = first_contact(lane, doubt, *given, block, alone)
            elif one:
                break
    return found

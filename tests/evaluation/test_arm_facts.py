"""What is told of an arm: shapes with their corners, and pairs that are left out with a reason."""

import pytest

from kinarm.arm import Arm
from kinarm.arm_specification import AllowedContact
from kinarm.contact_pairs import NEVER_TOUCH
from kinarm.contact_statistics import contact_on_bare_ground
from kinarm.evaluation.arm_facts import arm_facts, untested_pairs


@pytest.fixture(scope="module")
def arm(mesh_arm):
    """Of an arm whose first and last link are allowed to touch."""
    allowed = AllowedContact(links=("link_0", "link_4"), reason="a cable joins them")
    path = mesh_arm.specification.source
    return Arm.load(path, allowed_contacts=(allowed,))


def test_hulls_are_told_by_their_corners(arm):
    shapes = arm_facts(arm).partition("collision shapes\n")[2].splitlines()[:4]
    assert [line.partition(": ")[2] for line in shapes] == [
        "box",
        "convex hull of 8 vertices",
        "convex hull of 8 vertices",
        "cylinder",
    ]


def test_pairs_that_are_left_out_have_a_reason(arm):
    """Neighbours on the chain, those that are allowed to touch, and a bar high above the base."""
    contact = contact_on_bare_ground(arm)
    left_out = {
        frozenset((one, other)): reason
        for one, other, reason in untested_pairs(contact)
        if "ground" not in (one, other)
    }
    bodies = ("link_0", "link_2", "link_3", "link_4")
    assert left_out == {
        frozenset(("link_2", "link_3")): "neighbours",
        frozenset(("link_3", "link_4")): "neighbours",
        frozenset(("link_0", "link_4")): "allowed: a cable joins them",
        frozenset(("link_0", "link_2")): NEVER_TOUCH,
    }
    tested = {frozenset(pair) for pair in contact.pair_names if "ground" not in pair}
    assert tested == {
        *map(frozenset, [bodies[:3:2], bodies[1::2]]),
    }

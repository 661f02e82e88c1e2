"""What Pinocchio cannot make a model of is refused in a line of kinarm's."""

from pathlib import Path

import pytest

from kinarm.arm_model import build_model, build_shapes
from kinarm.errors import ArmError
from kinarm.urdf import Description

CHAIN = """<robot name="made"><link name="a">{shape}</link><link name="b"/>
<joint name="j" type="{kind}"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" velocity="1" effort="0"/></joint></robot>"""


def described(kind="revolute", shape=""):
    text = CHAIN.format(kind=kind, shape=shape and f"<collision>{shape}</collision>")
    return Description(Path("made.urdf"), text, ("a", "b"), "b", {}, ())


def test_a_chain_and_its_shapes():
    description = described(shape='<geometry><box size="1 2 3"/></geometry>')
    model = build_model(description)
    assert (model.njoints, build_shapes(description, model).ngeoms) == (2, 1)


def test_joints_of_no_kind():
    with pytest.raises(ArmError, match=r"^made\.urdf is not a readable URDF: [^\n]+$"):
        build_model(described(kind="telepathic"))


def test_nothing_that_moves():
    with pytest.raises(ArmError, match=r"^made\.urdf has no moving joint$"):
        build_model(described(kind="fixed"))


def test_shapes_that_are_not_read():
    """Pinocchio drops what it does not know, which must not be left out in silence."""
    description = described(shape="<geometry/>")
    with pytest.raises(ArmError, match=r"^made\.urdf declares 1 collision shapes but 0 were read$"):
        build_shapes(description, build_model(described()))

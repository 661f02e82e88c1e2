"""Robot descriptions and meshes that claim what cannot be: refused before libraries see them."""

import pytest

from kinarm.arm import Arm
from kinarm.errors import ArmError
from kinarm.urdf_tree import MOST_LINKS, parse_xml

ENTITIES = "".join(f'<!ENTITY e{n} "{10 * f"&e{n - 1};"}">' for n in range(1, 9))
BOMB = f'<!DOCTYPE a [<!ENTITY e0 "{100 * "b"}">{ENTITIES}]><robot>&e8;</robot>'.encode()


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (BOMB, "amplification"),
        (b"<a><b></a>", "mismatched tag"),
        (b"", "no element found"),
        (b"<a:b/>", "unbound prefix"),
        (b'<?xml version="1.0" encoding="xyz"?><a/>', "unknown encoding"),
        (b'<?xml version="1.0" encoding="hex"?><a/>', "not a text encoding"),
        (b'<?xml version="1.0" encoding="utf-7"?><a/>', "not supported"),
    ],
)
def test_documents_that_are_refused(content, reason):
    with pytest.raises(ValueError, match=reason):
        parse_xml(content)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"xyz": "0 0 1e308"}, "xyz of <origin>"),
        ({"rpy": "nan 0 0"}, "rpy of <origin>"),
        ({"xyz": "0 0"}, "must be 3"),
        ({"axis": "0 0 0"}, "no axis"),
        ({"limit": '<limit lower="-inf" upper="1" velocity="1"/>'}, "lower of <limit>"),
        ({"limit": '<limit upper="1" velocity="-1e308"/>'}, "must be 1 from 0 to"),
        ({"limit": '<limit lower="1" upper="-1" velocity="1"/>'}, "no usable limits: 1.0..-1.0"),
        ({"limit": '<limit upper="1e308" velocity="1"/>'}, "no usable limits"),
    ],
)
def test_joints_that_are_refused(make_joint, write_robot, changes, words, capfd):
    path = write_robot([make_joint(**changes), make_joint(axis="0 1 0")])
    with pytest.raises(ArmError, match=f"'joint_1' of made.urdf.*{words}"):
        Arm.load(path)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        ("<joint/>", "a joint has no name"),
        ("<link/>", "a link has no name"),
        ('<link name="link_0"/>', "two links are called 'link_0'"),
        ("".join(f'<link name="more_{n}"/>' for n in range(MOST_LINKS)), "links: more than"),
        (
            '<joint name="joint_1" type="fixed">'
            '<parent link="link_0"/><child link="link_1"/></joint>',
            "two joints are called 'joint_1'",
        ),
        (
            '<link name="a"/><link name="b"/>'
            '<joint name="ab" type="fixed"><parent link="a"/><child link="b"/></joint>'
            '<joint name="ba" type="fixed"><parent link="b"/><child link="a"/></joint>',
            "form a loop",
        ),
    ],
)
def test_robots_that_are_refused(make_joint, write_robot, extra, words):
    path = write_robot([make_joint()], extra=extra)
    with pytest.raises(ArmError, match=f"made.urdf.*{words}"):
        Arm.load(path)


def test_of_several_shapes_of_one_element_the_first_counts(make_joint, make_collision, write_robot):
    both = make_collision('<sphere radius="0.1"/><box size="9 9 9"/>')
    arm = Arm.load(write_robot([make_joint()], {1: both}))
    assert arm.description.text.count("<sphere") == 1
    assert "<box" not in arm.description.text


@pytest.mark.parametrize(
    "shape", ['<box size="1 1 -1"/>', '<sphere radius="1e308"/>', "<cone/>", "<sphere/>", ""]
)
def test_shapes_that_are_refused(make_joint, make_collision, write_robot, shape, capfd):
    path = write_robot([make_joint()], {1: make_collision(shape)})
    with pytest.raises(ArmError, match="link 'link_1' of made.urdf"):
        Arm.load(path)
    assert capfd.readouterr() == ("", "")


def test_a_tool_point_far_away_is_refused():
    with pytest.raises(ArmError, match="tool_offset must be at most 10000 m"):
        Arm.load("paper", tool_offset=(0.0, 1e308, 0.0))


def test_a_wheel_that_carries_nothing_is_held_where_it_is(make_joint, write_robot):
    """A continuous joint has no range to be in the middle of."""
    wheel = (
        '<link name="wheel"/><joint name="roll" type="continuous"><parent link="link_1"/>'
        '<child link="wheel"/><axis xyz="1 0 0"/></joint>'
    )
    arm = Arm.load(write_robot([make_joint()], extra=wheel))
    assert arm.description.held == {"roll": 0.0}


def test_elements_within_elements_without_end(make_joint, make_collision, write_robot):
    deep = 5000 * "<a>" + 5000 * "</a>"
    path = write_robot([make_joint()], {1: make_collision(f'<sphere radius="1">{deep}</sphere>')})
    with pytest.raises(ArmError, match="made.urdf is not a readable URDF: maximum recursion"):
        Arm.load(path)

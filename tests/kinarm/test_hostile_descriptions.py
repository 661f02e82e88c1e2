"""Robot descriptions and meshes that claim what cannot be: refused before libraries see them."""

import numpy as np
import pytest

from kinarm.arm import Arm
from kinarm.errors import ArmError
from kinarm.hulls import hull_of_mesh
from kinarm.mesh_content import mesh_content
from kinarm.urdf_schema import MOST_LINKS
from kinarm.xml_files import DEEPEST, parse_xml

BOMB = b'<!DOCTYPE a [<!ENTITY b "bbbbbbbbbb"><!ENTITY c "&b;&b;&b;&b;">]><robot>&c;</robot>'


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (BOMB, "entities"),
        (b"<a>" * (DEEPEST + 1), "levels"),
        (b'<a><b count="99999999999"/></a>', "more than it holds"),
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
        ({"limit": '<limit upper="1" velocity="-1e308"/>'}, "must be 1 of at least 0"),
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


@pytest.mark.parametrize(("number", "reason"), [("nan", "away"), ("1e30", "away"), ("0", "volume")])
def test_meshes_that_are_refused(tmp_path, number, reason):
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, number)]
    faces = "f 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n"
    path = tmp_path / "part.obj"
    path.write_text("".join("v {} {} {}\n".format(*corner) for corner in corners) + faces)
    with pytest.raises(ArmError, match=f"'part.obj'.*{reason}"):
        hull_of_mesh(path, np.ones(3))


@pytest.mark.parametrize("xyz", ["0 up 0", "0 0 0x"])
def test_words_in_place_of_numbers(make_joint, write_robot, xyz):
    path = write_robot([make_joint(xyz=xyz), make_joint(axis="0 1 0")])
    with pytest.raises(ArmError, match=f"numbers of xyz of <origin> must be 3 .*, got '{xyz}'"):
        Arm.load(path)


def test_links_that_nothing_holds(make_joint, write_robot):
    path = write_robot([make_joint()], extra='<link name="lost"/>')
    with pytest.raises(ArmError, match="has links that no joint joins: 'link_0', 'lost'"):
        Arm.load(path)


def test_a_robot_that_cannot_move(make_joint, write_robot):
    with pytest.raises(ArmError, match=r"made.urdf has no moving joint"):
        Arm.load(write_robot([make_joint("fixed")], tool=None))


def test_a_wheel_that_carries_nothing_is_held_where_it_is(make_joint, write_robot):
    """A continuous joint has no range to be in the middle of."""
    wheel = (
        '<link name="wheel"/><joint name="roll" type="continuous"><parent link="link_1"/>'
        '<child link="wheel"/><axis xyz="1 0 0"/></joint>'
    )
    arm = Arm.load(write_robot([make_joint()], extra=wheel))
    assert arm.description.held == {"roll": 0.0}


def test_meshes_with_words_in_place_of_numbers(tmp_path):
    path = tmp_path / "mesh.dae"
    path.write_text("<COLLADA><float_array>1.0 two 3.0</float_array></COLLADA>")
    with pytest.raises(ArmError, match=r"'mesh.dae' cannot .*<float_array> holds what is no"):
        mesh_content(path)


@pytest.mark.parametrize("count", ["-1e308", "-1", "24.5", "many", ""])
@pytest.mark.parametrize("name", ["count", "offset", "stride", "set"])
def test_collada_whose_counts_are_none(tmp_path, name, count):
    path = tmp_path / "mesh.dae"
    path.write_text(f'<COLLADA><float_array {name}="{count}">1.0 2.0</float_array></COLLADA>')
    with pytest.raises(ArmError, match=f"'mesh.dae' cannot .*{name} of <float_array> is no whole"):
        mesh_content(path)

"""A URDF is reduced to the chain that carries the tool, or refused with the reason."""

import math

import coal
import numpy as np
import pinocchio as pin
import pytest

from kinarm.arm import Arm
from kinarm.errors import ArmError, UnknownNameError

CENTRED = '<limit lower="-1" upper="1" velocity="2" effort="0"/>'
GRIPPER = """
<link name="finger_a"/><link name="finger_b"/>
<joint name="open_a" type="prismatic"><parent link="tool0"/><child link="finger_a"/>
<origin xyz="0 0.02 0" rpy="0.3 0.2 0.1"/><axis xyz="0 0.6 0.8"/>
<limit lower="{lower}" upper="0.04" velocity="1" effort="0"/></joint>
<joint name="open_b" type="revolute"><parent link="tool0"/><child link="finger_b"/>
<axis xyz="0 0 2"/><limit lower="-2" upper="2" velocity="1" effort="0"/>
<mimic joint="{leader}" multiplier="{factor}" offset="0.1"/></joint>
"""


def gripper(lower="0", factor="-3", leader="open_a"):
    return GRIPPER.format(lower=lower, factor=factor, leader=leader)


@pytest.fixture
def gripping(make_joint, write_robot):
    """Two axes that carry a gripper: a slide, and a joint that mimics it."""
    return write_robot([make_joint(), make_joint(axis="0 1 0")], extra=gripper())


def frame_pose(arm, q, name):
    data = arm.model.createData()
    pin.framesForwardKinematics(arm.model, data, np.asarray(q, dtype=float))
    return data.oMf[arm.model.getFrameId(name, pin.FrameType.BODY)].homogeneous


class TestHeldJoints:
    def test_what_does_not_carry_the_tool_is_held_at_zero(self, gripping):
        arm = Arm.load(gripping)
        assert arm.joint_names == ("joint_1", "joint_2")
        assert arm.description.held == {"open_a": 0.0, "open_b": pytest.approx(0.1)}
        (note,) = arm.description.notes
        assert note == "joints that do not carry the tool are held: open_a, open_b"

    @pytest.mark.parametrize("position", [-0.02, 0.0, 0.03])
    def test_poses_are_those_of_the_whole_tree(self, gripping, position):
        """Pinocchio reads the URDF with all its joints, one of which mimics another."""
        arm = Arm.load(gripping, held={"open_a": position})
        text = gripping.read_text().replace('<mimic joint="open_a"', '<ignored joint="open_a"')
        whole = pin.buildModelFromXML(text)
        data, q = whole.createData(), pin.neutral(whole)
        for name, value in {"joint_1": 0.4, "joint_2": -0.7, **arm.description.held}.items():
            q[whole.joints[whole.getJointId(name)].idx_q] = value
        assert arm.description.held["open_b"] == pytest.approx(-3 * position + 0.1)
        pin.framesForwardKinematics(whole, data, q)
        for link in ("tool0", "finger_a", "finger_b"):
            expected = data.oMf[whole.getFrameId(link, pin.FrameType.BODY)].homogeneous
            np.testing.assert_allclose(frame_pose(arm, [0.4, -0.7], link), expected, atol=1e-12)

    def test_joints_of_the_chain_can_be_held(self, make_joint, write_robot):
        path = write_robot([make_joint(axis="0 1 0") for _ in range(3)])
        arm, whole = Arm.load(path, held={"joint_2": 0.5}), Arm.load(path)
        assert arm.joint_names == ("joint_1", "joint_3")
        np.testing.assert_allclose(
            arm.tool_position([0.2, -0.3]), whole.tool_position([0.2, 0.5, -0.3]), atol=1e-12
        )

    @pytest.mark.parametrize("what", ["held", "limits"])
    def test_unknown_joints_are_refused(self, gripping, what):
        value = 0.0 if what == "held" else (0.0, 1.0)
        with pytest.raises(UnknownNameError, match=f"joint in {what} of made.urdf: 'jiont_1'"):
            Arm.load(gripping, **{what: {"jiont_1": value}})


class TestMimickingJoints:
    def test_one_that_carries_the_tool_is_refused_with_the_mend(self, make_joint, write_robot):
        follower = make_joint(limit=CENTRED + '<mimic joint="joint_1" multiplier="2"/>')
        path = write_robot([make_joint(), follower])
        with pytest.raises(ArmError, match=r"mimics 'joint_1' and.* tool: hold it \(held\)$"):
            Arm.load(path)
        arm = Arm.load(path, held={"joint_2": 0.2})
        assert arm.joint_names == ("joint_1",)

    def test_a_finger_that_became_the_tool_suggests_a_frame(self, make_joint, write_robot):
        path = write_robot([make_joint(), make_joint(axis="0 1 0")], extra=gripper())
        with pytest.raises(ArmError, match=r"'open_b'.* before it: --tool-frame tool0$"):
            Arm.load(path, tool_frame="finger_b")
        assert Arm.load(path, tool_frame="tool0").joint_names == ("joint_1", "joint_2")

    def test_one_that_follows_a_joint_of_the_chain_is_refused(self, make_joint, write_robot):
        path = write_robot([make_joint()], extra=gripper(leader="joint_1"))
        with pytest.raises(ArmError, match=r"'open_b'.*mimics 'joint_1', which moves: hold it"):
            Arm.load(path)
        assert Arm.load(path, held={"open_b": 0.3}).description.held["open_b"] == 0.3


class TestGivenLimits:
    def test_stand_in_for_those_that_are_missing(self, make_joint, write_robot):
        path = write_robot([make_joint(limit="")])
        arm = Arm.load(path, limits={"joint_1": (-1.0, 2.0)}, velocity_limits=[2])
        assert (arm.lower[0], arm.upper[0], arm.velocity_limits[0]) == (-1, 2, 2)

    def test_say_where_joints_stay_that_do_not_carry_the_tool(self, make_joint, write_robot):
        path = write_robot([make_joint()], extra=gripper())
        held = Arm.load(path, limits={"open_a": (0.02, 0.03)}).description.held
        assert held["open_a"] == 0.02


class TestContinuousJoints:
    def test_get_a_turn_and_a_note_or_the_limits_that_are_given(self, make_joint, write_robot):
        limit = '<limit velocity="1" effort="0"/>'
        path = write_robot([make_joint("continuous", axis="0 0.6 0.8", limit=limit)])
        arm = Arm.load(path)
        assert (arm.lower[0], arm.upper[0]) == (-math.pi, math.pi)
        (note,) = arm.description.notes
        assert note == "joint 'joint_1' is continuous: its range is taken as -180 to 180 deg"

        arm = Arm.load(path, limits={"joint_1": (-6, 6)})
        assert (arm.lower[0], arm.upper[0]) == (-6, 6)
        assert arm.description.notes == ()

    def test_without_a_speed_they_are_refused_unless_one_is_given(self, make_joint, write_robot):
        path = write_robot([make_joint("continuous", limit="")])
        with pytest.raises(ArmError, match="'joint_1'.*no velocity limit"):
            Arm.load(path)
        assert Arm.load(path, velocity_limits=[2]).n_joints == 1


class TestToolFrame:
    def test_without_it_the_last_link_and_a_note(self, make_joint, write_robot):
        arm = Arm.load(write_robot([make_joint(axis="0 1 0")] * 3, tool=None))
        assert arm.tool_frame == "link_3"
        (note,) = arm.description.notes
        assert note == "tool frame: 'link_3', the last link of the longest chain"

    def test_an_earlier_link_leaves_later_joints_out(self, make_joint, write_robot):
        arm = Arm.load(write_robot([make_joint("prismatic"), make_joint()]), tool_frame="link_1")
        assert arm.joint_names == ("joint_1",)
        assert arm.description.held == {"joint_2": 0.0}

    def test_an_unknown_one_lists_the_links(self, make_joint, write_robot):
        path = write_robot([make_joint()], tool=None)
        with pytest.raises(ArmError, match="no tool frame 'hand'.*link_0, link_1"):
            Arm.load(path, tool_frame="hand")

    def test_offset_in_the_tool_frame(self, make_joint, write_robot):
        path = write_robot([make_joint(), make_joint(axis="0 1 0", rpy="0.3 0.2 0.1")])
        arm, offset, q = Arm.load(path, tool_offset=(0.1, -0.2, 0.3)), (0.1, -0.2, 0.3), [0.3, 0.8]
        pose = frame_pose(Arm.load(path), q, "tool0")
        np.testing.assert_allclose(arm.tool_position(q), pose[:3] @ [*offset, 1], atol=1e-12)

    def test_tool_that_nothing_moves(self, make_joint, write_robot):
        path = write_robot([make_joint()], tool="0 0 0.1")
        with pytest.raises(ArmError, match="no joint of made.urdf moves the tool frame 'tool0'"):
            Arm.load(path)


class TestMeshes:
    TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"

    @pytest.mark.parametrize(
        ("name", "place"),
        [
            ("meshes/part.obj", "meshes/part.obj"),
            ("package://robot/meshes/part.obj", "robot/meshes/part.obj"),
            ("package://robot/part.obj", "part.obj"),
            ("package://made/part.obj", "made/part.obj"),
        ],
    )
    def test_are_found_around_the_urdf(
        self, make_joint, make_collision, write_robot, tmp_path, name, place
    ):
        """Beside it, in the folder of its package, or in one that is called as the package."""
        mesh = make_collision(f'<mesh filename="{name}"/>')
        text = write_robot([make_joint()], {1: mesh}).read_text()
        robot = tmp_path / "robot"
        path = robot / "own.urdf"
        robot.mkdir()
        path.write_text(text)
        beside = tmp_path if place.startswith("robot/") else robot
        (beside / place).parent.mkdir(parents=True, exist_ok=True)
        (beside / place).write_text(self.TETRAHEDRON)
        assert Arm.load(path).geometry.ngeoms == 1

    @pytest.mark.parametrize(
        "name",
        [
            "gone.stl",
            "package://gone/gone.stl",
        ],
    )
    def test_missing_ones_are_named(self, make_joint, make_collision, write_robot, name):
        path = write_robot([make_joint()], {1: make_collision(f'<mesh filename="{name}"/>')})
        with pytest.raises(ArmError, match=r"made\.urdf: .*gone\.stl' is not found; package_dirs"):
            Arm.load(path)


def fixed(name, parent, child, kind="fixed"):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f"{CENTRED}</joint>"
    )


LINKS = '<link name="a"/><link name="b"/>'


class TestRefusals:
    """In one line that names the file; Pinocchio prints nothing of its own."""

    def test_unknown_name_lists_the_arms(self):
        with pytest.raises(
            UnknownNameError, match="arm 'papier' .did you mean 'paper'.*panda.*paper, .*urdf"
        ):
            Arm.load("papier")

    @pytest.mark.parametrize(
        ("content", "reason"),
        [
            (b"<a><b></a>", "mismatched tag"),
            (b"<html/>", "its root is <html>"),
        ],
    )
    def test_malformed_file(self, tmp_path, content, reason):
        path = tmp_path / "broken.urdf"
        path.write_bytes(content)
        with pytest.raises(ArmError, match=rf"broken\.urdf: not a readable URDF: .*{reason}"):
            Arm.load(path)

    @pytest.mark.parametrize(
        ("extra", "message"),
        [
            (fixed("back", "link_1", "link_0"), "form a loop: closed loops are not supported"),
            (LINKS + fixed("x", "link_0", "a"), "no joint joins the links .*'b'"),
            (LINKS + fixed("x", "link_0", "a") + fixed("y", "link_1", "a"), "'a'.*hangs on two"),
            (LINKS + fixed("joint_1", "link_0", "a"), "a name of its own, not 'joint_1'"),
            (fixed("x", "link_0", "nobody"), "joint 'x' joins 'nobody', which is no link"),
            (LINKS + fixed("x", "link_0", "a", "floating"), "'x'.*the base must be fixed"),
            (gripper(leader="nobody"), "mimics 'nobody', which is no joint"),
        ],
    )
    def test_what_is_no_tree(self, make_joint, write_robot, extra, message):
        with pytest.raises(ArmError, match=message):
            Arm.load(write_robot([make_joint()], extra=extra))

    @pytest.mark.parametrize(
        ("changes", "words"),
        [
            ({"xyz": "0 0 1e308"}, "xyz of <origin>"),
            ({"axis": "0 0 0"}, "no axis"),
            ({"limit": ""}, "no limits"),
            ({"limit": '<limit lower="1" upper="-1" velocity="1"/>'}, "no usable limits: 1.0"),
        ],
    )
    def test_joints(self, make_joint, write_robot, changes, words, capfd):
        path = write_robot([make_joint(**changes), make_joint(axis="0 1 0")])
        with pytest.raises(ArmError, match=f"made.urdf: joint 'joint_1'.*{words}"):
            Arm.load(path)
        assert capfd.readouterr() == ("", "")

    def test_xacro_is_told_to_be_expanded(self, tmp_path):
        path = tmp_path / "arm.urdf.xacro"
        path.write_text(
            '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="arm">'
            '<xacro:property name="pi" value="3.14"/><link name="base"/></robot>'
        )
        with pytest.raises(ArmError, match=r"a xacro file.*: xacro arm.urdf.xacro > arm.urdf$"):
            Arm.load(path)

    def test_no_moving_joint(self, make_joint, write_robot):
        with pytest.raises(ArmError, match="no moving joint"):
            Arm.load(write_robot([make_joint("fixed", limit="")]))

    def test_more_shapes_than_can_be_paired(self, make_joint, make_collision, write_robot):
        many = 501 * make_collision('<sphere radius="0.05"/>')
        with pytest.raises(ArmError, match="501 collision shapes; at most 500"):
            Arm.load(write_robot([make_joint()], {1: many}))

    @pytest.mark.parametrize("shape", ['<box size="1 1 -1"/>', "<cone/>", ""])
    def test_shapes(self, make_joint, make_collision, write_robot, shape, capfd):
        path = write_robot([make_joint()], {1: make_collision(shape)})
        with pytest.raises(ArmError, match="made.urdf: .*link 'link_1'"):
            Arm.load(path)
        assert capfd.readouterr() == ("", "")


def test_of_several_shapes_of_one_element_the_first_counts(make_joint, make_collision, write_robot):
    both = make_collision('<sphere radius="0.1"/><box size="9 9 9"/>')
    (shape,) = Arm.load(write_robot([make_joint()], {1: both})).geometry.geometryObjects
    assert isinstance(shape.geometry, coal.Sphere)


def test_a_wheel_that_carries_nothing_is_held_where_it_is(make_joint, write_robot):
    """A continuous joint has no range to be in the middle of."""
    wheel = fixed("roll", "link_1", "a", "continuous")
    arm = Arm.load(write_robot([make_joint()], extra='<link name="a"/>' + wheel))
    assert arm.description.held == {"roll": 0.0}

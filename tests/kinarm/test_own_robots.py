"""Robots from a URDF: axes, home, what is actuated, and shapes."""

import coal
import numpy as np
import pytest

from kinarm.arm import Arm
from kinarm.errors import ArmError, KinarmError
from kinarm.problem import ReachProblem
from kinarm.simulator import Simulator

AXIS_NAMES = tuple(f"axis_{number}" for number in range(1, 7))


def test_name_and_axes_come_from_the_file(make_joint, write_robot):
    path = write_robot([make_joint(), make_joint("prismatic", axis="1 0 0")])
    arm = Arm.load(path)
    assert arm.name == "made"
    assert arm.joint_names == ("joint_1", "joint_2")
    np.testing.assert_array_equal(arm.chain.prismatic, [False, True])
    assert arm.urdf_path == path.resolve()


def test_prismatic_joint_slides_along_its_axis(make_joint, write_robot):
    arm = Arm.load(write_robot([make_joint("prismatic", axis="0 0.6 0.8")], tool="0 0 0"))
    np.testing.assert_allclose(arm.tool_position([0.5]), [0, 0.3, 0.6], atol=1e-12)


def test_home_is_zero_clipped_to_the_limits(make_joint, write_robot):
    limit = '<limit lower="0.3" upper="1" velocity="2" effort="0"/>'
    arm = Arm.load(write_robot([make_joint(), make_joint(limit=limit)]))
    np.testing.assert_array_equal(arm.home, [0, 0.3])


@pytest.mark.parametrize(
    ("last_axes", "tool", "expected"),
    [
        (["0 0 1"], "0 0 0.3", 1),
        (["0 0 1"], "0.1 0 0.3", 2),
        (["0 1 0", "0 0 1"], "0 0 0.3", 2),
        (["0 0 1", "0 0 1"], "0 0 0.3", 1),
        (["1 0 0"], "0 0 0.3", 2),
    ],
)
def test_trailing_axes_through_the_tool_point_are_not_actuated(
    make_joint, write_robot, last_axes, tool, expected
):
    joints = [make_joint(axis="0 1 0"), *(make_joint(axis=axis) for axis in last_axes)]
    assert Arm.load(write_robot(joints, tool=tool)).n_actuated == expected


def test_prismatic_axis_is_always_actuated(make_joint, write_robot):
    path = write_robot([make_joint(axis="0 1 0"), make_joint("prismatic")], tool="0 0 0.1")
    assert Arm.load(path).n_actuated == 2


def test_actuated_axes_can_be_named():
    assert Arm.load("paper", actuated=AXIS_NAMES).n_actuated == 6
    assert Arm.load("paper", actuated=AXIS_NAMES[:1]).n_actuated == 1


@pytest.mark.parametrize("named", [("axis_2",), ("axis_2", "axis_1"), ("axis_1", "axis_3")])
def test_other_axes_than_the_first_ones_are_refused(named):
    with pytest.raises(ArmError, match="actuated must name the first joints of paper.urdf"):
        Arm.load("paper", actuated=named)


def test_velocity_limits_can_be_given():
    limits = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    arm = Arm.load("paper", velocity_limits=limits)
    np.testing.assert_array_equal(arm.velocity_limits, limits)
    np.testing.assert_array_equal(arm.model.velocityLimit, limits)
    simulator = Simulator(ReachProblem.load("right").replace(arm=arm), threads=1)
    np.testing.assert_allclose(simulator.step_limit, 0.02 * np.array(limits[:5]))


@pytest.mark.parametrize("limits", [(1,) * 5, (1,) * 7, (1, 1, 1, 1, 1, 0), (-1,) * 6])
def test_impossible_velocity_limits_are_refused(limits):
    with pytest.raises(KinarmError, match="velocity_limits"):
        Arm.load("paper", velocity_limits=limits)


@pytest.mark.parametrize("home", [[0, 0], [np.nan] * 6, [0, 3, 0, 0, 0, 0], ["x"] * 6])
def test_impossible_home_is_refused(home):
    with pytest.raises(KinarmError, match="home"):
        Arm.load("paper", home=home)


def test_every_kind_of_shape_loads(sliding_arm):
    kinds = {type(shape.geometry) for shape in sliding_arm.geometry.geometryObjects}
    assert kinds == {coal.Cylinder, coal.Box, coal.Sphere, coal.Capsule}


def test_meshes_become_convex_hulls(mesh_arm):
    shapes = {shape.name: shape.geometry for shape in mesh_arm.geometry.geometryObjects}
    bar = shapes["link_2_0"]
    assert isinstance(bar, coal.ConvexBase)
    np.testing.assert_allclose(np.ptp(bar.points(), axis=0), [0.08, 0.1, 0.28], atol=1e-6)


def test_package_dirs_find_meshes(make_joint, make_collision, write_robot, tmp_path):
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "part.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    shape = make_collision('<mesh filename="package://robots/part.obj"/>')
    path = write_robot([make_joint()], {1: shape})
    assert Arm.load(path, package_dirs=[tmp_path]).geometry.ngeoms == 1
    with pytest.raises(ArmError, match="package_dirs names the folders"):
        Arm.load(path)

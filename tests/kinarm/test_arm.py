"""The arms of the data sheet: what they are made of, and what their digest depends on."""

import numpy as np
import pytest

from kinarm.arm import Arm
from kinarm.enclosures import inner_capsule
from kinarm.errors import ArmError, KinarmError
from kinarm.problem import ReachProblem
from kinarm.simulator import Simulator

AXIS_NAMES = tuple(f"axis_{number}" for number in range(1, 7))

# The arm's data sheet: origins, axes, limits [deg], speeds [deg/s], capsules (ends and radius).
ORIGINS = [(0, 0, 0.33), (0.075, 0, 0), (0, 0, 0.30), (0.32, 0, 0.075), (0, 0, 0), (0.08, 0, 0)]
AXES = [(0, 0, 1), (0, 1, 0), (0, -1, 0), (-1, 0, 0), (0, -1, 0), (-1, 0, 0)]
LOWER = [-180, -60, -72, -180, -120, -360]
UPPER = [180, 140, 185, 180, 120, 360]
SPEED = {
    "paper": [350, 350, 400, 450, 450, 720],
    "paper_flange": [350, 350, 400, 450, 450, 720],
    "lrmate200ic_5l": [270, 270, 270, 450, 450, 720],
}
CAPSULES = [
    ((-0.04, 0, 0.06), (0.01, 0, 0.06), 0.100),
    ((0.071, 0, -0.004), (0.009, 0, -0.094), 0.136),
    ((0, 0, 0.023), (0, 0, 0.288), 0.117),
    ((-0.012, 0, 0.019), (0.025, 0, 0.070), 0.097),
    ((-0.225, 0, 0), (-0.006, 0, 0), 0.069),
    ((0, 0, 0), (0.030, 0, 0), 0.048),
]
TOOL = ((0, 0, 0), (0.13, 0, 0), 0.020)
FLANGE = ((-0.022, 0, 0), (-0.022, 0, 0), 0.021)


def assert_same_capsules(arm, expected):
    shapes = arm.geometry.geometryObjects
    assert [shape.parentJoint for shape in shapes] == list(range(7))
    for shape, (start, end, radius) in zip(shapes, expected, strict=True):
        corners, rounding, _ = inner_capsule(shape)
        np.testing.assert_allclose(sorted(corners.tolist()), sorted([start, end]), atol=1e-12)
        assert rounding == radius


@pytest.mark.parametrize("name", SPEED)
def test_limits_and_speeds_are_those_of_the_data_sheet(shipped_arms, name):
    arm = shipped_arms[name]
    np.testing.assert_array_equal(arm.lower, np.deg2rad(LOWER))
    np.testing.assert_array_equal(arm.upper, np.deg2rad(UPPER))
    np.testing.assert_array_equal(arm.velocity_limits, np.deg2rad(SPEED[name]))


@pytest.mark.parametrize("name", ["paper", "paper_flange"])
def test_joint_origins_and_axes_are_those_of_the_data_sheet(shipped_arms, name):
    chain = shipped_arms[name].chain
    np.testing.assert_array_equal(chain.translation, ORIGINS)
    np.testing.assert_array_equal(chain.axis, AXES)
    np.testing.assert_array_equal(chain.rotation, np.tile([1, 0, 0, 0], (6, 1)))
    assert not chain.prismatic.any()


def test_tool_reaches_beyond_the_flange(shipped_arms):
    np.testing.assert_array_equal(shipped_arms["paper"].chain.tool, [0.15, 0, 0])
    np.testing.assert_array_equal(shipped_arms["paper_flange"].chain.tool, [0, 0, 0])
    np.testing.assert_array_equal(shipped_arms["lrmate200ic_5l"].chain.tool, [0, 0, 0])


def test_collision_capsules_are_those_of_the_data_sheet(shipped_arms):
    assert_same_capsules(shipped_arms["paper"], [*CAPSULES, TOOL])
    assert_same_capsules(shipped_arms["paper_flange"], [*CAPSULES, FLANGE])


def test_long_arm_differs_in_its_two_long_links(shipped_arms):
    long, short = shipped_arms["lrmate200ic_5l"].chain, shipped_arms["paper_flange"].chain
    np.testing.assert_array_equal(long.translation[2], [0, 0, 0.40])
    np.testing.assert_array_equal(long.translation[3], [0.41, 0, 0.075])
    np.testing.assert_array_equal(long.translation[[0, 1, 4, 5]], short.translation[[0, 1, 4, 5]])


def test_known_flange_pose(shipped_arms):
    q = np.deg2rad([-59, 0, -43, -186, -43, 154])
    flange = shipped_arms["paper_flange"].tool_position(q)
    np.testing.assert_allclose(flange, [0.2217, -0.3801, 0.4664], atol=5e-5)


def test_reach_bounds_the_tool(any_simulator):
    arm = any_simulator.arm
    rng = np.random.default_rng(0)
    tools = [arm.tool_position(rng.uniform(arm.lower, arm.upper)) for _ in range(500)]
    farthest = np.linalg.norm(tools, axis=1).max()
    assert 0.5 * arm.reach < farthest <= arm.reach


class TestDigest:
    def test_depends_on_home_velocity_limits_and_the_actuated_axes(self, shipped_arms):
        known = {shipped_arms["paper"].digest}
        known.add(Arm.load("paper", actuated=AXIS_NAMES).digest)
        known.add(Arm.load("paper", home=[0.1, 0, 0, 0, 0, 0]).digest)
        known.add(Arm.load("paper", velocity_limits=[1, 1, 1, 1, 1, 1]).digest)
        assert len(known) == 4

    @pytest.mark.parametrize(
        ("old", "new"),
        [
            ('velocity="6.1086523819801535"', 'velocity="6.2"'),
            ('lower="-1.0471975511965976"', 'lower="-1"'),
            ('xyz="0.075 0 0"', 'xyz="0.0751 0 0"'),
            ('capsule radius="0.136"', 'capsule radius="0.137"'),
            ('xyz="0.15 0 0"', 'xyz="0.16 0 0"'),
        ],
    )
    def test_changes_with_anything_that_matters(self, shipped_arms, tmp_path, old, new):
        text = shipped_arms["paper"].description.path.read_text(encoding="utf-8")
        assert old in text
        path = tmp_path / "changed.urdf"
        path.write_text(text.replace(old, new))
        assert Arm.load(path).digest != shipped_arms["paper"].digest

    def test_does_not_depend_on_looks_or_place(self, shipped_arms, tmp_path):
        text = shipped_arms["paper"].description.path.read_text(encoding="utf-8")
        path = tmp_path / "moved.urdf"
        path.write_text(text.replace('rgba="0.96 0.74 0.1 1"', 'rgba="0 0 1 1"'))
        assert Arm.load(path).digest == shipped_arms["paper"].digest

    def test_tells_meshes_with_equal_bounds_apart(
        self, make_joint, make_collision, write_robot, tmp_path
    ):
        # A tetrahedron and its mirror image fill the same box with different solids.
        corners = {"a": [(0, 0, 0), (1, 1, 0), (1, 0, 1), (0, 1, 1)]}
        corners["b"] = [(1 - x, y, z) for x, y, z in corners["a"]]
        digests = set()
        path = write_robot(
            [make_joint()], {1: make_collision(f'<mesh filename="{tmp_path / "part.obj"}"/>')}
        )
        for points in corners.values():
            vertices = "".join(f"v {x} {y} {z}\n" for x, y, z in points)
            faces = "f 1 2 3\nf 1 3 4\nf 1 4 2\nf 2 4 3\n"
            (tmp_path / "part.obj").write_text(vertices + faces)
            digests.add(Arm.load(path).digest)
        assert len(digests) == 2


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


def test_other_axes_than_the_first_ones_are_refused():
    with pytest.raises(ArmError, match="actuated must name the first joints of paper.urdf"):
        Arm.load("paper", actuated=("axis_1", "axis_3"))


def test_velocity_limits_can_be_given():
    limits = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    arm = Arm.load("paper", velocity_limits=limits)
    np.testing.assert_array_equal(arm.velocity_limits, limits)
    np.testing.assert_array_equal(arm.model.velocityLimit, limits)
    simulator = Simulator(ReachProblem.load("right").replace(arm=arm), threads=1)
    np.testing.assert_allclose(simulator.step_limit, 0.02 * np.array(limits[:5]))


@pytest.mark.parametrize(
    ("option", "value"),
    [
        *(("velocity_limits", each) for each in ((1,) * 5, (1, 1, 1, 1, 1, 0))),
        *(("home", each) for each in ([0, 0], [np.nan] * 6, [0, 3, 0, 0, 0, 0])),
    ],
)
def test_impossible_options_are_refused(option, value):
    with pytest.raises(KinarmError, match=option):
        Arm.load("paper", **{option: value})

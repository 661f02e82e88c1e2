"""The shipped arms, robots from URDF, and what is refused."""

import copy
import pickle

import coal
import numpy as np
import pytest

from kinarm.arm import Arm, ArmSpecification
from kinarm.capsules import enclosing_capsule
from kinarm.errors import ArmError, InvalidInputError, KinarmError, UnknownNameError
from kinarm.problem import ReachProblem
from kinarm.simulator import Simulator
from kinarm.urdf import arm_names

AXIS_NAMES = tuple(f"axis_{number}" for number in range(1, 7))
CENTRED = '<limit lower="-1" upper="1" velocity="2" effort="0"/>'

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
        capsule = enclosing_capsule(shape)
        ends = sorted([capsule.start.tolist(), capsule.end.tolist()])
        np.testing.assert_allclose(ends, sorted([start, end]), atol=1e-12)
        assert capsule.radius == radius


def test_three_arms_ship():
    assert arm_names() == ("lrmate200ic_5l", "paper", "paper_flange")


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


def test_collision_shapes_are_symmetric_about_the_vertical_plane(shipped_arms):
    for arm in shipped_arms.values():
        for shape in arm.geometry.geometryObjects:
            capsule = enclosing_capsule(shape)
            assert abs(capsule.start[1]) < 1e-15
            assert abs(capsule.end[1]) < 1e-15


def test_known_flange_pose(shipped_arms):
    q = np.deg2rad([-59, 0, -43, -186, -43, 154])
    flange = shipped_arms["paper_flange"].tool_position(q)
    np.testing.assert_allclose(flange, [0.2217, -0.3801, 0.4664], atol=5e-5)


def test_zero_pose(shipped_arms):
    np.testing.assert_allclose(
        shipped_arms["paper_flange"].tool_position(np.zeros(6)), [0.475, 0, 0.705], atol=1e-12
    )
    np.testing.assert_allclose(
        shipped_arms["paper"].tool_position(np.zeros(6)), [0.625, 0, 0.705], atol=1e-12
    )


def test_positive_axis_two_leans_forward_and_positive_axis_three_raises(shipped_arms):
    arm = shipped_arms["paper"]
    zero = arm.tool_position(np.zeros(6))
    assert arm.tool_position([0, 0.1, 0, 0, 0, 0])[0] > zero[0]
    assert arm.tool_position([0, 0, 0.1, 0, 0, 0])[2] > zero[2]


def test_five_axes_are_actuated(shipped_arms):
    for arm in shipped_arms.values():
        assert (arm.n_joints, arm.n_actuated) == (6, 5)
        np.testing.assert_array_equal(arm.home, np.zeros(6))


def test_arrays_are_read_only(shipped_arms):
    arm = shipped_arms["paper"]
    for array in (*arm.chain, arm.home, arm.lower, arm.upper, arm.velocity_limits):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def test_attributes_cannot_be_replaced(shipped_arms):
    with pytest.raises(AttributeError):
        shipped_arms["paper"].n_actuated = 6


def test_reach_bounds_the_tool(any_simulator):
    arm = any_simulator.arm
    rng = np.random.default_rng(0)
    tools = [arm.tool_position(rng.uniform(arm.lower, arm.upper)) for _ in range(500)]
    farthest = np.linalg.norm(tools, axis=1).max()
    assert 0.5 * arm.reach < farthest <= arm.reach


@pytest.mark.parametrize("bad", [[0] * 5, [0] * 7, [np.nan] * 6, [[0] * 6]])
def test_tool_position_refuses_a_bad_configuration(shipped_arms, bad):
    with pytest.raises(InvalidInputError, match="configuration must"):
        shipped_arms["paper"].tool_position(bad)


def test_arm_pickles(shipped_arms):
    arm = shipped_arms["paper"]
    other = pickle.loads(pickle.dumps(arm))
    assert (other.digest, other.specification) == (arm.digest, arm.specification)
    q = np.linspace(-1, 1, 6)
    np.testing.assert_array_equal(other.tool_position(q), arm.tool_position(q))


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda arm: pickle.loads(pickle.dumps(arm))])
def test_copies_are_read_only_too(shipped_arms, duplicate):
    arm = duplicate(shipped_arms["paper"])
    assert not any(array.flags.writeable for array in (*arm.chain, arm.home))


class TestDigest:
    def test_is_the_same_for_every_load(self, shipped_arms):
        for name, arm in shipped_arms.items():
            assert Arm.load(name).digest == arm.digest

    def test_differs_between_arms(self, shipped_arms):
        assert len({arm.digest for arm in shipped_arms.values()}) == 3

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
            ('axis xyz="0 1 0"', 'axis xyz="0 0.8 0.6"'),
            ('capsule radius="0.136"', 'capsule radius="0.137"'),
            ('capsule radius="0.02" length="0.13"', 'capsule radius="0.02" length="0.14"'),
            ('xyz="0.15 0 0"', 'xyz="0.16 0 0"'),
        ],
    )
    def test_changes_with_anything_that_matters(self, shipped_arms, tmp_path, old, new):
        text = shipped_arms["paper"].urdf_path.read_text(encoding="utf-8")
        assert old in text
        path = tmp_path / "changed.urdf"
        path.write_text(text.replace(old, new))
        assert Arm.load(path).digest != shipped_arms["paper"].digest

    def test_does_not_depend_on_looks_or_place(self, shipped_arms, tmp_path):
        text = shipped_arms["paper"].urdf_path.read_text(encoding="utf-8")
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


class TestGenericRobots:
    def test_name_and_axes_come_from_the_file(self, make_joint, write_robot):
        path = write_robot([make_joint(), make_joint("prismatic", axis="1 0 0")])
        arm = Arm.load(path)
        assert arm.name == "made"
        assert arm.joint_names == ("joint_1", "joint_2")
        np.testing.assert_array_equal(arm.chain.prismatic, [False, True])
        assert arm.urdf_path == path.resolve()

    def test_prismatic_joint_slides_along_its_axis(self, make_joint, write_robot):
        arm = Arm.load(write_robot([make_joint("prismatic", axis="0 0.6 0.8")], tool="0 0 0"))
        np.testing.assert_allclose(arm.tool_position([0.5]), [0, 0.3, 0.6], atol=1e-12)

    def test_home_is_zero_clipped_to_the_limits(self, make_joint, write_robot):
        limit = '<limit lower="0.3" upper="1" velocity="2" effort="0"/>'
        arm = Arm.load(write_robot([make_joint(), make_joint(limit=limit)]))
        np.testing.assert_array_equal(arm.home, [0, 0.3])

    def test_home_can_be_given(self, make_joint, write_robot):
        arm = Arm.load(write_robot([make_joint()]), home=[0.5])
        np.testing.assert_array_equal(arm.home, [0.5])

    def test_given_home_is_copied(self, make_joint, write_robot):
        home = np.array([0.5])
        arm = Arm.load(write_robot([make_joint()]), home=home)
        home[0] = 1.0
        np.testing.assert_array_equal(arm.home, [0.5])

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
        self, make_joint, write_robot, last_axes, tool, expected
    ):
        joints = [make_joint(axis="0 1 0"), *(make_joint(axis=axis) for axis in last_axes)]
        assert Arm.load(write_robot(joints, tool=tool)).n_actuated == expected

    def test_prismatic_axis_is_always_actuated(self, make_joint, write_robot):
        path = write_robot([make_joint(axis="0 1 0"), make_joint("prismatic")], tool="0 0 0.1")
        assert Arm.load(path).n_actuated == 2

    def test_actuated_axes_can_be_named(self):
        assert Arm.load("paper", actuated=AXIS_NAMES).n_actuated == 6
        assert Arm.load("paper", actuated=AXIS_NAMES[:1]).n_actuated == 1

    @pytest.mark.parametrize(
        "named", [(), ("axis_2",), ("axis_2", "axis_1"), ("axis_1", "axis_3"), ("axis_7",)]
    )
    def test_other_axes_than_the_first_ones_are_refused(self, named):
        with pytest.raises(ArmError, match="actuated must name the first joints of paper.urdf"):
            Arm.load("paper", actuated=named)

    def test_velocity_limits_can_be_given(self):
        limits = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
        arm = Arm.load("paper", velocity_limits=limits)
        np.testing.assert_array_equal(arm.velocity_limits, limits)
        np.testing.assert_array_equal(arm.model.velocityLimit, limits)
        simulator = Simulator(ReachProblem.load("right").replace(arm=arm), threads=1)
        np.testing.assert_allclose(simulator.step_limit, 0.02 * np.array(limits[:5]))

    @pytest.mark.parametrize("limits", [(1,) * 5, (1,) * 7, (1, 1, 1, 1, 1, 0), (-1,) * 6])
    def test_impossible_velocity_limits_are_refused(self, limits):
        with pytest.raises(KinarmError, match="velocity_limits"):
            Arm.load("paper", velocity_limits=limits)

    @pytest.mark.parametrize("home", [[0, 0], [np.nan] * 6, [0, 3, 0, 0, 0, 0], ["x"] * 6])
    def test_impossible_home_is_refused(self, home):
        with pytest.raises(KinarmError, match="home"):
            Arm.load("paper", home=home)

    def test_any_link_can_carry_the_tool(self, make_joint, write_robot):
        path = write_robot([make_joint("prismatic")], tool=None)
        arm = Arm.load(path, tool_frame="link_1")
        np.testing.assert_array_equal(arm.chain.tool, [0, 0, 0])

    def test_every_kind_of_shape_loads(self, sliding_arm):
        kinds = {type(shape.geometry) for shape in sliding_arm.geometry.geometryObjects}
        assert kinds == {coal.Cylinder, coal.Box, coal.Sphere, coal.Capsule}

    def test_meshes_become_convex_hulls(self, mesh_arm):
        shapes = {shape.name: shape.geometry for shape in mesh_arm.geometry.geometryObjects}
        bar = shapes["link_2_0"]
        assert isinstance(bar, coal.ConvexBase)
        np.testing.assert_allclose(np.ptp(bar.points(), axis=0), [0.08, 0.1, 0.28], atol=1e-6)

    def test_package_dirs_find_meshes(self, make_joint, make_collision, write_robot, tmp_path):
        (tmp_path / "robots").mkdir()
        (tmp_path / "robots" / "part.obj").write_text(
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
        )
        shape = make_collision('<mesh filename="package://robots/part.obj"/>')
        path = write_robot([make_joint()], {1: shape})
        assert Arm.load(path, package_dirs=[tmp_path]).geometry.ngeoms == 1
        with pytest.raises(ArmError, match="package_dirs names the folders"):
            Arm.load(path)

    def test_collision_in_a_comment_is_no_shape(self, make_joint, write_robot):
        path = write_robot([make_joint()], {1: "<!-- <collision> to be measured -->"})
        assert Arm.load(path).geometry.ngeoms == 0


class TestSpecification:
    def test_is_kept_by_the_arm(self):
        given = ArmSpecification(source="paper_flange", home=(0.1, 0, 0, 0, 0, 0))
        arm = Arm.load(given, actuated=AXIS_NAMES[:3])
        assert arm.specification == ArmSpecification(
            source="paper_flange", home=(0.1, 0, 0, 0, 0, 0), actuated=AXIS_NAMES[:3]
        )
        assert Arm.load(arm.specification).digest == arm.digest
        assert arm.name == "paper_flange"

    def test_values_become_what_is_annotated(self, tmp_path):
        given = ArmSpecification(
            source=tmp_path / "robot.urdf",
            package_dirs=[tmp_path],
            home=np.zeros(6),
            velocity_limits=[1, 2],
            actuated=["axis_1"],
        )
        assert given == ArmSpecification(
            source=str(tmp_path / "robot.urdf"),
            package_dirs=(str(tmp_path),),
            home=(0.0,) * 6,
            velocity_limits=(1.0, 2.0),
            actuated=("axis_1",),
        )
        assert hash(given)
        assert given.name == "robot"

    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"source": 3}, "source must be a text"),
            ({"home": "zero"}, r"home must be a list, each entry a number \[rad or m\]"),
            ({"actuated": 5}, "actuated must be a list, each entry a text, got 5"),
            ({"package_dirs": "meshes"}, "package_dirs must be a list"),
            ({"tool_frame": None}, "tool_frame must be a text"),
        ],
    )
    def test_wrong_types_are_refused(self, changes, message):
        with pytest.raises(InvalidInputError, match=message):
            ArmSpecification(**changes)

    def test_relative_paths_start_at_a_folder(self, tmp_path):
        given = ArmSpecification(source="robot.urdf", package_dirs=("meshes", "/opt/meshes"))
        assert given.resolved(tmp_path) == ArmSpecification(
            source=str(tmp_path / "robot.urdf"),
            package_dirs=(str(tmp_path / "meshes"), "/opt/meshes"),
        )

    @pytest.mark.parametrize("name", ["paper", "nope"])
    def test_names_are_no_paths(self, tmp_path, name):
        assert ArmSpecification(source=name).resolved(tmp_path).source == name

    def test_a_shipped_name_wins_over_a_file(self, tmp_path, monkeypatch):
        (tmp_path / "paper").write_text("")
        monkeypatch.chdir(tmp_path)
        assert Arm.load("paper").name == "paper"

    def test_pinned_digest_has_to_hold(self, shipped_arms):
        digest = shipped_arms["paper"].digest
        assert Arm.load("paper", digest=digest).digest == digest
        with pytest.raises(ArmError, match=f"'paper_flange' is another version .*{digest}"):
            Arm.load("paper_flange", digest=digest)


class TestRefusals:
    def test_unknown_name_lists_the_arms(self):
        with pytest.raises(UnknownNameError) as caught:
            Arm.load("papier")
        assert "'papier'" in str(caught.value)
        for name in arm_names():
            assert name in str(caught.value)

    @pytest.mark.parametrize("name", ["missing.urdf", "folder/robot"])
    def test_missing_file(self, tmp_path, name):
        with pytest.raises(ArmError, match="does not exist"):
            Arm.load(tmp_path / name)

    @pytest.mark.parametrize("text", ["", "not xml", "<robot name='x'>", "<html/>"])
    def test_malformed_file(self, tmp_path, text):
        path = tmp_path / "broken.urdf"
        path.write_text(text)
        with pytest.raises(ArmError, match=r"broken\.urdf is not a readable URDF"):
            Arm.load(path)

    def test_binary_file(self, tmp_path):
        path = tmp_path / "binary.urdf"
        path.write_bytes(bytes(range(256)))
        with pytest.raises(ArmError, match=r"binary\.urdf"):
            Arm.load(path)

    def test_message_is_one_line(self, tmp_path):
        path = tmp_path / "broken.urdf"
        path.write_text("not xml")
        with pytest.raises(ArmError) as caught:
            Arm.load(path)
        assert "\n" not in str(caught.value)

    def test_no_tool_frame_lists_the_links(self, make_joint, write_robot):
        path = write_robot([make_joint()], tool=None)
        with pytest.raises(ArmError, match="no tool frame 'tool0'.*link_0, link_1"):
            Arm.load(path)

    def test_tool_frame_before_the_last_joint(self, make_joint, write_robot):
        path = write_robot([make_joint(), make_joint()])
        with pytest.raises(ArmError, match="'link_1'.*not on the last moving link"):
            Arm.load(path, tool_frame="link_1")

    @pytest.mark.parametrize("kind", ["floating", "planar"])
    def test_moving_base(self, make_joint, write_robot, kind):
        path = write_robot([make_joint(kind, limit=""), make_joint()])
        with pytest.raises(ArmError, match="'joint_1'.*the base must be fixed"):
            Arm.load(path)

    @pytest.mark.parametrize("axis", ["1 0 0", "0 1 0", "0 0 1", "0 0.6 0.8"])
    def test_continuous_joint(self, make_joint, write_robot, axis):
        path = write_robot([make_joint("continuous", axis=axis, limit="")])
        with pytest.raises(ArmError, match="'joint_1'.*is continuous: give it limits"):
            Arm.load(path)

    def test_branching_chain(self, make_joint, write_robot):
        side = (
            '<link name="side"/><joint name="zz_side" type="revolute"><parent link="link_0"/>'
            f'<child link="side"/><axis xyz="0 0 1"/>{CENTRED}</joint>'
        )
        path = write_robot([make_joint()], extra=side)
        with pytest.raises(ArmError, match="branches at joint .*only a serial chain"):
            Arm.load(path)

    def test_no_moving_joint(self, make_joint, write_robot):
        path = write_robot([make_joint("fixed", limit="")])
        with pytest.raises(ArmError, match="no moving joint"):
            Arm.load(path)

    @pytest.mark.parametrize("velocity", ["", 'velocity="0"'])
    def test_no_rated_speed(self, make_joint, write_robot, velocity):
        limit = f'<limit lower="-1" upper="1" {velocity} effort="0"/>'
        path = write_robot([make_joint(limit=limit)])
        with pytest.raises(ArmError, match="'joint_1'.*no velocity limit"):
            Arm.load(path)

    @pytest.mark.parametrize(
        "limit",
        [
            "",
            '<limit velocity="1" effort="0"/>',
            '<limit lower="1" upper="-1" velocity="1" effort="0"/>',
            '<limit lower="1" upper="1" velocity="1" effort="0"/>',
        ],
    )
    def test_joint_without_usable_limits(self, make_joint, write_robot, limit):
        with pytest.raises(ArmError, match=r"made\.urdf"):
            Arm.load(write_robot([make_joint(limit=limit)]))

    def test_mimic_joint(self, make_joint, write_robot):
        follower = make_joint(limit=CENTRED + '<mimic joint="joint_1" multiplier="2"/>')
        with pytest.raises(ArmError, match="joint_2"):
            Arm.load(write_robot([make_joint(), follower]))

    def test_capsules_that_the_parser_drops(self, make_joint, make_collision, write_robot):
        shape = make_collision('<capsule radius="0.1" length="0.1"/>')
        path = write_robot([make_joint()], {1: shape}, version="")
        with pytest.raises(ArmError, match='capsules, which need <robot version="1.2">'):
            Arm.load(path)

    def test_missing_mesh(self, make_joint, make_collision, write_robot):
        path = write_robot([make_joint()], {1: make_collision('<mesh filename="gone.stl"/>')})
        with pytest.raises(ArmError, match=r"collision shapes of made\.urdf.*gone\.stl"):
            Arm.load(path)

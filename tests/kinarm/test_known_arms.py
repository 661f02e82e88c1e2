"""Arms of other packages: kinematics and contact against Pinocchio, MuJoCo and Coal."""

import math
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
from configurations import contact_boundary, jittered, random_configurations
from known_arms import EACH_ARM, INSTALLED, simulator_among_boxes
from reference_episodes import compare_actions

from kinarm.arm import Arm
from kinarm.collision import ContactModel
from kinarm.enclosures import core
from kinarm.problem import ReachProblem
from kinarm.scene import GoalRegion, Obstacle, Scene
from kinarm.simulator import Simulator

pytestmark = INSTALLED


@pytest.fixture(scope="module", params=EACH_ARM)
def arm(request):
    return Arm.load(request.param)


@pytest.fixture(scope="module")
def simulator(arm):
    return simulator_among_boxes(arm.name)


def configurations(arm, count=100):
    return np.random.default_rng(3).uniform(arm.lower, arm.upper, (count, arm.n_joints))


def positions(arm, q):
    """Positions of all joints by name, the held ones included."""
    return {**arm.description.held, **dict(zip(arm.joint_names, q, strict=True))}


def whole_configuration(model, arm, q):
    """The same configuration of the robot with all its joints, as Pinocchio orders them."""
    whole = pin.neutral(model)
    for name, position in positions(arm, q).items():
        joint = model.joints[model.getJointId(name)]
        turns = joint.nq == 2  # continuous: cosine and sine
        whole[joint.idx_q : joint.idx_q + joint.nq] = (
            (math.cos(position), math.sin(position)) if turns else position
        )
    return whole


def tool_of(arm, pose):
    """The tool point, from the pose of the frame that the arm's file names."""
    completed = arm.specification.completed()
    offset = np.array(completed.tool_offset or (0.0, 0.0, 0.0))
    return pose.rotation @ offset + pose.translation


def test_joint_frames_and_tool_are_those_of_the_whole_robot(arm):
    whole = pin.buildModelFromUrdf(str(arm.description.path))
    data, own = whole.createData(), arm.model.createData()
    frame = whole.getFrameId(arm.specification.completed().tool_frame, pin.FrameType.BODY)
    for q in configurations(arm):
        pin.framesForwardKinematics(whole, data, whole_configuration(whole, arm, q))
        pin.forwardKinematics(arm.model, own, q)
        for index, name in enumerate(arm.joint_names, start=1):
            expected = data.oMi[whole.getJointId(name)].homogeneous
            np.testing.assert_allclose(own.oMi[index].homogeneous, expected, rtol=0, atol=1e-12)
        expected = tool_of(arm, data.oMf[frame])
        np.testing.assert_allclose(arm.tool_position(q), expected, rtol=0, atol=1e-12)


def test_kernels_agree_with_pinocchio(simulator):
    arm, world = simulator.arm, simulator.world
    q = configurations(arm)
    expected = [arm.tool_position(each) for each in q]
    np.testing.assert_allclose(world.screen(q)[0], expected, rtol=0, atol=1e-12)
    data, origins = arm.model.createData(), []
    for each in q:
        pin.forwardKinematics(arm.model, data, each)
        origins.append(np.concatenate([pose.translation for pose in list(data.oMi)[1:]]))
    seen = world.observe(q, np.zeros((len(q), 3)))[:, -3 * arm.n_joints :]
    np.testing.assert_allclose(seen, origins, rtol=0, atol=1e-12)


def test_limits_are_those_of_the_urdf_unless_the_arm_file_says_otherwise(arm):
    robot, given = ElementTree.parse(arm.description.path), arm.specification.completed()
    joints = {joint.get("name"): joint for joint in robot.findall("joint")}
    for index, name in enumerate(arm.joint_names):
        limit = joints[name].find("limit")
        lower, upper = (given.limits or {}).get(name) or (
            float(limit.get("lower")),
            float(limit.get("upper")),
        )
        assert (arm.lower[index], arm.upper[index]) == (lower, upper)
        if given.velocity_limits is None:
            assert arm.velocity_limits[index] == float(limit.get("velocity"))


def test_home_is_free_and_inside_the_limits(arm):
    model = ContactModel.build(arm, Scene())
    assert model.contact_pair(arm.home) is None
    assert ((arm.lower <= arm.home) & (arm.home <= arm.upper)).all()


@pytest.mark.parametrize("name", ["panda", "ur5", "so101"])
def test_agrees_with_mujocos_reading_of_the_urdf(name):
    mujoco = pytest.importorskip("mujoco")
    arm = Arm.load(name)
    robot = ElementTree.parse(arm.description.path).getroot()
    for link in robot.findall("link"):
        for shape in ("visual", "collision"):  # kinematics alone
            for element in link.findall(shape):
                link.remove(element)
    settings = ElementTree.SubElement(ElementTree.SubElement(robot, "mujoco"), "compiler")
    settings.attrib.update(fusestatic="false", boundmass="0.01", boundinertia="0.001")
    model = mujoco.MjModel.from_xml_string(ElementTree.tostring(robot, encoding="unicode"))
    data = mujoco.MjData(model)
    links = {joint.get("name"): joint.find("child").get("link") for joint in robot.findall("joint")}
    tool = arm.specification.completed().tool_frame
    own = arm.model.createData()
    for q in configurations(arm, 50):
        for joint, position in positions(arm, q).items():
            data.qpos[model.jnt_qposadr[model.joint(joint).id]] = position
        mujoco.mj_kinematics(model, data)
        pin.framesForwardKinematics(arm.model, own, q)
        for index, joint in enumerate(arm.joint_names, start=1):
            body = data.body(links[joint])
            np.testing.assert_allclose(own.oMi[index].translation, body.xpos, rtol=0, atol=1e-6)
            turned = body.xmat.reshape(3, 3)
            np.testing.assert_allclose(own.oMi[index].rotation, turned, rtol=0, atol=1e-6)
        np.testing.assert_allclose(arm.tool_position(q), data.body(tool).xpos, rtol=0, atol=1e-6)


def test_the_proof_never_clears_what_touches(simulator):
    near = np.concatenate(contact_boundary(simulator, 6, 300))
    parts = [near, *(jittered(near, 6 + number) for number in range(3))]
    asked = np.concatenate([*parts, random_configurations(simulator, 6, 4000)])
    _, free, surely_touching, _ = simulator.world.proven(asked)
    touching = simulator.world.contact_model.in_contact(asked)
    assert 0.05 < touching.mean() < 0.99
    assert not (free & touching).any()
    assert not (surely_touching & ~touching).any()
    assert free.any()


def test_rollouts_equal_the_reference_path(simulator):
    _, collision, count = compare_actions(simulator, 5, 12)
    assert 0 < collision <= count


def farthest_along_x(simulator, q):
    """Highest x of an arm of hulls and capsules."""
    geometry, data = simulator.arm.geometry, simulator.arm.model.createData()
    placed = geometry.createData()
    pin.updateGeometryPlacements(simulator.arm.model, data, geometry, placed, q)
    cores = zip(placed.oMg, map(core, geometry.geometryObjects), strict=True)
    return max((c @ at.rotation[0]).max() + at.translation[0] + r for at, (c, r) in cores)


@pytest.mark.parametrize("size", [0.1, 10.0])
def test_freedom_is_not_claimed_where_coal_only_just_finds_contact(size):
    """Between shapes with corners, Coal finds contact at gaps of 1e-6 m, and hardly more."""
    front = Obstacle(name="front", lower=(0.4, -size, 0.2), upper=(0.4 + size, size, 0.2 + size))
    back = Obstacle(name="back", lower=(-0.3 - size, -size, 0.4), upper=(-0.3, size, 0.4 + size))
    air = GoalRegion(name="air", lower=(0.1, 0.1, 0.6), upper=(0.2, 0.2, 0.7))
    scene = Scene(obstacles=(front, back), goal_regions=(air,))
    problem = ReachProblem.load("right").replace(arm="panda", scene=scene, goal_regions=("air",))
    simulator = Simulator(problem)
    # Closer than a distance in which anything changes.
    touching = contact_boundary(simulator, 3, 1500, halvings=60)[1]
    if size > 1:  # faces are touched, not edges
        gaps = np.array([0.4 - farthest_along_x(simulator, q) for q in touching])
        assert (np.abs(gaps - 1e-6) < 1e-9).sum() > 20
    assert not simulator.world.proven(touching)[1].any()

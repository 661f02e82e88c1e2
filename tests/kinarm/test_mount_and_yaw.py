"""Arms that stand elsewhere, and boxes that are turned: the same contact as with all moved back."""

import math
import pickle

import coal
import numpy as np
import pinocchio as pin
import pytest
from reference_episodes import compare_actions

from kinarm.arm import Arm
from kinarm.collision import ContactModel
from kinarm.errors import ProblemError
from kinarm.problem import PROBLEMS
from kinarm.scene import GoalRegion, Mount, Obstacle, Scene, rotation_matrix
from kinarm.simulator import Simulator
from kinarm.world import World

REGION = GoalRegion(name="goal", lower=(0.3, -0.3, 0.2), upper=(0.6, 0.3, 0.6))
POST = Obstacle(name="post", lower=(0.35, -0.05, 0), upper=(0.55, 0.05, 0.9))


def problem(scene):
    return PROBLEMS["right"].replace(scene=scene, goal_regions=("goal",), name="moved")


def moved_scene(mount=None, yaw=0.0, ground=True):
    post = Obstacle(name=POST.name, lower=POST.lower, upper=POST.upper, yaw=yaw)
    return Scene(ground=ground, obstacles=(post,), goal_regions=(REGION,), mount=mount or Mount())


@pytest.mark.parametrize("rpy", [(0.3, -0.2, 2.0), (0, 0, math.pi / 2), (math.pi, 0, 0)])
def test_rotation_is_that_of_pinocchio(rpy):
    np.testing.assert_allclose(rotation_matrix(rpy), pin.rpy.rpyToMatrix(*rpy), atol=1e-11)


def test_a_mounted_arm_moves_as_the_other_one():
    position, rpy = (0.4, -1.2, 0.8), (0.4, -0.3, 2.0)
    arm, rng = Arm.load("paper"), np.random.default_rng(0)
    mount = Mount(position=position, rpy=rpy)
    placed = arm.placed(mount.position, mount.rotation)
    world = World(problem(moved_scene(mount, ground=False)))
    q = rng.uniform(arm.lower, arm.upper, (50, 6))
    expected = [mount.rotation @ arm.tool_position(each) + position for each in q]
    np.testing.assert_allclose([placed.tool_position(each) for each in q], expected, atol=1e-12)
    np.testing.assert_allclose(world.screen(q)[0], expected, atol=1e-12)
    assert (placed.name, placed.digest) == ("paper", arm.digest)
    assert pickle.loads(pickle.dumps(placed)).digest == arm.digest


def test_contact_is_that_of_a_scene_that_is_moved_back():
    """A post that is turned, and an arm that is turned as much: as if neither were."""
    angle = 0.7
    centre = rotation_matrix((0, 0, angle)) @ np.array(POST.body.position)
    half = np.array(POST.body.size) / 2
    post = Obstacle(name="post", lower=centre - half, upper=centre + half, yaw=angle)
    turned = Scene(obstacles=(post,), goal_regions=(REGION,), mount=Mount(rpy=(0, 0, angle)))
    worlds = [World(problem(scene)) for scene in (turned, moved_scene())]
    q = np.random.default_rng(1).uniform(worlds[0].arm.lower, worlds[0].arm.upper, (3000, 6))
    there, here = (world.screen(q)[1] for world in worlds)
    assert 0.1 < here.mean() < 0.9
    # Rounding of the turned corners can decide what touches by less than 1e-9.
    assert (there != here).sum() <= 1


@pytest.mark.parametrize("yaw", [0.3, 2.0, -1.0])
def test_a_turned_box_is_where_coal_has_it(yaw):
    scene = moved_scene(yaw=yaw)
    model = ContactModel.build(Arm.load("paper"), scene)
    (shape,) = [each for each in model.geometry.geometryObjects if each.name == "post"]
    shapes, index = model.shapes, model.body_names.index("post")
    row = shapes.placed[index - model.arm.geometry.ngeoms]
    corners = shapes.corners[slice(*shapes.bodies[index, :2])] * row[:3] @ row[4:13].reshape(3, 3).T
    corners += row[13:]
    box = coal.CollisionObject(shape.geometry, shape.placement)
    for corner in corners:
        ball = coal.CollisionObject(coal.Sphere(1e-6), pin.SE3(np.eye(3), corner))
        result = coal.DistanceResult()
        coal.distance(box, ball, coal.DistanceRequest(), result)
        assert abs(result.min_distance) < 2e-6


@pytest.mark.parametrize(
    "scene",
    [
        moved_scene(yaw=0.6),
        moved_scene(Mount(position=(-0.2, 0.1, 0.4), rpy=(0, 0, 0.5)), yaw=-0.4),
        moved_scene(Mount(position=(0, 0, 1.2), rpy=(math.pi, 0, 0.3)), yaw=0.9),
        moved_scene(Mount(position=(-0.1, 0, 0.5), rpy=(0.2, 0.3, 0)), yaw=0.9, ground=False),
    ],
    ids=["turned box", "on a plinth", "upside down", "leaning"],
)
def test_rollouts_equal_the_reference_path(scene):
    _, collision, _ = compare_actions(Simulator(problem(scene), threads=1), 2, 40)
    assert collision > 2


def test_a_box_that_the_first_link_cannot_leave_is_refused():
    box = Obstacle(name="box", lower=(-0.3, -0.3, 0), upper=(0.3, 0.3, 0.6))
    scene = Scene(
        obstacles=(box,),
        goal_regions=(GoalRegion(name="goal", lower=(0.3, -0.3, 1.0), upper=(0.6, 0.3, 1.1)),),
    )
    with pytest.raises(ProblemError, match="arm .paper. cannot move: shoulder touches box"):
        World(problem(scene))


def test_ground_that_the_first_link_always_touches_is_its_mounting():
    scene = moved_scene(Mount(position=(0, 0, -0.2)))
    world = World(problem(scene))
    assert world.contact_model.left_out["shoulder", "ground"] == "the mounting: always touch"

"""Bodies of every shape: where they are, and what they touch."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from mesh_files import CUBE_CORNERS, write_obj, write_stl
from random_scenes import random_body, random_scene
from reference_episodes import compare_actions

from kinarm.bodies import SHAPES, Body
from kinarm.errors import KinarmError
from kinarm.meshes import coal_shape
from kinarm.problem import ReachProblem
from kinarm.problem_files import find_scene
from kinarm.scene import GoalRegion, Obstacle, Scene
from kinarm.simulator import Simulator
from kinarm.world import World

SIZES = {shape: (0.3, 0.2, 0.1)[: len(labels)] for shape, labels in SHAPES.items()}
CORNERS = CUBE_CORNERS - 0.5


def body(shape="box", **changes):
    vertices = CORNERS if shape == "mesh" else ()
    return Body(
        **{"name": "it", "shape": shape, "size": SIZES.get(shape, ()), "vertices": vertices}
        | changes
    )


@pytest.mark.parametrize("shape", SHAPES)
def test_contains_what_coal_has_no_distance_from(shape):
    rng = np.random.default_rng(3)
    for _ in range(5):
        each = random_body(rng, "it", shape)
        points = rng.uniform((-1, -1, -0.6), (1, 1, 1.4), (400, 3))
        points[:200] = np.array(each.position) + rng.normal(size=(200, 3)) * 0.1
        place, ball = pin.SE3(each.rotation, np.array(each.position)), coal.Sphere(1e-9)
        distances = []
        for point in points:
            result = coal.DistanceResult()
            at = pin.SE3(np.eye(3), point)
            request = coal.DistanceRequest()
            coal.distance(coal_shape(each), place, ball, at, request, result)
            distances.append(result.min_distance)
        apart = np.array(distances)
        clear = np.abs(apart) > 1e-5
        np.testing.assert_array_equal(each.contains(points, 0.0)[clear], apart[clear] < 0)


def test_orientation_by_angles_and_by_quaternion():
    rpy, quaternion = (0.3, -0.2, 2.0), pin.Quaternion(pin.rpy.rpyToMatrix(0.3, -0.2, 2.0))
    x, y, z, w = quaternion.coeffs()
    turned = body(quaternion=2 * np.array([w, x, y, z])).rotation
    np.testing.assert_allclose(turned, body(rpy=rpy).rotation, atol=1e-11)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"shape": "cone", "size": ()},
            "shape must be one of box, sphere, capsule, cylinder, halfspace, mesh",
        ),
        ({"size": (1, 1)}, r"box 'it': size must be x, y, z \[m\], got \[1.0, 1.0\]"),
        ({"size": (1, 0, 1)}, "box 'it': y must be 1e-06 to 10000 m, got 0"),
        ({"quaternion": (0, 0, 0, 0)}, "quaternion must have a length of about 1"),
        ({"quaternion": (1, 0, 0, 0), "rpy": (0, 0, 1)}, "has both rpy and quaternion"),
        ({"shape": "mesh", "size": (), "vertices": CORNERS[:3]}, "4 to 1000 vertices are possible"),
        ({"shape": "mesh", "size": (), "vertices": CORNERS[:4]}, "hull of the vertices has no vol"),
    ],
)
def test_impossible_ones_are_refused(changes, message):
    with pytest.raises(KinarmError, match=message):
        body(**changes)


class TestScenes:
    def test_boxes_by_corners_are_the_same_as_by_centre(self):
        corners = Obstacle(name="a", lower=(0.2, 0.1, 0), upper=(0.6, 0.3, 0.5), yaw=0.4)
        size, centre = (0.4, 0.2, 0.5), (0.4, 0.2, 0.25)
        centred = Body(name="a", shape="box", size=size, position=centre, rpy=(0, 0, 0.4))
        q = np.random.default_rng(0).uniform(-2, 2, (2000, 6))
        touching = [
            World(ReachProblem.load("both").replace(scene=random_scene_of(each))).in_contact(q)
            for each in (corners, centred)
        ]
        np.testing.assert_array_equal(*touching)

    @pytest.mark.parametrize("write", [write_stl, write_obj], ids=["stl", "obj"])
    def test_meshes_are_read_beside_the_file(self, tmp_path, write):
        (tmp_path / "meshes").mkdir()
        path = tmp_path / f"meshes/cube.{write.__name__[-3:]}"
        write(path, 1000 * CORNERS)
        (tmp_path / "scene.toml").write_text(
            f'[[obstacles]]\nname = "it"\nmesh = "meshes/{path.name}"\nscale = 0.0002\n'
            "position = [0.6, 0.0, 0.4]\n[[goal_regions]]\nname = 'g'\n"
            "lower = [0.3, 0.3, 0.3]\nupper = [0.4, 0.4, 0.3]\n"
        )
        (found,) = find_scene(tmp_path / "scene.toml").obstacles
        box = body(size=(0.2, 0.2, 0.2), position=(0.6, 0.0, 0.4))
        np.testing.assert_allclose(np.sort(found.vertices, 0), np.sort(CORNERS * 0.2, 0), atol=1e-9)
        assert found.position == box.position

    @pytest.mark.parametrize(
        ("more", "message"),
        [
            ("", "obstacles.0.: mesh 'bent.stl' is not convex"),
            ('hull = "no"', "obstacles.0.: mesh 'bent.stl' is not convex"),
            ("vertices = [[0, 0, 0]]", "obstacles.0. has both mesh and vertices"),
        ],
    )
    def test_meshes_that_are_not_convex_or_given_twice_are_refused(self, tmp_path, more, message):
        bent = CORNERS.copy()
        bent[CUBE_CORNERS.sum(axis=1) == 3] = -0.2
        write_stl(tmp_path / "bent.stl", bent)
        (tmp_path / "scene.toml").write_text(
            f'[[obstacles]]\nname = "it"\nmesh = "bent.stl"\n{more}\n'
            "[[goal_regions]]\nname = 'g'\nlower = [0.3, 0.3, 0.3]\nupper = [0.4, 0.4, 0.3]\n"
        )
        with pytest.raises(KinarmError, match=message):
            find_scene(tmp_path / "scene.toml")

    @pytest.mark.parametrize("shape", SHAPES)
    def test_goals_inside_a_body_are_refused(self, shape):
        large = {"size": [5 * each for each in SIZES[shape]]}
        vertices = {"vertices": 3 * CORNERS} if shape == "mesh" else {}
        around = body(shape, position=(0.5, 0, 0.5), **large, **vertices)
        region = GoalRegion(name="g", lower=(0.45, 0, 0.4), upper=(0.5, 0.1, 0.45))
        scene = Scene(obstacles=(around,), goal_regions=(region,))
        with pytest.raises(KinarmError, match="goal region 'g' lies inside obstacle 'it'"):
            ReachProblem.load("both").replace(scene=scene, goal_regions=("g",))


def random_scene_of(*bodies):
    return Scene(obstacles=bodies, goal_regions=Scene().goal_regions)


@pytest.mark.parametrize("shape", SHAPES)
def test_episodes_are_those_of_the_reference(shape):
    """Among bodies of a shape, one of which is the ground."""
    count = 1 if shape == "halfspace" else 5
    scene = random_scene(7, count, (shape,), ground=shape != "halfspace")
    simulator = Simulator(ReachProblem.load("both").replace(scene=scene), threads=1)
    _, collisions, count = compare_actions(simulator, 8, 40)
    assert 0.1 * count < collisions < count


def test_claims_hold_in_many_scenes():
    for seed in range(8):
        problem = ReachProblem.load("both").replace(scene=random_scene(seed, 10))
        world = World(problem, threads=1)
        arm = world.arm
        q = np.random.default_rng(seed).uniform(arm.lower, arm.upper, (4000, arm.n_joints))
        _, free, touching, proven = world.proven(q)
        found = world.contact_model.in_contact(q)
        assert not (free & found).any()
        assert not (touching & ~found).any()
        assert proven > 0.7 * len(q)

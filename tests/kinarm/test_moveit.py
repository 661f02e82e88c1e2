"""Scenes and requests of MoveIt: what becomes of them, and what is refused."""

import copy
import math

import numpy as np
import pytest

from kinarm.arm import Arm
from kinarm.arm_specification import ArmSpecification
from kinarm.errors import InvalidInputError
from kinarm.moveit import import_problem
from kinarm.problem import ReachProblem
from kinarm.scene import Mount
from kinarm.world import World

yaml = pytest.importorskip("yaml")

PAPER = Arm.load()
NAMES = list(PAPER.joint_names)
GOAL = PAPER.home + 0.1
HALF = math.sqrt(0.5)
PLAIN = {"position": [0.6, 0.1, 0.5], "orientation": [0, 0, 0, 1]}
BOX = {"type": "box", "dimensions": [0.1, 0.2, 0.3]}
CORNERS = [[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]]


def an_object(primitive=None, pose=None, **more):
    """A collision object of one primitive."""
    return {
        "id": "thing",
        "primitives": [primitive or BOX],
        "primitive_poses": [pose or PLAIN],
        **more,
    }


SCENE = {
    "fixed_frame_transforms": [
        {
            "child_frame_id": "world",
            "transform": {"translation": [0, 0, 0], "rotation": [0, 0, 0, 1]},
        },
        {
            "child_frame_id": "table",
            "transform": {"translation": [0, 0, 1], "rotation": [0, 0, HALF, HALF]},
        },
    ],
    "robot_state": {"joint_state": {"name": [], "position": []}},
    "world": {"collision_objects": [an_object()]},
}
REQUEST = {
    "start_state": {
        "joint_state": {
            "name": ["finger", *NAMES[::-1]],
            "position": [0.4, *PAPER.home[::-1].tolist()],
        }
    },
    "goal_constraints": [
        {
            "joint_constraints": [
                {"joint_name": name, "position": float(at)}
                for name, at in zip(NAMES, GOAL, strict=True)
            ]
        }
    ],
}


@pytest.fixture
def imported(tmp_path):
    """Write a scene and a request, and import them."""

    def make(scene, request=REQUEST, mount=None):
        for name, content in (("scene1.yaml", scene), ("request1.yaml", request)):
            text = content if isinstance(content, str) else yaml.safe_dump(content)
            (tmp_path / name).write_text(text)
        files = tmp_path / "scene1.yaml", tmp_path / "request1.yaml"
        return import_problem(*files, ArmSpecification(), mount or Mount())

    return make


def with_objects(*objects, **more):
    """The scene with other objects."""
    return {**SCENE, "world": {"collision_objects": list(objects), **more}}


@pytest.mark.parametrize(
    ("primitive", "shape", "size"),
    [
        (BOX, "box", (0.1, 0.2, 0.3)),
        ({"type": "sphere", "dimensions": [0.1]}, "sphere", (0.1,)),
        ({"type": "cylinder", "dimensions": [0.5, 0.03]}, "cylinder", (0.03, 0.5)),
    ],
)
def test_primitives_have_their_sizes(imported, primitive, shape, size):
    problem, _ = imported(with_objects(an_object(primitive)))
    (body,) = problem.scene.obstacles
    assert (body.name, body.shape, body.size) == ("thing", shape, size)
    assert body.position == (0.6, 0.1, 0.5)
    assert np.array_equal(body.rotation, np.eye(3))
    assert not problem.scene.ground


def test_meshes_and_several_shapes_of_an_object(imported):
    mesh = {"vertices": CORNERS, "triangles": [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]}
    both = an_object(meshes=[mesh], mesh_poses=[PLAIN])
    first, second = imported(with_objects(both))[0].scene.obstacles
    assert (first.name, second.name) == ("thing 1", "thing 2")
    assert second.shape == "mesh"
    assert np.array_equal(second.vertices, CORNERS)


@pytest.mark.parametrize("frame", ["", "world", "table"])
def test_poses_follow_one_another(imported, frame):
    """Frame, object and primitive, each a quarter turn about an axis of its own."""
    outer = {"position": [1, 2, 3], "orientation": [HALF, 0, 0, HALF]}
    inner = {"position": [0.1, 0.2, 0.3], "orientation": [0, HALF, 0, HALF]}
    header = {"frame_id": frame}
    (body,) = imported(with_objects(an_object(pose=inner, header=header) | {"pose": outer}))[
        0
    ].scene.obstacles
    position = np.array([1.1, 2 - 0.3, 3 + 0.2])
    rotation = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    if frame == "table":
        turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
        position, rotation = turn @ position + [0, 0, 1], turn @ rotation
    assert body.position == pytest.approx(position)
    assert body.rotation == pytest.approx(rotation)


def test_start_and_goal_are_those_of_the_request(imported):
    problem, found = imported(SCENE)
    assert np.array_equal(found, [PAPER.home, GOAL])
    assert problem.task.starts == (tuple(PAPER.home),)
    (region,) = problem.scene.goal_regions
    middle = (np.array(region.lower) + np.array(region.upper)) / 2
    assert middle == pytest.approx(PAPER.tool_position(GOAL), abs=1e-8)
    assert np.ptp([region.lower, region.upper], axis=0).max() <= 2.1e-6
    assert ReachProblem.from_json(problem.to_json()) == problem
    assert not World(problem).in_contact(found).any()


def test_arm_stands_on_its_mount(imported):
    mount = Mount(position=(0.5, 0.0, 0.9), rpy=(0.0, 0.0, math.pi / 2))
    problem, (_, goal) = imported(SCENE, mount=mount)
    x, y, z = PAPER.tool_position(goal)
    (region,) = problem.scene.goal_regions
    assert region.lower == pytest.approx((0.5 - y, x, 0.9 + z), abs=1e-5)
    assert World(problem).screen(goal[None])[0][0] == pytest.approx((0.5 - y, x, 0.9 + z))


@pytest.mark.parametrize("where", ["scene", "request"])
@pytest.mark.parametrize("header", [{}, {"header": {"frame_id": "hand"}}])
def test_attached_objects_are_held(imported, where, header):
    link = PAPER.tool_frame
    frame = {"header": {"frame_id": link}} if header else {}
    attached = [{"link_name": link, "object": an_object(pose=PLAIN, **frame)}]
    scene, request = copy.deepcopy(SCENE), copy.deepcopy(REQUEST)
    state = scene["robot_state"] if where == "scene" else request["start_state"]
    state["attached_collision_objects"] = attached
    problem, _ = imported(scene, request)
    (body,) = problem.arm.held_bodies
    assert (body.name, body.link, body.position) == ("thing", link, (0.6, 0.1, 0.5))
    assert problem.load_arm().held_bodies == (body,)


def changed(table, keys, value):
    """A copy with another value, or without the key if it is None."""
    table = copy.deepcopy(table)
    inner = table
    for key in keys[:-1]:
        inner = inner[key]
    if value is None:
        del inner[keys[-1]]
    else:
        inner[keys[-1]] = value
    return table


OBJECT = ("world", "collision_objects", 0)
PRIMITIVE, POSE = (*OBJECT, "primitives", 0), (*OBJECT, "primitive_poses", 0)
STATE, GOALS = ("start_state", "joint_state"), ("goal_constraints", 0)
IN_GOAL = (*GOALS, "joint_constraints", 0)


@pytest.mark.parametrize(
    ("keys", "value", "words"),
    [
        (("world",), None, ["'world' is missing"]),
        (("world", "octomap"), {"id": "tree"}, ["world: 'octomap' cannot be imported"]),
        (
            (*OBJECT, "header"),
            {"frame_id": "shelf"},
            ["'shelf' is none of the fixed frames world, table"],
        ),
        ((*PRIMITIVE, "type"), "cone", ["primitives[0]: type 'cone'", "box, sphere, cylinder"]),
        ((*POSE, "orientation"), [0, 0, 0, 0], ["orientation: must be a quaternion of length 1"]),
    ],
)
def test_refused_scenes(imported, keys, value, words):
    with pytest.raises(InvalidInputError) as refused:
        imported(changed(SCENE, keys, value))
    assert all(word in str(refused.value) for word in ["scene1.yaml: ", *words]), refused.value
    assert str(refused.value).count("scene1.yaml") == 1


@pytest.mark.parametrize(
    ("keys", "value", "words"),
    [
        ((*STATE, "position"), [1, 2], ["joint_state.position must have shape (7), got (2,)"]),
        ((*STATE, "name", 2), "other", [f"joint_state: {NAMES[-2]} of arm 'paper' is missing"]),
        ((*STATE, "position", 1), 99.0, ["joint_state lies outside the limits", NAMES[-1]]),
        ((*IN_GOAL, "position"), "up", ["joint_constraints[0].position must be numbers"]),
        (
            ("start_state", "attached_collision_objects"),
            [{"link_name": "nail", "object": an_object(header={"frame_id": "world"})}],
            ["object: header.frame_id 'world' is none of the fixed frames nail"],
        ),
    ],
)
def test_refused_requests(imported, keys, value, words):
    with pytest.raises(InvalidInputError) as refused:
        imported(SCENE, changed(REQUEST, keys, value))
    assert all(word in str(refused.value) for word in ["request1.yaml: ", *words]), refused.value


@pytest.mark.parametrize("key", ["fixed_frame_transforms", "robot_state", "world.octomap"])
def test_keys_without_a_value_count_as_missing(imported, key):
    scene = yaml.safe_dump(changed(SCENE, key.split("."), "nothing")).replace("nothing", "")
    problem, _ = imported(scene)
    assert [body.name for body in problem.scene.obstacles] == ["thing"]


@pytest.mark.parametrize("text", ["a: [1", "\t", "[" * 200_000, ""])
def test_files_that_are_no_table(imported, text):
    with pytest.raises(InvalidInputError, match=r"scene1\.yaml"):
        imported(text)


def test_goal_inside_an_obstacle(imported):
    pose = {"position": PAPER.tool_position(GOAL).tolist(), "orientation": [0, 0, 0, 1]}
    with pytest.raises(InvalidInputError, match=r"scene1\.yaml: .*lies inside obstacle 'thing'"):
        imported(with_objects(an_object(pose=pose)))

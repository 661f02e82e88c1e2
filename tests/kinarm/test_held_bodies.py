"""What links hold: where it is, what it is tested against, how it looks, and what is refused."""

import numpy as np
import pinocchio as pin
import pytest
from mesh_files import CUBE_CORNERS, write_stl
from random_scenes import random_body
from reference_episodes import compare_actions

from kinarm import Arm, ReachProblem, Simulator, World
from kinarm.arm_specification import AllowedContact, ArmSpecification
from kinarm.bodies import SHAPES, HeldBody
from kinarm.contact_pairs import NEVER_TOUCH, TOUCH_AT_HOME
from kinarm.contact_statistics import arm_warnings, contact_on_bare_ground
from kinarm.errors import KinarmError
from kinarm.problem_options import say_choices
from kinarm.recording import record_path
from kinarm.viewer.visual_shapes import arm_parts

HELD = [shape for shape in SHAPES if shape != "halfspace"]


def held(shape="sphere", **changes):
    """A body some way in front of the paper arm's hand."""
    at = {"name": "it", "link": "hand", "shape": shape, "position": (0.2, 0.02, 0.0)}
    size = (0.04, 0.03, 0.05)[: len(SHAPES[shape])]
    vertices = (CUBE_CORNERS - 0.5) * 0.05 if shape == "mesh" else ()
    return HeldBody(**at | {"size": size, "vertices": vertices} | changes)


def holding(*bodies, **changes):
    return Arm.load("paper", held_bodies=bodies, **changes)


def moving_pairs(arm):
    """Pairs that are tested or proven never to touch."""
    contact = contact_on_bare_ground(arm)
    proven = {pair for pair, reason in contact.left_out.items() if reason == NEVER_TOUCH}
    return {*contact.pair_names, *proven}


def test_it_is_tested_against_everything_but_its_link(shipped_arms):
    bare, arm = shipped_arms["paper"], holding(held(), held(name="other", position=(0.3, 0, 0)))
    pairs, more = map(moving_pairs, (bare, arm))
    links = [shape.name.rsplit("_", 1)[0] for shape in bare.geometry.geometryObjects]
    others = [link for link in links if link != "hand"] + ["ground"]
    assert links == ["base", "shoulder", "upper_arm", "elbow", "forearm", "wrist", "hand"]
    expected = {frozenset((name, other)) for name in ("it", "other") for other in others}
    assert {frozenset(pair) for pair in more - pairs} == expected
    assert pairs < more


def test_what_the_file_allows_is_not_tested():
    allowed = AllowedContact(links=("it", "wrist"), reason="the gripper gives way")
    pairs = moving_pairs(holding(held(), allowed_contacts=(allowed,)))
    assert ("wrist", "it") not in pairs
    assert ("forearm", "it") in pairs


def test_what_touches_at_home_is_told(capsys):
    arm = holding(held(position=(0.0, 0.0, 0.0)))
    contact = contact_on_bare_ground(arm)
    assert contact.left_out["wrist", "it"] == TOUCH_AT_HOME
    (line,) = arm_warnings(contact)
    assert "since they touch at home: forearm and it, wrist and it;" in line
    say_choices([ReachProblem.load("right").replace(arm=arm)])
    assert capsys.readouterr().err == f"arm paper: {line}\n"
    assert arm_warnings(contact_on_bare_ground(holding(held()))) == []


@pytest.mark.parametrize("placed", [False, True])
def test_it_moves_with_its_link(placed):
    """Pinocchio says where the link is."""
    body = held("box", rpy=(0.3, -0.2, 1.0))
    arm = holding(body)
    if placed:
        arm = arm.placed((0.1, 0.2, 0.3), pin.rpy.rpyToMatrix(0.1, 0.2, 0.3))
    contact, q = contact_on_bare_ground(arm), arm.home + 0.3
    data, shapes = arm.model.createData(), contact.geometry.createData()
    pin.updateGeometryPlacements(arm.model, data, contact.geometry, shapes, q)
    pin.framesForwardKinematics(arm.model, data, q)
    link = data.oMf[arm.model.getFrameId("hand")]
    expected = link * pin.SE3(body.rotation, np.array(body.position))
    found = shapes.oMg[contact.body_names.index("it")]
    np.testing.assert_allclose(found.homogeneous, expected.homogeneous, atol=1e-12)


@pytest.mark.parametrize("shape", HELD)
def test_episodes_are_those_of_the_reference(shape):
    turn = random_body(np.random.default_rng(4), "it", shape).quaternion
    specification = ArmSpecification(held_bodies=(held(shape, quaternion=turn),))
    simulator = Simulator(ReachProblem.load("both").replace(arm=specification), threads=1)
    _, collisions, count = compare_actions(simulator, 8, 40)
    assert 0.1 * count < collisions < count


def test_joints_that_are_not_actuated_move_it_into_contact():
    """The last joint of the arm, by which a box beside its axis meets the bench."""
    arm = ArmSpecification(held_bodies=(held("box", size=(0.05, 0.05, 0.4)),))
    world = World(ReachProblem.load("both").replace(arm=arm), threads=1)
    rng, met = np.random.default_rng(3), 0
    for q in rng.uniform(world.arm.lower, world.arm.upper, (1000, 6)):
        ends = np.tile(q, (2, 1))
        ends[:, 5] = 0.0, 1.0
        met_at_end = world.in_contact(ends)
        if met_at_end.tolist() == [False, True]:
            met += 1
            assert world.contact(*ends) is not None
            assert record_path(world, ends).outcome == "collision"
    assert met > 3


def test_problems_keep_it(tmp_path):
    problem = ReachProblem.load("both").replace(arm=ArmSpecification(held_bodies=(held(),)))
    problem.save(tmp_path / "problem.toml")
    assert ReachProblem.load(tmp_path / "problem.toml") == problem
    elsewhere = holding(held(position=(0.2, 0.02, 0.01)))
    assert len({holding(held()).digest, elsewhere.digest, Arm.load("paper").digest}) == 3


@pytest.mark.parametrize("arm", ["paper", "mesh"])
def test_it_is_drawn(arm, shipped_arms, mesh_arm):
    bare = {"mesh": mesh_arm, **shipped_arms}[arm]
    body = held("box", link=bare.tool_frame)
    arm = Arm.load(bare.specification, held_bodies=(body,), digest=None)
    link = arm.model.frames[arm.model.getFrameId(body.link)]
    centre = link.placement.act(np.array(body.position))
    (more,) = (
        part
        for part in arm_parts(arm)
        if np.allclose(
            (part.mesh.vertices.min(axis=0) + part.mesh.vertices.max(axis=0)) / 2, centre
        )
    )
    assert more.joint == link.parentJoint
    assert len(arm_parts(arm)) == len(arm_parts(bare)) + 1


def test_mesh_files_are_named_from_the_arm_file(tmp_path):
    write_stl(tmp_path / "part.stl", (CUBE_CORNERS - 0.5) * 50)
    text = '[[arm.held_bodies]]\nname = "it"\nlink = "hand"\nmesh = "part.stl"\nscale = 0.001\n'
    (tmp_path / "mine.toml").write_text('[arm]\nsource = "paper"\n' + text)
    (tmp_path / "problem.toml").write_text(text)
    bodies = [
        Arm.load(tmp_path / "mine.toml").held_bodies,
        ReachProblem.load(tmp_path / "problem.toml").arm.held_bodies,
    ]
    for (body,) in bodies:
        ends = np.sort(body.vertices, axis=0)[[0, -1]]
        np.testing.assert_allclose(ends, [[-0.025] * 3, [0.025] * 3], atol=1e-9)


@pytest.mark.parametrize(
    ("bodies", "message"),
    [
        ([{"link": "claw"}], "link in held_bodies of paper.urdf: 'claw'"),
        ([{}, {}], "paper.urdf: held body 'it' needs a name of its own"),
        ([{"shape": "halfspace"}], "halfspace 'it' has no end: link 'hand' cannot hold it"),
    ],
)
def test_unusable_ones_are_refused(bodies, message):
    with pytest.raises(KinarmError, match=message):
        holding(*(held(**{"shape": "sphere"} | each) for each in bodies))

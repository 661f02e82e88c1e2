"""The closest pair and its closest points, held against the distances of all pairs."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from configurations import contact_boundary, pair_distances, random_configurations

from kinarm.arm import Arm
from kinarm.clearance import arm_warnings, contact_on_bare_ground
from kinarm.problem import ReachProblem
from kinarm.scene import Scene
from kinarm.world import World

COAL = 2e-6
"""Precision of Coal's distances of hulls and cylinders [m]."""


def test_equals_the_smallest_distance_of_coal(any_simulator):
    world = any_simulator.world
    q = random_configurations(any_simulator, 1, 300)
    q = np.concatenate([q, *contact_boundary(any_simulator, 2, 60)])
    found = world.clearance(q)
    assert (found.distance > 0.01).sum() > 20
    assert (found.distance < -0.01).sum() > 20
    names = list(world.contact_model.pair_names)
    for row, distances in enumerate(pair_distances(world, q)):
        assert found.distance[row] == pytest.approx(distances.min(), rel=0, abs=COAL)
        pair = names.index(tuple(found.bodies[row]))
        assert distances[pair] == pytest.approx(distances.min(), rel=0, abs=COAL)


def test_points_are_as_far_apart_and_on_the_line_between_the_bodies(any_simulator):
    world, q = any_simulator.world, random_configurations(any_simulator, 5, 400)
    distance, _, points = world.clearance(q)
    apart = np.linalg.norm(points[:, 0] - points[:, 1], axis=1)
    np.testing.assert_allclose(apart, np.abs(distance), rtol=0, atol=1e-5)


def test_points_lie_on_the_bodies(any_simulator):
    """Half of a small ball about a point lies in the body."""
    world, data = any_simulator.world, any_simulator.arm.model.createData()
    geometry = world.contact_model.geometry
    placed = geometry.createData()
    for q in random_configurations(any_simulator, 6, 60):
        distance, bodies, points = world.clearance(q)
        if distance <= 0:
            continue
        pin.updateGeometryPlacements(any_simulator.arm.model, data, geometry, placed, q)
        for name, point in zip(bodies, points, strict=True):
            index = world.contact_model.body_names.index(name)
            shape = geometry.geometryObjects[index].geometry
            if isinstance(shape, coal.Cylinder):
                continue
            at = coal.Transform3s(np.eye(3), point)
            place = coal.Transform3s(placed.oMg[index].rotation, placed.oMg[index].translation)
            gap = coal.distance(
                coal.Sphere(1e-3), at, shape, place, coal.DistanceRequest(), coal.DistanceResult()
            )
            assert gap == pytest.approx(-1e-3, rel=0, abs=1e-5)


def test_one_is_as_many_and_order_does_not_matter(simulator):
    q = random_configurations(simulator, 7, 1500)
    together, turned = simulator.world.clearance(q), simulator.world.clearance(q[::-1])
    for first, second in zip(together, turned, strict=True):
        np.testing.assert_array_equal(first, second[::-1])
    alone = simulator.world.clearance(q[5].tolist())
    assert alone.distance == together.distance[5]
    assert alone.bodies.tolist() == together.bodies[5].tolist()
    assert alone.points.tolist() == together.points[5].tolist()
    assert simulator.world.clearance(np.empty((0, 6))).points.shape == (0, 2, 3)


def test_infinite_where_nothing_is_tested(make_joint, write_robot):
    arm = Arm.load(write_robot([make_joint(axis="0 1 0")]))
    world = World(ReachProblem.load("left").replace(arm=arm, scene=Scene()), threads=1)
    distance, bodies, points = world.clearance(np.zeros((2, 1)))
    assert np.isposinf(distance).all()
    assert bodies.tolist() == [["", ""]] * 2
    assert np.isnan(points).all()


def warnings_of(path):
    return arm_warnings(contact_on_bare_ground(Arm.load(path)))


class TestWarnings:
    BALL = '<sphere radius="0.05"/>'

    def test_an_arm_without_shapes_never_touches(self, make_joint, make_collision, write_robot):
        base = {0: make_collision(self.BALL)}
        path = write_robot([make_joint(), make_joint(axis="0 1 0")], base)
        (line,) = warnings_of(path)
        assert "no moving link has a collision shape" in line

    def test_pairs_that_touch_at_home_are_named(self, make_joint, make_collision, write_robot):
        near = [make_joint(xyz="0.01 0 0.02", axis="0 1 0") for _ in range(4)]
        shapes = {link: make_collision(self.BALL, xyz="0.3 0 0") for link in range(5)}
        (line,) = warnings_of(write_robot(near, shapes))
        # All six pairs but those of neighbours, each once.
        assert line.startswith("never tested for contact, since they touch at home: link_0 and")
        assert line.count(" and link_") == 3
        assert ", and 3 more;" in line
        one = {0: shapes[0], 2: shapes[2]}
        (line,) = warnings_of(write_robot(near, one))
        assert "home: link_0 and link_2; an arm file" in line

    def test_absurd_velocity_limits_are_named(self, make_joint, make_collision, write_robot):
        limit = '<limit lower="-1" upper="1" velocity="{}" effort="0"/>'
        joints = [make_joint(limit=limit.format(speed), axis="0 1 0") for speed in (30, 62.8)]
        path = write_robot(joints, {2: make_collision(self.BALL)})
        assert warnings_of(path) == ["velocity limits that no arm reaches: joint_2 63 rad/s"]

    def test_a_sound_arm_has_none(self, make_joint, make_collision, write_robot):
        shapes = {link: make_collision(self.BALL) for link in range(3)}
        joints = [make_joint(xyz="0.2 0 0", axis="0 1 0") for _ in range(2)]
        assert warnings_of(write_robot(joints, shapes)) == []

"""Capsules that enclose shapes."""

import coal
import numpy as np
import pinocchio as pin
import pytest

from kinarm.enclosures import _capsule_around, enclosing_capsule
from kinarm.errors import ArmError


def surface_points(geometry, rng, count):
    """Points of a shape's surface, in its own frame."""
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    if isinstance(geometry, coal.Sphere):
        return geometry.radius * directions
    if isinstance(geometry, coal.Box):
        corners = rng.choice([-1.0, 1.0], size=(count, 3))
        return corners * geometry.halfSide
    along = rng.choice([-1.0, 1.0], size=(count, 1)) * [[0, 0, geometry.halfLength]]
    if isinstance(geometry, coal.Capsule):
        return geometry.radius * directions + along
    flat = directions * [1, 1, 0]
    return geometry.radius * flat / np.linalg.norm(flat, axis=1, keepdims=True) + along


def distance_from_segment(points, capsule):
    along = capsule.end - capsule.start
    t = (points - capsule.start) @ along / max(along @ along, 1e-300)
    nearest = capsule.start + np.clip(t, 0, 1)[:, None] * along
    return np.linalg.norm(points - nearest, axis=1)


def placed(geometry, seed):
    return pin.GeometryObject("shape", 1, pin.SE3.Random(), geometry)


class TestEnclosingCapsule:
    @pytest.mark.parametrize(
        "geometry",
        [
            coal.Sphere(0.1),
            coal.Capsule(0.1, 0.5),
            coal.Cylinder(0.1, 0.5),
            coal.Cylinder(0.5, 0.1),
            coal.Box(0.1, 0.2, 0.7),
            coal.Box(0.3, 0.3, 0.3),
            coal.Box(0.5, 0.5, 0.01),
        ],
        ids=lambda geometry: type(geometry).__name__,
    )
    def test_encloses_the_surface(self, geometry):
        pin.seed(0)
        for seed in range(5):
            shape = placed(geometry, seed)
            points = surface_points(geometry, np.random.default_rng(seed), 2000)
            world = points @ shape.placement.rotation.T + shape.placement.translation
            capsule = enclosing_capsule(shape)
            assert (distance_from_segment(world, capsule) <= capsule.radius + 1e-12).all()

    def test_equals_capsules_and_spheres(self):
        capsule = enclosing_capsule(
            pin.GeometryObject("shape", 1, pin.SE3.Identity(), coal.Capsule(0.1, 0.5))
        )
        np.testing.assert_allclose([capsule.start, capsule.end], [[0, 0, -0.25], [0, 0, 0.25]])
        assert capsule.radius == 0.1
        ball = enclosing_capsule(
            pin.GeometryObject("shape", 1, pin.SE3.Identity(), coal.Sphere(0.2))
        )
        np.testing.assert_array_equal([ball.start, ball.end], np.zeros((2, 3)))
        assert ball.radius == 0.2

    def test_encloses_random_hulls_without_waste(self):
        rng = np.random.default_rng(0)
        for _ in range(30):
            points = rng.normal(size=(40, 3)) * rng.uniform(0.01, 1, 3)
            vertices = coal.StdVec_Vec3s()
            vertices.extend(list(points))
            hull = coal.Convex.convexHull(vertices, False, "Qt")
            capsule = enclosing_capsule(pin.GeometryObject("hull", 1, pin.SE3.Identity(), hull))
            distances = distance_from_segment(points, capsule)
            assert distances.max() <= capsule.radius + 1e-9
            assert capsule.radius <= np.ptp(points, axis=0).max()

    def test_meshes_of_an_arm_are_enclosed(self, mesh_arm):
        for shape in mesh_arm.geometry.geometryObjects:
            if isinstance(shape.geometry, coal.ConvexBase):
                points = np.array([shape.placement.act(p) for p in shape.geometry.points()])
                capsule = enclosing_capsule(shape)
                assert (distance_from_segment(points, capsule) <= capsule.radius + 1e-12).all()

    def test_what_is_round_gets_a_sphere(self):
        """The corners of an octahedron are as far from its centre in all directions."""
        corners = np.concatenate([np.eye(3), -np.eye(3)])
        capsule = _capsule_around(corners)
        np.testing.assert_array_equal(capsule.start, capsule.end)
        np.testing.assert_allclose(capsule.start, 0, atol=1e-8)
        assert capsule.radius == pytest.approx(1)

    def test_unsupported_shape_is_refused(self):
        shape = pin.GeometryObject("cone_0", 1, pin.SE3.Identity(), coal.Cone(0.1, 0.2))
        with pytest.raises(ArmError, match="'cone_0' is a Cone"):
            enclosing_capsule(shape)

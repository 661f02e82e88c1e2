"""Polytopes and capsules around shapes against the shapes themselves."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from kinarm.enclosures import (
    MANY,
    SOME,
    Enclosure,
    enclosing_polytope,
    inner_capsule,
    outer_capsule,
)
from kinarm.errors import ArmError

PLACED = pin.SE3(pin.Quaternion(0.5, 0.1, -0.7, 0.3).normalized(), np.array([0.1, -0.2, 0.3]))


def placed(geometry):
    return pin.GeometryObject("shape", 1, PLACED, geometry)


def hull(points):
    vertices = coal.StdVec_Vec3s()
    vertices.extend(list(points))
    return coal.Convex.convexHull(vertices, False, "Qt")


def support(enclosure, directions):
    """How far an enclosure reaches along unit vectors, shape (n, 3)."""
    return (enclosure.corners @ directions.T).max(axis=0) + enclosure.rounding


@pytest.fixture
def directions():
    normal = np.random.default_rng(3).normal(size=(4000, 3))
    return normal / np.linalg.norm(normal, axis=1)[:, None]


def local(directions):
    """The same directions in the frame of the shape."""
    return directions @ PLACED.rotation


SIMPLE = {
    "sphere": (coal.Sphere(0.2), lambda d: np.full(len(d), 0.2)),
    "capsule": (coal.Capsule(0.1, 0.6), lambda d: 0.1 + 0.3 * np.abs(d[:, 2])),
    "box": (coal.Box(0.2, 0.4, 0.6), lambda d: np.abs(d) @ [0.1, 0.2, 0.3]),
}


@pytest.mark.parametrize("name", SIMPLE)
def test_equals_simple_shapes(name, directions):
    geometry, reach = SIMPLE[name]
    expected = reach(local(directions)) + directions @ PLACED.translation
    found = support(enclosing_polytope(placed(geometry)), directions)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("most", "loose"), [(16, 0.06), (SOME, 0.03), (64, 0.004), (MANY, 0.004)])
def test_encloses_a_cylinder_closely(most, loose, directions):
    d = local(directions)
    exact = 0.2 * np.hypot(d[:, 0], d[:, 1]) + 0.3 * np.abs(d[:, 2])
    exact += directions @ PLACED.translation
    found = support(enclosing_polytope(placed(coal.Cylinder(0.2, 0.6)), most), directions)
    assert (found >= exact - 1e-12).all()
    assert (found - exact).max() < loose


@pytest.mark.parametrize("most", [16, MANY])
@pytest.mark.parametrize("count", [5, 60, 2000])
def test_encloses_every_vertex_of_a_hull(most, count):
    rng = np.random.default_rng(count)
    geometry = hull(rng.normal(size=(count, 3)) * [0.3, 0.1, 0.05])
    vertices = geometry.points()
    enclosure = enclosing_polytope(placed(geometry), most)
    assert len(enclosure.corners) <= most
    if len(vertices) <= most:
        assert enclosure.rounding < 1e-3
    # A vertex is within the radius of a convex combination of corners, found independently.
    for vertex in vertices[rng.permutation(len(vertices))[:40]]:
        world = PLACED.act(vertex)
        n = len(enclosure.corners)
        # Least largest coordinate of the difference, which no distance is less than.
        cost = np.append(np.zeros(n), 1.0)
        upper = np.c_[np.r_[enclosure.corners.T, -enclosure.corners.T], -np.ones(6)]
        total = np.append(np.ones(n), 0.0)[None]
        found = linprog(cost, upper, np.append(world, -world), total, [1.0])
        assert found.fun <= enclosure.rounding + 1e-9


@pytest.mark.parametrize("enclosing", [inner_capsule, outer_capsule, enclosing_polytope])
def test_other_shapes_are_refused(enclosing):
    shape = pin.GeometryObject("cone_0", 1, pin.SE3.Identity(), coal.Cone(0.1, 0.2))
    with pytest.raises(ArmError, match="'cone_0' is a Cone: not supported"):
        enclosing(shape)


@pytest.mark.parametrize(
    ("geometry", "share"),
    [
        (coal.Sphere(0.2), 1.0),
        (coal.Capsule(0.1, 0.6), 1.0),
        (coal.Cylinder(0.1, 0.6), 0.85),
        (coal.Cylinder(0.3, 0.1), 0.05),
        (coal.Box(0.2, 0.2, 0.9), 0.7),
        (coal.Box(0.5, 0.4, 0.1), 0.1),
        (hull(np.random.default_rng(5).normal(size=(60, 3)) * [0.3, 0.1, 0.05]), 0.2),
        (hull(np.random.default_rng(6).normal(size=(8, 3)) * 0.1), 0.2),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, coal.CollisionGeometry) else "",
)
def test_the_capsule_in_a_shape(geometry, share, directions):
    """It reaches no farther than the shape in any direction, and fills a fair share of it."""
    (start, end), radius, _ = inner_capsule(placed(geometry))
    capsule = np.pi * radius**2 * (np.linalg.norm(end - start) + 4 / 3 * radius)
    if isinstance(geometry, coal.ConvexBase):
        points = np.array([PLACED.act(point) for point in geometry.points()])
        reach, whole = (points @ directions.T).max(axis=0), ConvexHull(points).volume
    else:
        reach = support(enclosing_polytope(placed(geometry)), directions)
        whole = geometry.computeVolume()
    if isinstance(geometry, coal.Cylinder):
        d = local(directions)
        reach = geometry.radius * np.hypot(d[:, 0], d[:, 1]) + geometry.halfLength * np.abs(d[:, 2])
        reach += directions @ PLACED.translation
    assert (support(Enclosure(np.array([start, end]), radius), directions) <= reach + 1e-9).all()
    assert share - 1e-9 < capsule / whole < 1 + 1e-9


@pytest.mark.parametrize("name", ["sphere", "capsule"])
def test_a_round_shape_is_its_capsule(name, directions):
    geometry, reach = SIMPLE[name]
    expected = reach(local(directions)) + directions @ PLACED.translation
    found = support(outer_capsule(placed(geometry)), directions)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("count", [4, 60, 2000])
@pytest.mark.parametrize("spread", [(0.3, 0.1, 0.05), (0.1, 0.1, 0.1), (0.2, 0.2, 0.001)])
def test_a_capsule_around_a_hull_is_slim(count, spread):
    rng = np.random.default_rng(count)
    geometry = hull(rng.normal(size=(count, 3)) * spread)
    (first, last), radius, _ = outer_capsule(placed(geometry))
    world = np.array([PLACED.act(vertex) for vertex in geometry.points()])
    length = np.linalg.norm(last - first)
    along = np.clip((world - first) @ (last - first) / max(length, 1e-12) ** 2, 0, 1)
    distances = np.linalg.norm(world - first - along[:, None] * (last - first), axis=1)
    assert distances.max() <= radius
    # Nor is it much larger than a ball around them.
    middle = world.mean(axis=0)
    assert length / 2 + radius <= 2.0 * np.linalg.norm(world - middle, axis=1).max()
    assert radius <= np.linalg.norm(world - middle, axis=1).max()

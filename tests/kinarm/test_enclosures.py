"""Rounded polytopes around shapes against the shapes themselves."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import linprog

from kinarm.enclosures import FEW, MANY, enclosing_polytope
from kinarm.errors import ArmError

PLACED = pin.SE3(pin.Quaternion(0.5, 0.1, -0.7, 0.3).normalized(), np.array([0.1, -0.2, 0.3]))


def placed(geometry):
    return pin.GeometryObject("shape", 1, PLACED, geometry)


def hull(points):
    from scipy.spatial import ConvexHull

    convex = ConvexHull(points)
    vertices = coal.StdVec_Vec3s()
    for point in points[convex.vertices]:
        vertices.append(point)
    faces = coal.StdVec_Triangle()
    index = {vertex: i for i, vertex in enumerate(convex.vertices)}
    for simplex in convex.simplices:
        faces.append(coal.Triangle(*(index[i] for i in simplex)))
    return coal.Convex(vertices, faces), points[convex.vertices]


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


@pytest.mark.parametrize(("most", "loose"), [(FEW, 0.06), (MANY, 0.004)])
def test_encloses_a_cylinder_closely(most, loose, directions):
    d = local(directions)
    exact = 0.2 * np.hypot(d[:, 0], d[:, 1]) + 0.3 * np.abs(d[:, 2])
    exact += directions @ PLACED.translation
    found = support(enclosing_polytope(placed(coal.Cylinder(0.2, 0.6)), most), directions)
    assert (found >= exact - 1e-12).all()
    assert (found - exact).max() < loose


@pytest.mark.parametrize("most", [FEW, MANY])
@pytest.mark.parametrize("count", [5, 60, 2000])
def test_encloses_every_vertex_of_a_hull(most, count):
    rng = np.random.default_rng(count)
    geometry, vertices = hull(rng.normal(size=(count, 3)) * [0.3, 0.1, 0.05])
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
        upper = np.vstack(
            [
                np.hstack([enclosure.corners.T, -np.ones((3, 1))]),
                np.hstack([-enclosure.corners.T, -np.ones((3, 1))]),
            ]
        )
        found = linprog(
            cost,
            A_ub=upper,
            b_ub=np.append(world, -world),
            A_eq=np.append(np.ones(n), 0.0)[None],
            b_eq=[1.0],
        )
        assert found.fun <= enclosure.rounding + 1e-9


def test_is_refused_for_what_has_no_volume():
    plane = coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
    with pytest.raises(ArmError, match="not supported"):
        enclosing_polytope(placed(plane))

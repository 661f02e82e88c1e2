"""Pieces of meshes: nothing of a mesh is left outside, and hollows are freed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from kinarm import Arm, UnknownNameError
from kinarm.errors import KinarmError
from kinarm.pieces import cut, cut_into_pieces


def faces(points):
    """Triangles of the hull of points."""
    return points[ConvexHull(points).simplices]


def box(lower, upper):
    ends = np.array([lower, upper], dtype=float)
    corners = np.array([[x, y, z] for x in ends[:, 0] for y in ends[:, 1] for z in ends[:, 2]])
    return faces(corners)


ELL = np.concatenate([box((0, 0, 0), (0.1, 0.1, 0.8)), box((0, 0, 0.7), (0.5, 0.1, 0.8))])


@st.composite
def heaps(draw):
    """Triangles of a few convex lumps beside each other."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    lumps = [
        faces(rng.normal(size=(rng.integers(8, 60), 3)) * rng.uniform(0.05, 0.3, 3) + middle)
        for middle in rng.normal(size=(draw(st.integers(1, 4)), 3)) * 0.5
    ]
    return np.concatenate(lumps), rng


def outside(points, pieces):
    """How far points lie outside all hulls at most [m]; SciPy decides."""
    hulls = [ConvexHull(piece).equations for piece in pieces]
    depths = [(points @ each[:, :3].T + each[:, 3]).max(axis=1) for each in hulls]
    return np.min(depths, axis=0).max()


def areas(triangles):
    a, b, c = triangles.swapaxes(0, 1)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


@settings(max_examples=20, deadline=None)
@given(heaps(), st.integers(0, 2), st.floats(-0.3, 0.3))
def test_both_sides_of_a_cut_make_up_the_triangles(heap, axis, at):
    triangles, _ = heap
    below, above = cut(triangles, axis, at), cut(triangles, axis, at, above=True)
    assert (below[:, :, axis] <= at).all()
    assert (above[:, :, axis] >= at).all()
    assert areas(below).sum() + areas(above).sum() == pytest.approx(areas(triangles).sum())


@settings(max_examples=8, deadline=None)
@given(heaps(), st.integers(1, 5))
def test_every_point_of_a_mesh_is_in_a_piece(heap, count):
    triangles, rng = heap
    pieces = cut_into_pieces(triangles, count)
    assert 1 <= len(pieces) <= count
    weights = rng.dirichlet(np.ones(3), (20, len(triangles)))
    points = np.einsum("skc,kcd->skd", weights, triangles).reshape(-1, 3)
    assert outside(points, pieces) < 1e-9


def test_an_ell_becomes_its_two_bars():
    volume = sum(ConvexHull(piece).volume for piece in cut_into_pieces(ELL, 2))
    # The best plane is within a seventeenth of an extent from the corner: a wedge more.
    assert 0.012 <= volume < 0.012 + 0.5 * 0.4 * 0.1 * 0.8 / 17
    assert ConvexHull(ELL.reshape(-1, 3)).volume == pytest.approx(0.012 + 0.5 * 0.4 * 0.1 * 0.7)


def test_what_is_convex_stays_whole():
    assert len(cut_into_pieces(box((0, 0, 0), (1, 2, 3)), 8)) == 1


def write_mesh(path, triangles):
    corners = [f"v {x} {y} {z}" for x, y, z in triangles.reshape(-1, 3)]
    numbers = np.arange(1, 3 * len(triangles) + 1).reshape(-1, 3)
    path.write_text("\n".join(corners + ["f {} {} {}".format(*face) for face in numbers]))
    return f'<mesh filename="{path.name}"/>'


@pytest.fixture(scope="module")
def ell_arm(write_robot, make_joint, make_collision):
    """An arm whose second link is an L."""
    path = write_robot([make_joint(axis="0 1 0"), make_joint(axis="0 1 0"), make_joint()])
    shape = make_collision(write_mesh(path.with_name("ell.obj"), ELL))
    link = '<link name="link_2">'
    path.write_text(path.read_text().replace(link, link + shape))
    return path


def test_an_arm_has_the_pieces_that_it_is_asked_for(ell_arm):
    whole, cut_up = Arm.load(ell_arm), Arm.load(ell_arm, pieces={"link_2": 2})
    assert [shape.name for shape in whole.geometry.geometryObjects] == ["link_2_0"]
    shapes = cut_up.geometry.geometryObjects
    assert [shape.name for shape in shapes] == ["link_2_0", "link_2_1"]
    assert {shape.parentJoint for shape in shapes} == {2}
    pieces = [np.array(shape.geometry.points()) for shape in shapes]
    assert outside(ELL.reshape(-1, 3), pieces) < 1e-6  # Coal reads meshes in single precision
    assert whole.digest != cut_up.digest
    assert Arm.load(ell_arm, pieces={"link_2": 1}).digest == whole.digest


@pytest.mark.parametrize(
    ("pieces", "message"),
    [
        ({"link_9": 2}, "unknown link with a mesh in pieces of made.urdf: 'link_9'"),
        ({"link_2": 0}, "pieces.link_2 must be a whole number of at least 1, got 0"),
        ({"link_2": 33}, "pieces.link_2 must be at most 32, got 33"),
    ],
)
def test_unusable_pieces_are_refused(ell_arm, pieces, message):
    with pytest.raises((UnknownNameError, KinarmError), match=message):
        Arm.load(ell_arm, pieces=pieces)

"""Mesh files and their hulls: never smaller than the mesh, little larger, always the same."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from kinarm import meshes
from kinarm.errors import ArmError
from kinarm.meshes import (
    EXCESS,
    MANY_VERTICES,
    PLANES,
    enclosing_corners,
    hulls_of_mesh,
    mesh_content,
)


@st.composite
def clouds(draw):
    """Points that span a volume: on boxes, spheres and rods of all sizes."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    points = rng.normal(size=(draw(st.integers(30, 400)), 3))
    kind = draw(st.sampled_from(["ball", "sphere", "box", "grid"]))
    if kind == "sphere":
        points /= np.linalg.norm(points, axis=1)[:, None]
    elif kind == "box":
        points = np.clip(points, -0.7, 0.7)
    elif kind == "grid":
        points = np.round(points, 1)
    sizes = [10.0 ** draw(st.floats(-2.5, 0)) for _ in range(3)]
    return points * sizes + rng.normal(size=3)


def outside(points, corners):
    """How far points lie outside the hull of corners at most [m]; SciPy decides."""
    hull = ConvexHull(corners)
    return (points @ hull.equations[:, :3].T + hull.equations[:, 3]).max()


@settings(max_examples=8, deadline=None)
@given(clouds())
def test_no_point_is_left_outside(points):
    corners = enclosing_corners(points)
    # The tests of SciPy are that exact themselves.
    assert outside(points, corners) < 1e-9
    assert len(corners) <= 2 * PLANES - 4
    np.testing.assert_array_equal(enclosing_corners(points), corners)


def ball(count):
    rng = np.random.default_rng(0)
    points = rng.normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1)[:, None]


@pytest.mark.parametrize("radius", [0.01, 0.2])
def test_stands_out_by_little(radius):
    points = radius * ball(3000)
    corners = enclosing_corners(points)
    # 160 planes about a ball: corners stand out by a few per cent of its radius.
    assert outside(corners, points) <= max(EXCESS, 0.08 * radius)


def test_what_has_few_faces_keeps_its_shape():
    box = np.array([(x, y, z) for x in (0, 0.3) for y in (0, 0.2) for z in (0, 0.1)])
    corners = enclosing_corners(np.vstack([box, box.mean(axis=0) + 0.01 * ball(50)]))
    assert outside(corners, box) < 1e-8


def write_ball(path, count):
    """A mesh of a ball whose vertices are all corners of its hull."""
    points = 0.1 * ball(count)
    faces = ConvexHull(points).simplices + 1
    lines = ["v {} {} {}".format(*point) for point in points]
    path.write_text("\n".join(lines + ["f {} {} {}".format(*face) for face in faces]) + "\n")
    return points


@pytest.mark.parametrize("count", [200, MANY_VERTICES + 500])
def test_of_a_mesh_encloses_its_vertices(tmp_path, count):
    points = write_ball(tmp_path / "ball.obj", count)
    scale = np.array([1.0, 2.0, 0.5])
    (hull,) = hulls_of_mesh(tmp_path / "ball.obj", scale)
    corners = np.array(hull.points())
    assert outside(points * scale, corners) < 1e-7  # Coal reads meshes in single precision
    assert outside(corners, points * scale) < 0.02
    assert len(corners) == count or (count > MANY_VERTICES and len(corners) <= 2 * PLANES - 4)


def test_is_looked_up_the_second_time(tmp_path, monkeypatch):
    write_ball(tmp_path / "ball.obj", 100)
    (first,) = hulls_of_mesh(tmp_path / "ball.obj", np.ones(3))
    monkeypatch.setattr(meshes, "_corners", None)
    (second,) = hulls_of_mesh(tmp_path / "ball.obj", np.ones(3))
    np.testing.assert_array_equal(first.points(), second.points())
    with pytest.raises(TypeError):
        hulls_of_mesh(tmp_path / "ball.obj", np.full(3, 2.0))


@pytest.mark.parametrize("name", ["part.stl", "part.obj", "part.xyz"])
def test_what_is_no_mesh_is_refused(tmp_path, name):
    (tmp_path / name).write_text("nothing")
    with pytest.raises(
        ArmError, match=f"mesh '?{name}'? (cannot be loaded|must be a file of)"
    ) as caught:
        hulls_of_mesh(tmp_path / name, np.ones(3))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("number", "reason"), [("nan", "away"), ("0", "volume")])
def test_meshes_that_are_refused(tmp_path, number, reason):
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, number)]
    faces = "f 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n"
    path = tmp_path / "part.obj"
    path.write_text("".join("v {} {} {}\n".format(*corner) for corner in corners) + faces)
    with pytest.raises(ArmError, match=f"'part.obj'.*{reason}"):
        hulls_of_mesh(path, np.ones(3))


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("<float_array>1.0 two 3.0</float_array>", "<float_array> holds what is no"),
        ('<float_array count="-1">1.0</float_array>', "count of <float_array> is no"),
    ],
)
def test_collada_that_would_end_the_process(tmp_path, content, reason):
    path = tmp_path / "mesh.dae"
    path.write_text(f"<COLLADA>{content}</COLLADA>")
    with pytest.raises(ArmError, match=f"'mesh.dae' cannot .*{reason}"):
        mesh_content(path)

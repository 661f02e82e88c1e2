"""Meshes of robots: what files say is what is seen, simplified within a bound, read once."""

import struct

import coal
import numpy as np
import pinocchio as pin
import pytest
from drawings import volume
from known_arms import EACH_ARM, INSTALLED

from kinarm.arm import Arm
from kinarm.errors import ArmError, MissingExtraError
from kinarm.viewer import visual_shapes
from kinarm.viewer.meshes import Mesh, box
from kinarm.viewer.parts import shape_finish
from kinarm.viewer.visual_shapes import (
    TOLERANCE,
    arm_parts,
    collision_parts,
    read_mesh_file,
    visual_parts,
)

trimesh = pytest.importorskip("trimesh", reason="pip install 'kinarm[robots]'")

DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="millimeter" meter="0.001"/><up_axis>Y_UP</up_axis></asset>
<library_effects>{effects}</library_effects>
<library_materials>{materials}</library_materials>
<library_geometries><geometry id="cube"><mesh>
<source id="p"><float_array id="pa" count="24">{places}</float_array><technique_common>
<accessor source="#pa" count="8" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="12" material="look"><input semantic="VERTEX" source="#v" offset="0"/>
<p>{faces}</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="scene">
<node id="outer"><translate>100 0 0</translate>{first}
<node id="inner"><matrix>0 -1 0 0  1 0 0 200  0 0 1 0  0 0 0 1</matrix>{second}</node></node>
<node id="mirror"><matrix>-1 0 0 0  0 1 0 0  0 0 1 -300  0 0 0 1</matrix>{second}</node>
</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#scene"/></scene></COLLADA>"""

EFFECT = """<effect id="e{0}"><profile_COMMON><technique sid="t"><lambert><diffuse>
<color>{1}</color></diffuse></lambert></technique></profile_COMMON></effect>"""

INSTANCE = """<instance_geometry url="#cube"><bind_material><technique_common>
<instance_material symbol="look" target="#m{}"/></technique_common></bind_material>
</instance_geometry>"""


def write_dae(path, size=(20, 40, 60), colours=("1 0 0 1", "0 0.4 0.8 1")):
    """Three boxes [mm] in nodes: one red, two blue, of which one mirrored."""
    mesh = box(size)
    path.write_text(
        DAE.format(
            effects="".join(EFFECT.format(k, colour) for k, colour in enumerate(colours)),
            materials="".join(
                f'<material id="m{k}"><instance_effect url="#e{k}"/></material>' for k in (0, 1)
            ),
            places=" ".join(map(str, mesh.vertices.ravel())),
            faces=" ".join(map(str, mesh.faces.ravel())),
            first=INSTANCE.format(0),
            second=INSTANCE.format(1),
        )
    )
    return path


def write_stl(path, mesh):
    """A binary STL whose normals are zero."""
    corners = mesh.vertices[mesh.faces].astype("<f4")
    rows = b"".join(bytes(12) + corner.tobytes() + bytes(2) for corner in corners)
    path.write_bytes(bytes(80) + struct.pack("<I", len(corners)) + rows)
    return path


def bounds(*meshes):
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    return np.array([vertices.min(axis=0), vertices.max(axis=0)])


def coal_mesh(mesh):
    """A mesh for Coal's distances."""
    shape = coal.BVHModelOBBRSS()
    shape.beginModel(len(mesh.faces), len(mesh.vertices))
    for corners in mesh.vertices[mesh.faces]:
        shape.addTriangle(*corners)
    shape.endModel()
    return shape


def distance_from(surface, points):
    """Largest distance of points from a surface, by Coal [m]."""
    ball, identity = coal.Sphere(1e-9), coal.Transform3s()
    farthest = 0.0
    for point in points:
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        there = coal.Transform3s(np.eye(3), point)
        farthest = max(farthest, coal.distance(surface, identity, ball, there, request, result))
    return farthest


class TestFiles:
    def test_collada_has_nodes_units_and_colours(self, tmp_path):
        pieces = read_mesh_file(write_dae(tmp_path / "a.dae"), (1, 1, 1))
        by_place = {tuple(np.round(bounds(p.mesh).mean(axis=0), 6)): p for p in pieces}
        assert set(by_place) == {(0.1, 0, 0), (0.1, 0.2, 0), (0, 0, -0.3)}
        red, blue = by_place[0.1, 0, 0], by_place[0.1, 0.2, 0]
        np.testing.assert_allclose(np.ptp(bounds(red.mesh), axis=0), (0.02, 0.04, 0.06), atol=1e-9)
        np.testing.assert_allclose(np.ptp(bounds(blue.mesh), axis=0), (0.04, 0.02, 0.06), atol=1e-9)
        assert (red.colour, blue.colour) == (0xFF0000, 0x0066CC)
        for piece in pieces:  # the mirrored one, too, has its outside out
            assert volume(piece.mesh) == pytest.approx(0.02 * 0.04 * 0.06)

    def test_stl_without_normals(self, tmp_path):
        path = write_stl(tmp_path / "a.stl", box((30, 20, 10)))
        (piece,) = read_mesh_file(path, (0.001, 0.001, 0.001))
        assert piece.colour is None
        vertices, normals, faces = piece.mesh.with_normals()
        assert len(faces) == 12
        assert (np.abs(normals).max(axis=1) == 1).all()
        assert ((normals * vertices).sum(axis=1) > 0).all()
        (mirrored,) = read_mesh_file(path, (0.1, -0.1, 0.1))
        assert volume(mirrored.mesh) == pytest.approx(6)

    @pytest.mark.parametrize("suffix", ["stl", "dae", "xyz"])
    def test_what_cannot_be_read(self, tmp_path, suffix):
        path = tmp_path / f"damaged.{suffix}"
        path.write_bytes(b"solid")
        with pytest.raises(
            ArmError, match=f"mesh 'damaged.{suffix}' (cannot be read|has no|must be)"
        ):
            read_mesh_file(path, (1, 1, 1))
        with pytest.raises(ArmError, match="cannot read mesh 'none.stl': No such file"):
            read_mesh_file(tmp_path / "none.stl", (1, 1, 1))


class TestSimplification:
    def test_a_ball_stays_within_the_bound(self, tmp_path):
        ball = trimesh.creation.icosphere(5, 0.08)  # of 20,480 triangles
        fine = Mesh(np.array(ball.vertices), np.array(ball.faces))
        path = write_stl(tmp_path / "ball.stl", fine)
        (piece,) = read_mesh_file(path, (1, 1, 1))
        assert len(piece.mesh.faces) < len(fine.faces) / 3
        rng = np.random.default_rng(0)
        some = fine.vertices[rng.choice(len(fine.vertices), 1000, replace=False)]
        assert distance_from(coal_mesh(piece.mesh), some) < TOLERANCE
        assert distance_from(coal_mesh(fine), piece.mesh.vertices) < TOLERANCE

    def test_open_edges_stay(self, tmp_path):
        flat = np.array([(x, y, 0.0) for x in range(6) for y in range(6)]) / 50
        cells = [6 * x + y for x in range(5) for y in range(5)]
        faces = np.array([(k, k + 6, k + 7) for k in cells] + [(k, k + 7, k + 1) for k in cells])
        (piece,) = read_mesh_file(write_stl(tmp_path / "flat.stl", Mesh(flat, faces)), (1, 1, 1))
        np.testing.assert_allclose(bounds(piece.mesh), bounds(Mesh(flat, faces)), atol=1e-7)
        assert len(piece.mesh.faces) < 50


class TestColours:
    def test_which_colour_counts(self, tmp_path, make_joint, write_robot):
        """A file of several colours keeps them, else the URDF's goes before; the first one wins."""
        many = write_dae(tmp_path / "many.dae")
        one = write_dae(tmp_path / "one.dae", colours=("1 0 0 1", "1 0 0 1"))
        plain = write_stl(tmp_path / "plain.stl", box((0.1, 0.1, 0.1)))
        green = '<material name="g"><color rgba="0 1 0 1"/></material>'
        grey = '<material name="g"><color rgba="0.5 0.5 0.5 1"/></material>'
        named = '<material name="g"/>'
        visuals = [(many, green), (one, named), (one, ""), (plain, named), (plain, grey)]
        shapes = {
            k: f'<visual><geometry><mesh filename="{path}"/></geometry>{look}</visual>'
            for k, (path, look) in enumerate(visuals)
        }
        arm = Arm.load(write_robot([make_joint()] * 4, shapes))
        found = {}
        for part in visual_parts(arm):
            found.setdefault(part.joint, set()).add(part.finish.colour)
        red, blue, lime, middle = (
            shape_finish(colour).colour for colour in (0xFF0000, 0x0066CC, 0x00FF00, 0x808080)
        )
        assert [found[k] for k in range(5)] == [{red, blue}, {lime}, {red}, {lime}, {middle}]


class TestWithoutTheExtra:
    def test_collision_shapes_are_shown_and_it_is_said(self, simulators, monkeypatch, caplog):
        def missing(name):
            raise visual_shapes.metadata.PackageNotFoundError(name)

        monkeypatch.setattr(visual_shapes.metadata, "version", missing)
        visual_shapes._versions.cache_clear()
        with pytest.raises(MissingExtraError):
            visual_shapes._versions()
        arm = Arm.load(simulators["mesh"].arm.specification)
        path = next(iter(simulators["mesh"].arm.description.path.parent.glob("*.stl")))
        monkeypatch.setattr(
            "kinarm.viewer.visual_shapes.visual_parts", lambda _: read_mesh_file(path, (1, 1, 1))
        )
        parts = arm_parts(arm)
        assert len(parts) == len(collision_parts(arm)) + 1
        assert [record.getMessage() for record in caplog.records] == [
            f"{arm.name} is shown by its collision shapes: trimesh is not installed: "
            "pip install 'kinarm[robots]'"
        ]


@INSTALLED
@pytest.mark.parametrize("name", EACH_ARM)
def test_meshes_of_robots_are_small_and_lie_where_pinocchio_puts_them(name):
    """Of the part of the file that Pinocchio reads, by joint."""
    arm = Arm.load(name)
    geometry = pin.buildGeomFromUrdfString(
        arm.model, arm.description.text, pin.GeometryType.VISUAL, package_dirs=[]
    )
    ours = {joint: [] for joint in range(arm.n_joints + 1)}
    for part in visual_parts(arm):
        ours[part.joint].append(part.mesh)
    assert all(ours.values())
    assert sum(len(mesh.faces) for meshes in ours.values() for mesh in meshes) < 200_000
    for shape in geometry.geometryObjects:
        vertices = np.array(shape.geometry.vertices()) @ shape.placement.rotation.T
        theirs = bounds(Mesh(vertices + shape.placement.translation, np.zeros((0, 3), int)))
        whole = bounds(*ours[shape.parentJoint])
        assert (theirs[0] > whole[0] - 2 * TOLERANCE).all(), shape.name
        assert (theirs[1] < whole[1] + 2 * TOLERANCE).all(), shape.name

"""What robots look like, of shapes that their descriptions name."""

import shutil

import numpy as np
import pytest

from kinarm.arm import Arm
from kinarm.errors import ArmError
from kinarm.viewer.visual_shapes import arm_parts, visual_parts


def seen(write_robot, make_joint, visual):
    """Parts of a robot whose base has a visual element."""
    arm = Arm.load(write_robot([make_joint()], {0: f"<visual>{visual}</visual>"}))
    return list(visual_parts(arm))


@pytest.mark.parametrize(
    ("shape", "extents"),
    [
        ('<box size=".1 .2 .3"/>', (0.1, 0.2, 0.3)),
        ('<sphere radius=".1"/>', (0.2, 0.2, 0.2)),
        ('<cylinder radius=".1" length=".5"/>', (0.2, 0.2, 0.5)),
        ('<capsule radius=".1" length=".5"/>', (0.2, 0.2, 0.7)),
    ],
)
def test_shapes_have_their_sizes_and_places(write_robot, make_joint, shape, extents):
    visual = f'<origin xyz="0 0 1" rpy="0 0 0"/><geometry>{shape}</geometry>'
    (part,) = seen(write_robot, make_joint, visual)
    vertices = part.mesh.vertices
    np.testing.assert_allclose(np.ptp(vertices, axis=0), extents, atol=2e-3)
    np.testing.assert_allclose(vertices.max(axis=0) + vertices.min(axis=0), (0, 0, 2), atol=2e-3)


@pytest.mark.parametrize("name", ["paper", "paper_flange", "lrmate200ic_5l"])
def test_looks_ship_with_the_projects_own_arms(name, tmp_path):
    """With their joints and tool. What lies beside another URDF is not read."""
    arm = Arm.load(name)
    assert len(arm_parts(arm)) >= 50
    for changes in ({"held": {"axis_4": 0.3}}, {"tool_offset": (0.0, 0.0, 0.1)}):
        assert len(arm_parts(Arm.load(name, **changes))) < 50
    copied = tmp_path / "copied.urdf"
    shutil.copy(arm.description.path, copied)
    copied.with_suffix(".npz").touch()
    assert len(arm_parts(Arm.load(copied))) < 50


@pytest.mark.parametrize(
    ("visual", "words"),
    [
        ("", "needs a shape of box, .* in each visual element"),
        ("<geometry><cone/></geometry>", "needs a shape of box, .* in each visual element"),
        (
            '<geometry><sphere radius="1"/></geometry>'
            '<material name="m"><color rgba="x"/></material>',
            "numbers of rgba of <color> must be 4 from .*, got 'x'",
        ),
    ],
)
def test_what_cannot_be_shown(write_robot, make_joint, visual, words):
    with pytest.raises(ArmError, match=words):
        seen(write_robot, make_joint, visual)

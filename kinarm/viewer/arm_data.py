"""What a page has to know of an arm, as JSON."""

from collections import Counter
from typing import Any

from kinarm.arm import Arm
from kinarm.collision import body_names
from kinarm.scene import Scene
from kinarm.viewer.arm_shapes import arm_parts
from kinarm.viewer.camera import stage_scale


def arm_data(arm: Arm, scene: Scene) -> dict[str, Any]:
    """Describe an arm: its axes and tool, which joint carries which body, its colour and size."""
    chain, painted = arm.chain, Counter[int]()
    for part in arm_parts(arm):
        painted[part.finish.colour] += len(part.mesh.faces)
    return {
        "arm": arm.name,
        "axes": [
            {
                "translation": chain.translation[k].tolist(),
                "rotation": chain.rotation[k].tolist(),
                "axis": chain.axis[k].tolist(),
                "slides": bool(chain.prismatic[k]),
            }
            for k in range(arm.n_joints)
        ],
        "tool": chain.tool.tolist(),
        "links": {
            name: shape.parentJoint
            for name, shape in zip(body_names(arm), arm.geometry.geometryObjects, strict=True)
        },
        "scale": stage_scale(arm, scene),
        "swatch": f"#{painted.most_common(1)[0][0]:06x}",
    }

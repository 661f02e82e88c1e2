"""Pages of arms: joints to move by hand, and what touches then."""

from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from kinarm.arm import Arm
from kinarm.arm_specification import ArmSpecification
from kinarm.collision import ContactModel
from kinarm.scene import Scene
from kinarm.viewer.drawing import SHAPE, CapturingWindow, draw_stage, put
from kinarm.viewer.html_page import HtmlPage, arm_data, page_html
from kinarm.viewer.visual_shapes import collision_parts

NEARER = 0.8
"""Distance of the camera, as a share of that in replays, which show more than the arm."""

BARE_GROUND = Scene(obstacles=(), goal_regions=())


class ArmPage(HtmlPage):
    """A page on which an arm can be moved. In a notebook it shows itself."""


def arm_page(
    arm: Arm | ArmSpecification | str | Path,
    path: str | Path | None = None,
    *,
    scene: Scene = BARE_GROUND,
) -> ArmPage:
    """Make a page with a slider for each joint of an arm, which shows contact as it happens.

    The page tests the same pairs of shapes for contact as the simulator, in the browser. Its
    verdicts are those of Coal, except for shapes that are less than 1e-6 m from touching.

    Parameters
    ----------
    arm : Arm, ArmSpecification, str or Path
        The arm, where it stands; or what `kinarm.Arm.load` takes, mounted as the scene says.
    path : str or Path, optional
        File of the page; without it, no file is written.
    scene : Scene
        The scene around the arm; the bare ground by default.
    """
    if not isinstance(arm, Arm):
        arm = Arm.load(arm).placed(scene.mount.position, scene.mount.rotation)
    page = ArmPage(_arm_html(arm, scene))
    if path is not None:
        page.save(path)
    return page


def _arm_html(arm: Arm, scene: Scene) -> str:
    """Page of an arm in a scene, with the shapes and pairs that are tested for contact."""
    model = ContactModel.build(arm, scene)
    window = CapturingWindow()
    frames = draw_stage(window.top, arm, scene)
    for number, part in enumerate(collision_parts(arm)):
        put(frames[part.joint][f"shape_{number}"], SHAPE, part.mesh)
    objects = zip(model.geometry.geometryObjects, model.body_names, strict=True)
    bodies = [{"name": name, "joint": s.parentJoint, **_shape_data(s)} for s, name in objects]
    data = arm_data(arm, scene) | {
        "joints": list(arm.joint_names),
        **{name: getattr(arm, name).tolist() for name in ("lower", "upper", "home")},
        "reach": arm.reach,
        "bodies": bodies,
        "pairs": [[pair.first, pair.second] for pair in model.geometry.collisionPairs],
    }
    data["scale"] *= NEARER
    title = f"{arm.name} · kinarm arm"
    return page_html("arm_page", title, window.content, data, ("contact", "arm_page"))


def _shape_data(shape: pin.GeometryObject) -> dict[str, Any]:
    """A shape as the hull of points, widened by a radius or by discs; the ground has no points.

    In the frame of its joint [m].
    """
    body, discs, radius = shape.geometry, 0.0, 0.0
    if isinstance(body, coal.Halfspace):
        return {}
    if isinstance(body, coal.Sphere):
        points, radius = np.zeros((1, 3)), float(body.radius)
    elif isinstance(body, coal.Capsule | coal.Cylinder):
        points = np.array([(0.0, 0.0, -body.halfLength), (0.0, 0.0, body.halfLength)])
        rounded = isinstance(body, coal.Capsule)
        discs, radius = (0.0, body.radius) if rounded else (body.radius, 0.0)
    elif isinstance(body, coal.Box):
        points = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T * body.halfSide
    else:
        points = np.array(body.points())
    placed = points @ shape.placement.rotation.T + shape.placement.translation
    return {"points": placed.tolist(), "discs": float(discs), "radius": float(radius)}

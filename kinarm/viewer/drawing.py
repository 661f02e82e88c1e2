"""Draw an arm and its scene into a Meshcat window: a page in the making, or a live one."""

import struct
from collections import defaultdict
from typing import Any

import numpy as np
import umsgpack
from meshcat import Visualizer
from meshcat.geometry import Geometry, LineBasicMaterial, LineSegments, Material, Object
from meshcat.geometry import Mesh as DrawnMesh
from numpy.typing import NDArray

from kinarm.arm import Arm
from kinarm.problem import ReachProblem
from kinarm.scene import Scene
from kinarm.viewer.camera import stage_scale
from kinarm.viewer.lighting import SUN, SUN_PLACE
from kinarm.viewer.meshes import Mesh, capsule, cylinder, tube
from kinarm.viewer.parts import OUTCOME_COLOURS, TRACES, Finish
from kinarm.viewer.surroundings import (
    FLASH_RADIUS,
    FLOOR_RADIUS,
    GRID_RADIUS,
    GRID_STEP,
    TRACE_RADIUS,
    TRACE_SIDES,
    cube_mesh,
    obstacle_meshes,
)
from kinarm.viewer.visual_shapes import arm_parts

FLOOR = Finish(0xE9ECEF, roughness=0.95)
OBSTACLE = Finish(0xB4BCC6, roughness=0.8)
GOAL_SLAB = Finish(0xCBD2DA, roughness=0.7)
CUBE = Finish(0x009E73, roughness=0.5)
HALO = Finish(0x009E73, opacity=0.16, glow=True)
FLASH = Finish(OUTCOME_COLOURS["collision"], opacity=0.5, glow=True)
SHAPE = Finish(0x56B4E9, roughness=0.6, opacity=0.34)
GRID_COLOUR = 0xC6CCD3
BACKGROUND = [0.93, 0.945, 0.96]

CLUTTER = ("/Axes", "/Grid", "/Lights/PointLightPositiveX", "/Lights/PointLightNegativeX")
"""What Meshcat shows by default and a replay does not."""
DIMMED = {"/Lights/AmbientLight/<object>": 0.42, "/Lights/FillLight/<object>": 0.2}
FIELD_OF_VIEW, CAMERA_PLACE = 32, (-2.4, 1.6, 1.9)
"""Of the live page [degrees, m], in the frame of three.js, whose y axis points up."""


class CapturingWindow:
    """Stands in for Meshcat's window and keeps every command as bytes, in order.

    The same drawing gives the same bytes: Meshcat's random ids are replaced by numbers.

    Attributes
    ----------
    top : meshcat.Visualizer
        What to draw on.
    """

    def __init__(self) -> None:
        self.top = Visualizer(window=self)
        self._commands: list[bytes] = []
        self._numbers: dict[str, str] = {}

    def send(self, command: Any) -> None:
        """Keep a command; Meshcat calls this."""
        self._commands.append(umsgpack.packb(self._renumbered(command.lower())))

    @property
    def content(self) -> bytes:
        """All commands, each led by its length."""
        return b"".join(struct.pack("<I", len(each)) + each for each in self._commands)

    def _renumbered(self, value: Any, key: str = "") -> Any:
        """Part of a command with its ids replaced."""
        if isinstance(value, dict):
            return {name: self._renumbered(entry, name) for name, entry in value.items()}
        if isinstance(value, list):
            return [self._renumbered(entry) for entry in value]
        if key in ("uuid", "geometry", "material"):
            return self._numbers.setdefault(value, f"id-{len(self._numbers)}")
        return value


class _BufferGeometry(Geometry):
    """Points with attributes, in as few bytes as three.js reads; triangles if there are faces."""

    def __init__(
        self, faces: NDArray[np.int64] | None = None, **attributes: NDArray[np.generic]
    ) -> None:
        super().__init__()
        self.data: dict[str, object] = {
            "attributes": {name: _typed_array(array, 3) for name, array in attributes.items()}
        }
        if faces is not None:
            few = faces.max(initial=0) < 2**16
            self.data["index"] = _typed_array(faces.astype(np.uint16 if few else np.uint32), 1)

    def lower(self, _: dict[str, object]) -> dict[str, object]:
        """Describe it to three.js."""
        return {"uuid": self.uuid, "type": "BufferGeometry", "data": self.data}


class _QuantisedGeometry(_BufferGeometry):
    """A mesh whose corners lie on a grid of 65535 steps along its longest side."""

    def __init__(self, mesh: Mesh) -> None:
        vertices, normals, faces = mesh.with_normals()
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        self._middle, self._step = (low + high) / 2, max((high - low).max(), 1e-9) / 65534
        position = np.round((vertices - self._middle) / self._step).astype(np.int16)
        super().__init__(faces, position=position, normal=np.round(127 * normals).astype(np.int8))

    def intrinsic_transform(self) -> NDArray[np.float64]:
        """Grid to frame, shape (4, 4), transposed: three.js reads it column by column."""
        transform = np.diag([self._step, self._step, self._step, 1.0])
        transform[3, :3] = self._middle
        return transform


class _FinishMaterial(Material):
    """A finish as a material."""

    def __init__(self, finish: Finish) -> None:
        super().__init__()
        self.finish = finish

    def lower(self, _: dict[str, object]) -> dict[str, object]:
        """Describe it to three.js."""
        look = self.finish
        described = {"uuid": self.uuid, "color": look.colour, "opacity": look.opacity}
        if look.opacity < 1:
            described |= {"transparent": True, "depthWrite": False}
        if look.glow:
            return described | {"type": "MeshBasicMaterial"}
        shine = {"roughness": look.roughness, "metalness": look.metalness}
        return described | shine | {"type": "MeshStandardMaterial"}


class _Sun(Object):
    """A light from afar that casts shadows."""

    def __init__(self) -> None:
        super().__init__(None, None)

    def lower(self) -> dict[str, object]:
        """Describe it to three.js."""
        sides = {"left": -1.7, "right": 1.7, "top": 1.7, "bottom": -1.7, "near": 0.5, "far": 8.0}
        shadow = {"mapSize": [2048, 2048], "bias": -0.0004, "normalBias": 0.004, "radius": 3}
        camera = {"uuid": f"{self.uuid}-camera", "type": "OrthographicCamera", "zoom": 1, **sides}
        light = {"uuid": self.uuid, "type": "DirectionalLight", "color": SUN, "intensity": 0.5}
        return {"object": {**light, "shadow": {**shadow, "camera": camera}}}


BUFFER_TYPES = {
    "float32": ("Float32Array", 0x17),
    "int16": ("Int16Array", 0x13),
    "int8": ("Int8Array", 0x11),
    "uint16": ("Uint16Array", 0x14),
    "uint32": ("Uint32Array", 0x16),
}


def _typed_array(array: NDArray[np.generic], size: int) -> dict[str, object]:
    name, code = BUFFER_TYPES[array.dtype.name]
    data = umsgpack.Ext(code, np.ascontiguousarray(array).tobytes())
    return {"itemSize": size, "type": name, "array": data, "normalized": name == "Int8Array"}


def put(window: Visualizer, finish: Finish, *meshes: Mesh) -> None:
    """Show meshes with one finish."""
    window.set_object(DrawnMesh(_QuantisedGeometry(Mesh.joined(meshes)), _FinishMaterial(finish)))


def draw_stage(window: Visualizer, arm: Arm, scene: Scene) -> list[Visualizer]:
    """Draw surroundings, the ball that marks a contact, and an arm; return the arm's frames.

    Parameters
    ----------
    window : meshcat.Visualizer
        Where to draw.
    arm : Arm
        The arm.
    scene : Scene
        What stands around it.
    """
    draw_surroundings(window, scene)
    put(window["flash"], FLASH, capsule(0.0, stage_scale(arm, scene) * FLASH_RADIUS))
    return draw_arm(window["arm"], arm)


def draw_surroundings(window: Visualizer, scene: Scene) -> None:
    """Lights, floor with a grid, and obstacles."""
    for path in CLUTTER:
        window[path].set_property("visible", False)
    for path, intensity in DIMMED.items():
        window[path].set_property("intensity", intensity)
    for end in ("top_color", "bottom_color"):
        window["/Background"].set_property(end, BACKGROUND)
    window["sun"].set_object(_Sun())
    window["sun"]["<object>"].set_property("position", list(SUN_PLACE))
    if scene.ground:
        put(window["floor"], FLOOR, cylinder(0.002, FLOOR_RADIUS, 0.0).moved((0, 0, -0.002)))
        grid = _BufferGeometry(position=_grid_lines().astype(np.float32))
        window["grid"].set_object(LineSegments(grid, LineBasicMaterial(color=GRID_COLOUR)))
    for number, obstacle in enumerate(scene.obstacles):
        place, meshes = window[f"obstacles/{number}"], obstacle_meshes(obstacle, scene)
        if meshes.top is not None:
            put(place["top"], GOAL_SLAB, meshes.top)
        put(place["body"], OBSTACLE, meshes.body)


def _grid_lines() -> NDArray[np.float64]:
    """Ends of lines within a circle."""
    lines = []
    for across in np.arange(-GRID_RADIUS, GRID_RADIUS + 1e-9, GRID_STEP):
        half = np.sqrt(max(GRID_RADIUS**2 - across**2, 0))
        lines += [(across, -half), (across, half), (-half, across), (half, across)]
    return np.column_stack([np.array(lines), np.full(len(lines), 0.0005)])


def aim_camera(window: Visualizer, scale: float = 1.0) -> None:
    """Look at the arm from behind its right side; see `kinarm.viewer.camera.stage_scale`."""
    camera = window["/Cameras/default/rotated/<object>"]
    camera.set_property("fov", FIELD_OF_VIEW)
    camera.set_property("position", [scale * value for value in CAMERA_PLACE])


def draw_goal(window: Visualizer, problem: ReachProblem) -> None:
    """The cube, and a halo within which the goal counts as reached, about the origin."""
    put(window["cube"], CUBE, cube_mesh(problem.scene))
    put(window["halo"], HALO, capsule(0.0, problem.task.tolerance))


def draw_arm(window: Visualizer, arm: Arm) -> list[Visualizer]:
    """Draw an arm as nested groups: the base and the joints, which are returned.

    A joint's transform is that in its parent.
    """
    frames = [window]
    for number in range(1, arm.n_joints + 1):
        frames.append(frames[-1][f"axis_{number}"])
    surfaces: dict[tuple[int, Finish], list[Mesh]] = defaultdict(list)
    for part in arm_parts(arm):
        surfaces[part.joint, part.finish].append(part.mesh)
    for index, ((joint, finish), meshes) in enumerate(surfaces.items()):
        put(frames[joint][f"part_{index}"], finish, *meshes)
    return frames


def draw_trace(
    window: Visualizer, points: NDArray[np.float64], outcome: str | None, scale: float
) -> None:
    """Draw the way of the tool; none for a point.

    Parameters
    ----------
    window : meshcat.Visualizer
        Where to draw.
    points : ndarray, shape (n, 3)
        Where the tool has been [m].
    outcome : {"success", "collision", "truncated"}, optional
        How the episode ended, if it has, which decides about the colour.
    scale : float
        Size of the stage; see `kinarm.viewer.camera.stage_scale`.
    """
    if len(points) > 1:
        put(window, TRACES[outcome], tube(points, scale * TRACE_RADIUS, TRACE_SIDES))

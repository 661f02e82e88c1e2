"""A problem as triangles: arm, obstacles and cube with what they are made of."""

from collections.abc import Iterable

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kinarm.arm import Arm
from kinarm.problem import ReachProblem
from kinarm.viewer.camera import stage_scale
from kinarm.viewer.kernels.rasterising import place
from kinarm.viewer.kernels.views import Surfaces
from kinarm.viewer.meshes import Mesh, tube
from kinarm.viewer.parts import TRACES, Finish, channels
from kinarm.viewer.surroundings import TRACE_RADIUS, TRACE_SIDES, cube_mesh, obstacle_meshes
from kinarm.viewer.visual_shapes import arm_parts, link_joints

Array = NDArray[np.float64]

# Finishes under the light of the replay page; the first is the floor's.
GROUND = Finish(0xD3D9DF, roughness=0.95)
BODY = Finish(0x8F9AA8, roughness=0.8)
SLAB = Finish(0xB3BDC8, roughness=0.7)
CUBE = Finish(0x009E73, roughness=0.5)

CUBE_GLOW, TOUCH_GLOW = 0x0B6B50, 0x8C2F00
"""Light that the cube emits when it is reached, and links that touch something."""


class TriangleScene:
    """Surfaces of a problem, which are moved to where they are at a moment.

    Parameters
    ----------
    problem : ReachProblem
        The problem.
    arm : Arm
        Its arm.

    Attributes
    ----------
    n_joints : int
        Length of a configuration.
    scale : float
        Size of the stage; see `kinarm.viewer.camera.stage_scale`.
    """

    def __init__(self, problem: ReachProblem, arm: Arm) -> None:
        self.n_joints = arm.n_joints
        self.scale = stage_scale(arm, problem.scene)
        self._arm, self._data = arm, arm.model.createData()
        self._goal_frame = arm.n_joints + 1
        self._links = link_joints(arm)
        parts = _parts(problem, arm, self._goal_frame)
        self._arm_owners = {(part.joint, part.finish) for part in arm_parts(arm)}
        # Each frame has materials of its own, so that a link can light up.
        owners = [(0, GROUND), *((0, finish) for finish in TRACES.values())]
        self._owners = list(dict.fromkeys([*owners, *((frame, look) for frame, look, _ in parts)]))
        meshes = [mesh.with_normals() for *_, mesh in parts]
        sizes = [len(vertices) for vertices, _, _ in meshes]
        starts = np.cumsum([0, *sizes[:-1]])
        self._vertices = np.concatenate([vertices for vertices, _, _ in meshes])
        self._normals = np.concatenate([normals for _, normals, _ in meshes])
        self._faces = np.concatenate([f + s for (_, _, f), s in zip(meshes, starts, strict=True)])
        self._frames = np.repeat([frame for frame, *_ in parts], sizes)
        self._materials = np.repeat([self._owners.index(part[:2]) for part in parts], sizes)

    @property
    def finishes(self) -> tuple[Finish, ...]:
        """Finishes of the surfaces, by material; the floor comes first."""
        return tuple(finish for _, finish in self._owners)

    def surfaces(
        self, configuration: Array, goal: Array, trace: Array, outcome: str | None
    ) -> Surfaces:
        """All triangles in the world at a moment.

        Parameters
        ----------
        configuration, goal, trace, outcome
            As for `kinarm.viewer.Renderer.render`.
        """
        n_vertices = len(self._vertices)
        places, normals = np.empty((n_vertices, 3)), np.empty((n_vertices, 3))
        poses = self._poses(configuration, goal)
        place(self._vertices, self._normals, self._frames, poses, places, normals)
        faces, materials = self._faces, self._materials
        if len(trace) > 1:
            way, aside, stretches = _tube(trace, self.scale * TRACE_RADIUS)
            material = self._owners.index((0, TRACES[outcome]))
            places, normals = np.concatenate([places, way]), np.concatenate([normals, aside])
            faces = np.concatenate([faces, stretches + n_vertices])
            materials = np.concatenate([materials, np.full(len(way), material)])
        return Surfaces(places, normals, np.empty_like(places), faces, materials)

    def emission(self, outcome: str | None, touching: Iterable[str]) -> Array:
        """Light of each material, shape (n, 3): a cube that is reached glows, and what touches."""
        joints = {self._links[body] for body in touching if body in self._links}
        light = np.zeros((len(self._owners), 3))
        for material, (frame, finish) in enumerate(self._owners):
            if finish == CUBE and outcome == "success":
                light[material] = channels(CUBE_GLOW)
            elif frame in joints and (frame, finish) in self._arm_owners:
                light[material] = channels(TOUCH_GLOW)
        return light

    def _poses(self, configuration: Array, goal: Array) -> Array:
        """Frames in the world, shape (n_joints + 2, 3, 4): the world, the joints, the goal."""
        pin.forwardKinematics(self._arm.model, self._data, configuration)
        poses = np.zeros((self._goal_frame + 1, 3, 4))
        poses[0, :, :3] = poses[-1, :, :3] = np.eye(3)
        for joint in range(1, self._goal_frame):
            poses[joint] = self._data.oMi[joint].homogeneous[:3]
        poses[-1, :, 3] = goal
        return poses


def _parts(problem: ReachProblem, arm: Arm, goal_frame: int) -> list[tuple[int, Finish, Mesh]]:
    """Frame, finish and shape of all that stands or moves."""
    parts: list[tuple[int, Finish, Mesh]] = []
    for obstacle in problem.scene.obstacles:
        meshes = obstacle_meshes(obstacle, problem.scene)
        parts.append((0, BODY, meshes.body))
        if meshes.top is not None:
            parts.append((0, SLAB, meshes.top))
    parts += [(part.joint, part.finish, part.mesh) for part in arm_parts(arm)]
    return [*parts, (goal_frame, CUBE, cube_mesh(problem.scene))]


def _tube(points: Array, radius: float) -> tuple[Array, Array, NDArray[np.int64]]:
    """Vertices, normals and faces of a tube along points, shape (n, 3) [m]."""
    mesh = tube(points, radius, TRACE_SIDES)
    around = mesh.vertices[:-2].reshape(len(points), TRACE_SIDES, 3) - points[:, None]
    ends = points[[0, -1]] - points[[1, -2]]
    normals = np.concatenate([around.reshape(-1, 3), ends])
    return mesh.vertices, normals, mesh.faces

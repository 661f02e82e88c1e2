"""A problem as triangles: arm, obstacles and cube with what they are made of."""

from collections.abc import Iterable

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kinarm.arm import Arm
from kinarm.problem import ReachProblem
from kinarm.viewer.camera import stage_scale
from kinarm.viewer.kernels.rasterising import transform
from kinarm.viewer.kernels.views import Surfaces
from kinarm.viewer.meshes import Mesh, tube
from kinarm.viewer.parts import (
    TRACE_RADIUS,
    TRACE_SIDES,
    TRACES,
    Finish,
    channels,
    cube_mesh,
    obstacle_meshes,
)
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
    """Surfaces of a problem and its arm, which are moved to where they are at a moment.

    Attributes
    ----------
    n_joints, scale
        Length of a configuration, and size of the stage; see `stage_scale`.
    finishes : list of Finish
        Finishes of the surfaces, by material; the floor comes first.
    """

    def __init__(self, problem: ReachProblem, arm: Arm) -> None:
        scene = problem.scene
        self.n_joints, self.scale = arm.n_joints, stage_scale(arm, scene)
        self._arm, self._data, self._links = arm, arm.model.createData(), link_joints(arm)
        standing = [
            (0, finish, mesh)
            for obstacle in scene.obstacles
            for finish, mesh in zip((BODY, SLAB), obstacle_meshes(obstacle, scene), strict=False)
        ]
        parts = [*standing, *arm_parts(arm), (arm.n_joints + 1, CUBE, cube_mesh(scene))]
        self._arm_owners = {part[:2] for part in arm_parts(arm)}
        # Each frame has materials of its own, so that a link can light up.
        owners = [(0, GROUND), *((0, finish) for finish in TRACES.values())]
        self._owners = list(dict.fromkeys([*owners, *(part[:2] for part in parts)]))
        self.finishes = [finish for _, finish in self._owners]
        meshes = [Mesh.joined([mesh]) for *_, mesh in parts]
        sizes = [len(mesh.vertices) for mesh in meshes]
        self._vertices, self._normals, self._faces = Mesh.joined(meshes).with_normals()
        self._frames = np.repeat([frame for frame, *_ in parts], sizes)
        self._materials = np.repeat([self._owners.index(part[:2]) for part in parts], sizes)

    def surfaces(
        self, configuration: Array, goal: Array, trace: Array, outcome: str | None
    ) -> Surfaces:
        """All triangles in the world at a moment.

        Parameters
        ----------
        configuration, goal, trace, outcome
            As for `kinarm.viewer.Renderer.render`.
        """
        places, normals = np.empty_like(self._vertices), np.empty_like(self._normals)
        poses = self._poses(configuration, goal)
        transform(self._vertices, self._frames, poses, places)
        poses[:, :, 3] = 0.0
        transform(self._normals, self._frames, poses, normals)
        faces, materials = self._faces, self._materials
        if len(trace) > 1:
            way, aside, stretches = _tube(trace, self.scale * TRACE_RADIUS)
            material = self._owners.index((0, TRACES[outcome]))
            faces = np.concatenate([faces, stretches + len(places)])
            places, normals = np.concatenate([places, way]), np.concatenate([normals, aside])
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
        poses = np.zeros((self.n_joints + 2, 3, 4))
        poses[0, :, :3] = poses[-1, :, :3] = np.eye(3)
        for joint in range(1, self.n_joints + 1):
            poses[joint] = self._data.oMi[joint].homogeneous[:3]
        poses[-1, :, 3] = goal
        return poses


def _tube(points: Array, radius: float) -> tuple[Array, Array, NDArray[np.int64]]:
    """Vertices, normals and faces of a tube along points, shape (n, 3) [m]."""
    mesh = tube(points, radius, TRACE_SIDES)
    around = mesh.vertices[:-2].reshape(len(points), TRACE_SIDES, 3) - points[:, None]
    ends = points[[0, -1]] - points[[1, -2]]
    normals = np.concatenate([around.reshape(-1, 3), ends])
    return mesh.vertices, normals, mesh.faces

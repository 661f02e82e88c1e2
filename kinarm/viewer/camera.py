"""Where pictures are taken from."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from kinarm._fields import Checked
from kinarm.arm import Arm
from kinarm.errors import InvalidInputError
from kinarm.problem import ReachProblem
from kinarm.scene import Scene

FIELD_OF_VIEW = 30.0
OPENING = {
    "must": "be between 0 and 180 degrees",
    "holds": lambda angle: 0 < angle < 180,
}
TARGET, EYE = (0.05, 0.1, 0.38), (-2.42, 1.9, 1.5)
"""Middle of the picture, and the camera relative to it, if goals lie on the
left [m]: as on the replay page, but with room for an upright arm."""

NEAR, FAR = 1.0, 1.45
"""Stages of a radius between these are seen from there; others scale that [m]."""


@dataclass(frozen=True)
class Camera(Checked):
    """A pinhole camera.

    Parameters
    ----------
    position, target : tuple of float
        Its place and the middle of the picture, in the world [m].
    field_of_view : float
        Angle between the picture's upper and lower edges [degrees].

    Raises
    ------
    InvalidInputError
        If the camera sees nothing.
    """

    position: tuple[float, float, float]
    target: tuple[float, float, float]
    field_of_view: float = field(default=FIELD_OF_VIEW, metadata=OPENING)

    def __post_init__(self) -> None:
        super().__post_init__()
        if math.dist(self.target, self.position) < 1e-6:
            raise InvalidInputError(f"position and target are the same: {self.position}")

    @classmethod
    def of_replays(cls, problem: ReachProblem, arm: Arm | None = None) -> "Camera":
        """Stand as on the replay page: behind the arm, on the side of most goals.

        Without an arm, the problem's is loaded.
        """
        regions = [problem.scene.goal_region(name) for name in problem.task.goal_regions]
        across = sum(region.lower[1] + region.upper[1] for region in regions)
        side = 1.0 if across > 0 else -1.0
        scale = stage_scale(arm or problem.load_arm(), problem.scene)
        target = scale * np.array(TARGET) * (1, side, 1)
        eye = target + scale * np.array(EYE) * (1, side, 1)
        return cls(tuple(eye.tolist()), tuple(target.tolist()))

    def projection(self, width: int, height: int) -> NDArray[np.float64]:
        """World to picture, shape (3, 4).

        A point [x, y, z, 1] goes to its column and row [pixels], both times its distance along the
        line of sight, and that distance [m].
        """
        position, target = np.array(self.position), np.array(self.target)
        ahead = (target - position) / np.linalg.norm(target - position)
        right = np.cross(ahead, (0.0, 0.0, 1.0))
        if np.linalg.norm(right) < 1e-9:  # straight up or down: x goes up in the picture
            right = np.cross(ahead, (1.0, 0.0, 0.0))
        right /= np.linalg.norm(right)
        turn = np.array([right, np.cross(ahead, right), ahead])
        focal = height / 2 / math.tan(math.radians(self.field_of_view) / 2)
        lens = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]])
        projection: NDArray[np.float64] = lens @ np.column_stack([turn, -turn @ position])
        return projection


def stage_scale(arm: Arm, scene: Scene) -> float:
    """Scale of a camera's distance for arm and goals; 1 for a reach of about 1 m."""
    corners = [corner for region in scene.goal_regions for corner in (region.lower, region.upper)]
    radius = max([arm.reach, *(float(np.linalg.norm(corner)) for corner in corners)])
    return radius / min(max(radius, NEAR), FAR)

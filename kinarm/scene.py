"""The world around the arm: the ground, solid bodies, and places of goals.

What is empty or named twice is a `ProblemError`.
"""

from dataclasses import dataclass, field
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from kinarm._fields import OPTIONAL, Checked
from kinarm.bodies import Body, Point, RandomBodies, rotation_matrix
from kinarm.errors import FROM_ZERO, NOT_NEGATIVE, ProblemError, UnknownNameError

ROUNDING = 1e-12
"""Lengths that differ less are the same [m]."""


def _check_box(what: str, lower: Point, upper: Point, *, flat: bool) -> None:
    extents = [high - low for low, high in zip(lower, upper, strict=True)]
    if min(extents) < 0 or sum(extent > 0 for extent in extents) < (2 if flat else 3):
        wanted = "lower <= upper, and < along two axes at least" if flat else "lower < upper"
        raise ProblemError(f"{what} is empty: {lower} to {upper}; expected {wanted}")


@dataclass(frozen=True, kw_only=True)
class Mount(Checked):
    """Where the arm stands.

    Parameters
    ----------
    position : tuple of float
        Origin of the arm's base in the world [m].
    rpy : tuple of float
        Its orientation: roll, pitch and yaw about the axes of the world [rad].
    """

    position: Point = (0.0, 0.0, 0.0)
    rpy: Point = (0.0, 0.0, 0.0)

    @property
    def rotation(self) -> NDArray[np.float64]:
        """Orientation, as a rotation matrix, shape (3, 3)."""
        return rotation_matrix(self.rpy)


@dataclass(frozen=True, kw_only=True)
class Obstacle(Checked):
    """A solid box, its edges along the axes of the world, or turned about the vertical.

    Parameters
    ----------
    name : str
        How contact reports call it.
    lower, upper : tuple of float
        Opposite corners, before it is turned, in the world frame [m].
    yaw : float
        Angle by which it is turned about the vertical through its centre [rad].
    """

    name: str
    lower: Point
    upper: Point
    yaw: float = field(default=0.0, metadata=OPTIONAL)

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_box(f"obstacle {self.name!r}", self.lower, self.upper, flat=False)

    @property
    def body(self) -> Body:
        """The same box by its centre."""
        centre = (np.array(self.lower) + np.array(self.upper)) / 2
        size = np.array(self.upper) - np.array(self.lower)
        return Body(
            name=self.name, shape="box", size=size, position=centre, rpy=(0.0, 0.0, self.yaw)
        )


@dataclass(frozen=True, kw_only=True)
class GoalRegion(Checked):
    """A box, or a rectangle, over which goals are uniform.

    Parameters
    ----------
    name : str
        How tasks call it.
    lower, upper : tuple of float
        Opposite corners in the world frame [m].
    """

    name: str
    lower: Point
    upper: Point

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_box(f"goal region {self.name!r}", self.lower, self.upper, flat=True)


MOST_MEMBERS = 1000
"""Obstacles, and goal regions, at most: so many take seconds to prepare."""

PAPER_BENCHES = (
    Obstacle(name="right bench", lower=(-0.5, -0.75, 0.0), upper=(0.5, -0.55, 0.3)),
    Obstacle(name="left bench", lower=(-0.5, 0.55, 0.0), upper=(0.5, 0.75, 0.3)),
)
"""The paper's benches (section 3.3)."""

PAPER_GOALS = (
    GoalRegion(name="right", lower=(-0.5, -0.75, 0.325), upper=(0.5, -0.55, 0.325)),
    GoalRegion(name="left", lower=(-0.5, 0.55, 0.325), upper=(0.5, 0.75, 0.325)),
)
"""Centres of cubes on the paper's benches."""


@dataclass(frozen=True, kw_only=True)
class Scene(Checked):
    """Ground, obstacles and goal regions.

    The world frame has z up, x forward (the arm's zero heading) and y to the
    left. By default the arm's base is at the origin, in the paper's scene
    (section 3.3): a bench on each side of it.

    Parameters
    ----------
    ground : bool
        Whether the half-space z < 0 is solid.
    cube_edge : float
        Edge of the cube that marks a goal, which is no obstacle [m].
    obstacles : tuple of Obstacle or Body
        Solid bodies, whether goals lie on them or not.
    random_bodies : tuple of RandomBodies
        Further ones, drawn anew for every episode: from the seed, its start and
        its goal, so that these have one scene.
    seed : int
        Seed of these draws.
    goal_regions : tuple of GoalRegion
        Where goals may lie.
    mount : Mount
        Where the arm stands.
    """

    ground: bool = True
    cube_edge: float = field(default=0.05, metadata=NOT_NEGATIVE)
    obstacles: tuple[Obstacle | Body, ...] = PAPER_BENCHES
    random_bodies: tuple[RandomBodies, ...] = field(default=(), metadata=OPTIONAL)
    seed: int = field(default=0, metadata={**OPTIONAL, **FROM_ZERO, "at_most": 2**63 - 1})
    goal_regions: tuple[GoalRegion, ...] = PAPER_GOALS
    mount: Mount = field(default_factory=Mount, metadata=OPTIONAL)

    def __post_init__(self) -> None:
        super().__post_init__()
        for what, members in (("obstacle", self.bodies), ("goal region", self.goal_regions)):
            count = len(members) - (members is self.bodies and self.ground)
            if count > MOST_MEMBERS:
                raise ProblemError(f"{count} {what}s: at most {MOST_MEMBERS} are possible")
            names = [member.name for member in members]
            for name in names:
                if names.count(name) > 1:
                    raise ProblemError(f"two {what}s are called {name!r}")

    def goal_region(self, name: str) -> GoalRegion:
        """Goal region of a name; UnknownNameError if there is none."""
        for region in self.goal_regions:
            if region.name == name:
                return region
        raise UnknownNameError("goal region", name, (region.name for region in self.goal_regions))

    @cached_property
    def bodies(self) -> tuple[Body, ...]:
        """Obstacles, then random bodies (far away), then the ground."""
        obstacles = (each if isinstance(each, Body) else each.body for each in self.obstacles)
        random = (body for each in self.random_bodies for body in each.slots)
        ground = (Body(name="ground", shape="halfspace"),) if self.ground else ()
        return (*obstacles, *random, *ground)

    @cached_property
    def moving(self) -> tuple[int, ...]:
        """Indices of the bodies that move."""
        return tuple(k for k, body in enumerate(self.bodies) if body.motion is not None)

    def obstacle_around(self, region: GoalRegion) -> Body | None:
        """First body that wholly contains a goal region, or None.

        What lies on a body's face is outside.
        """
        corners = np.array(list(product(*zip(region.lower, region.upper, strict=True))))
        middle = corners.mean(axis=0, keepdims=True)
        for body in self.bodies:
            if body.contains(corners, ROUNDING).all() and body.contains(middle, -ROUNDING).all():
                return body
        return None

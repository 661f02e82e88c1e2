"""The world around the arm: the ground, the benches and where cubes may lie."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from kinarm.errors import SceneError, UnknownNameError


@dataclass(frozen=True, kw_only=True)
class Bench:
    """A solid box that stands on the ground.

    Parameters
    ----------
    name : str
        How tasks and contact reports call it.
    x, y : tuple of float
        Lower and upper bound of the footprint [m], in world coordinates.
    height : float
        Height of the top above the ground [m].
    """

    name: str
    x: tuple[float, float]
    y: tuple[float, float]
    height: float

    def __post_init__(self) -> None:
        numbers = (*self.x, *self.y, self.height)
        if not all(math.isfinite(number) for number in numbers):
            raise SceneError(f"bench {self.name!r} has a bound that is not finite: {numbers}")
        if self.x[0] >= self.x[1] or self.y[0] >= self.y[1] or self.height <= 0:
            raise SceneError(
                f"bench {self.name!r} is empty: x {self.x}, y {self.y}, height {self.height}; "
                "expected lower < upper and height > 0"
            )

    @property
    def lower(self) -> NDArray[np.float64]:
        """Lower corner [m], shape (3,)."""
        return np.array([self.x[0], self.y[0], 0.0])

    @property
    def upper(self) -> NDArray[np.float64]:
        """Upper corner [m], shape (3,)."""
        return np.array([self.x[1], self.y[1], self.height])


RIGHT_BENCH = Bench(name="right", x=(-0.5, 0.5), y=(-0.75, -0.55), height=0.3)
LEFT_BENCH = Bench(name="left", x=(-0.5, 0.5), y=(0.55, 0.75), height=0.3)


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Ground, benches and the size of the cube to reach.

    The world frame has z up, x forward (the arm's zero heading) and y to the left; the base of
    the arm stands at the origin. The default is the paper's scene (section 3.3): two benches to
    the right and the left of the arm.

    Parameters
    ----------
    benches : tuple of Bench
        Obstacles that can carry a cube.
    ground : bool
        Whether the half-space z < 0 is solid.
    cube_edge : float
        Edge of the cube [m]. The cube is a goal, not an obstacle: its centre lies half an edge
        above the bench.
    """

    benches: tuple[Bench, ...] = field(default=(RIGHT_BENCH, LEFT_BENCH))
    ground: bool = True
    cube_edge: float = 0.05

    def __post_init__(self) -> None:
        names = [bench.name for bench in self.benches]
        if len(set(names)) != len(names):
            raise SceneError(f"bench names must differ, got {names}")
        if not (math.isfinite(self.cube_edge) and self.cube_edge >= 0):
            raise SceneError(f"cube_edge must be at least 0 m, got {self.cube_edge}")

    def bench(self, name: str) -> Bench:
        """Look a bench up by name.

        Raises
        ------
        UnknownNameError
            If the scene has no such bench.
        """
        for bench in self.benches:
            if bench.name == name:
                return bench
        raise UnknownNameError("bench", name, (bench.name for bench in self.benches))

    def goal_region(self, bench_name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return where the centre of a cube on a bench can be.

        Returns
        -------
        lower, upper : ndarray, shape (3,)
            Corners of the region [m]; its height is a single value.
        """
        bench = self.bench(bench_name)
        height = bench.height + self.cube_edge / 2
        return (
            np.array([bench.x[0], bench.y[0], height]),
            np.array([bench.x[1], bench.y[1], height]),
        )

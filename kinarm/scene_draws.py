"""How the scenes of episodes are drawn, as flat arrays for the kernels."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.contact_shapes import placed_row, unit_body
from kinarm.errors import ProblemError, UnknownNameError
from kinarm.scene import Scene

IN_WORLD, ON_PATH, ON_BODY = range(3)
"""What places are relative to, in `SceneDraws.entries`."""

TURNS = ("no", "yaw", "any")
"""Turns, by their numbers in `SceneDraws.entries`."""

MEASURES = {
    "box": (0, 1, 2, 0),
    "sphere": (0, 0, 0, 0),
    "capsule": (0, 0, 1, 0),
    "cylinder": (0, 0, 1, 0),
    "mesh": (0, 0, 0, 0),
}
"""Random number that each entry of a row's size and rounding takes, by shape."""


class SceneDraws(NamedTuple):
    """How scenes are drawn, as flat arrays for `kinarm.kernels.placing`.

    Attributes
    ----------
    entries : ndarray of int, shape (n, 6)
        First row of each kind of bodies among the placed ones, fewest, most,
        what places are relative to, row of the obstacle they stand on, and turn.
    measures : ndarray of int, shape (n, 4)
        Which random number each entry of a row's size and rounding takes.
    sizes : ndarray, shape (n, 2, 4)
        Range of the rows' sizes and roundings [m].
    extents : ndarray, shape (n, 2, 3)
        Lower and upper ends of the corners, before the size.
    places : ndarray, shape (n, 2, 3)
        Range of the positions [m].
    clear : ndarray, shape (n,)
        Distances that are kept from the goal [m].
    placed : ndarray, shape (n_placed, 16)
        Rows of all bodies, the random ones far away.
    seed : int
        Seed.
    """

    entries: NDArray[np.int64]
    measures: NDArray[np.int64]
    sizes: NDArray[np.float64]
    extents: NDArray[np.float64]
    places: NDArray[np.float64]
    clear: NDArray[np.float64]
    placed: NDArray[np.float64]
    seed: int

    @classmethod
    def of(cls, scene: Scene) -> "SceneDraws":
        """Flatten the random bodies of a scene.

        Raises UnknownNameError if they stand on none, and ProblemError if that is no upright box.
        """
        names = [body.name for body in scene.bodies]
        entries, sizes, extents, places = [], [], [], []
        for each in scene.random_bodies:
            near, surface, half = ON_BODY, 0, np.zeros(3)
            if each.near in ("world", "path"):
                near = IN_WORLD if each.near == "world" else ON_PATH
            elif each.near in names[: len(scene.obstacles)]:
                surface = names.index(each.near)
                below = scene.bodies[surface]
                if below.shape != "box" or below.rotation[2, 2] != 1.0:
                    told = f"random bodies {each.name!r} stand on {each.near!r}"
                    raise ProblemError(f"{told}, which is no upright box")
                half = np.array([*below.size[:2], 0.0]) / 2
            else:
                raise UnknownNameError("obstacle", each.near, names[: len(scene.obstacles)])
            first = names.index(each.slots[0].name) if each.slots else 0
            entries.append((first, *each.count, near, surface, TURNS.index(each.turned)))
            units = [unit_body(each.sized(size)) for size in (each.smallest, each.largest)]
            sizes.append([(*unit.size, unit.rounding) for unit in units])
            corners = units[0].corners
            extents.append((corners.min(axis=0), corners.max(axis=0)))
            places.append((-half, half) if each.lower is None else (each.lower, each.upper))
        return cls(
            entries=np.array(entries, dtype=np.int64).reshape(-1, 6),
            measures=np.array(
                [MEASURES[each.shape] for each in scene.random_bodies], dtype=np.int64
            ).reshape(-1, 4),
            sizes=np.array(sizes).reshape(-1, 2, 4),
            extents=np.array(extents).reshape(-1, 2, 3),
            places=np.array(places).reshape(-1, 2, 3),
            clear=np.array([each.clear_of_goal for each in scene.random_bodies]),
            placed=np.array([placed_row(body, unit_body(body)) for body in scene.bodies]),
            seed=scene.seed,
        )

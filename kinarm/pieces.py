"""Convex pieces of a mesh: its triangles are cut by planes, and each part gets its hull.

Every point of a triangle lies in a piece. So the pieces are never too small, and stand out only
where the mesh is hollow.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

Array = NDArray[np.float64]

STEPS = 17
"""Shares of an extent between which planes may cut: a prime, so that few lie in faces."""


class Part(NamedTuple):
    """Triangles, shape (n, 3, 3) [m], and the best cut of them.

    It leaves two halves, whose hulls together have less volume than the whole one, by what is
    saved [m^3]; none if nothing is.
    """

    triangles: Array
    saved: float = 0.0
    halves: tuple[Array, ...] = ()


def cut_into_pieces(triangles: Array, count: int) -> list[Array]:
    """Cut triangles, shape (n, 3, 3) [m], into parts that fill their hulls well.

    The planes lie across the axes. Each next cut is the one that saves most of
    the hulls' volume.

    Returns
    -------
    list of ndarray, shape (n, 3)
        Corners of the triangles of each part; as many parts as asked for, or
        fewer if no cut saves anything [m].
    """
    parts = [_with_best_cut(triangles)]
    while len(parts) < count:
        largest = max(range(len(parts)), key=lambda number: parts[number].saved)
        if not parts[largest].halves:
            break
        parts += [_with_best_cut(half) for half in parts.pop(largest).halves]
    return [np.unique(part.triangles.reshape(-1, 3), axis=0) for part in parts]


def _with_best_cut(triangles: Array) -> Part:
    """Find the cut that saves most."""
    best, whole = Part(triangles), _hull_volume(triangles)
    lower, upper = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    for axis in range(3):
        for share in np.arange(1, STEPS) / STEPS:
            at = lower[axis] + share * (upper[axis] - lower[axis])
            halves = cut(triangles, axis, at), cut(triangles, axis, at, above=True)
            # Rounded, so that machines agree.
            saved = round(whole - sum(map(_hull_volume, halves)), 12)
            if saved > best.saved:
                best = Part(triangles, saved, halves)
    return best


def _hull_volume(triangles: Array) -> float:
    """Volume of the convex hull of triangles [m^3], infinite if it is flat."""
    try:
        volume = ConvexHull(triangles.reshape(-1, 3)).volume
    except (QhullError, ValueError):
        return np.inf
    return float(volume) if volume > 1e-12 else np.inf


def cut(triangles: Array, axis: int, at: float, *, above: bool = False) -> Array:
    """What of triangles lies below, or above, a plane across an axis.

    Parameters
    ----------
    triangles : ndarray, shape (n, 3, 3)
        Corners of each [m].
    axis, at : int and float
        The plane: where this coordinate has this value [m].
    above : bool
        Which side is wanted.

    Returns
    -------
    ndarray, shape (m, 3, 3)
    """
    depth = (triangles[:, :, axis] - at) * (1.0 if above else -1.0)
    inside = depth >= 0
    wanted = [triangles[inside.all(axis=1)]]
    for count in (1, 2):
        rows = np.flatnonzero(inside.sum(axis=1) == count)[:, None]
        # The corner that is alone on its side comes first.
        alone = (inside[rows[:, 0]] == (count == 1)).argmax(axis=1)
        order = (alone[:, None] + np.arange(3)) % 3
        (a, b, c), (p, q, r) = triangles[rows, order].swapaxes(0, 1), depth[rows, order].T
        ab, ac = a + (p / (p - q))[:, None] * (b - a), a + (p / (p - r))[:, None] * (c - a)
        ab[:, axis] = ac[:, axis] = at
        shapes = [(a, ab, ac)] if count == 1 else [(ab, b, c), (ab, c, ac)]
        wanted += [np.stack(shape, axis=1) for shape in shapes]
    return np.concatenate(wanted)

"""Contact-free paths of straight segments, by RRT-Connect with shortcuts.

Two trees grow in turns until they meet (Kuffner and LaValle 2000).
"""

import numpy as np

from kinarm.kernels.compiling import Array
from kinarm.policies.planning.motions import Motions

EXTENSIONS, LONGEST_EXTENSION = 1500, 0.5
"""Samples at most, and how far a tree grows towards one, as a share of the joints' longest way."""

SHORTCUTS = 120
"""Pairs of points between which the straight way is tried."""

WORTHWHILE = 1e-3
"""Share of a path that a straight way has to save."""

SAME = 1e-9
"""Duration of a motion between configurations that count as one [s]."""


class Tree:
    """Configurations connected to roots by contact-free straight motions."""

    def __init__(self, roots: Array) -> None:
        self._nodes, self.parents = roots.copy(), [-1] * len(roots)

    @property
    def nodes(self) -> Array:
        """The configurations, shape (n, n_joints) [rad or m]."""
        return self._nodes[: len(self.parents)]

    def extend(self, motions: Motions, sample: Array, longest: float) -> int | None:
        """Grow towards a sample, as far as nothing touches; return the node there."""
        closest = int(motions.durations(self.nodes, sample).argmin())
        origin = self._nodes[closest]
        duration = float(motions.durations(origin, sample))
        if duration < SAME:
            return closest
        towards = sample if duration <= longest else origin + longest / duration * (sample - origin)
        share = motions.free_share(origin, towards, asking=self.parents[closest] < 0)
        if share == 0.0:
            return None
        if len(self.parents) == len(self._nodes):
            self._nodes = np.concatenate([self._nodes, np.empty_like(self._nodes)])
        reached = towards if share == 1.0 else origin + share * (towards - origin)
        self._nodes[len(self.parents)] = reached
        self.parents.append(closest)
        return len(self.parents) - 1

    def path_to_root(self, node: int) -> list[Array]:
        """Nodes from this one to its root."""
        found = []
        while node >= 0:
            found.append(self.nodes[node])
            node = self.parents[node]
        return found


def find_path(
    motions: Motions,
    start: Array,
    ends: Array,
    rng: np.random.Generator,
    extensions: int = EXTENSIONS,
) -> Array | None:
    """Find a contact-free path of straight segments to one of several ends.

    The path has the shape (m, n_joints); None if none was found.

    Parameters
    ----------
    motions, rng
        Arm and scene, and the source of samples and shortcuts.
    start, ends : ndarray, shape (n_joints,) and (k, n_joints)
        Where the path begins and may end, without contact [rad or m].
    extensions : int
        Samples at most.
    """
    for end in ends:
        if motions.free_share(start, end) == 1.0:
            return np.array([start, end])
    chain, moved = motions.world.arm.chain, slice(motions.moved)
    lower, upper = chain.lower[moved], chain.upper[moved]
    longest = LONGEST_EXTENSION * float(motions.durations(chain.lower, chain.upper))
    growing, other, from_start = Tree(start[None]), Tree(ends), True
    samples = np.tile(start, (extensions, 1))
    samples[:, moved] = lower + (upper - lower) * rng.random((extensions, motions.moved))
    for sample in samples:
        grown = growing.extend(motions, sample, longest)
        if grown is not None:
            node = growing.nodes[grown]
            met = other.extend(motions, node, np.inf)
            if met is not None and motions.durations(other.nodes[met], node) < SAME:
                near, far = growing.path_to_root(grown)[::-1], other.path_to_root(met)[1:]
                path = np.array(near + far)
                return shortened(motions, path if from_start else path[::-1], rng)
        growing, other, from_start = other, growing, not from_start
    return None


def shortened(motions: Motions, path: Array, rng: np.random.Generator) -> Array:
    """A path with straight ways instead of some parts, where nothing touches.

    No straight way takes longer than what it replaces, at the velocity limits.
    """
    path = _pruned(motions, path)
    for a, b in np.sort(rng.random((SHORTCUTS, 2))):
        if len(path) < 3:
            break
        lengths = motions.lengths(path[:-1], path[1:])
        arrival = np.concatenate([[0.0], np.cumsum(lengths)])
        early, late = a * arrival[-1], b * arrival[-1]
        first, second = on_path(path, arrival, np.array([early, late]))
        saved = late - early - float(motions.lengths(first, second))
        if saved > WORTHWHILE * arrival[-1] and motions.is_free(first, second):
            before, after = path[arrival < early], path[arrival > late]
            path = np.concatenate([before, first[None], second[None], after])
    return _pruned(motions, path)


def _pruned(motions: Motions, path: Array) -> Array:
    """A path without the corners that the straight way may leave out."""
    corner = 1
    while corner < len(path) - 1:
        if motions.is_free(path[corner - 1], path[corner + 1]):
            path = np.delete(path, corner, axis=0)
            corner = max(corner - 1, 1)
        else:
            corner += 1
    return path


def on_path(path: Array, arrival: Array, times: Array) -> Array:
    """Configurations on a path of straight segments, shape (k, n_joints) [rad or m].

    Parameters
    ----------
    path, arrival : ndarray, shape (m, n_joints) and (m,)
        Its corners, and when they are passed.
    times : ndarray, shape (k,)
        From the first to the last arrival.
    """
    after = np.clip(np.searchsorted(arrival, times, side="right"), 1, max(len(path) - 1, 1))
    before, after = after - 1, np.fmin(after, len(path) - 1)
    duration = arrival[after] - arrival[before]
    shares = np.zeros(len(times))
    np.divide(times - arrival[before], duration, out=shares, where=duration > 0.0)
    return path[before] + shares[:, None] * (path[after] - path[before])

"""Detours: contact-free paths of straight segments.

They are planned by RRT-Connect with shortcuts (Kuffner and LaValle 2000).
"""

import numpy as np

from kinarm.kernels.compiling import Array
from kinarm.policies.oracle.inverse import steps_between
from kinarm.simulator import Simulator

EXTENSIONS, LONGEST_EXTENSION = 1500, 6.0
"""Samples at most, and how far a tree grows towards one [steps]."""

SHORTCUTS = 120
"""Pairs of points between which the straight way is tried."""


class Tree:
    """Configurations connected to roots by contact-free straight motions."""

    def __init__(self, roots: Array) -> None:
        self.nodes = roots.copy()
        self.parents = [-1] * len(roots)

    def add(self, node: Array, parent: int) -> int:
        """Append a node and return its index."""
        self.nodes = np.concatenate([self.nodes, node[None]])
        self.parents.append(parent)
        return len(self.parents) - 1

    def path_to_root(self, node: int) -> list[Array]:
        """Nodes from this one to its root."""
        found = []
        while node >= 0:
            found.append(self.nodes[node])
            node = self.parents[node]
        return found


def find_detour(
    simulator: Simulator, start: Array, ends: Array, rng: np.random.Generator
) -> Array | None:
    """Find a contact-free path of straight segments to one of several ends.

    Two trees grow in turns until they meet. The path has the shape (m,
    n_joints); None if none was found.

    Parameters
    ----------
    simulator, rng
        Arm and scene, and the source of samples and shortcuts.
    start, ends : ndarray, shape (n_joints,) and (k, n_joints)
        Where the path begins and may end, without contact [rad or m].
    """
    moved, n = slice(simulator.n_actions), simulator.n_actions
    lower, upper = simulator.arm.lower[moved], simulator.arm.upper[moved]
    growing, other = Tree(start[None]), Tree(ends)
    from_start = True
    for _ in range(EXTENSIONS):
        sample = start.copy()
        sample[moved] = lower + (upper - lower) * rng.random(n)
        grown = _extend(simulator, growing, sample, LONGEST_EXTENSION)
        if grown is not None:
            node = growing.nodes[grown]
            met = _extend(simulator, other, node, np.inf)
            if met is not None and steps_between(simulator, other.nodes[met], node) < 1e-9:
                near, far = growing.path_to_root(grown)[::-1], other.path_to_root(met)[1:]
                path = np.array(near + far)
                return _shorten(simulator, path if from_start else path[::-1], rng)
        growing, other, from_start = other, growing, not from_start
    return None


def _extend(simulator: Simulator, tree: Tree, sample: Array, longest: float) -> int | None:
    """Grow a tree towards a sample, as far as nothing touches."""
    distances = steps_between(simulator, tree.nodes, sample)
    nearest = int(distances.argmin())
    if distances[nearest] < 1e-9:
        return nearest
    origin = tree.nodes[nearest]
    towards = origin + min(1.0, longest / distances[nearest]) * (sample - origin)
    on_the_way, free = _straight_way(simulator, origin, towards)
    return tree.add(on_the_way[free - 1], nearest) if free else None


def _straight_way(simulator: Simulator, first: Array, second: Array) -> tuple[Array, int]:
    """Configurations on the way, and how many in a row touch nothing."""
    parts = simulator.world.rules.parts
    count = max(1, int(np.ceil(parts * steps_between(simulator, first, second))))
    tested = first + np.arange(1, count + 1)[:, None] / count * (second - first)
    tested[-1] = second
    _, touching = simulator.world.screen(tested)
    return tested, int(touching.argmax()) if touching.any() else count


def _shorten(simulator: Simulator, path: Array, rng: np.random.Generator) -> Array:
    """Replace parts of a path by the straight way where nothing touches."""
    for _ in range(SHORTCUTS):
        if len(path) < 3:
            break
        lengths = steps_between(simulator, path[:-1], path[1:])
        arrival = np.concatenate([[0.0], np.cumsum(lengths)])
        a, b = np.sort(arrival[-1] * rng.random(2))
        first, second = on_path(path, arrival, np.array([a, b]))
        if steps_between(simulator, first, second) > b - a - 1e-6:
            continue
        tested, free = _straight_way(simulator, first, second)
        if free == len(tested):
            before, after = path[arrival < a], path[arrival > b]
            path = np.concatenate([before, first[None], second[None], after])
    return path


def on_path(path: Array, arrival: Array, times: Array) -> Array:
    """Configurations on a path of straight segments, shape (k, n_joints) [rad or m].

    Parameters
    ----------
    path, arrival : ndarray, shape (m, n_joints) and (m,)
        Its corners, and when they are passed [steps].
    times : ndarray, shape (k,)
        From the first to the last arrival [steps].
    """
    after = np.clip(np.searchsorted(arrival, times, side="right"), 1, max(len(path) - 1, 1))
    before, after = after - 1, np.fmin(after, len(path) - 1)
    duration = arrival[after] - arrival[before]
    shares = np.zeros(len(times))
    np.divide(times - arrival[before], duration, out=shares, where=duration > 0.0)
    configurations: Array = path[before] + shares[:, None] * (path[after] - path[before])
    return configurations

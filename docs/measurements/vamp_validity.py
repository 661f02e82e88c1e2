"""VAMP's check of configurations of a UR5, beside `World.screen`.

VAMP is built from source, by CMake and a C++ compiler: ``pip install 'kinarm[vamp]'``.
"""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import vamp
from numpy.typing import NDArray

from kinarm.problem import PROBLEMS
from kinarm.scene import PAPER_BENCHES, Scene
from kinarm.world import World

RAKE = 8
"""Configurations that VAMP checks at once, on the way between two."""
WAYPOINTS, CALLS = 2000, 500
STEP = 0.2
"""Length of a way [rad], short enough for VAMP to check `RAKE` configurations on it."""
TERMS = (
    "free configurations of UR5 between the paper's benches, without ground, one thread. VAMP: 40 "
    "spheres for arm and gripper, float32, compiled for the robot and this machine; kinarm: "
    "convex pieces of the meshes, float64, any arm, and tool points as well"
)

Compared = tuple[str, str, str, Callable[[], int], Callable[[], int]]
"""What is done, its unit, what is alike, and how both do it."""


def compare() -> Iterator[Compared]:
    """Configurations in one call, and in one call each."""
    problem = PROBLEMS["right"].replace(arm="ur5", scene=Scene(ground=False))
    world, surroundings = World(problem, threads=1), vamp.Environment()
    for box in PAPER_BENCHES:
        centre, half = np.add(box.upper, box.lower) / 2, np.subtract(box.upper, box.lower) / 2
        surroundings.add_cuboid(vamp.Cuboid(centre.tolist(), [0.0] * 3, half.tolist()))
    waypoints = free_walk(world, surroundings, np.random.default_rng(0))
    path = vamp.ur5.Path()
    for waypoint in waypoints:
        path.append(waypoint)
    raked = on_the_way(waypoints)

    def theirs_together() -> int:
        path.validate(surroundings)
        return len(raked)

    def ours_together() -> int:
        world.screen(raked)
        return len(raked)

    def theirs_singly() -> int:
        for waypoint in waypoints[:CALLS]:
            vamp.ur5.validate(waypoint, surroundings)
        return CALLS

    def ours_singly() -> int:
        for waypoint in waypoints[:CALLS]:
            world.screen(waypoint[None])
        return CALLS

    about = ("configurations/s", TERMS)
    many = f"{len(raked):,} configurations of UR5 in one call"
    yield many, *about, theirs_together, ours_together
    yield "configurations of UR5, one call each", *about, theirs_singly, ours_singly


def free_walk(world: World, surroundings: Any, rng: np.random.Generator) -> NDArray[np.float32]:
    """A random walk within the limits on which both find nothing that touches.

    Returns
    -------
    ndarray, shape (WAYPOINTS, n_joints)
        Steps have the length `STEP` [rad].
    """
    place = np.zeros(world.arm.n_joints)
    place[1] = -np.pi / 2  # upright
    walk: list[NDArray[np.float32]] = []
    while len(walk) < WAYPOINTS:
        step = rng.standard_normal(len(place))
        target = (place + STEP / np.linalg.norm(step) * step).astype(np.float32)
        way = on_the_way(np.array([place, target]))
        if (
            (np.abs(target) < np.pi).all()
            and vamp.ur5.validate_motion(place.astype(np.float32), target, surroundings, False)
            and not world.screen(way)[1].any()
        ):
            place = target.astype(np.float64)
            walk.append(target)
    return np.array(walk, dtype=np.float32)


def on_the_way(waypoints: NDArray[Any]) -> NDArray[np.float64]:
    """The configurations that VAMP checks between waypoints, shape (RAKE (n - 1), n_joints)."""
    shares = np.arange(1, RAKE + 1) / RAKE
    ways = np.diff(waypoints.astype(np.float64), axis=0)
    found = waypoints[:-1, None].astype(np.float64) + shares[:, None] * ways[:, None]
    return found.reshape(-1, waypoints.shape[1])

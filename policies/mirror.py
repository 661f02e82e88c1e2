"""Reflection about the x-z plane: what it does to observations and actions.

The reflection y -> -y maps the right bench to the left one and an arm that is symmetric about its
x-z plane to itself, with joints that turn about x or z reversed. In kinarm's observations and
actions it only changes signs. A linear policy commutes with it exactly if its weights vanish
wherever the signs of input and output disagree: it then does on one bench what it does on the
other. Any other network does so if it sees goals on the left in the mirror; see `kinarm.Networks`.
"""

import math
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from kinarm.errors import InvalidInputError
from kinarm.networks import Mirror
from kinarm.observation import observation_signs
from kinarm.problem import ReachProblem
from kinarm.scene import Point
from kinarm.world import World

TESTED_CONFIGURATIONS = 16
ACCURACY = 1e-9


def commuting_weights(mirror: Mirror) -> NDArray[np.bool_]:
    """Where a linear policy that commutes with a reflection may have weights."""
    return np.outer(mirror.actions, mirror.observations) > 0


def find_mirror(world: World) -> Mirror:
    """Find the signs for an arm, and check them with forward kinematics.

    Raises
    ------
    InvalidInputError
        If the reflection does not map the arm's motions to themselves.
    """
    arm = world.arm
    along_y = np.abs(arm.chain.axis[:, 1]) > 0.5
    axes = np.where(along_y ^ arm.chain.prismatic, 1.0, -1.0)
    mirror = Mirror(observation_signs(arm.n_joints), axes[: arm.n_actuated])
    if not _is_mirror(mirror, axes, world):
        raise InvalidInputError(f"arm {arm.name!r} is not its own mirror image")
    return mirror


def _is_mirror(mirror: Mirror, axes: NDArray[np.float64], world: World) -> bool:
    """Whether mirrored configurations lead to mirrored observations, limits included."""
    arm = world.arm
    limits = np.sort(np.array([axes * arm.lower, axes * arm.upper]), axis=0)
    if not np.allclose(limits, [arm.lower, arm.upper], rtol=0, atol=ACCURACY):
        return False
    rng = np.random.default_rng(0)
    q = rng.uniform(arm.lower, arm.upper, (TESTED_CONFIGURATIONS, arm.n_joints))
    goals = rng.normal(size=(TESTED_CONFIGURATIONS, 3))
    seen = world.observe(q, goals)
    reflected = world.observe(axes * q, goals * (1.0, -1.0, 1.0))
    return np.allclose(reflected, seen * mirror.observations, rtol=0, atol=ACCURACY)


def task_mirror(symmetric: bool, world: World) -> Mirror | None:
    """Reflection that a policy has to commute with, if it is to and arm and task have one."""
    if symmetric and is_symmetric(world.problem):
        with suppress(InvalidInputError):
            return find_mirror(world)
    return None


def has_mirror(problem: ReachProblem) -> bool:
    """Whether arm, obstacles and goals are their own mirror image."""
    return is_symmetric(problem) and task_mirror(True, World(problem, threads=1)) is not None


def is_symmetric(problem: ReachProblem) -> bool:
    """Whether the reflection maps obstacles and goals, with their weights, to themselves."""
    task, scene = problem.task, problem.scene
    weights = task.goal_weights or (1.0,) * len(task.goal_regions)
    regions = [scene.goal_region(name) for name in task.goal_regions]
    goals = {(region.lower, region.upper, w) for region, w in zip(regions, weights, strict=True)}
    obstacles = {(each.lower, each.upper, _of_half_turn(each.yaw)) for each in scene.obstacles}
    return goals == {(*_reflected(lower, upper), w) for lower, upper, w in goals} and (
        obstacles
        == {(*_reflected(lower, upper), _of_half_turn(-yaw)) for lower, upper, yaw in obstacles}
    )


def _of_half_turn(yaw: float) -> float:
    """The angle in [0, pi) by which a box looks the same, rounded [rad]."""
    return round(yaw % math.pi, 9) % round(math.pi, 9)


def _reflected(lower: Point, upper: Point) -> tuple[Point, Point]:
    """Mirror image of a box."""
    return (lower[0], -upper[1], lower[2]), (upper[0], -lower[1], upper[2])

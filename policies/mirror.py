"""Reflection about the x-z plane, and its effect on observations and actions.

The reflection y -> -y swaps the benches, and reverses the joints that turn about x or z of an arm
that is symmetric about its x-z plane. Observations and actions only change signs. A policy with a
mirror sees goals on the left reflected, and its actions are reflected in turn: it does the same on
both benches.
"""

from functools import lru_cache
from typing import Any

import numpy as np

from kinarm.bodies import Body, Point
from kinarm.contact_shapes import CUBE
from kinarm.errors import InvalidInputError
from kinarm.networks import Mirror
from kinarm.problem import ReachProblem
from kinarm.world import World

TESTED_CONFIGURATIONS = 16
"""Where observations are compared."""

ACCURACY = 1e-9

REFLECTION = (1.0, -1.0, 1.0)


def find_mirror(world: World) -> Mirror:
    """Find the signs for an arm, and check limits and forward kinematics."""
    arm = world.arm
    along_y = np.abs(arm.chain.axis[:, 1]) > 0.5
    axes = np.where(along_y ^ arm.chain.prismatic, 1.0, -1.0)
    side = world.layout.side
    if side is None:
        raise InvalidInputError("the observation has no part 'goal', which tells the side")
    of_rest = {"direction": REFLECTION, "pose": (1.0, -1.0, 1.0, -1.0), "configuration": axes}
    of_goal = np.concatenate([REFLECTION, of_rest.get(world.problem.task.goal.kind, ())])
    mirror = Mirror(world.layout.signs(axes), axes[: arm.n_actuated], side, of_goal)
    rng = np.random.default_rng(0)
    q = rng.uniform(arm.lower, arm.upper, (TESTED_CONFIGURATIONS, arm.n_joints))
    goals = rng.normal(size=(TESTED_CONFIGURATIONS, world.goal_width))
    reflected = world.observe(axes * q, goals * of_goal)
    apart = np.abs(reflected - world.observe(q, goals) * mirror.observations).max()
    limits = np.sort([axes * arm.lower, axes * arm.upper], axis=0)
    uneven = np.abs(limits - [arm.lower, arm.upper]).max()
    if uneven > ACCURACY or apart > ACCURACY:
        raise InvalidInputError(f"arm {arm.name!r} is not its own mirror image")
    return mirror


@lru_cache(maxsize=8)
def _mirror_and_reason(problem: ReachProblem) -> tuple[Mirror | None, str]:
    """Reflection of arm and obstacles, or why there is none; the arm is pinned.

    A training asks often, and a world takes longer to build than an iteration.
    """
    if not obstacles_are_symmetric(problem):
        return None, "obstacles are not their own mirror image"
    motion = problem.task.goal.motion
    if motion is not None and motion.reflected(REFLECTION) != motion:
        return None, "the motion of goals is not its own mirror image"
    try:
        return find_mirror(World(problem, threads=1)), ""
    except InvalidInputError as error:
        return None, str(error)


def problem_mirror(problem: ReachProblem) -> Mirror | None:
    """Reflection of arm and obstacles, if they have one; goals need not."""
    return _mirror_and_reason(problem.pinned)[0]


def missing_mirror(problem: ReachProblem) -> str:
    """Why arm and obstacles are not their own mirror image, or an empty text."""
    return _mirror_and_reason(problem.pinned)[1]


def different_regions(problem: ReachProblem, symmetric: bool) -> int:
    """Goal regions that a policy meets, those on the left mirrored if symmetric."""
    regions = (problem.scene.goal_region(name) for name in problem.task.goal_regions)
    found = set()
    for (x, y, z), (far_x, far_y, far_z) in ((each.lower, each.upper) for each in regions):
        right = (-far_y, -y) if symmetric and y >= 0 else (y, far_y)
        found.add((x, far_x, *right, z, far_z))
    return len(found)


def obstacles_are_symmetric(problem: ReachProblem) -> bool:
    """Whether the reflection maps the obstacles to themselves."""
    if problem.scene.random_bodies:
        return False
    bodies = problem.scene.bodies
    return {_outline(each, REFLECTION) for each in bodies} == {_outline(each) for each in bodies}


def _outline(body: Body, signs: Point = (1.0, 1.0, 1.0)) -> tuple[Any, ...]:
    """Points that tell where a body is, the same however it is turned into itself.

    Coordinates get these signs.
    """
    centre, rotation = np.array(body.position), body.rotation
    if body.shape == "halfspace":
        normal = rotation[:, 2]
        points = np.array([normal, normal * (normal @ centre)])
    else:
        points = np.array(body.vertices).reshape(-1, 3)
        if body.shape == "box":
            points = CUBE * np.array(body.size) / 2
        elif body.shape != "mesh":
            length = body.size[1] if len(body.size) > 1 else 0.0
            points = np.array([(0.0, 0.0, -length / 2), (0.0, 0.0, length / 2)])
        points = points @ rotation.T + centre
    rounded = np.round(points * signs, 9) + 0.0
    motion = None if body.motion is None else body.motion.reflected(signs)
    radius = body.size[:1] if body.shape != "box" else ()
    return body.shape, radius, frozenset(map(tuple, rounded.tolist())), motion

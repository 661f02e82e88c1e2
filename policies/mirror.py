"""Reflection about the x-z plane, and its effect on observations and actions.

The reflection y -> -y swaps the benches, and reverses the joints that turn about x or z of an arm
that is symmetric about its x-z plane. Observations and actions only change signs. A policy with a
mirror sees goals on the left reflected, and its actions are reflected in turn: it does the same on
both benches.
"""

from functools import lru_cache
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kinarm.bodies import Body, Point
from kinarm.clearance import random_configurations
from kinarm.contact_shapes import CUBE
from kinarm.errors import InvalidInputError
from kinarm.goals import GoalSpecification
from kinarm.kernels.compiling import Array
from kinarm.networks import Mirror
from kinarm.problem import ReachProblem
from kinarm.world import World

TESTED_CONFIGURATIONS, MIRRORED_CONFIGURATIONS = 16, 2000
"""Where observations are compared, and contact."""

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
    if _beyond_limits(axes, arm.lower, arm.upper).any() or apart > ACCURACY:
        raise InvalidInputError(f"arm {arm.name!r} is not its own mirror image")
    return mirror


def _beyond_limits(axes: Array, lower: Array, upper: Array) -> NDArray[np.bool_]:
    """Joints whose limits are not their own mirror image."""
    apart = np.abs(np.sort([axes * lower, axes * upper], axis=0) - [lower, upper])
    uneven: NDArray[np.bool_] = apart.max(axis=0) > ACCURACY
    return uneven


def mirror_findings(world: World) -> dict[str, str]:
    """Reasons against reflecting arm, scene and task.

    Joints that turn about y, or slide across it, keep their sign, judged with all joints at zero.
    Joints that are not actuated stay at home. For ``kinematics``, ``limits``, ``contact``,
    ``scene`` and ``observations`` (whether their mirror images differ by signs alone), there is a
    reason, or an empty text.
    """
    arm = world.arm
    data, moved = arm.model.createData(), slice(arm.n_actuated)
    pin.forwardKinematics(arm.model, data, np.zeros(arm.n_joints))
    turned = zip(list(data.oMi)[1:], arm.chain.axis, strict=True)
    across = np.array([abs((pose.rotation @ axis)[1]) > 0.5 for pose, axis in turned])
    axes = np.where(across ^ arm.chain.prismatic, 1.0, -1.0)[moved]
    q = random_configurations(world.contact_model, MIRRORED_CONFIGURATIONS)
    beyond = _beyond_limits(axes, arm.lower[moved], arm.upper[moved])
    uneven = [arm.joint_names[joint] for joint in np.flatnonzero(beyond)]
    mirrored = q.copy()
    mirrored[:, moved] *= axes
    tools, touching = world.screen(q)
    reflected, touching_there = world.screen(mirrored)
    apart = np.abs(reflected - tools * REFLECTION).max()
    differing = (touching != touching_there).mean()
    found = {
        "kinematics": f"tool points differ by up to {apart:.3g} m" if apart > ACCURACY else "",
        "limits": f"those of {', '.join(uneven)} are uneven" if uneven else "",
        "contact": f"differs at {differing:.1%} of {len(q)} configurations" if differing else "",
        "scene": "" if is_symmetric(world.problem) else "obstacles or goals are not their image",
        "observations": "",
    }
    try:
        find_mirror(world)
    except InvalidInputError:
        found["observations"] = "joint frames are not their image"
    return found


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
    boxes = [(region.lower, region.upper) for region in regions]
    if symmetric:
        boxes = [_reflected(*box) if box[0][1] >= 0 else box for box in boxes]
    return len(set(boxes))


def obstacles_are_symmetric(problem: ReachProblem) -> bool:
    """Whether the reflection maps the obstacles to themselves."""
    if problem.scene.random_bodies:
        return False
    bodies = problem.scene.bodies
    return {_outline(each, REFLECTION) for each in bodies} == {_outline(each) for each in bodies}


def is_symmetric(problem: ReachProblem) -> bool:
    """Whether the reflection maps obstacles, goals and weights to themselves."""
    task, scene = problem.task, problem.scene
    weights = task.goal_weights or (1.0,) * len(task.goal_regions)
    regions = [scene.goal_region(name) for name in task.goal_regions]
    goals = {(region.lower, region.upper, w) for region, w in zip(regions, weights, strict=True)}
    reflected = {(*_reflected(lower, upper), w) for lower, upper, w in goals}
    rests = _rests_are_symmetric(task.goal)
    return goals == reflected and rests and obstacles_are_symmetric(problem)


def _rests_are_symmetric(goal: GoalSpecification) -> bool:
    """Whether the reflection surely maps what goals have beside a position to itself."""
    turned = {(-roll, pitch, -yaw) for roll, pitch, yaw in goal.rotations}
    return turned == set(goal.rotations) and not goal.configurations


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


def _reflected(lower: Point, upper: Point) -> tuple[Point, Point]:
    """Mirror image of a box."""
    return (lower[0], -upper[1], lower[2]), (upper[0], -lower[1], upper[2])

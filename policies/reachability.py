"""Which goals an arm can reach at all, found in a second: what is looked at before a training.

The oracle proves what no policy can reach, and finds motions. Here configurations at a goal are
looked for, without contact; that none is found proves nothing.
"""

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kinarm.contact_statistics import ContactStatistics, random_configurations
from kinarm.world import World

GOALS = 100
"""Goals that are looked at."""

MANY = 0.1
"""More than this share of them without a configuration is worth a line."""

CONFIGURATIONS, NEAREST, STEPS = 50_000, 32, 20
"""Random configurations; how many of them are tried for a goal, and in how many steps."""

DAMPING = 1e-3
"""Of the steps to a goal, so that they stay small near singular configurations [m^2]."""


def find_reachable(
    world: World, goals: NDArray[np.float64], configurations: int = CONFIGURATIONS
) -> NDArray[np.bool_]:
    """Find out for which goals there is a configuration that touches nothing.

    Of random configurations that are free, those whose tools are nearest to a goal are moved
    towards it, by damped least squares.

    Parameters
    ----------
    world : World
        Arm and scene.
    goals : ndarray, shape (n, 3)
        Goal points [m].
    configurations : int
        How many random ones.

    Returns
    -------
    ndarray of bool, shape (n,)

    Raises
    ------
    ProblemError
        If all random configurations touch something.
    """
    q = random_configurations(world.contact_model, configurations)
    tools, touching = world.screen(q)
    if touching.all():
        ContactStatistics.sample(world.contact_model).check_movable(world.arm.name)
    q, tools = q[~touching], tools[~touching]
    found = []
    for goal in goals:
        distances = np.linalg.norm(tools - goal, axis=1)
        nearest = np.argsort(distances, kind="stable")[:NEAREST]
        reached = distances[nearest[0]] <= world.problem.task.tolerance
        found.append(reached or any(_leads_to(world, q[index], goal) for index in nearest))
    return np.array(found, dtype=bool)


def _leads_to(world: World, start: NDArray[np.float64], goal: NDArray[np.float64]) -> bool:
    """Whether steps from a configuration lead to one at a goal that touches nothing."""
    arm, q = world.arm, start.copy()
    model, data, moved = arm.model, arm.model.createData(), slice(arm.n_actuated)
    frame = model.getFrameId(arm.tool_frame, pin.FrameType.BODY)
    for _ in range(STEPS):
        jacobian = pin.computeFrameJacobian(
            model, data, q, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )[:3, moved]
        missing = goal - pin.updateFramePlacement(model, data, frame).translation
        distance, tolerance = np.linalg.norm(missing), world.problem.task.tolerance
        if distance <= tolerance and not world.contact_model.in_contact(q[None])[0]:
            return True
        if distance <= tolerance / 10:
            return False
        damped = jacobian @ jacobian.T + DAMPING * np.eye(3)
        q[moved] += jacobian.T @ np.linalg.solve(damped, missing)
        q = np.clip(q, arm.lower, arm.upper)
    return False


def reach_warning(world: World) -> str | None:
    """Say in a line that many of a problem's goals seem out of reach, if they do.

    Raises
    ------
    ProblemError
        If the arm cannot move.
    """
    task, scene = world.problem.task, world.problem.scene
    found = find_reachable(world, task.draw_goals(scene, np.random.default_rng(0), GOALS))
    missed = int((~found).sum())
    if missed <= MANY * GOALS:
        return None
    return (
        f"problem {world.problem.name}: no contact-free configuration was found for {missed} of "
        f"{GOALS} goals; see kinarm-problem check"
    )

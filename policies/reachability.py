"""Check before a training, within a second, which goals an arm can reach at all.

The oracle proves what no policy can reach, and finds motions. Here configurations at a goal are
looked for, without contact; that none is found proves nothing.
"""

import numpy as np
from numpy.typing import NDArray

from kinarm.contact_statistics import ContactStatistics, random_configurations
from kinarm.world import World

GOALS = 100
"""Goals that are looked at."""

MANY = 0.1
"""More than this share of them without a configuration is worth a line."""

CONFIGURATIONS = 50_000
"""Random configurations that are tried for all goals."""


def find_reachable(
    world: World, goals: NDArray[np.float64], configurations: int = CONFIGURATIONS
) -> NDArray[np.bool_]:
    """Find out for which goals there is a configuration that touches nothing.

    One of many random configurations may bring the tool within the tolerance; for the goals that
    are left, inverse kinematics is asked.

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
    tools, tolerance = tools[~touching], world.problem.task.tolerance
    found = np.array([(np.linalg.norm(tools - goal, axis=1) <= tolerance).any() for goal in goals])
    missing = np.flatnonzero(~found)
    solutions = world.inverse_kinematics(goals[missing], free=True, most=256)
    found[missing[solutions.owner]] = True
    return found


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

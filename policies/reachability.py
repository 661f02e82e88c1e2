"""Check before a training, within a second, for which goals there is a contact-free configuration.

That none is found proves nothing; the oracle does.
"""

import numpy as np
from numpy.typing import NDArray

from kinarm.clearance import ContactStatistics, random_configurations
from kinarm.kernels.compiling import Array
from kinarm.world import World

GOALS, MANY = 100, 0.1
"""Goals that are looked at, and the share of them that may lack a configuration without a line."""


def find_reachable(world: World, goals: Array, configurations: int = 50_000) -> NDArray[np.bool_]:
    """Find out for which goals there is a configuration that touches nothing.

    One of many random configurations may bring the tool within the tolerance; for the goals that
    are left, inverse kinematics is asked. An arm that always touches something is refused.

    Parameters
    ----------
    world, configurations
        Arm and scene, and how many random configurations are tried.
    goals : ndarray, shape (n, 3)
        Goal points [m].

    Returns
    -------
    ndarray of bool, shape (n,)
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
    """Say in a line that many of a problem's goals seem out of reach, if they do."""
    found = find_reachable(world, world.goals.draw(np.random.default_rng(0), GOALS))
    missed = int((~found).sum())
    if missed <= MANY * GOALS:
        return None
    return (
        f"problem {world.problem.name}: no contact-free configuration was found for {missed} of "
        f"{GOALS} goals; see kinarm-problem check"
    )

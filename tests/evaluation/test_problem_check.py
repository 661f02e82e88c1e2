"""What a check finds, and where a checked problem may start."""

import numpy as np

from kinarm.evaluation.problem_check import check_problem, random_starts
from kinarm.problem import PROBLEMS
from kinarm.world import World


def test_the_papers_third_task():
    check = check_problem(World("both"), trials=20)
    assert check.reached.value == 1
    assert check.home_contact is None
    # FACTS of the arm: about 72 % of uniform configurations are free.
    low, high = check.free_starts.ci95
    assert low < 0.72 < high
    assert len(check.touching) == 24
    assert not check.mirror


def test_where_starts_are_listed_these_are_checked():
    listed = ((0.0,) * 6, (0.5, 0.0, 0.0, 0.0, 0.0, 0.0))
    world = World(PROBLEMS["right"].replace(starts=listed))
    np.testing.assert_array_equal(random_starts(world), listed)
    assert " of 2; at home nothing touches" in str(check_problem(world, trials=1))


def test_elsewhere_starts_lie_between_home_and_the_limits():
    world = World(PROBLEMS["right"].replace(start_spread=0.25))
    away, arm = random_starts(world) - world.arm.home, world.arm
    low, high = (away.min(axis=0), away.max(axis=0))
    assert (low >= 0.25 * (arm.lower - arm.home) - 1e-12).all()
    assert (high <= 0.25 * (arm.upper - arm.home) + 1e-12).all()
    assert (high > low).sum() == arm.n_actuated

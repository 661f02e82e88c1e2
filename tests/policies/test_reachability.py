"""Which goals have a configuration: held against the oracle."""

import numpy as np
import pytest

from kinarm.policies.oracle import Oracle
from kinarm.problem import PROBLEMS
from kinarm.scene import GoalRegion, Obstacle, Scene
from kinarm.world import World


def find_reachable(world, goals):
    nothing = np.zeros((0, *world.contact_model.shapes.placed.shape))
    return world.solved_goals(goals, np.zeros(len(goals)), nothing)[0]


@pytest.mark.parametrize("arm", ["paper", "paper_flange"])
def test_finds_what_the_oracle_reaches(arm):
    """All but a few at the edge of what an arm can reach."""
    problem = PROBLEMS["both"].replace(arm=arm, tolerance=0.005)
    world, oracle = World(problem), Oracle(problem)
    starts, goals = oracle.simulator.sample(np.random.default_rng(1), 40)
    reached = oracle.solve_batch(starts, goals).reachable
    found = find_reachable(world, goals)
    assert reached.sum() > 30
    assert (reached & ~found).sum() <= 2


def test_goals_deep_in_an_obstacle_are_not_found():
    block = Obstacle(name="block", lower=(0.3, -0.2, 0.2), upper=(0.7, 0.2, 0.6))
    inside = GoalRegion(name="inside", lower=(0.4, -0.05, 0.35), upper=(0.8, 0.05, 0.45))
    scene = Scene(obstacles=(block,), goal_regions=(inside,))
    world = World(PROBLEMS["right"].replace(scene=scene, goal_regions=("inside",)))
    goals = world.goals.draw(np.random.default_rng(1), 30)
    found = find_reachable(world, goals)
    deep = goals[:, 0] < 0.55
    assert not found[deep].any()

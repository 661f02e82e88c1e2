"""Which goals have a configuration: held against the oracle, and the line that a training says."""

import numpy as np
import pytest

from kinarm.clearance import reach_warning
from kinarm.errors import ProblemError
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


def test_a_line_if_more_than_a_tenth_is_missed():
    assert reach_warning(World("both")) is None
    far = GoalRegion(name="far", lower=(2, 0, 0.3), upper=(3, 1, 0.3))
    scene = Scene(goal_regions=(*Scene().goal_regions, far))
    mixed = PROBLEMS["right"].replace(scene=scene, goal_regions=("right", "far"))
    few, many = ((30.0, 1.0), (1.0, 1.0))
    assert reach_warning(World(mixed.replace(goal_weights=few))) is None
    line = reach_warning(World(mixed.replace(goal_weights=many, name="mixed")))
    assert line.startswith("problem mixed: no contact-free configuration was found for ")
    assert "\n" not in line


def test_an_arm_that_cannot_move_is_refused():
    roof = Obstacle(name="roof", lower=(-2, -2, 0.47), upper=(2, 2, 2))
    floor = Obstacle(name="floor", lower=(0.2, -2, 0), upper=(2, 2, 0.46))
    sides = [
        Obstacle(name="left", lower=(-2, 0.2, 0), upper=(0.2, 2, 0.46)),
        Obstacle(name="right", lower=(-2, -2, 0), upper=(0.2, -0.2, 0.46)),
        Obstacle(name="back", lower=(-2, -0.2, 0), upper=(-0.2, 0.2, 0.46)),
    ]
    goal = GoalRegion(name="goal", lower=(0, 0, 3), upper=(1, 1, 3))
    scene = Scene(obstacles=(roof, floor, *sides), goal_regions=(goal,))
    world = World(PROBLEMS["right"].replace(scene=scene, goal_regions=("goal",)))
    with pytest.raises(ProblemError, match="arm 'paper' cannot move: it touches something at all"):
        reach_warning(world)

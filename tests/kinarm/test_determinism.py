"""What becomes of an episode depends neither on its batch nor on the number of threads."""

from dataclasses import fields

import numpy as np
import pytest
from random_scenes import CLUTTER, among, random_scene, swinging
from reference_episodes import held_actions

from kinarm.plant import Plant
from kinarm.problem import ReachProblem
from kinarm.simulator import Simulator

N = 300
BOTH = ReachProblem.load("both").replace(tolerance=0.3)
LAGGING = Plant(
    delay=(0, 3),
    bandwidth=(5.0, 50.0),
    damping=(0.5, 1.5),
    acceleration=(50.0, 400.0),
    noise=0.01,
    calibration=(0.0, 0.02),
    goal_noise=0.003,
)
POSE = {"kind": "pose", "rotation_tolerance": 1.0}
DIRECTION = {"kind": "direction", "rotation_tolerance": 1.0}
PROBLEMS = {
    "sequence": BOTH.replace(goal={"sequence": 3}),
    "held sequence of directions": BOTH.replace(goal={**DIRECTION, "sequence": 2, "hold": 2}),
    "poses": BOTH.replace(goal=POSE),
    "moving bodies": BOTH.replace(scene=random_scene(3, 12, moving=9)),
    "random bodies that move": among("both", swinging(0.35)),
    "random bodies": among("both", CLUTTER),
    "plant": BOTH.replace(plant=LAGGING),
    "shield": among("both", CLUTTER).replace(shield=True, tolerance=0.3),
    "shield and plant": BOTH.replace(plant=LAGGING, shield=True),
}


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.slow) if name == "plant" else name for name in PROBLEMS],
)
def test_results_depend_on_the_episode_alone(name):
    one, two = (Simulator(PROBLEMS[name], threads=threads) for threads in (1, 2))
    rng = np.random.default_rng(5)
    starts, goals = two.sample(rng, N)
    actions = held_actions(two, rng, N)
    whole = two.rollout_actions(actions, starts, goals, record=True)
    assert len(np.unique(whole.steps)) > 5
    for rows in (slice(7, 8), np.arange(3, N, 13), rng.permutation(N)):
        for simulator in (one, two):
            part = simulator.rollout_actions(actions[rows], starts[rows], goals[rows], record=True)
            for field in fields(whole):
                found, expected = getattr(part, field.name), getattr(whole, field.name)
                if np.shape(expected)[:1] == (N,):
                    np.testing.assert_array_equal(found, expected[rows], err_msg=field.name)

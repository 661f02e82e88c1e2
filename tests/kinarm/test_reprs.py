"""What a prompt shows of an object is one line that can be read."""

import numpy as np

import kinarm
from kinarm.policies import Oracle, load_policy, recipe


def test_objects_show_themselves_in_one_line() -> None:
    simulator, policy = kinarm.Simulator("left"), load_policy("ars-tuned-both")
    starts, goals = simulator.sample(np.random.default_rng(0), 3)
    rollouts = simulator.rollout(policy, starts, goals)
    shown = {
        "Simulator(ReachProblem('left'": simulator,
        "World(ReachProblem('left'": simulator.world,
        "Policy(ars tuned": policy,
        "Networks(1 of layers 48-5)": policy.networks(),
        "Rollouts(3 episodes, ": rollouts,
        "OracleSolutions(3 trials, ": Oracle("left").solve_batch(starts, goals),
        "Arm('paper'": simulator.arm,
        "ARSConfig(problem=ReachProblem('right'": recipe("ars"),
    }
    for beginning, thing in shown.items():
        assert repr(thing).startswith(beginning)
        assert "\n" not in repr(thing)

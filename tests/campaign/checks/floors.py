"""Policies and the oracle's bounds: does any reach a goal faster than is proven possible?"""

import numpy as np

from kinarm.policies import load_policy, policy_names
from kinarm.policies.oracle import Oracle
from kinarm.problem import ReachProblem
from tests.campaign.checks.tally import Tally


def check_floors(problem: ReachProblem, trials: int, seed: int) -> Tally:
    """Put all shipped policies to the same scenarios, so many trials or a few more in all."""
    tally, oracle = Tally(), Oracle(problem, threads=1)
    simulator, names = oracle.simulator, policy_names()
    scenarios = simulator.sample(np.random.default_rng(seed), -(-trials // len(names)))
    bounds = oracle.solve_batch(*scenarios)
    tally.count("scenarios", len(bounds))
    tally.count("scenarios whose floor is exact", bounds.proof_complete.sum())
    tally.count("policies", len(names))
    for name in names:
        done = simulator.rollout(load_policy(name), *scenarios)
        tally.count("trials", len(done))
        tally.count("steps", done.steps.sum())
        tally.count("successes", done.success.sum())
        at_floor = done.success & (done.steps == bounds.steps_lower_bound)
        tally.count("successes as fast as is proven possible", at_floor.sum())

        def describe(row: int, name: str = name) -> dict[str, object]:
            start, goal = (part[row].tolist() for part in scenarios)
            return {"policy": name, "seed": seed, "start": start, "goal": goal}

        faster = done.success & (done.steps < bounds.steps_lower_bound)
        tally.check("no success is faster than is proven possible", ~faster, describe)
        kept = done.distance >= bounds.distance_lower_bound
        tally.check("no trial ends closer than is proven possible", kept, describe)
        within = done.distance <= problem.task.tolerance
        tally.check("success is being within the tolerance", done.success == within, describe)
    return tally

"""How near the simulator comes to what the machine can do, and where time goes."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from kinarm.errors import MissingExtraError
from kinarm.evaluation.measurements.attainable import (
    CHAINS,
    attainable_operations,
    multiply_and_add,
)
from kinarm.evaluation.measurements.operations import measure_operations
from kinarm.evaluation.measurements.shares import time_shares
from kinarm.evaluation.measurements.timing import alternated
from kinarm.kernels.lanes import LANES
from kinarm.policies.learners import begin_training
from kinarm.policies.policy import Policy
from kinarm.policies.recipes import recipe
from kinarm.problem import ReachProblem
from kinarm.simulator import Simulator

TURNS = 50_000_000
BATCH = 4096
PROFILED_ITERATIONS = 20


def measure_attainable(simulator: Simulator, policy: Policy, repetitions: int) -> dict[str, Any]:
    """Operations per second of one core, and steps per second of rollouts on it, by turns."""
    scenarios = simulator.sample(np.random.default_rng(BATCH), BATCH)
    threads, space = simulator.threads, np.zeros((2 + CHAINS, LANES))
    space[0], space[1] = 0.999, 0.001

    def multiply() -> int:
        multiply_and_add(TURNS, space)
        return attainable_operations(TURNS)

    def roll() -> int:
        return int(simulator.rollout(policy, *scenarios).steps.sum())

    try:
        simulator.threads = 1
        rates = alternated({"operations": multiply, "steps": roll}, repetitions)
    finally:
        simulator.threads = threads
    return {
        "operations_per_second": rates["operations"]._asdict(),
        "steps_per_second": rates["steps"]._asdict(),
    }


def measure_limits(policy_name: str, policy: Policy, attainable: dict[str, Any]) -> dict[str, Any]:
    """Operations of a step, the share of the attainable rate, and where time goes."""
    operations = measure_operations(policy_name)
    rate = operations["total"] * attainable["steps_per_second"]["median"]
    return {
        "operations": operations,
        "share_of_attainable": rate / attainable["operations_per_second"]["median"],
        "time": measure_shares(policy),
    }


def measure_shares(policy: Policy) -> dict[str, dict[str, float]]:
    """Where the time of rollouts, of an iteration of ARS and of one of PPO goes, on one thread."""
    simulator = Simulator(policy.problem, threads=1)
    scenarios = simulator.sample(np.random.default_rng(BATCH), BATCH)
    shares = {f"rollouts of {BATCH} episodes": time_shares(_twice(simulator, policy, scenarios))}
    for learner, name in (("ars", "paper"), ("ars", "tuned"), ("ppo", "tuned")):
        try:
            run = _iterations(learner, name, policy.problem)
        except MissingExtraError:
            continue
        shares[f"iteration of {learner.upper()}, `{name}`"] = time_shares(run)
    return shares


def _twice(simulator: Simulator, policy: Policy, scenarios: Any) -> Callable[[], object]:
    """Rollouts that were run before."""
    simulator.rollout(policy, *scenarios)
    return lambda: simulator.rollout(policy, *scenarios)


def _iterations(learner: str, name: str, problem: ReachProblem) -> Callable[[], object]:
    """Iterations of a training, which is warmed up."""
    few = 1 if learner == "ppo" else PROFILED_ITERATIONS
    config = recipe(learner, name, problem=problem)
    config = replace(config, iterations=max(config.iterations, 2 * few))
    training = begin_training(config, **({"threads": 1} if learner == "ars" else {}))
    state = training.iterate(training.initial_state())

    def run() -> None:
        nonlocal state
        for _ in range(few):
            state = training.iterate(state)

    return run

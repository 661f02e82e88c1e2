"""The oracle."""

from typing import Any

import numpy as np

from kinarm.evaluation.measurements.timing import timed
from kinarm.policies.oracle import Oracle
from kinarm.problem import ReachProblem

ORACLE_TRIALS = 200


def measure_oracle(problem: ReachProblem, repetitions: int) -> dict[str, Any]:
    """Trials that the oracle solves per second."""
    oracle = Oracle(problem)
    starts, goals = oracle.simulator.sample(np.random.default_rng(0), ORACLE_TRIALS)

    def run() -> int:
        oracle.solve_batch(starts, goals)
        return ORACLE_TRIALS

    return {"trials": ORACLE_TRIALS, "trials_per_second": timed(run, repetitions)._asdict()}

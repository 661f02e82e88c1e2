"""Whole episodes, compiled and by the reference path."""

from collections.abc import Callable
from typing import Any

import numpy as np

from kinarm._parallel import available_threads
from kinarm.evaluation.measurements.timing import Timing, timed
from kinarm.policies.policy import Policy
from kinarm.reference import ReferenceSimulator
from kinarm.simulator import Simulator

REFERENCE_TRIALS = 24


def measure_rollouts(
    simulator: Simulator, policy: Policy, batch: int, repetitions: int
) -> list[dict[str, Any]]:
    """Steps per second of whole episodes: random and trained, on one and on all threads."""
    rng = np.random.default_rng(batch)
    starts, goals = simulator.sample(rng, batch)
    actions = rng.uniform(-1, 1, (batch, simulator.task.horizon, simulator.n_actions))
    tested = simulator.problem.stepping.tested_configurations

    runs: dict[str, Callable[[], int]] = {
        "random": lambda: int(simulator.rollout_actions(actions, starts, goals).steps.sum()),
        "trained": lambda: int(simulator.rollout(policy, starts, goals).steps.sum()),
    }
    rows = []
    for name, run in runs.items():
        judged_before = simulator.judged
        steps = run()
        row = {"batch": batch, "actions": name}
        judged_share = (simulator.judged - judged_before) / (tested * steps)
        for threads in sorted({1, available_threads()}):
            simulator.threads = threads
            rate = timed(run, repetitions)._asdict()
            rates = {"threads": threads, "steps_per_second": rate, "judged_share": judged_share}
            rows.append(row | rates)
    return rows


def measure_reference(simulator: Simulator, policy: Policy, repetitions: int) -> Timing:
    """Steps per second of the slow reference path, on the trained policy."""
    reference = ReferenceSimulator(simulator)
    starts, goals = simulator.sample(np.random.default_rng(0), REFERENCE_TRIALS)

    def run() -> int:
        episodes = [reference.rollout(policy, *pair) for pair in zip(starts, goals, strict=True)]
        return sum(len(episode.rewards) for episode in episodes)

    return timed(run, repetitions)

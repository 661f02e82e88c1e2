"""Everything that ``kinarm-bench`` measures, as one document."""

import platform
from typing import Any

from kinarm._parallel import available_threads
from kinarm.evaluation.measurements.environments import (
    measure_sb3,
    measure_single_env,
    measure_vector_env,
)
from kinarm.evaluation.measurements.evaluation import measure_evaluation
from kinarm.evaluation.measurements.limits import measure_attainable, measure_limits
from kinarm.evaluation.measurements.oracle import measure_oracle
from kinarm.evaluation.measurements.peers.measuring import measure_peers
from kinarm.evaluation.measurements.pictures import measure_pictures
from kinarm.evaluation.measurements.robots import measure_robots
from kinarm.evaluation.measurements.rollouts import measure_reference, measure_rollouts
from kinarm.evaluation.measurements.studies import measure_studies
from kinarm.evaluation.measurements.training import measure_ppo, measure_training
from kinarm.policies.library import load_policy
from kinarm.policies.provenance import package_versions, source_commit
from kinarm.simulator import Simulator

BATCHES = (48, 512, 4096)
HEADLINE_BATCH = 512
"""Batch whose trained rollouts on all threads are compared with the reference path."""
SLOW_REPETITIONS = 3
"""How often, at most, is measured what takes seconds."""


def measure(
    policy_name: str,
    repetitions: int,
    *,
    ppo: bool = False,
    limits: bool = False,
    peers: bool = False,
    studies: bool = False,
) -> dict[str, Any]:
    """Measure everything that a `BenchmarkRequest` asks for."""
    policy = load_policy(policy_name)
    problem = policy.problem
    simulator = Simulator(problem)
    rollouts = []
    for size in BATCHES:
        rollouts += measure_rollouts(simulator, policy, size, repetitions)
    reference = measure_reference(simulator, policy, repetitions)
    fast = [row for row in rollouts if row["batch"] == HEADLINE_BATCH][-1]
    few = min(repetitions, SLOW_REPETITIONS)
    document = {
        "machine": {"architecture": platform.machine(), "threads": available_threads()},
        "versions": package_versions(),
        "commit": source_commit(),
        "policy": policy_name,
        "repetitions": repetitions,
        "rollouts": rollouts,
        "attainable": measure_attainable(simulator, policy, repetitions),
        "robots": measure_robots(repetitions),
        "reference": reference._asdict(),
        "speed_up_over_reference": fast["steps_per_second"]["median"] / reference.median,
        "vector_environment": measure_vector_env(problem, repetitions)._asdict(),
        "single_environment": measure_single_env(problem, repetitions)._asdict(),
        "stable_baselines3": measure_sb3(problem, repetitions),
        "pictures": measure_pictures(simulator, policy, repetitions)._asdict(),
        "table_1_training": measure_training(problem, few),
        "oracle": measure_oracle(problem, few),
        "evaluation": measure_evaluation(),
    }
    if ppo:
        document["ppo_training"] = measure_ppo(problem)
    if studies:
        document["studies"] = measure_studies()
    if limits:
        document["limits"] = measure_limits(policy_name, policy, document["attainable"])
    if peers:
        document["peers"] = measure_peers(policy, repetitions)
    return document

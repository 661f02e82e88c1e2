"""How many floating-point operations a step of the simulator takes, by function.

They are counted in a process of its own, whose kernels are compiled to count along.
"""

import json
import os
import subprocess
import sys
import tempfile
from typing import Any

import numpy as np

from kinarm.evaluation.measurements.counting import KINDS, OperationCounter
from kinarm.policies.library import load_policy
from kinarm.simulator import Simulator

EPISODES = 512


def measure_operations(policy_name: str) -> dict[str, Any]:
    """Operations that one step of a policy's rollouts takes, as of `count_operations`."""
    command = [sys.executable, "-P", "-m", __name__, policy_name]
    with tempfile.TemporaryDirectory() as folder:
        env = {**os.environ, "NUMBA_CACHE_DIR": folder}
        done = subprocess.run(command, capture_output=True, check=True, env=env, text=True)
    counts: dict[str, Any] = json.loads(done.stdout)
    return counts


def count_operations(  # pragma: no cover - runs in a process of its own
    policy_name: str, episodes: int = EPISODES
) -> dict[str, Any]:
    """Run a policy with counters, and divide them by the steps taken.

    Idle lanes count as busy ones, since the machine is as busy with them.

    Returns
    -------
    dict
        ``total``, and operations by kind (``kinds``) and by function (``functions``).
    """
    counter = OperationCounter()
    policy = load_policy(policy_name)
    simulator = Simulator(policy.problem, threads=1)
    with counter.active():
        scenarios = simulator.sample(np.random.default_rng(episodes), episodes)
        steps = int(simulator.rollout(policy, *scenarios).steps.sum())
    counter.reset()
    simulator.rollout(policy, *scenarios)
    functions = counter.by_function()
    kinds = {kind: sum(each[kind] for each in functions.values()) / steps for kind in KINDS}
    totals = {name: sum(each.values()) / steps for name, each in functions.items()}
    ordered = sorted(totals.items(), key=lambda item: -item[1])
    return {"total": sum(kinds.values()), "kinds": kinds, "functions": dict(ordered)}


if __name__ == "__main__":
    sys.stdout.write(json.dumps(count_operations(sys.argv[1])))

"""What ``kinarm-bench`` measures."""

import os
import platform
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from kinarm._parallel import available_threads

if TYPE_CHECKING:
    from kinarm.policies.policy import Policy
    from kinarm.problem import ReachProblem
    from kinarm.simulator import Simulator

BATCHES = (48, 512, 4096)
VECTOR_ENVS = 64
ORACLE_TRIALS = 200


class Timing(NamedTuple):
    """Rates over several repetitions [1/s]."""

    median: float
    best: float


def measure(policy_name: str, repetitions: int, *, ppo: bool = False) -> dict[str, Any]:
    """Measure everything.

    Parameters
    ----------
    policy_name : str
        Trained policy to run, on the problem that it is for.
    repetitions : int
        How often each figure is measured.
    ppo : bool
        Time a training with PPO as well, once.

    Returns
    -------
    dict
        Figures that JSON can hold: rates [steps/s], shares, and times [s].
    """
    from kinarm.policies.library import load_policy
    from kinarm.policies.provenance import package_versions, source_commit
    from kinarm.simulator import Simulator

    policy = load_policy(policy_name)
    problem = policy.problem
    simulator = Simulator(problem)
    rollouts = measure_rollouts(simulator, policy, repetitions)
    reference = measure_reference(simulator, policy, repetitions)
    fast = next(row for row in rollouts if _is_headline(row))
    return {
        "machine": {"architecture": platform.machine(), "threads": simulator.threads},
        "versions": package_versions(),
        "commit": source_commit(),
        "policy": policy_name,
        "repetitions": repetitions,
        "rollouts": rollouts,
        "reference": reference._asdict(),
        "speed_up_over_reference": fast["steps_per_second"]["median"] / reference.median,
        "vector_environment": measure_vector_env(problem, repetitions)._asdict(),
        "single_environment": measure_single_env(problem, repetitions)._asdict(),
        "table_1_training": measure_training(problem, min(repetitions, 3)),
        "oracle": measure_oracle(problem, min(repetitions, 3)),
        "evaluation": measure_evaluation(),
        **({"ppo_training": measure_ppo(problem)} if ppo else {}),
    }


def _is_headline(row: dict[str, Any]) -> bool:
    """The figure that others are compared with: 512 trained episodes on all threads."""
    return bool(
        row["batch"] == 512
        and row["actions"] == "trained"
        and row["threads"] == available_threads()
    )


def timed(run: Callable[[], int], repetitions: int) -> Timing:
    """Time something that returns how many steps it took; the first run is not counted."""
    run()
    rates = []
    for _ in range(repetitions):
        began = time.perf_counter()
        steps = run()
        rates.append(steps / (time.perf_counter() - began))
    return Timing(statistics.median(rates), max(rates))


def measure_rollouts(
    simulator: "Simulator", policy: "Policy", repetitions: int
) -> list[dict[str, Any]]:
    """Steps per second of whole episodes: batch sizes, random and trained, 1 and all threads."""
    return [
        row for batch in BATCHES for row in measure_batch(simulator, policy, batch, repetitions)
    ]


def measure_batch(
    simulator: "Simulator", policy: "Policy", batch: int, repetitions: int
) -> list[dict[str, Any]]:
    """Steps per second of one batch size."""
    import numpy as np

    rng = np.random.default_rng(batch)
    starts, goals = simulator.sample(rng, batch)
    tested = simulator.problem.stepping.tested_configurations
    actions = rng.uniform(-1, 1, (batch, simulator.task.horizon, simulator.n_actions))

    def run_random() -> int:
        return int(simulator.rollout_actions(actions, starts, goals).steps.sum())

    def run_trained() -> int:
        return int(simulator.rollout(policy, starts, goals).steps.sum())

    rows = []
    for name, run in (("random", run_random), ("trained", run_trained)):
        judged_before = simulator.judged
        steps = run()
        judged_share = (simulator.judged - judged_before) / (tested * steps)
        for threads in sorted({1, available_threads()}):
            simulator.threads = threads
            rows.append(
                {
                    "batch": batch,
                    "actions": name,
                    "threads": threads,
                    "steps_per_second": timed(run, repetitions)._asdict(),
                    "judged_share": judged_share,
                }
            )
    return rows


def measure_reference(simulator: "Simulator", policy: "Policy", repetitions: int) -> Timing:
    """Steps per second of the slow reference path, on the trained policy."""
    import numpy as np

    from kinarm.reference import ReferenceSimulator

    reference = ReferenceSimulator(simulator)
    starts, goals = simulator.sample(np.random.default_rng(0), 24)

    def run() -> int:
        episodes = [reference.rollout(policy, *pair) for pair in zip(starts, goals, strict=True)]
        return sum(len(episode.rewards) for episode in episodes)

    return timed(run, repetitions)


def measure_vector_env(problem: "ReachProblem", repetitions: int) -> Timing:
    """Steps per second of the native batch environment, on random actions."""
    import numpy as np

    from kinarm.envs import ReachVectorEnv

    env = ReachVectorEnv(VECTOR_ENVS, problem)
    env.reset(seed=0)
    shape = (200, *(env.action_space.shape or ()))
    actions = np.random.default_rng(0).uniform(-1, 1, shape)

    def run() -> int:
        for action in actions:
            env.step(action)
        return len(actions) * VECTOR_ENVS

    return timed(run, repetitions)


def measure_single_env(problem: "ReachProblem", repetitions: int) -> Timing:
    """Steps per second of the single environment without wrappers, on random actions."""
    import numpy as np

    from kinarm.envs import ReachEnv

    env = ReachEnv(problem)
    env.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1, 1, (2000, env.simulator.n_actions))

    def run() -> int:
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
        return len(actions)

    return timed(run, repetitions)


def measure_training(problem: "ReachProblem", repetitions: int) -> dict[str, Any]:
    """Time and steps of a training with Table 1's settings."""
    from kinarm.policies.learners import train_policy
    from kinarm.policies.recipes import recipe

    seconds, steps = [], 0
    for _ in range(repetitions):
        result = train_policy(recipe("ars", "paper", problem=problem))
        seconds.append(result.curve[-1].wall_time)
        steps = result.curve[-1].environment_steps
    return {
        "seconds": {"median": statistics.median(seconds), "best": min(seconds)},
        "environment_steps": steps,
    }


def measure_oracle(problem: "ReachProblem", repetitions: int) -> dict[str, Any]:
    """Trials that the oracle solves per second."""
    import numpy as np

    from kinarm.policies.oracle import Oracle

    oracle = Oracle(problem)
    starts, goals = oracle.simulator.sample(np.random.default_rng(0), ORACLE_TRIALS)

    def run() -> int:
        oracle.solve_batch(starts, goals)
        return ORACLE_TRIALS

    return {"trials": ORACLE_TRIALS, "trials_per_second": timed(run, repetitions)._asdict()}


def measure_ppo(problem: "ReachProblem") -> dict[str, Any]:
    """Time, steps and the simulator's share of a training with PPO's tuned recipe.

    Returns
    -------
    dict
        Figures that JSON can hold, or under ``skipped`` why there are none.
    """
    from kinarm.errors import MissingExtraError
    from kinarm.policies.learners import train_policy
    from kinarm.policies.recipes import recipe

    config = recipe("ppo", "tuned", problem=problem)
    try:
        train_policy(replace(config, iterations=1))  # imports torch and compiles
    except MissingExtraError as error:
        return {"skipped": str(error)}
    result = train_policy(config)
    seconds = result.curve[-1].wall_time
    return {
        "seconds": seconds,
        "environment_steps": result.curve[-1].environment_steps,
        "simulator_share": result.state.simulator_time / seconds,
    }


def measure_evaluation() -> dict[str, float]:
    """Time [s] and peak memory [MB] of ``kinarm-eval --trials 200`` as a process of its own.

    The first time, the bounds of the trials are not known; then they are.
    """
    from kinarm.evaluation.bounds import CACHE_VARIABLE

    code = (
        "from kinarm.evaluation.commands.evaluate import main; main(['--trials', '200', '--json'])"
    )
    seconds = []
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(2):
            began = time.perf_counter()
            subprocess.run(
                [sys.executable, "-P", "-c", code],
                stdout=subprocess.DEVNULL,
                check=True,
                env={**os.environ, CACHE_VARIABLE: folder},
            )
            seconds.append(time.perf_counter() - began)
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    return {
        "seconds_without_bounds": seconds[0],
        "seconds": seconds[1],
        "peak_memory_mb": peak / 1024,
    }

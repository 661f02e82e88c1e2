"""Rates, times and memory of what users run, on this machine."""

import math
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from kinarm._files import CACHE_VARIABLE
from kinarm._parallel import available_threads
from kinarm.envs import ReachEnv, ReachVectorEnv
from kinarm.errors import WorkerError
from kinarm.policies.learners import train_policy
from kinarm.policies.library import load_policy
from kinarm.policies.oracle import Oracle
from kinarm.policies.policy import Policy
from kinarm.policies.provenance import package_versions, source_commit
from kinarm.policies.recipes import recipe
from kinarm.problem import ReachProblem
from kinarm.simulator import Simulator

BATCHES = (48, 512, 4096)
SLOW_REPETITIONS = 3
"""Most repetitions of what takes seconds."""
ORACLE_TRIALS = 200
VECTOR_ENVS, VECTOR_STEPS, SINGLE_STEPS = 64, 200, 2000


def timed(run: Callable[[], int], repetitions: int) -> dict[str, float]:
    """Median and best rate [1/s] of what returns its steps, after a first run."""
    run()
    rates = []
    for _ in range(repetitions):
        began = time.perf_counter()
        steps = run()
        rates.append(steps / (time.perf_counter() - began))
    return {"median": statistics.median(rates), "best": max(rates)}


def measure(policy_name: str, repetitions: int, *, ppo: bool = False) -> dict[str, Any]:
    """Measure everything: rates [1/s], shares, times [s] and memory [MB], as JSON holds them.

    Parameters
    ----------
    policy_name : str
        Trained policy to run, on the problem that it is for.
    repetitions, ppo : int, bool
        How often to measure, and whether to time a training with PPO.
    """
    policy = load_policy(policy_name)
    problem = policy.problem
    simulator, few = Simulator(problem), min(repetitions, SLOW_REPETITIONS)
    rollouts = [
        row for size in BATCHES for row in _measure_rollouts(simulator, policy, size, repetitions)
    ]
    vector, single = ReachVectorEnv(VECTOR_ENVS, problem), ReachEnv(problem)
    document = {
        "machine": {"architecture": platform.machine(), "threads": available_threads()},
        "versions": package_versions(),
        "commit": source_commit(),
        "policy": policy_name,
        "repetitions": repetitions,
        "rollouts": rollouts,
        "vector_environment": _measure_env(vector, (VECTOR_STEPS, VECTOR_ENVS), repetitions),
        "single_environment": _measure_env(single, (SINGLE_STEPS,), repetitions),
        "table_1_training": measure_training(problem, few),
        "oracle": {
            "trials": ORACLE_TRIALS,
            "trials_per_second": timed(lambda: solved_trials(problem), few),
        },
        "evaluation": measure_evaluation(),
    }
    return {**document, "ppo_training": measure_ppo(problem)} if ppo else document


def _measure_rollouts(
    simulator: Simulator, policy: Policy, batch: int, repetitions: int
) -> list[dict[str, Any]]:
    """Steps per second of a batch of episodes: random and trained, on one and all threads."""
    rng = np.random.default_rng(batch)
    starts, goals = simulator.sample(rng, batch)
    actions = rng.uniform(-1, 1, (batch, simulator.task.horizon, simulator.n_actions))
    runs: dict[str, Callable[[], int]] = {
        "random": lambda: int(simulator.rollout_actions(actions, starts, goals).steps.sum()),
        "trained": lambda: int(simulator.rollout(policy, starts, goals).steps.sum()),
    }
    rows = []
    for name, run in runs.items():
        before = simulator.checked_by_coal
        tested = simulator.world.rules.parts * run()
        share = (simulator.checked_by_coal - before) / tested
        for threads in sorted({1, available_threads()}):
            simulator.threads = threads
            row = {"batch": batch, "actions": name, "threads": threads}
            row |= {"steps_per_second": timed(run, repetitions), "judged_share": share}
            rows.append(row)
    return rows


def _measure_env(
    env: ReachEnv | ReachVectorEnv, shape: tuple[int, ...], repetitions: int
) -> dict[str, float]:
    """Steps per second of all arms of an environment, on random actions.

    The shape has the steps of a measurement, and the number of arms of a vector environment.
    """
    env.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1, 1, (*shape, env.simulator.n_actions))

    def run() -> int:
        for action in actions:
            _, _, *over, _ = env.step(action)
            if isinstance(env, ReachEnv) and any(over):
                env.reset()
        return math.prod(shape)

    return timed(run, repetitions)


def measure_training(problem: ReachProblem, repetitions: int) -> dict[str, Any]:
    """Time and steps of a training with Table 1's settings."""
    config = recipe("ars", "paper", problem=problem)
    ends = [train_policy(config).curve[-1] for _ in range(repetitions)]
    seconds = [end.wall_time for end in ends]
    return {
        "seconds": {"median": statistics.median(seconds), "best": min(seconds)},
        "environment_steps": ends[-1].environment_steps,
    }


def measure_ppo(problem: ReachProblem) -> dict[str, Any]:
    """Time and steps of a training with PPO's recipe ``paper``."""
    config = recipe("ppo", "paper", problem=problem)
    train_policy(replace(config, iterations=1))  # compiles
    state = train_policy(config).state
    return {"seconds": state.wall_time, "environment_steps": state.environment_steps}


def solved_trials(problem: ReachProblem) -> int:
    """Let the oracle solve some trials, and return their number."""
    oracle = Oracle(problem)
    oracle.solve_batch(*oracle.simulator.sample(np.random.default_rng(0), ORACLE_TRIALS))
    return ORACLE_TRIALS


RUN_AND_TELL = """
import resource, subprocess, sys
run = [sys.executable, "-P", "-m", *sys.argv[1:]]
subprocess.run(run, stdout=subprocess.DEVNULL, check=True)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
"""
"""A small process in between: peak memory counts that of the parent."""


def measure_evaluation() -> dict[str, float]:
    """Time [s] and peak memory [MB] of ``kinarm-eval --trials 200`` as its own process.

    First nothing is compiled; then the bounds of the trials are unknown; then they are known.
    """
    command = ("kinarm", "eval", "--trials", "200", "--json")
    with tempfile.TemporaryDirectory() as compiled, tempfile.TemporaryDirectory() as bounds:
        known = {CACHE_VARIABLE: bounds}
        new = {CACHE_VARIABLE: compiled, "NUMBA_CACHE_DIR": compiled}
        runs = [_time_and_memory(command, env) for env in (new, known, known)]
    (first, _), (unbounded, _), (seconds, _) = runs
    return {
        "seconds_first": first,
        "seconds_without_bounds": unbounded,
        "seconds": seconds,
        "peak_memory_mb": max(peak for _, peak in runs[1:]),
    }


def _time_and_memory(command: Iterable[str], env: Mapping[str, str]) -> tuple[float, float]:
    """Time [s] and peak memory [MB] of a module as its own process."""
    began = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", RUN_AND_TELL, *command],
        stdout=subprocess.PIPE,
        env={**os.environ, **env},
        check=False,
    )
    if done.returncode:
        raise WorkerError("an evaluation that was to be measured ended unexpectedly")
    return time.perf_counter() - began, int(done.stdout) / 1024

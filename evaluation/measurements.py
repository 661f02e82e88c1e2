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
from typing import Any, NamedTuple

import gymnasium
import numpy as np

from kinarm._parallel import available_threads
from kinarm.envs import ReachEnv, ReachVectorEnv
from kinarm.errors import MissingExtraError
from kinarm.evaluation.bounds import CACHE_VARIABLE
from kinarm.policies.learners import train_policy
from kinarm.policies.library import load_policy
from kinarm.policies.oracle import Oracle
from kinarm.policies.policy import Policy
from kinarm.policies.provenance import package_versions, source_commit
from kinarm.policies.recipes import recipe
from kinarm.policies.sb3.environment import sb3_vec_env
from kinarm.problem import ReachProblem
from kinarm.reference import ReferenceSimulator
from kinarm.simulator import Simulator

BATCHES = (48, 512, 4096)
HEADLINE_BATCH = 512
"""Batch whose trained rollouts on all threads are compared with the reference path."""
VECTOR_ENVS = 64
VECTOR_STEPS, SINGLE_STEPS = 200, 2000
DUMMY_STEPS = 20
PICTURES = 40
ORACLE_TRIALS = 200
REFERENCE_TRIALS = 24
SLOW_REPETITIONS = 3
"""How often, at most, is measured what takes seconds."""


class Timing(NamedTuple):
    """Rates over several repetitions [1/s]."""

    median: float
    best: float


def measure(policy_name: str, repetitions: int, *, ppo: bool = False) -> dict[str, Any]:
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
    return {
        "machine": {"architecture": platform.machine(), "threads": available_threads()},
        "versions": package_versions(),
        "commit": source_commit(),
        "policy": policy_name,
        "repetitions": repetitions,
        "rollouts": rollouts,
        "reference": reference._asdict(),
        "speed_up_over_reference": fast["steps_per_second"]["median"] / reference.median,
        "vector_environment": measure_vector_env(problem, repetitions)._asdict(),
        "single_environment": measure_single_env(problem, repetitions)._asdict(),
        "stable_baselines3": measure_sb3(problem, repetitions),
        "pictures": measure_pictures(simulator, policy, repetitions)._asdict(),
        "table_1_training": measure_training(problem, few),
        "oracle": measure_oracle(problem, few),
        "evaluation": measure_evaluation(),
        **({"ppo_training": measure_ppo(problem)} if ppo else {}),
    }


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


def measure_vector_env(problem: ReachProblem, repetitions: int) -> Timing:
    """Steps per second of the native batch environment, on random actions."""
    env = ReachVectorEnv(VECTOR_ENVS, problem)
    env.reset(seed=0)
    shape = (VECTOR_STEPS, VECTOR_ENVS, env.simulator.n_actions)
    actions = np.random.default_rng(0).uniform(-1, 1, shape)

    def run() -> int:
        for action in actions:
            env.step(action)
        return VECTOR_STEPS * VECTOR_ENVS

    return timed(run, repetitions)


def measure_single_env(problem: ReachProblem, repetitions: int) -> Timing:
    """Steps per second of the single environment without wrappers, on random actions."""
    env = ReachEnv(problem)
    env.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1, 1, (SINGLE_STEPS, env.simulator.n_actions))

    def run() -> int:
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
        return SINGLE_STEPS

    return timed(run, repetitions)


def measure_sb3(problem: ReachProblem, repetitions: int) -> dict[str, Any]:
    """Steps per second of `sb3_vec_env`, and of single arms in their ``DummyVecEnv``.

    Where Stable-Baselines3 is missing, ``skipped`` says so.
    """
    try:
        native = sb3_vec_env(problem, VECTOR_ENVS, seed=0)
    except MissingExtraError as error:
        return {"skipped": str(error)}
    from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv

    def make() -> gymnasium.Env[Any, Any]:
        return gymnasium.make("kinarm/ReachRight-v0", problem=problem, observation_dtype=np.float32)

    def rate(env: VecEnv, steps: int) -> Timing:
        env.reset()
        shape = (steps, VECTOR_ENVS, native.simulator.n_actions)
        actions = np.random.default_rng(0).uniform(-1, 1, shape).astype(np.float32)

        def run() -> int:
            for action in actions:
                env.step(action)
            return steps * VECTOR_ENVS

        return timed(run, repetitions)

    batch = rate(native, VECTOR_STEPS)
    dummy = rate(DummyVecEnv([make] * VECTOR_ENVS), DUMMY_STEPS)
    return {
        "native": batch._asdict(),
        "dummy": dummy._asdict(),
        "speed_up": batch.median / dummy.median,
    }


def measure_pictures(simulator: Simulator, policy: Policy, repetitions: int) -> Timing:
    """Pictures per second of an environment's usual size, on one core, with the tool's ways."""
    from kinarm.viewer import Renderer

    renderer = Renderer(simulator.problem)
    starts, goals = simulator.sample(np.random.default_rng(0), PICTURES)
    rollouts = simulator.rollout(policy, starts, goals, record=True)
    ways = [
        [simulator.arm.tool_position(state) for state in path[: steps + 1]]
        for path, steps in zip(rollouts.paths, rollouts.steps, strict=True)
    ]

    def run() -> int:
        for state, goal, way in zip(rollouts.configurations, goals, ways, strict=True):
            renderer.render(state, goal, trace=way)
        return len(goals)

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


def measure_oracle(problem: ReachProblem, repetitions: int) -> dict[str, Any]:
    """Trials that the oracle solves per second."""
    oracle = Oracle(problem)
    starts, goals = oracle.simulator.sample(np.random.default_rng(0), ORACLE_TRIALS)

    def run() -> int:
        oracle.solve_batch(starts, goals)
        return ORACLE_TRIALS

    return {"trials": ORACLE_TRIALS, "trials_per_second": timed(run, repetitions)._asdict()}


def measure_ppo(problem: ReachProblem) -> dict[str, Any]:
    """Time, steps and the simulator's share of a training with PPO's tuned recipe.

    Where it cannot be trained, ``skipped`` says why.
    """
    config = recipe("ppo", "tuned", problem=problem)
    try:
        train_policy(replace(config, iterations=1))  # imports torch and compiles
    except MissingExtraError as error:
        return {"skipped": str(error)}
    state = train_policy(config).state
    return {
        "seconds": state.wall_time,
        "environment_steps": state.environment_steps,
        "simulator_share": state.simulator_time / state.wall_time,
    }


def measure_evaluation() -> dict[str, float]:
    """Time [s] and peak memory [MB] of ``kinarm-eval --trials 200`` as a process of its own.

    The first time, the bounds of the trials are not known; then they are.
    """
    module = "kinarm.evaluation.commands.evaluate"
    command = [sys.executable, "-P", "-m", module, "--trials", "200", "--json"]
    seconds = []
    with tempfile.TemporaryDirectory() as folder:
        env = {**os.environ, CACHE_VARIABLE: folder}
        for _ in range(2):
            began = time.perf_counter()
            subprocess.run(command, stdout=subprocess.DEVNULL, check=True, env=env)
            seconds.append(time.perf_counter() - began)
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    before, after = seconds
    return {"seconds_without_bounds": before, "seconds": after, "peak_memory_mb": peak / 1024}

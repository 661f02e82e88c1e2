"""How fast everything is on this machine: rates, times and memory of what users run."""

import os
import platform
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np

from kinarm._archive import CACHE_VARIABLE
from kinarm._parallel import available_threads
from kinarm.envs import ReachEnv, ReachVectorEnv
from kinarm.errors import MissingExtraError, WorkerError
from kinarm.policies.learners import train_policy
from kinarm.policies.library import load_policy
from kinarm.policies.oracle import Oracle
from kinarm.policies.policy import Policy
from kinarm.policies.provenance import package_versions, source_commit
from kinarm.policies.recipes import recipe
from kinarm.policies.sb3.environment import sb3_vec_env
from kinarm.problem import PROBLEMS, ReachProblem
from kinarm.reference import ReferenceSimulator
from kinarm.simulator import Simulator

BATCHES = (48, 512, 4096)
HEADLINE_BATCH = 512
"""Batch whose trained rollouts on all threads are compared with the reference path."""
SLOW_REPETITIONS = 3
"""How often, at most, is measured what takes seconds."""
ROBOTS = ("ur5", "panda")
"""Arms with meshes, of the extra robots."""
ROBOT_ITERATIONS = 20
"""Iterations of ARS after which a policy no longer acts at random."""
REFERENCE_TRIALS, ORACLE_TRIALS = 24, 200
VECTOR_ENVS = 64
VECTOR_STEPS, SINGLE_STEPS, DUMMY_STEPS = 200, 2000, 20
PICTURES = 40


def timed(run: Callable[[], int], repetitions: int) -> dict[str, float]:
    """Time something that returns how many steps it took; the first run is not counted."""
    return alternated({"": run}, repetitions)[""]


def alternated(
    runs: Mapping[str, Callable[[], int]], repetitions: int
) -> dict[str, dict[str, float]]:
    """Time several things by turns, so that other work of the machine slows all of them.

    Each returns how many steps it took, and its first run is not counted. What is found are the
    median and the best rate of each [1/s].
    """
    for run in runs.values():
        run()
    rates: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(repetitions):
        for name, run in runs.items():
            began = time.perf_counter()
            steps = run()
            rates[name].append(steps / (time.perf_counter() - began))
    return {
        name: {"median": statistics.median(each), "best": max(each)} for name, each in rates.items()
    }


def measure(policy_name: str, repetitions: int, *, ppo: bool = False) -> dict[str, Any]:
    """Measure everything.

    Parameters
    ----------
    policy_name : str
        Trained policy to run, on the problem that it is for.
    repetitions : int
        How often each figure is measured.
    ppo : bool
        Whether to time a training with PPO as well.

    Returns
    -------
    dict
        Figures that JSON can hold: rates [1/s], shares, times [s] and memory [MB].
    """
    policy = load_policy(policy_name)
    problem = policy.problem
    simulator = Simulator(problem)
    rollouts = [
        row for size in BATCHES for row in measure_rollouts(simulator, policy, size, repetitions)
    ]
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
        "robots": measure_robots(repetitions),
        "reference": reference,
        "speed_up_over_reference": fast["steps_per_second"]["median"] / reference["median"],
        "vector_environment": measure_vector_env(problem, repetitions),
        "single_environment": measure_single_env(problem, repetitions),
        "stable_baselines3": measure_sb3(problem, repetitions),
        "pictures": measure_pictures(simulator, policy, repetitions),
        "table_1_training": measure_training(problem, few),
        "oracle": measure_oracle(problem, few),
        "evaluation": measure_evaluation(),
    }
    if ppo:
        document["ppo_training"] = measure_ppo(problem)
    return document


def measure_rollouts(
    simulator: Simulator, policy: Policy, batch: int, repetitions: int
) -> list[dict[str, Any]]:
    """Steps per second of whole episodes: random and trained, on one and on all threads.

    Parameters
    ----------
    simulator : Simulator
        What to step.
    policy : Policy
        The trained policy.
    batch, repetitions : int
        How many episodes, and how often.
    """
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
        judged_before = simulator.checked_by_coal
        steps = run()
        row = {"batch": batch, "actions": name}
        judged_share = (simulator.checked_by_coal - judged_before) / (tested * steps)
        for threads in sorted({1, available_threads()}):
            simulator.threads = threads
            rates = {"threads": threads, "steps_per_second": timed(run, repetitions)}
            rows.append(row | rates | {"judged_share": judged_share})
    return rows


def measure_robots(repetitions: int) -> list[dict[str, Any]]:
    """Rates of arms with meshes, as of `measure_rollouts`; ``skipped`` says why there are none.

    Their policies are trained for seconds, so that episodes are no random walks.
    """
    rows: list[dict[str, Any]] = []
    for arm in ROBOTS:
        try:
            problem = PROBLEMS["right"].replace(arm=arm)
            config = recipe("ars", "paper", problem=problem, iterations=ROBOT_ITERATIONS)
            policy = train_policy(config).policy
        except MissingExtraError as error:
            return [{"skipped": str(error)}]
        measured = measure_rollouts(Simulator(problem), policy, HEADLINE_BATCH, repetitions)
        rows += [{"arm": arm, **row} for row in measured]
    return rows


def measure_reference(simulator: Simulator, policy: Policy, repetitions: int) -> dict[str, float]:
    """Steps per second of the slow reference path, on the trained policy."""
    reference = ReferenceSimulator(simulator)
    starts, goals = simulator.sample(np.random.default_rng(0), REFERENCE_TRIALS)

    def run() -> int:
        episodes = [reference.rollout(policy, *pair) for pair in zip(starts, goals, strict=True)]
        return sum(len(episode.rewards) for episode in episodes)

    return timed(run, repetitions)


def measure_vector_env(problem: ReachProblem, repetitions: int) -> dict[str, float]:
    """Steps per second of the native batch environment, on random actions."""
    env = ReachVectorEnv(VECTOR_ENVS, problem)
    env.reset(seed=0)
    return _stepped(env, VECTOR_STEPS, env.simulator.n_actions, np.float64, repetitions)


def measure_single_env(problem: ReachProblem, repetitions: int) -> dict[str, float]:
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
    from stable_baselines3.common.vec_env import DummyVecEnv

    def make() -> gymnasium.Env[Any, Any]:
        return gymnasium.make("kinarm/ReachRight-v0", problem=problem, observation_dtype=np.float32)

    found: dict[str, Any] = {}
    dummy = DummyVecEnv([make] * VECTOR_ENVS)
    for name, env, steps in (("native", native, VECTOR_STEPS), ("dummy", dummy, DUMMY_STEPS)):
        env.reset()
        found[name] = _stepped(env, steps, native.simulator.n_actions, np.float32, repetitions)
    return {**found, "speed_up": found["native"]["median"] / found["dummy"]["median"]}


def _stepped(
    env: Any, steps: int, n_actions: int, kind: type[np.floating[Any]], repetitions: int
) -> dict[str, float]:
    """Steps per second of all arms of a batch, on random actions of a kind."""
    shape = (steps, VECTOR_ENVS, n_actions)
    actions = np.random.default_rng(0).uniform(-1, 1, shape).astype(kind)

    def run() -> int:
        for action in actions:
            env.step(action)
        return steps * VECTOR_ENVS

    return timed(run, repetitions)


def measure_pictures(simulator: Simulator, policy: Policy, repetitions: int) -> dict[str, float]:
    """Pictures per second of an environment's usual size, on one core, with the tool's paths."""
    from kinarm.viewer import Renderer

    renderer = Renderer(simulator.problem)
    starts, goals = simulator.sample(np.random.default_rng(0), PICTURES)
    rollouts = simulator.rollout(policy, starts, goals, record=True)
    traces = [
        [simulator.arm.tool_position(state) for state in path[: steps + 1]]
        for path, steps in zip(rollouts.paths, rollouts.steps, strict=True)
    ]

    def run() -> int:
        for state, goal, trace in zip(rollouts.configurations, goals, traces, strict=True):
            renderer.render(state, goal, trace=trace)
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


def measure_oracle(problem: ReachProblem, repetitions: int) -> dict[str, Any]:
    """Trials that the oracle solves per second."""
    oracle = Oracle(problem)
    starts, goals = oracle.simulator.sample(np.random.default_rng(0), ORACLE_TRIALS)

    def run() -> int:
        oracle.solve_batch(starts, goals)
        return ORACLE_TRIALS

    return {"trials": ORACLE_TRIALS, "trials_per_second": timed(run, repetitions)}


RUN_AND_TELL = """
import resource, subprocess, sys
run = [sys.executable, "-P", "-m", *sys.argv[1:]]
subprocess.run(run, stdout=subprocess.DEVNULL, check=True)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
"""
"""A small process in between: the peak memory of another one counts that which started it."""


def measure_evaluation() -> dict[str, float]:
    """Time [s] and peak memory [MB] of ``kinarm-eval --trials 200`` as its own process.

    The first time, nothing is compiled; then the bounds of the trials are not known; then they are.
    """
    module = "kinarm.evaluation.commands.evaluate"
    command = [sys.executable, "-c", RUN_AND_TELL, module, "--trials", "200", "--json"]
    with tempfile.TemporaryDirectory() as compiled, tempfile.TemporaryDirectory() as bounds:
        known = {**os.environ, CACHE_VARIABLE: bounds}
        new = {**os.environ, CACHE_VARIABLE: compiled, "NUMBA_CACHE_DIR": compiled}
        runs = [_time_and_memory(command, env) for env in (new, known, known)]
    (first, _), (unbounded, _), (seconds, _) = runs
    return {
        "seconds_first": first,
        "seconds_without_bounds": unbounded,
        "seconds": seconds,
        "peak_memory_mb": max(peak for _, peak in runs[1:]),
    }


def _time_and_memory(command: list[str], env: Mapping[str, str]) -> tuple[float, float]:
    """Time [s] of processes that end with this one, and what they print [KB] in MB."""
    began, pipe = time.perf_counter(), subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, env=env, start_new_session=True) as process:
        try:
            told, _ = process.communicate()
        except BaseException:
            os.killpg(process.pid, signal.SIGKILL)
            raise
    if process.returncode:
        raise WorkerError("an evaluation that was to be measured ended unexpectedly")
    return time.perf_counter() - began, int(told) / 1024

"""How near the simulator comes to what a core attains, and where time goes.

``python -m docs.measurements.limits`` prints it for a trained policy, ``--policy`` for another.
Operations are counted in a process of its own, whose kernels are compiled to count along.
"""

import argparse
import cProfile
import json
import os
import pstats
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from docs.measurements.counting import KINDS, OperationCounter
from docs.measurements.turns import alternated
from kinarm.errors import MissingExtraError
from kinarm.evaluation.report.templating import markdown_table
from kinarm.kernels.compiling import Array, kernel
from kinarm.kernels.lanes import LANES, as_lanes
from kinarm.policies import Policy, load_policy, recipe
from kinarm.policies.learners import find_learner
from kinarm.problem import ReachProblem
from kinarm.simulator import Simulator

CHAINS = 6
"""Independent sums: as many as hide the latency, and as fit into sixteen registers."""
TURNS = 50_000_000
COUNTED, BATCH = 512, 4096
"""Episodes whose operations are counted, and that are timed."""
PROFILED_ITERATIONS = 20
LIBRARIES = ("torch", "stable_baselines3", "numpy", "scipy")
LEAST_OPERATIONS, LEAST_TIME = 0.005, 0.03
"""Shares below which functions and places are not named."""


@kernel
def multiply_and_add(turns: int, space: Array) -> None:
    """Multiply and add in `CHAINS` lanes, ``space[2:]``; not contracted, as in the simulator.

    Parameters
    ----------
    turns : int
        How often.
    space : ndarray, shape (2 + CHAINS, LANES)
        Factor, summand, and what they are applied to.
    """
    values = as_lanes(space)
    factor, summand = values[0], values[1]
    a, b, c = values[2], values[3], values[4]
    d, e, f = values[5], values[6], values[7]
    for _ in range(turns):
        a = a * factor + summand
        b = b * factor + summand
        c = c * factor + summand
        d = d * factor + summand
        e = e * factor + summand
        f = f * factor + summand
    values[2], values[3], values[4] = a, b, c
    values[5], values[6], values[7] = d, e, f


def measure_attainable(policy: Policy, repetitions: int) -> dict[str, dict[str, float]]:
    """Operations per second of one core, and steps per second of rollouts on it, by turns."""
    simulator = Simulator(policy.problem, threads=1)
    scenarios = simulator.sample(np.random.default_rng(BATCH), BATCH)
    space = np.zeros((2 + CHAINS, LANES))
    space[0], space[1] = 0.999, 0.001

    def multiply() -> int:
        multiply_and_add(TURNS, space)
        return 2 * CHAINS * LANES * TURNS

    def roll() -> int:
        return int(simulator.rollout(policy, *scenarios).steps.sum())

    return alternated({"operations": multiply, "steps": roll}, repetitions)


def measure_operations(policy_name: str) -> dict[str, Any]:
    """Operations that one step takes, as of `count_operations`, in a process of its own."""
    command = [sys.executable, "-m", "docs.measurements.limits", "--count", "--policy", policy_name]
    with tempfile.TemporaryDirectory() as folder:
        env = {**os.environ, "NUMBA_CACHE_DIR": folder}
        done = subprocess.run(command, capture_output=True, check=True, env=env, text=True)
    counts: dict[str, Any] = json.loads(done.stdout)
    return counts


def count_operations(policy_name: str) -> dict[str, Any]:
    """Run a policy with counters: operations a step, in all, by kind and by function.

    Idle lanes count as busy ones, since the machine is as busy with them.
    """
    counter = OperationCounter()
    policy = load_policy(policy_name)
    simulator = Simulator(policy.problem, threads=1)
    with counter.active():
        scenarios = simulator.sample(np.random.default_rng(COUNTED), COUNTED)
        steps = int(simulator.rollout(policy, *scenarios).steps.sum())
    counter.reset()
    simulator.rollout(policy, *scenarios)
    functions = counter.by_function()
    kinds = {kind: sum(each[kind] for each in functions.values()) / steps for kind in KINDS}
    totals = {name: sum(each.values()) / steps for name, each in functions.items()}
    ordered = sorted(totals.items(), key=lambda item: -item[1])
    return {"total": sum(kinds.values()), "kinds": kinds, "functions": dict(ordered)}


def measure_times(policy: Policy) -> Iterator[tuple[str, dict[str, float]]]:
    """Where the time of rollouts, of an iteration of ARS and of one of PPO goes, on one thread."""
    simulator = Simulator(policy.problem, threads=1)
    scenarios = simulator.sample(np.random.default_rng(BATCH), BATCH)
    simulator.rollout(policy, *scenarios)
    what = f"rollouts of {BATCH} episodes"
    yield what, time_shares(lambda: simulator.rollout(policy, *scenarios))
    for learner, name in (("ars", "paper"), ("ars", "tuned"), ("ppo", "quick")):
        try:
            run = _iterations(learner, name, policy.problem)
        except MissingExtraError:
            continue
        yield f"iteration of {learner.upper()}, `{name}`", time_shares(run)


def _iterations(learner: str, name: str, problem: ReachProblem) -> Callable[[], object]:
    """Iterations of a training, which is warmed up."""
    few = 1 if learner == "ppo" else PROFILED_ITERATIONS
    config = recipe(learner, name, problem=problem)
    config = replace(config, iterations=max(config.iterations, 2 * few))
    training = find_learner(learner).begin(config, 1)
    state = training.iterate(training.initial_state())

    def run() -> None:
        nonlocal state
        for _ in range(few):
            state = training.iterate(state)

    return run


def time_shares(run: Callable[[], object]) -> dict[str, float]:
    """Shares of time by place, largest first; those below `LEAST_TIME` are summed up.

    The profiler does not see into Pinocchio and Coal: they count for the module that calls them.
    """
    profile = cProfile.Profile()
    profile.runcall(run)
    modules = {getattr(module, "__file__", None): name for name, module in sys.modules.items()}
    seconds: dict[str, float] = {}
    for (file, _, name), entry in pstats.Stats(profile).stats.items():
        place = _place(modules.get(file), name)
        seconds[place] = seconds.get(place, 0.0) + entry[2]
    total = sum(seconds.values())
    ordered = sorted(seconds.items(), key=lambda item: -item[1])
    shares = {place: time / total for place, time in ordered if time >= LEAST_TIME * total}
    return {**shares, "everything else": 1.0 - sum(shares.values())}


def _place(module: str | None, function: str) -> str:
    """What a function belongs to."""
    if module and module.startswith("kinarm"):
        return "compiled kernels" if ".kernels." in module else module
    for library in LIBRARIES:
        if (module or function).startswith(library) or (not module and library in function):
            return library
    return "Python"


def page(policy_name: str, repetitions: int) -> Iterator[str]:
    """Measure everything; tables in Markdown."""
    policy = load_policy(policy_name)
    found, rates = measure_operations(policy_name), measure_attainable(policy, repetitions)
    total = found["total"]
    kinds = ", ".join(f"{count:,.0f} {kind}" for kind, count in found["kinds"].items())
    steps, most = rates["steps"]["median"], rates["operations"]["median"]
    yield "## Operations of a step\n"
    yield (
        f"A step takes {total:,.0f} floating-point operations ({kinds}). At {steps / 1e6:.2f} "
        f"million steps/s on one core that is {total * steps / 1e9:.1f} of {most / 1e9:.1f} "
        f"billion operations/s, {total * steps / most:.0%} of what the core attains.\n"
    )
    rows = [
        (name.removeprefix("kinarm.kernels."), f"{count:,.0f}", f"{count / total:.1%}")
        for name, count in found["functions"].items()
        if count >= LEAST_OPERATIONS * total
    ]
    header = ("where", "operations a step", "share")
    yield markdown_table(header, [*rows, ("all", f"{total:,.0f}", "100.0%")])
    yield "## Where time goes\n"
    times = (
        (what, ", ".join(f"{place} {share:.0%}" for place, share in shares.items()))
        for what, shares in measure_times(policy)
    )
    yield markdown_table(("time of", "spent in"), times)


def main() -> None:
    """Print the tables, or what was counted, as JSON."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--policy", default="ars-tuned-both", metavar="NAME_OR_FILE")
    parser.add_argument("--repetitions", type=int, default=3)
    parser.add_argument("--count", action="store_true", help="only count, and print JSON")
    given = parser.parse_args()
    if given.count:
        print(json.dumps(count_operations(given.policy)))
        return
    for part in page(given.policy, given.repetitions):
        print(part)


if __name__ == "__main__":
    main()

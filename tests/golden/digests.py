"""Digests of what must not change: trials, rollouts, training iterations and oracle solutions.

``python tests/golden/digests.py`` prints them, ``--record`` keeps them in ``digests.json`` with the
semantics of simulator and oracle that they belong to; under one version they stay as they are.
``--bits`` prints those of all bits, by which machines compare.
A digest of what a policy or settings lead to follows a hash of that policy or those settings, and
may change with it: other policies ship and recipes are tuned without another version. Numbers are
rounded to 8 decimals, far above what processors and C libraries differ by.
"""

import hashlib
import json
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from kinarm import SEMANTICS
from kinarm._fields import to_plain
from kinarm.episodes import Rollouts
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.ars import ARSState
from kinarm.policies.learners import train_policy
from kinarm.policies.library import load_policy
from kinarm.policies.oracle import ORACLE_SEMANTICS, Oracle
from kinarm.policies.recipes import recipe
from kinarm.problem import PROBLEMS as SHIPPED
from kinarm.simulator import Simulator

RECORDED = Path(__file__).with_name("digests.json")
ARMS = ("lrmate200ic_5l", "paper", "paper_flange")
TASKS = ("left", "right", "both")
PROBLEMS = {name: each.replace(tested_configurations=4) for name, each in SHIPPED.items()}
"""The paper's problems with the test of contact under which digests were first recorded."""

EPISODES = 96
RAISE = "if that is meant, raise SEMANTICS in kinarm/__init__.py or, for bounds, ORACLE_SEMANTICS"


def digest(arrays: Iterable[object], decimals: int = 8) -> str:
    """Hash of numbers, rounded."""
    content = hashlib.sha256()
    for array in arrays:
        numbers = np.asarray(array, dtype=np.float64)
        content.update(str(numbers.shape).encode())
        kept = numbers if "--bits" in sys.argv else np.round(numbers, decimals)
        content.update((kept + 0.0).tobytes())
    return content.hexdigest()[:16]


def of_rollouts(rollouts: Rollouts) -> str:
    """Hash of everything that happened."""
    return digest(
        [
            *(rollouts.success, rollouts.collision, rollouts.steps, rollouts.distance),
            *(rollouts.returns, rollouts.configurations, rollouts.targets),
            *(np.nan_to_num(rollouts.paths, nan=-9.0), rollouts.moments),
        ]
    )


def led_to(given: str, found: str) -> str:
    """A digest after a hash of what it follows from."""
    return f"{hashlib.sha256(given.encode()).hexdigest()[:8]} {found}"


def trial_digests() -> dict[str, str]:
    """Starts and goals of the trials of every arm and task."""
    found = {}
    for arm in ARMS:
        for task in TASKS:
            trials = TrialSet.draw(PROBLEMS[task].replace(arm=arm), 200, 0)
            found[f"trials {arm} {task}"] = digest([trials.starts, trials.goals], 12)
    return found


def rollout_digests() -> dict[str, str]:
    """Rollouts of random actions and of shipped policies on every arm and task."""
    found = {}
    for arm in ARMS:
        for task in TASKS:
            simulator = Simulator(PROBLEMS[task].replace(arm=arm))
            rng = np.random.default_rng(5)
            starts, goals = simulator.sample(rng, EPISODES)
            actions = rng.uniform(-1, 1, (EPISODES, 64, simulator.n_actions))
            found[f"rollouts {arm} {task} random"] = of_rollouts(
                simulator.rollout_actions(actions, starts, goals, record=True)
            )
            groups = (f"ars-paper-{task}", "ars-tuned-both", "ppo-best-both")
            for group in (*groups, f"ppo-paper-{task}") if arm == "paper" else groups:
                policy = load_policy(f"{group}-seed1")
                shift = np.linspace(-0.5, 0.5, policy.n_observations)
                found[f"rollouts {arm} {task} {group.rpartition('-')[0]}"] = led_to(
                    json.dumps([layer.weights.tolist() for layer in policy.layers]),
                    of_rollouts(simulator.rollout(policy, starts, goals, record=True, shift=shift)),
                )
    return found


def ars_digests() -> dict[str, str]:
    """Ten iterations of Augmented Random Search."""
    found = {}
    again = {"replay_share": 0.5}
    settings = (
        ("paper", {}),
        ("tuned", {}),
        ("tuned", again),
        ("best", {"episodes": 2}),
        ("brs", {}),
    )
    for name, changes in settings:
        for task in TASKS:
            states: list[ARSState] = []
            made = recipe("ars", name, problem=PROBLEMS[task], seed=2)
            config = replace(made, iterations=10, **changes)
            result = train_policy(config, on_iteration=states.append)
            state = states[-1]
            curve = [point[:4] for point in state.curve]
            found[f"ars {name} {task}{' replay' if changes == again else ''}"] = led_to(
                str(to_plain(config)),
                digest(
                    [
                        *(state.theta, state.normalizer.mean, state.normalizer.squares, curve),
                        *result.policy.networks().parameters,
                    ]
                ),
            )
    return found


def ppo_digests() -> dict[str, str]:
    """Three iterations of PPO."""
    from kinarm.policies.ppo import PPOState

    found = {}
    for name, task in (("paper", "right"), ("quick", "left"), ("best", "both")):
        states: list[PPOState] = []
        made = recipe("ppo", name, problem=PROBLEMS[task], seed=2)
        config = replace(made, iterations=3)
        train_policy(config, on_iteration=states.append)
        state = states[-1]
        found[f"ppo {name} {task}"] = led_to(
            str(to_plain(config)),
            digest(
                [
                    *(state.parameters, state.first_moment, state.second_moment),
                    *(state.normalizer.mean, state.normalizer.squares, *state.episodes[:4]),
                    np.nan_to_num([point[:4] for point in state.curve]),
                ]
            ),
        )
    return found


def oracle_digests() -> dict[str, str]:
    """What the oracle knows about 200 trials."""
    found = {}
    for arm, task in (("paper", "both"), ("paper_flange", "right"), ("lrmate200ic_5l", "left")):
        problem = PROBLEMS[task].replace(arm=arm)
        trials = TrialSet.draw(problem, 200, 3)
        solutions = Oracle(problem).solve_batch(trials.starts, trials.goals)
        found[f"oracle {arm} {task}"] = digest(
            [
                *(solutions.reachable, solutions.proof_complete, solutions.steps),
                *(solutions.steps_lower_bound, solutions.final_distance, solutions.actions),
                np.nan_to_num(solutions.paths, nan=-9.0),
            ]
        )
    return found


def changed(record: dict[str, Any], digests: dict[str, str]) -> list[str]:
    """Names under which a record holds another digest, or none."""
    return [name for name, found in digests.items() if record["digests"].get(name) != found]


def seal(record: dict[str, Any]) -> str:
    """Hash of a record, by which a change by hand shows."""
    content = {name: entry for name, entry in record.items() if name != "seal"}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def _given(digest: str) -> str:
    """Hash of what a digest follows from; empty if it follows from the name alone."""
    return digest.rpartition(" ")[0]


def renewed(record: dict[str, Any], digests: dict[str, str]) -> dict[str, Any]:
    """A record of the digests; refused if those of the same version and givens change."""
    versions = {"semantics": SEMANTICS, "oracle_semantics": ORACLE_SEMANTICS}
    kept = {name for name, version in versions.items() if record[name] == version}
    refused = [
        name
        for name, recorded in record["digests"].items()
        if digests.get(name) != recorded
        and _given(digests.get(name, recorded)) == _given(recorded)
        and "semantics" in kept
        and ("oracle_semantics" in kept or not name.startswith("oracle "))
    ]
    if refused:
        raise SystemExit(f"results changed under the same versions {versions}: {refused}; {RAISE}")
    made = {**versions, "digests": digests}
    return {"seal": seal(made), **made}


if __name__ == "__main__":
    found = {
        **trial_digests(),
        **rollout_digests(),
        **ars_digests(),
        **oracle_digests(),
        **ppo_digests(),
    }
    if "--record" in sys.argv:
        record = renewed(json.loads(RECORDED.read_text()), found)
        RECORDED.write_text(json.dumps(record, indent=1) + "\n")
    sys.stdout.write(json.dumps(found, indent=1) + "\n")

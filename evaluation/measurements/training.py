"""Whole trainings with the recipes of kinarm."""

import statistics
from dataclasses import replace
from typing import Any

from kinarm.errors import MissingExtraError
from kinarm.policies.learners import train_policy
from kinarm.policies.recipes import recipe
from kinarm.problem import ReachProblem


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

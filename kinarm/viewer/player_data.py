"""What the player of a page has to know, as JSON."""

from collections.abc import Sequence
from typing import Any

from kinarm.arm import Arm
from kinarm.recording import Recording
from kinarm.viewer.arm_data import arm_data
from kinarm.viewer.surroundings import OUTCOME_COLOURS, TRACE_SIDES


def player_data(
    trials: Sequence[Sequence[Recording]],
    arm: Arm,
    groups: Sequence[str] = (),
    heading: str = "",
) -> dict[str, Any]:
    """Describe an arm, what it did in one or two recordings of each trial, and their list."""
    return {
        **arm_data(arm, trials[0][0].problem.scene),
        "traceIndices": 6 * TRACE_SIDES,
        "colours": {name: f"#{colour:06x}" for name, colour in OUTCOME_COLOURS.items()},
        "trials": [_trial_data(runs) for runs in trials],
        "groups": list(groups),
        "heading": heading,
    }


def _trial_data(runs: Sequence[Recording]) -> dict[str, Any]:
    first, problem = runs[0], runs[0].problem
    return {
        "problem": problem.name,
        "trial": first.trial,
        "goal": first.goal.tolist(),
        "tolerance": problem.task.tolerance,
        "horizon": problem.task.horizon,
        "timeStep": problem.stepping.time_step,
        "floor": first.steps_lower_bound,
        "runs": [_run_data(run) for run in runs],
    }


def _run_data(run: Recording) -> dict[str, Any]:
    arrays = {
        "contactPoint": run.contact_point,
        "refused": run.refused,
        "states": run.states,
        "distances": run.distances,
    }
    lists = {name: None if value is None else value.tolist() for name, value in arrays.items()}
    return {"policy": run.policy, "outcome": run.outcome, "contact": run.contact, **lists}

"""What the player of a page has to know, as JSON."""

from collections.abc import Sequence
from typing import Any

from kinarm.arm import Arm
from kinarm.collision import body_names
from kinarm.recording import Recording
from kinarm.viewer.surroundings import OUTCOME_COLOURS, TRACE_SIDES


def player_data(trials: Sequence[Sequence[Recording]], arm: Arm) -> dict[str, Any]:
    """Describe an arm and what it did in one or two recordings of each trial."""
    chain = arm.chain
    return {
        "arm": arm.name,
        "axes": [
            {
                "translation": chain.translation[k].tolist(),
                "rotation": chain.rotation[k].tolist(),
                "axis": chain.axis[k].tolist(),
                "slides": bool(chain.prismatic[k]),
            }
            for k in range(arm.n_joints)
        ],
        "tool": chain.tool.tolist(),
        "links": {
            name: shape.parentJoint
            for name, shape in zip(body_names(arm), arm.geometry.geometryObjects, strict=True)
        },
        "traceIndices": 6 * TRACE_SIDES,
        "colours": {name: f"#{colour:06x}" for name, colour in OUTCOME_COLOURS.items()},
        "trials": [_trial_data(runs) for runs in trials],
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

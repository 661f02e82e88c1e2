"""Carry out one training of a study of transfer, and judge it in the course."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kinarm.evaluation.studies.transfer.planning import PlannedTraining
from kinarm.evaluation.studies.transfer.runs import Look, TransferRun, policy_path
from kinarm.evaluation.trials import trial_set
from kinarm.policies.learners import (
    TrainingState,
    begin_training,
    run_training,
    state_policy,
    thread_options,
)


def look_iterations(iterations: int, looks: int) -> NDArray[np.int64]:
    """After how many iterations policies are judged; the first and the last are among them."""
    return np.unique(np.geomspace(1, iterations, looks).round().astype(np.int64))


def carry_out(training: PlannedTraining, folder: Path) -> TransferRun:
    """Train on one thread and judge; the policy to begin with lies in the folder."""
    config, protocol = training.config, training.protocol
    if training.source is not None:
        path = policy_path(folder, training.source)
        config = config.changed({"initial_policy": str(path)})
    trials = trial_set(config.problem, protocol.look_trials, protocol.look_seed)
    due = set(look_iterations(config.iterations, protocol.looks).tolist())
    looks: list[Look] = []

    def look(state: TrainingState) -> None:
        if state.iteration == 0 or state.iteration in due:
            policy = state_policy(config, state)
            rollouts = trials.simulator.rollout(policy, trials.starts, trials.goals)
            ended = int(rollouts.success.sum()), int(rollouts.collision.sum())
            looks.append(Look(state.iteration, state.environment_steps, *ended))

    begun = begin_training(config, **thread_options(config, 1))
    state = begun.initial_state()
    look(state)
    result = run_training(config, begun, state=state, on_iteration=look)
    return TransferRun(result.policy, tuple(looks))

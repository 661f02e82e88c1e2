"""Run one training of a reproduction and evaluate its policy."""

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinarm.evaluation.reproduction.runs import TrainedRun
from kinarm.evaluation.reproduction.study import LITERAL, PlannedTraining, Protocol
from kinarm.evaluation.trials import TrialSet, trial_set
from kinarm.policies.learners import TrainingState, state_policy, thread_options, train_policy
from kinarm.policies.policy import Policy
from kinarm.problem import ReachProblem
from kinarm.rollouts import Rollouts


def final_trials(problem: ReachProblem, protocol: Protocol) -> TrialSet:
    """Trials that final policies face.

    Those of the paper's tasks are crossed where spread and seed are the same: trial by trial, all
    tasks have the same start, and goals at the same place of the left or of the right bench.
    """
    return trial_set(problem, protocol.trials, protocol.seed)


def snapshot_iterations(iterations: int, snapshots: int) -> NDArray[np.int64]:
    """After which iterations (from 0) policies are judged; the last is always among them."""
    ends = np.linspace(0, iterations, snapshots + 1)[1:].round()
    return np.unique(ends.astype(np.int64)) - 1


def carry_out(
    training: PlannedTraining, protocol: Protocol, threads: int
) -> tuple[Policy, TrainedRun]:
    """Train and judge; the result does not depend on the threads."""
    _load_kernels()
    config = training.config
    trials = trial_set(config.problem, protocol.snapshot_trials, protocol.snapshot_seed)
    snapshots = snapshot_iterations(config.iterations, protocol.snapshots)
    distance: list[NDArray[np.float32]] = []

    def judge(state: TrainingState) -> None:
        if state.iteration - 1 in snapshots:
            rollouts = _face(state_policy(config, state), trials)
            distance.append(rollouts.distance.astype(np.float32))

    options: dict[str, Any] = dict(thread_options(config, threads))
    policy, curve, _ = train_policy(config, on_iteration=judge, **options)
    final = _face(policy, final_trials(config.problem, protocol))
    run = TrainedRun(
        returns=np.array([point.mean_return for point in curve]),
        environment_steps=np.array([point.environment_steps for point in curve]),
        wall_time=np.array([point.wall_time for point in curve]),
        snapshots=snapshots,
        snapshot_distance=np.array(distance),
        distance=final.distance,
        collision=final.collision,
        steps=final.steps,
    )
    return policy, run


def _face(policy: Policy, trials: TrialSet) -> Rollouts:
    return trials.simulator.rollout(policy, trials.starts, trials.goals)


@cache
def _load_kernels() -> None:
    """Load the compiled kernels, before any clock runs."""
    trials = trial_set(LITERAL.problem("left"), 1, 0)
    simulator = trials.simulator
    actions = np.zeros((1, simulator.task.horizon, simulator.n_actions))
    simulator.rollout_actions(actions, trials.starts, trials.goals)

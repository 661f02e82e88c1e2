"""Carry out one training of a study and judge what it came to."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinarm.arm import DEFAULT_ARM, Arm
from kinarm.evaluation.entrants import BASELINES
from kinarm.evaluation.reproduction.runs import RunStore, TrainedRun
from kinarm.evaluation.reproduction.study import LITERAL, Protocol, Reading, Training
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.ars import ARSState, state_policy, train_ars
from kinarm.policies.ars_config import ARSConfig
from kinarm.policies.policy import Policy
from kinarm.policies.ppo import ppo_policy, train_ppo
from kinarm.policies.ppo_state import PPOState
from kinarm.simulator import Simulator
from kinarm.task import load_task


@cache
def trial_set(task: str, start_spread: float, trials: int, seed: int) -> TrialSet:
    """Trials of a task with the starts of a reading, drawn once in a process.

    Those of one spread and seed are crossed: trial by trial, all tasks have the same start, and
    goals at the same place of the left or of the right bench.
    """
    simulator = Simulator(DEFAULT_ARM, load_task(task, start_spread=start_spread))
    return TrialSet.draw(simulator, trials, seed)


def final_trials(task: str, reading: Reading, protocol: Protocol) -> TrialSet:
    """Trials that final policies face."""
    return trial_set(task, reading.start_spread, protocol.trials, protocol.seed)


@dataclass
class SnapshotTaker:
    """Judges a policy in the course of its training, and stops the clock meanwhile.

    Parameters
    ----------
    trials : TrialSet
        What the policy faces.
    iterations : ndarray of int, shape (n_snapshots,)
        After which iterations (from 0).
    policy : callable
        Makes a policy of a state of the training.
    """

    trials: TrialSet
    iterations: NDArray[np.int64]
    policy: Callable[[Any], Policy]
    distance: list[NDArray[np.float32]] = field(default_factory=list)
    wall_time: list[float] = field(default_factory=list)
    paused: float = 0.0

    def __call__(self, state: ARSState | PPOState) -> None:
        """Take note of an iteration."""
        began = time.perf_counter()
        self.wall_time.append(state.wall_time - self.paused)
        if state.iteration - 1 in self.iterations:
            policy, trials = self.policy(state), self.trials
            rollouts = trials.simulator.rollout(policy, trials.starts, trials.goals)
            self.distance.append(rollouts.distance.astype(np.float32))
        self.paused += time.perf_counter() - began


def carry_out(training: Training, protocol: Protocol, folder: Path, threads: int) -> None:
    """Train, judge and save.

    Parameters
    ----------
    training : Training
        What is trained.
    protocol : Protocol
        How it is judged.
    folder : Path
        The output folder of the reproduction.
    threads : int
        Threads of the simulator in ARS; the result does not depend on it.
    """
    _load_kernels()
    config, reading = training.config, training.reading
    iterations = np.linspace(0, config.iterations, protocol.snapshots + 1)[1:].round() - 1
    taker = SnapshotTaker(
        trials=trial_set(
            config.task, reading.start_spread, protocol.snapshot_trials, protocol.snapshot_seed
        ),
        iterations=np.unique(iterations.astype(np.int64)),
        policy=_policy_of(training),
    )
    if isinstance(config, ARSConfig):
        policy, curve = train_ars(config, on_iteration=taker, threads=threads)
    else:
        policy, curve, _ = train_ppo(config, on_iteration=taker)
    trials = final_trials(config.task, reading, protocol)
    rollouts = trials.simulator.rollout(policy, trials.starts, trials.goals)
    run = TrainedRun(
        returns=np.array([point.mean_return for point in curve]),
        environment_steps=np.array([point.environment_steps for point in curve]),
        wall_time=np.array(taker.wall_time),
        snapshots=taker.iterations,
        snapshot_distance=np.array(taker.distance),
        distance=rollouts.distance,
        collision=rollouts.collision,
        steps=rollouts.steps,
    )
    RunStore(folder, protocol).save(training, policy, run)


@cache
def _load_kernels() -> None:
    """Load what is compiled once in a process, before any clock runs."""
    BASELINES["zero"].run(final_trials("left", LITERAL, Protocol(trials=1)))


def _policy_of(training: Training) -> Callable[[Any], Policy]:
    """How to make a policy of a state of a training."""
    config = training.config
    if isinstance(config, ARSConfig):
        arm = Arm.load(config.arm)
        return lambda state: state_policy(config, arm, state)
    return lambda state: ppo_policy(config, state)

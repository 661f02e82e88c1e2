"""Carry out one task of an experiment: train and evaluate a policy, or find bounds of trials."""

import hashlib
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from kinarm import SEMANTICS
from kinarm.episodes import Rollouts
from kinarm.evaluation.experiments.curve import CurvePoint, TrialSettings
from kinarm.evaluation.experiments.plan import Run
from kinarm.evaluation.experiments.runs import (
    Checkpoint,
    Clock,
    TrialBounds,
    bounds_content,
    run_content,
    save_checkpoint,
)
from kinarm.evaluation.trials import TrialSet, trial_set
from kinarm.policies.learners import CurvePoint as IterationPoint
from kinarm.policies.learners import TrainingState, begin_training, find_learner, state_policy
from kinarm.policies.oracle import ORACLE_SEMANTICS, Oracle
from kinarm.policies.policy import Policy
from kinarm.policies.training import CHECKPOINT_SECONDS
from kinarm.problem import ReachProblem


@dataclass(frozen=True)
class BoundTask:
    """Trials of a problem, its arm pinned, whose bounds are to be found."""

    problem: ReachProblem
    trials: TrialSettings

    @property
    def name(self) -> str:
        """Its name in a line."""
        return f"oracle {self.problem.name}"

    @cached_property
    def key(self) -> str:
        """Hash of trials and oracle; the name of the file of the bounds."""
        protocol = (self.trials.count, self.trials.seed)
        described = f"{self.problem.digest} {protocol} {SEMANTICS} {ORACLE_SEMANTICS}"
        return hashlib.sha256(described.encode()).hexdigest()[:20]


class Task(NamedTuple):
    """What an executor is given to do.

    Attributes
    ----------
    work : Run or BoundTask
        A training, or trials whose bounds are to be found.
    start : Checkpoint or None
        Where the training goes on; None for its beginning.
    checkpoint : Path or None
        Where it saves how far it is; None if its files are not those of the driver.
    """

    work: Run | BoundTask
    start: Checkpoint | None = None
    checkpoint: Path | None = None


class TaskResult(NamedTuple):
    """Result of a task, as it comes back from a worker.

    Attributes
    ----------
    content : bytes
        What the file of the run or of the bounds holds.
    clock, iterations : Clock and tuple
        How long a training took, and its iterations as its learner tells of them.
    """

    content: bytes
    clock: Clock = Clock()
    iterations: tuple[IterationPoint, ...] = ()


def carry_out(task: Task, threads: int = 1, logs: Path | None = None) -> TaskResult:
    """Train and evaluate, or find bounds; threads and logs are as for `train`."""
    if isinstance(task.work, BoundTask):
        return TaskResult(bounds_content(find_bounds(task.work, threads)))
    return train(task.work, threads, start=task.start, checkpoint=task.checkpoint, logs=logs)


def find_bounds(task: BoundTask, threads: int) -> TrialBounds:
    """The bounds of some trials."""
    trials = trial_set(task.problem, task.trials.count, task.trials.seed)
    oracle = Oracle(trials.simulator.problem, threads=threads)
    solutions = oracle.solve_batch(trials.starts, trials.goals)
    return TrialBounds(solutions.reachable, solutions.steps_lower_bound)


def train(
    run: Run,
    threads: int = 1,
    *,
    start: Checkpoint | None = None,
    checkpoint: Path | None = None,
    on_point: Callable[[CurvePoint], object] | None = None,
    logs: Path | None = None,
) -> TaskResult:
    """Train and evaluate; the result depends neither on threads nor on where a training goes on.

    Parameters
    ----------
    run, threads : Run and int
        The training, and on how many threads.
    start, checkpoint
        As of a `Task`.
    on_point : callable, optional
        Is told every point of the learning curve.
    logs : Path, optional
        Folder of the logs for TensorBoard, a folder in it for each seed.
    """
    config, learner = run.config, find_learner(run.learner)
    options: dict[str, Any] = {"threads": threads} if "threads" in learner.options else {}
    if logs is not None and "tensorboard" in learner.options:
        options["tensorboard"] = logs / f"{learner.name}-seed{config.seed}"
    curve = Curve(run, start or Checkpoint(TrainingState()))
    with curve.timed():
        training = begin_training(config, **options)
        state = training.initial_state() if start is None else start.state
    if start is None:
        curve.update(state)
    saved = time.monotonic()
    while state.iteration < config.iterations:
        with curve.timed():
            state = training.iterate(state)
        if curve.update(state) and on_point is not None:
            on_point(curve.points[-1])
        if checkpoint is not None and time.monotonic() - saved > CHECKPOINT_SECONDS:
            save_checkpoint(checkpoint, run, curve.checkpoint(state))
            saved = time.monotonic()
    end, policy = curve.checkpoint(state), state_policy(config, state)
    rollouts = _face(policy, trial_set(config.problem, run.trials.count, run.trials.seed))
    return TaskResult(run_content(run, end, policy, rollouts), end.clock, state.curve)


def _face(policy: Policy, trials: TrialSet) -> Rollouts:
    """Put a policy to trials."""
    return trials.simulator.rollout(policy, trials.starts, trials.goals)


class Curve:
    """The learning curve of a training, as far as it is, and the time that it took.

    Parameters
    ----------
    run, start : Run and Checkpoint
        The training, and what there is of it.
    """

    def __init__(self, run: Run, start: Checkpoint) -> None:
        self.points, self._distances = [*start.curve], [*start.distances]
        self._run, clock = run, start.clock
        self._spent = np.array([clock.seconds, clock.processor_seconds])
        self._times = [*zip(clock.points, clock.processor_points, strict=False)]
        own = run.trials.curve or run.trials
        self._trials = trial_set(run.config.problem, own.count, own.seed)
        first = self._trials.chosen([0])
        simulator = first.simulator
        actions = np.zeros((1, simulator.task.horizon, simulator.n_actions))
        simulator.rollout_actions(actions, first.starts, first.goals)  # before any clock runs

    @contextmanager
    def timed(self) -> Iterator[None]:
        """Add the time of a part of the training that runs within it."""
        self._spent -= time.perf_counter(), time.process_time()
        yield
        self._spent += time.perf_counter(), time.process_time()

    def update(self, state: TrainingState) -> bool:
        """Add a point, and its time, if it is time for one; whether it was."""
        if not self._is_due(state):
            return False
        rollouts = _face(state_policy(self._run.config, state), self._trials)
        self.points.append(CurvePoint.of(state, rollouts))
        self._times.append(tuple(self._spent.round(3).tolist()))
        if self._run.trials.curve is not None:
            self._distances.append(rollouts.distance.astype(np.float32))
        return True

    def _is_due(self, state: TrainingState) -> bool:
        """Whether a point of the curve is reached that was not reached before."""
        settings = self._run.trials
        if settings.curve is not None:
            return state.iteration in settings.curve.iterations(self._run.config.iterations)
        if settings.per_decade == 0:
            return False
        last = self.points[-1].environment_steps if self.points else 0
        number = 0  # of the first point beyond the last one
        while last >= (due := settings.first * 10.0 ** (number / settings.per_decade)):
            number += 1
        return bool(state.environment_steps >= due)

    def checkpoint(self, state: TrainingState) -> Checkpoint:
        """How far the training is that is in a state."""
        times = tuple(zip(*self._times, strict=True)) or ((), ())
        clock = Clock(*self._spent.round(3).tolist(), *times)
        return Checkpoint(state, tuple(self.points), tuple(self._distances), clock)

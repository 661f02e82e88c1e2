"""Carry out one task of an experiment: train and evaluate a policy, or find bounds of trials."""

import hashlib
import time
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from kinarm import SEMANTICS
from kinarm.evaluation.experiments.curve import Curve, CurvePoint, TrialSettings, face
from kinarm.evaluation.experiments.plan import Run
from kinarm.evaluation.experiments.progress import Watcher
from kinarm.evaluation.experiments.runs import (
    Checkpoint,
    Clock,
    TrainedRun,
    TrialBounds,
    TrialOutcomes,
    bounds_content,
    run_content,
    save_checkpoint,
)
from kinarm.evaluation.trials import trial_set
from kinarm.policies.learners import CurvePoint as IterationPoint
from kinarm.policies.learners import (
    TrainingState,
    begin_training,
    find_learner,
    state_policy,
    thread_options,
)
from kinarm.policies.oracle import ORACLE_SEMANTICS, Oracle
from kinarm.policies.policy import Policy
from kinarm.problem import ReachProblem

CHECKPOINT_SECONDS = 5.0
"""How often a training saves how far it is [s]."""


@dataclass(frozen=True, eq=False)
class RunTask:
    """A training to be carried out.

    Attributes
    ----------
    run : Run
        The training.
    start : Checkpoint or None
        Where it goes on; None for its beginning.
    checkpoint : Path or None
        Where it saves how far it is; None if it cannot.
    watcher : Watcher or None
        Who is told how far it is.
    """

    run: Run
    start: Checkpoint | None = None
    checkpoint: Path | None = None
    watcher: Watcher | None = None

    @property
    def name(self) -> str:
        """What to call it."""
        return self.run.name

    @property
    def cost(self) -> float:
        """Rough duration, relative to other trainings."""
        done = 0 if self.start is None else self.start.state.iteration
        return self.run.cost * (1 - done / self.run.config.iterations)

    @property
    def key(self) -> str:
        """Name of its files."""
        return self.run.key

    def watched(self, watcher: Watcher) -> "RunTask":
        """The training, which tells a watcher how far it is."""
        return replace(self, watcher=watcher)


@dataclass(frozen=True)
class BoundTask:
    """Trials whose bounds are to be found.

    Attributes
    ----------
    problem : ReachProblem
        The problem, its arm pinned.
    trials : TrialSettings
        The trials.
    """

    problem: ReachProblem
    trials: TrialSettings

    @property
    def name(self) -> str:
        """What to call it."""
        return f"oracle {self.problem.name}"

    @property
    def cost(self) -> float:
        """Rough duration [s of a core]."""
        return 3e-3 * self.trials.count

    @cached_property
    def key(self) -> str:
        """Hash of trials and oracle; the name of the file of the bounds."""
        protocol = (self.trials.count, self.trials.seed)
        described = f"{self.problem.digest} {protocol} {SEMANTICS} {ORACLE_SEMANTICS}"
        return hashlib.sha256(described.encode()).hexdigest()[:20]

    def watched(self, _: Watcher) -> "BoundTask":
        """The same: it takes too little time to tell how far it is."""
        return self


class TaskResult(NamedTuple):
    """What comes back from a worker.

    Attributes
    ----------
    content : bytes
        What the file of the run or of the bounds holds.
    clock : Clock
        How long a training took.
    iterations : tuple
        The iterations of a training, as its learner tells of them.
    """

    content: bytes
    clock: Clock = Clock()
    iterations: tuple[IterationPoint, ...] = ()


def carry_out(task: RunTask | BoundTask, threads: int = 1, **options: Any) -> TaskResult:
    """Train and evaluate, or find bounds.

    The result does not depend on the number of threads, or on where a training goes on.

    Parameters
    ----------
    task : RunTask or BoundTask
        What to do.
    threads : int
        On so many threads.
    **options
        As of `train`.
    """
    if isinstance(task, BoundTask):
        return TaskResult(bounds_content(find_bounds(task, threads)))
    return train(task, threads, **options)


def find_bounds(task: BoundTask, threads: int) -> TrialBounds:
    """What the oracle knows about some trials."""
    trials = trial_set(task.problem, task.trials.count, task.trials.seed)
    oracle = Oracle(trials.simulator.problem, threads=threads)
    solutions = oracle.solve_batch(trials.starts, trials.goals)
    return TrialBounds(solutions.reachable, solutions.steps_lower_bound)


def train(
    task: RunTask,
    threads: int = 1,
    *,
    on_point: Callable[[CurvePoint], object] | None = None,
    logs: Path | None = None,
) -> TaskResult:
    """Train and evaluate.

    Parameters
    ----------
    task : RunTask
        The training.
    threads : int
        On so many threads.
    on_point : callable, optional
        Is told every point of the learning curve.
    logs : Path, optional
        Folder of the logs for TensorBoard, a folder in it for each seed.
    """
    run, config, start = task.run, task.run.config, task.start
    learner, earlier = find_learner(run.learner), start or Checkpoint(TrainingState())
    stopwatch = Stopwatch(earlier.clock)
    options: dict[str, Any] = dict(thread_options(config, threads))
    if logs is not None and "tensorboard" in learner.options:
        options["tensorboard"] = logs / f"{learner.name}-seed{config.seed}"
    with task.watcher.preparing() if task.watcher else nullcontext():
        curve = Curve(config, run.trials, earlier.curve, earlier.distances)
        with stopwatch:
            training = begin_training(config, **options)
            state = training.initial_state() if start is None else start.state
    if start is None and curve.update(state):
        stopwatch.note()
    saved = time.monotonic()
    while state.iteration < config.iterations:
        with stopwatch:
            state = training.iterate(state)
        if curve.update(state):
            stopwatch.note()
            if on_point is not None:
                on_point(curve.points[-1])
        if task.watcher is not None:
            task.watcher.update(state, config.iterations)
        if task.checkpoint is not None and time.monotonic() - saved > CHECKPOINT_SECONDS:
            done = tuple(curve.points), tuple(curve.distances), stopwatch.clock
            save_checkpoint(task.checkpoint, run, Checkpoint(state, *done))
            saved = time.monotonic()
    policy = state_policy(config, state)
    trained = _trained(run, curve, state, policy)
    return TaskResult(run_content(trained, policy), stopwatch.clock, state.curve)


def _trained(run: Run, curve: Curve, state: TrainingState, policy: Policy) -> TrainedRun:
    """What a training came to, whose policy now faces the trials."""
    trials, detailed = run.trials, run.trials.curve is not None
    rollouts = face(policy, trial_set(run.config.problem, trials.count, trials.seed))
    names = TrialOutcomes._fields
    return TrainedRun(
        settings=run.settings,
        curve=tuple(curve.points),
        last=CurvePoint.of(state, rollouts),
        outcomes=TrialOutcomes(*(np.array(getattr(rollouts, name)) for name in names)),
        returns=np.array([point.mean_return for point in state.curve]) if detailed else None,
        curve_distance=np.array(curve.distances) if detailed else None,
        state=state if run.config.can_extend else None,
    )


class Stopwatch:
    """Adds up how long the parts of a training take that run within it.

    Parameters
    ----------
    earlier : Clock
        What went before.
    """

    def __init__(self, earlier: Clock) -> None:
        self._spent = np.array([earlier.seconds, earlier.processor_seconds])
        self._points = [*zip(earlier.points, earlier.processor_points, strict=False)]

    def __enter__(self) -> None:
        self._spent -= time.perf_counter(), time.process_time()

    def __exit__(self, *_: object) -> None:
        self._spent += time.perf_counter(), time.process_time()

    def note(self) -> None:
        """Note the time of a point of the learning curve."""
        self._points.append(tuple(self._spent.round(3).tolist()))

    @property
    def clock(self) -> Clock:
        """The times so far."""
        points = tuple(zip(*self._points, strict=True)) or ((), ())
        return Clock(*self._spent.round(3).tolist(), *points)

"""Run one training of a study, and evaluate its policy."""

import hashlib
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from kinarm import SEMANTICS
from kinarm._files import first_line
from kinarm.evaluation.studies.planning import PlannedRun
from kinarm.evaluation.studies.runs import (
    RunClock,
    RunPoint,
    TrialBounds,
    TrialOutcomes,
    WholeRun,
    bounds_content,
    run_content,
)
from kinarm.evaluation.studies.specification import StudyTrials
from kinarm.evaluation.trials import trial_set
from kinarm.policies.learners import (
    TrainingState,
    begin_training,
    state_policy,
    thread_options,
)
from kinarm.policies.oracle import ORACLE_SEMANTICS, Oracle
from kinarm.policies.policy import Policy
from kinarm.problem import ReachProblem
from kinarm.rollouts import Rollouts


class Start(NamedTuple):
    """The end of a shorter training, from which a longer one goes on.

    Attributes
    ----------
    state : TrainingState
        The state that the shorter one ended in.
    curve : tuple of RunPoint
        Its learning curve.
    clock : RunClock
        What it took.
    """

    state: TrainingState
    curve: tuple[RunPoint, ...]
    clock: RunClock


@dataclass(frozen=True, eq=False)
class RunTask:
    """A training to be carried out.

    Attributes
    ----------
    run : PlannedRun
        The training.
    start : Start or None
        Where it goes on; None for its beginning.
    """

    run: PlannedRun
    start: Start | None = None

    @property
    def name(self) -> str:
        """What to call it."""
        return self.run.name

    @property
    def cost(self) -> float:
        """Rough duration, relative to other trainings."""
        done = 0 if self.start is None else self.start.state.iteration
        return self.run.cost * (1 - done / self.run.config.iterations)


@dataclass(frozen=True)
class BoundTask:
    """Trials whose bounds the task finds.

    Attributes
    ----------
    problem : ReachProblem
        The problem, its arm pinned.
    trials : StudyTrials
        The trials.
    """

    problem: ReachProblem
    trials: StudyTrials

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


class TaskResult(NamedTuple):
    """What comes back from a worker.

    Attributes
    ----------
    content : bytes
        What the file of the run or of the bounds holds; nothing if it failed.
    clock : RunClock or None
        How long a training took.
    error, trace : str
        Why it failed, in a line, and where; empty if it did not.
    """

    content: bytes
    clock: RunClock | None = None
    error: str = ""
    trace: str = ""


def carry_out(task: RunTask | BoundTask, threads: int = 1) -> TaskResult:
    """Train and judge, or find bounds; errors are returned, not raised.

    The result does not depend on the number of threads, or on where a training goes on.
    """
    try:
        if isinstance(task, BoundTask):
            return TaskResult(bounds_content(find_bounds(task, threads)))
        run, clock = train(task, threads)
        return TaskResult(run_content(run), clock)
    except Exception as error:  # whatever it is, other tasks go on
        return TaskResult(b"", None, first_line(error), traceback.format_exc())


def find_bounds(task: BoundTask, threads: int) -> TrialBounds:
    """What the oracle knows about some trials."""
    trials = trial_set(task.problem, task.trials.count, task.trials.seed)
    oracle = Oracle(trials.simulator.problem, threads=threads)
    solutions = oracle.solve_batch(trials.starts, trials.goals)
    return TrialBounds(solutions.reachable, solutions.steps_lower_bound)


def train(
    task: RunTask, threads: int = 1, on_point: Callable[[RunPoint], object] | None = None
) -> tuple[WholeRun, RunClock]:
    """Train and judge; calls ``on_point`` with every point of the learning curve."""
    began = time.process_time()
    planned = task.run
    config, trials = planned.config, planned.trials
    judge = Judge(config.problem, trials)
    training = begin_training(config, **thread_options(config, threads))
    state: TrainingState
    if task.start is None:
        state, earlier = training.initial_state(), RunClock()
    else:
        state, judge.curve, earlier = task.start.state, [*task.start.curve], task.start.clock
    times = [*earlier.points]
    while state.iteration < config.iterations:
        state = training.iterate(state)
        if judge.is_due(state.environment_steps):
            judge.look(state, state_policy(config, state))
            times.append(earlier.seconds + state.wall_time)
            if on_point is not None:
                on_point(judge.curve[-1])
    policy = state_policy(config, state)
    rollouts = judge.face(policy)
    run = WholeRun(
        settings=planned.settings,
        curve=tuple(judge.curve),
        last=point_of(state, rollouts),
        outcomes=outcomes_of(rollouts),
        policy=policy,
        state=state if config.can_extend else None,
    )
    seconds = earlier.seconds + state.wall_time
    spent = earlier.processor_seconds + time.process_time() - began
    return run, RunClock(round(seconds, 3), round(spent, 3), tuple(round(t, 3) for t in times))


class Judge:
    """Puts policies to the trials in the course of a training.

    Parameters
    ----------
    problem : ReachProblem
        What they face.
    trials : StudyTrials
        Which trials, and when.

    Attributes
    ----------
    curve : list of RunPoint
        How they did.
    """

    def __init__(self, problem: ReachProblem, trials: StudyTrials) -> None:
        self.curve: list[RunPoint] = []
        self._protocol = trials
        self._trials = trial_set(problem, trials.count, trials.seed)

    def is_due(self, environment_steps: int) -> bool:
        """Whether a point of the learning curve is reached that was not reached before."""
        if self._protocol.per_decade == 0:
            return False
        seen = self.curve[-1].environment_steps if self.curve else 0
        return self._reached(environment_steps) > self._reached(seen)

    def _reached(self, environment_steps: int) -> int:
        """How many points there are up to a number of steps."""
        protocol, number = self._protocol, 0
        while environment_steps >= protocol.first * 10.0 ** (number / protocol.per_decade):
            number += 1
        return number

    def look(self, state: TrainingState, policy: Policy) -> None:
        """Add a point to the learning curve."""
        self.curve.append(point_of(state, self.face(policy)))

    def face(self, policy: Policy) -> Rollouts:
        """Put a policy to the trials."""
        trials = self._trials
        return trials.simulator.rollout(policy, trials.starts, trials.goals)


def point_of(state: TrainingState, rollouts: Rollouts) -> RunPoint:
    """A point of a learning curve."""
    return RunPoint(
        iteration=state.iteration,
        environment_steps=state.environment_steps,
        success=float(rollouts.success.mean()),
        collision=float(rollouts.collision.mean()),
        median_distance=float(np.median(rollouts.distance)),
    )


def outcomes_of(rollouts: Rollouts) -> TrialOutcomes:
    """What is kept of rollouts."""
    return TrialOutcomes(*(np.array(getattr(rollouts, name)) for name in TrialOutcomes._fields))

"""A study: its trainings, their results, and how to run the missing ones."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kinarm._console import open_console
from kinarm._parallel import available_threads
from kinarm._validation import whole_number
from kinarm.errors import InvalidInputError
from kinarm.evaluation.running.executor import Executor
from kinarm.evaluation.running.progress import TaskProgress
from kinarm.evaluation.studies.planning import PlannedRun, planned_runs
from kinarm.evaluation.studies.runs import RunClock, TrainedRun, TrialBounds, load_whole_run
from kinarm.evaluation.studies.search import carry_out_search, searched_runs
from kinarm.evaluation.studies.specification import StudySpecification
from kinarm.evaluation.studies.store import SPECIFICATION, StudyStore
from kinarm.evaluation.studies.training import BoundTask, RunTask, Start, carry_out
from kinarm.policies.learners import find_learner
from kinarm.policies.policy import Policy
from kinarm.workers import LocalExecutor

if TYPE_CHECKING:
    import numpy as np

    from kinarm.evaluation.studies.table import Group


class Study:
    """Many trainings from one file, kept in one folder.

    Parameters
    ----------
    specification : StudySpecification, mapping, str or Path
        What is trained: a specification, what its ``to_json`` returns, or a study file.
    folder : str or Path
        Where the trainings lie, or will.

    Raises
    ------
    KinarmError
        If the specification cannot be used; in one line that names file and field.

    Attributes
    ----------
    specification : StudySpecification
        What is trained.
    runs : tuple of PlannedRun
        The trainings, whether finished or not.
    """

    def __init__(
        self,
        specification: StudySpecification | Mapping[str, Any] | str | Path,
        folder: str | Path,
    ) -> None:
        if isinstance(specification, str | Path):
            where = str(specification)
            specification = StudySpecification.load(specification)
        else:
            where = "study"
            if isinstance(specification, Mapping):
                specification = StudySpecification.from_json(specification, where)
        self.specification = specification
        self.store = StudyStore(Path(folder))
        try:
            self.runs = self._planned()
        except InvalidInputError as error:
            raise InvalidInputError(f"{where}: {error}") from error

    def _planned(self) -> tuple[PlannedRun, ...]:
        """The trainings of the specification, or those that a search chose."""
        if self.specification.search:
            return searched_runs(self.specification, self.store.folder)
        return planned_runs(self.specification)

    @classmethod
    def load(cls, folder: str | Path) -> "Study":
        """Read the study that lies in a folder.

        Raises
        ------
        InvalidInputError
            If there is none.
        """
        marker = Path(folder) / SPECIFICATION
        if not marker.is_file():
            raise InvalidInputError(f"there is no study in {str(folder)!r}")
        return cls(marker, folder)

    def __repr__(self) -> str:
        return (
            f"Study({self.specification.name!r}, {len(self.finished)} of {len(self.runs)} "
            "trainings finished)"
        )

    def __len__(self) -> int:
        return len(self.finished)

    def __iter__(self) -> Iterator[TrainedRun]:
        return iter(self.finished.values())

    @cached_property
    def finished(self) -> Mapping[PlannedRun, TrainedRun]:
        """The trainings that are finished, in the order of the study."""
        found = {run: self.store.load(run) for run in self.runs}
        return {run: trained for run, trained in found.items() if trained is not None}

    @property
    def missing(self) -> tuple[PlannedRun, ...]:
        """The trainings that are not finished."""
        return tuple(run for run in self.runs if run not in self.finished)

    @cached_property
    def bounds(self) -> Mapping[str, TrialBounds]:
        """What the oracle knows about the trials, as far as it is known, by the problem's hash."""
        found = {task.problem.digest: self.store.bounds(task) for task in self.bound_tasks}
        return {digest: bounds for digest, bounds in found.items() if bounds is not None}

    @property
    def bound_tasks(self) -> tuple[BoundTask, ...]:
        """The trials whose bounds belong to the study."""
        problems = {run.config.problem.digest: run.config.problem for run in self.runs}
        return tuple(BoundTask(each, self.specification.trials) for each in problems.values())

    @property
    def failures(self) -> Mapping[PlannedRun, str]:
        """Why trainings failed that were not finished since."""
        found = {run: self.store.failure(run) for run in self.missing}
        return {run: error for run, error in found.items() if error is not None}

    def run(
        self,
        *,
        jobs: int | None = None,
        threads: int = 1,
        executor: Executor | None = None,
    ) -> "Study":
        """Run the missing trainings; after any interruption, the same call goes on.

        A training that fails does not stop the others: see `failures`. The next call tries again.

        Parameters
        ----------
        jobs : int, optional
            Trainings at a time; one a processor by default.
        threads : int
            Threads of a training; they do not change what it comes to.
        executor : Executor, optional
            Where trainings are carried out; worker processes of this machine by default.

        Returns
        -------
        Study
            The study with what is finished.

        Raises
        ------
        KinarmError
            If the folder is that of another study or cannot be written to, a package is missing,
            or workers end unexpectedly.
        """
        whole_number("threads", threads, 1)
        jobs = available_threads() if jobs is None else whole_number("jobs", jobs, 1)
        for name in self.specification.learners:
            find_learner(name).check_installed()
        with self.store.writing(self.specification):
            if self.specification.search:
                carry_out_search(self.specification, self.store.folder, jobs, threads)
            self.refresh()
            tasks = self._tasks()
            jobs = max(1, min(jobs, len(tasks)))
            work = partial(carry_out, threads=threads)
            total = len(self.runs) + len(self.bound_tasks)
            console = open_console(stderr=True)
            with TaskProgress(total, tasks, jobs, console) as progress:
                chosen = executor or LocalExecutor(jobs, threads)
                for number, result in chosen.carry_out(work, tasks):
                    self.store.save(tasks[number], result)
                    progress.finished(tasks[number])
        self.refresh()
        return self

    def refresh(self) -> None:
        """Read the folder again."""
        if self.specification.search:
            self.runs = self._planned()
        for name in ("finished", "bounds", "_groups"):
            self.__dict__.pop(name, None)

    def _tasks(self) -> Sequence[RunTask | BoundTask]:
        """The missing tasks: first the bounds, then the trainings seed by seed."""
        known, missing = self.bounds, self.missing
        bounds = [task for task in self.bound_tasks if task.problem.digest not in known]
        starts = self._starts(missing)
        return [*bounds, *(RunTask(run, starts.get(run)) for run in missing)]

    def _starts(self, missing: Sequence[PlannedRun]) -> dict[PlannedRun, Start]:
        """Where trainings can go on that shorter ones began."""
        wanted = {run.lineage: run for run in missing if run.config.can_extend}
        shorter = self.store.shorter_runs(wanted) if wanted else {}
        starts = {}
        for run in missing:
            before = [
                found
                for found in shorter.get(run.lineage, ())
                if found[1].last.iteration < run.config.iterations
            ]
            if before:
                planned, trained = max(before, key=lambda each: each[1].last.iteration)
                made = self.store.made(planned)
                clock = RunClock(**{name: made[name] for name in RunClock._fields if name in made})
                if trained.state is not None:
                    starts[run] = Start(trained.state, trained.curve, clock)
        return starts

    def policy(self, run: PlannedRun) -> Policy:
        """The policy of a finished training, with versions and commit that made it.

        Raises
        ------
        InvalidInputError
            If the training is not finished, or its file is damaged.
        """
        trained, made = load_whole_run(self.store.run_path(run), run), self.store.made(run)
        known = {name: made[name] for name in ("versions", "commit") if name in made}
        provenance = replace(trained.policy.provenance, **known)
        return replace(trained.policy, provenance=provenance)

    def groups(self) -> "tuple[Group, ...]":
        """The finished trainings, those with the same settings but for the seed together."""
        return self._groups

    @cached_property
    def _groups(self) -> "tuple[Group, ...]":
        from kinarm.evaluation.studies.table import group_runs

        return group_runs(self)

    def table(self) -> "np.ndarray[Any, np.dtype[Any]]":
        """One row per finished training, as a structured array."""
        from kinarm.evaluation.studies.table import run_table

        return run_table(self)

    def best(self, count: int = 1) -> "tuple[Group, ...]":
        """The settings with the largest success over what the oracle reaches, best first."""
        ordered = sorted(self.groups(), key=lambda group: -group.relative_success)
        return tuple(ordered[:count])

"""A study: an experiment in its folder, how to carry it out, and what it came to."""

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any

from kinarm._files import is_being_written
from kinarm._parallel import available_threads
from kinarm._validation import whole_number
from kinarm.errors import InvalidInputError, TrainingFailedError
from kinarm.evaluation.experiments.executors import Executor, Failure, LocalExecutor
from kinarm.evaluation.experiments.experiment import Experiment
from kinarm.evaluation.experiments.plan import Run, plan
from kinarm.evaluation.experiments.progress import Progress
from kinarm.evaluation.experiments.results import Results
from kinarm.evaluation.experiments.search import carry_out_search, searched_runs
from kinarm.evaluation.experiments.store import SPECIFICATION, Store
from kinarm.evaluation.experiments.train import BoundTask, RunTask, TaskResult, carry_out
from kinarm.policies.learners import find_learner


class Study(Results):
    """An experiment, kept in one folder.

    Parameters
    ----------
    experiment : Experiment, mapping, str or Path
        What is trained: an experiment, what its ``to_json`` returns, the name of a shipped one, or
        a file.
    folder : str or Path
        Where the trainings lie, or will.
    runs : tuple of Run, optional
        The trainings, instead of those that the experiment plans.

    Raises
    ------
    KinarmError
        If the experiment cannot be used; in one line that names file and field.

    Attributes
    ----------
    experiment : Experiment
        What is trained.
    runs : tuple of Run
        The trainings, whether finished or not.
    """

    def __init__(
        self,
        experiment: Experiment | Mapping[str, Any] | str | Path,
        folder: str | Path,
        runs: tuple[Run, ...] | None = None,
    ) -> None:
        where = "experiment"
        if isinstance(experiment, str | Path):
            where, experiment = str(experiment), Experiment.load(experiment)
        elif isinstance(experiment, Mapping):
            experiment = Experiment.from_json(experiment, where)
        else:
            where = experiment.name
        super().__init__(experiment, Store(Path(folder)), ())
        try:
            self.runs = self._planned() if runs is None else runs
        except InvalidInputError as error:
            raise InvalidInputError(f"{where}: {error}") from error

    def _planned(self) -> tuple[Run, ...]:
        """The trainings of the experiment, or those that a search chose."""
        if self.experiment.search:
            return searched_runs(self.experiment, self.store.folder)
        return plan(self.experiment)

    @classmethod
    def load(cls, folder: str | Path) -> "Study":
        """Read the experiment that lies in a folder.

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
        done = f"{len(self.finished)} of {len(self.runs)} trainings finished"
        return f"{type(self).__name__}({self.experiment.name!r}, {done})"

    def run(
        self,
        *,
        jobs: int | None = None,
        threads: int = 1,
        executor: Executor | None = None,
        logs: Path | None = None,
        on_trained: Callable[[Run, TaskResult], object] = lambda *_: None,
    ) -> "Study":
        """Run the missing trainings; after any interruption, the same call goes on.

        A training that fails does not stop the others. The next call tries it again.

        Parameters
        ----------
        jobs : int, optional
            Trainings at a time; one a processor by default.
        threads : int
            Threads of a training; they do not change what it comes to.
        executor : Executor, optional
            Where trainings are carried out; worker processes of this machine by default.
        logs : Path, optional
            Folder of the logs for TensorBoard.
        on_trained : callable
            Is told of every training that is finished.

        Returns
        -------
        Study
            The study with what is finished.

        Raises
        ------
        TrainingFailedError
            If trainings failed; all others are finished then.
        KinarmError
            If the folder is that of another experiment or cannot be written to, a package is
            missing, or workers end unexpectedly.
        """
        whole_number("threads", threads, 1)
        jobs = available_threads() if jobs is None else whole_number("jobs", jobs, 1)
        for entry in self.experiment.all_entries:
            find_learner(entry.learner).check_installed()
        with self.store.writing(self.experiment) as store:
            if self.experiment.search:
                carry_out_search(self.experiment, self.store.folder, jobs, threads)
            self.refresh()
            chosen = executor or LocalExecutor(jobs, threads)
            tasks = self._tasks(checkpoints=chosen.shares_files)
            if isinstance(chosen, LocalExecutor):
                chosen = replace(chosen, jobs=max(1, min(chosen.jobs, len(tasks))))
            work = partial(carry_out, threads=threads, logs=logs)
            failures = {}
            with Progress(self._total, tasks, jobs) as progress:
                for task, result in chosen.map(work, progress.tasks):
                    if isinstance(result, Failure):
                        failures[task.name] = result.error
                    store.save(task, result)
                    if isinstance(task, RunTask) and not isinstance(result, Failure):
                        on_trained(task.run, result)
                    progress.finished(task)
        self.refresh()
        if failures:
            raise TrainingFailedError(failures, len(self.runs))
        return self

    @property
    def _total(self) -> int:
        """Number of all tasks; trainings that several entries share count once."""
        return len({run.key for run in self.runs}) + len(self.bound_tasks)

    def refresh(self) -> None:
        """Read the folder again."""
        if self.experiment.search:
            self.runs = self._planned()
        for name in ("finished", "bounds", "_groups"):
            self.__dict__.pop(name, None)

    def _tasks(self, *, checkpoints: bool) -> list[RunTask | BoundTask]:
        """The missing tasks: first the bounds, then the trainings seed by seed."""
        bounds = [task for task in self.bound_tasks if task.problem.digest not in self.bounds]
        missing = {run.key: run for run in self.missing}.values()
        starts = self.store.starts(missing)
        return [
            *bounds,
            *(
                RunTask(run, starts.get(run), self.store.checkpoint_path(run))
                if checkpoints
                else RunTask(run, starts.get(run))
                for run in missing
            ),
        ]

    def status(self) -> list[str]:
        """How far it is, in lines, while it runs or after it was stopped."""
        finished = [path for run in self.runs if (path := self.store.run_path(run)).exists()]
        remain = len(self.runs) - len(finished)
        told = [f"{self.experiment.name}: {len(finished)} of {len(self.runs)} trainings finished"]
        if remain and is_being_written(self.store.folder):
            told[0] += ", running"
            times = sorted(path.stat().st_mtime for path in finished)[-RECENT:]
            if passed := times[-1] - times[0] if times else 0.0:
                rate = 60 * (len(times) - 1) / passed
                end = datetime.fromtimestamp(time.time()).astimezone()
                end += timedelta(minutes=remain / rate)
                told.append(f"{rate:.1f} a minute; {remain} remain, until about {end:%H:%M}")
        elif remain:
            told[0] += ", stopped; the command that made it goes on"
        return told + [f"failed: {run.name}: {error}" for run, error in self.failures.items()]


RECENT = 50
"""How many of the latest trainings tell the rate."""

"""A study: an experiment in its folder, how to run it, and its results."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from threading import Event, Thread
from typing import Any

import numpy as np

from kinarm._console import ProgressLine
from kinarm._files import absolute, is_being_written
from kinarm._interrupts import kept_from_children
from kinarm._parallel import available_threads
from kinarm.errors import InvalidInputError, TrainingFailedError, whole_number
from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.experiments.executors import Executor, Failure, LocalExecutor
from kinarm.evaluation.experiments.experiment import Experiment
from kinarm.evaluation.experiments.plan import Run, plan
from kinarm.evaluation.experiments.runs import Task, TaskResult, TrainedRun, load_policy, train
from kinarm.evaluation.experiments.search import carry_out_search, searched_runs
from kinarm.evaluation.experiments.store import SPECIFICATION, Store
from kinarm.evaluation.experiments.table import Group, figures_of, identity, shown
from kinarm.evaluation.outcomes import Outcomes
from kinarm.evaluation.trials import trial_set
from kinarm.policies.checkpoint import CHECKPOINT_SECONDS
from kinarm.policies.learners import find_learner
from kinarm.policies.oracle import OracleSolutions
from kinarm.policies.policy import Policy


class Study:
    """An experiment, kept in one folder.

    Parameters
    ----------
    experiment : Experiment, mapping, str or Path
        An experiment, what its ``to_json`` returns, the name of a shipped one,
        or a file.
    folder : str or Path
        Folder of the trainings.
    runs : tuple of Run, optional
        The trainings, instead of those of the experiment.

    Raises
    ------
    KinarmError
        If the experiment cannot be used; names file and field.
    """

    def __init__(
        self,
        experiment: Experiment | Mapping[str, Any] | str | Path,
        folder: str | Path,
        runs: tuple[Run, ...] | None = None,
    ) -> None:
        if isinstance(experiment, str | Path):
            experiment = Experiment.load(experiment)
        elif isinstance(experiment, Mapping):
            experiment = Experiment.from_json(experiment, "experiment")
        self.experiment, self.store = experiment, Store(Path(folder))
        try:
            self.runs = self._planned() if runs is None else runs
        except InvalidInputError as error:
            raise InvalidInputError(f"{experiment.name}: {error}") from error

    def _planned(self) -> tuple[Run, ...]:
        """The trainings of the experiment, or of its search."""
        if self.experiment.search:
            return searched_runs(self.experiment, self.store.folder)
        return plan(self.experiment)

    @classmethod
    def load(cls, folder: str | Path) -> "Study":
        """Read the experiment in a folder.

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
        done = f"{len(self)} of {len(self.runs)} trainings finished"
        return f"{type(self).__name__}({self.experiment.name!r}, {done})"

    def __len__(self) -> int:
        return len(self.finished)

    def __iter__(self) -> Iterator[TrainedRun]:
        return iter(self.finished.values())

    def run(
        self,
        *,
        jobs: int | None = None,
        threads: int = 1,
        executor: Executor | None = None,
        on_trained: Callable[[Run, TaskResult], object] = lambda *_: None,
    ) -> "Study":
        """Run the missing trainings; after an interruption, the same call goes on.

        A training that fails does not stop the others; the next call tries it
        again.

        Parameters
        ----------
        jobs, threads : int
            Trainings at a time, one a processor by default, and threads of
            each; neither changes a training, but the first what a search tries.
        executor : Executor, optional
            Where trainings run; processes of this machine by default.
        on_trained : callable
            Called with every finished training and its result.

        Raises
        ------
        TrainingFailedError
            If trainings failed; all others are finished.
        KinarmError
            If the folder is of another experiment or cannot be written to, a
            package is missing, or workers end unexpectedly.
        """
        whole_number("threads", threads, 1)
        jobs = available_threads() if jobs is None else whole_number("jobs", jobs, 1)
        for entry in self.experiment.all_entries:
            find_learner(entry.learner).check_installed()
        where, work = executor or LocalExecutor(jobs, threads), partial(train, threads=threads)
        train_all = partial(self._train, where, work, on_trained)
        with self.store.writing(self.experiment):
            if self.experiment.search:
                carry_out_search(self.experiment, self.store, jobs, train_all)
            self.refresh()
            failures = train_all(self.missing)
        self.refresh()
        if failures:
            raise TrainingFailedError(failures, len(self.runs))
        return self

    def _train(
        self,
        executor: Executor,
        work: Callable[[Task], TaskResult],
        on_trained: Callable[[Run, TaskResult], object],
        runs: Sequence[Run],
    ) -> dict[str, str]:
        """Train some runs, and return why others failed, by name."""
        # Trainings that several entries share come once.
        distinct = tuple({run.key: run for run in runs}.values())
        tasks = [
            Task(run, *self.store.start(run), absolute(self.store.path("checkpoints", run)))
            for run in distinct
        ]
        failures, done = dict[str, str](), list[str]()
        with self._progress(distinct, done) as show:
            for (run, *_), result in executor.map(work, tasks):
                self.store.save(run, result)
                if isinstance(result, Failure):
                    failures[run.name] = result.error
                else:
                    on_trained(run, result)
                    self.store.path("checkpoints", run).unlink(missing_ok=True)
                done.append(run.name)
                show()
        return failures

    @contextmanager
    def _progress(self, runs: Sequence[Run], done: list[str]) -> Iterator[Callable[[], None]]:
        """Show how many trainings are done, and how far others are."""
        over = Event()

        def show() -> None:
            shares, words = self._under_way(runs)
            line.update(len(done) + shares, [*words, *done[-1:]])

        def show_again() -> None:
            while not over.wait(CHECKPOINT_SECONDS):
                show()

        with ProgressLine("trainings", len(runs), "finished") as line:
            show()
            with kept_from_children():  # such a thread gets no request to end, either
                (thread := Thread(target=show_again, daemon=True)).start()
            try:
                yield show
            finally:
                over.set()
                thread.join()

    def _under_way(self, runs: Sequence[Run]) -> tuple[float, list[str]]:
        """Sum of the shares that trainings under way have done, and how far they are in words."""
        if not (found := self.store.progress(runs)):
            return 0.0, []
        share, mean_return, success = np.mean(found, axis=0)
        words = [f"{len(found)} under way {100 * share:.0f} %"]
        if len(found) == 1:
            words.append(f"return {mean_return:+.3f}, success {100 * success:.0f} %")
        return len(found) * share, words

    def refresh(self) -> None:
        """Read the folder again."""
        if self.experiment.search:
            self.runs = self._planned()
        for name in ("finished", "bounds", "varied", "_groups"):
            self.__dict__.pop(name, None)

    def status(self) -> list[str]:
        """How far it is, in lines."""
        remain = [run for run in self.runs if not self.store.path("runs", run).exists()]
        finished = len(self.runs) - len(remain)
        told = [f"{self.experiment.name}: {finished} of {len(self.runs)} trainings finished"]
        told += self._under_way(remain)[1]
        if remain:
            runs = is_being_written(self.store.folder)
            told.append("running" if runs else "stopped; the command that made it goes on")
        failed = (f"failed: {run.name}: {error}" for run, error in self.failures.items())
        return [", ".join(told), *failed]

    @cached_property
    def finished(self) -> Mapping[Run, TrainedRun]:
        """The finished trainings, in the order of the experiment."""
        return self.store.load(self.runs)

    @property
    def missing(self) -> tuple[Run, ...]:
        """The trainings that are not finished."""
        return tuple(run for run in self.runs if run not in self.finished)

    @cached_property
    def bounds(self) -> Mapping[str, OracleSolutions]:
        """Bounds of finished trainings, by the hash of their problem but for what is seen."""
        trials, wanted = self.experiment.trials, self.finished if self.experiment.bounds else ()
        problems = {run.config.problem.unseen.digest: run.config.problem for run in wanted}
        return {
            digest: oracle_bounds(trial_set(problem, trials.count, trials.seed))
            for digest, problem in problems.items()
        }

    @property
    def failures(self) -> Mapping[Run, str]:
        """Errors of trainings that failed and were not finished since."""
        found = {run: self.store.failure(run) for run in self.missing}
        return {run: error for run, error in found.items() if error is not None}

    def policy(self, run: Run) -> Policy:
        """The policy of a finished training, with its versions and commit.

        Raises
        ------
        InvalidInputError
            If the training is not finished, or its file is damaged.
        """
        policy = load_policy(self.store.path("runs", run), run)
        made = self.store.made(run)
        origin = replace(policy.provenance, versions=made.versions, commit=made.commit)
        return replace(policy, provenance=origin)

    def groups(self) -> tuple[Group, ...]:
        """The finished trainings, in groups that differ in the seed alone."""
        return self._groups

    @cached_property
    def _groups(self) -> tuple[Group, ...]:
        shared: dict[tuple[str, str], list[Run]] = {}
        for run in self.finished:
            config = {k: v for k, v in run.settings["config"].items() if k != "seed"}
            shared.setdefault((run.entry.name, repr((run.learner, config))), []).append(run)
        groups, firsts = list[Group](), dict[str, Group]()
        for runs in shared.values():
            digest = runs[0].config.problem.unseen.digest
            group = Group(
                label=self._label(runs[0]),
                entry=runs[0].entry,
                config=runs[0].config,
                choices=runs[0].choices,
                runs=tuple(self.finished[run] for run in runs),
                bounds=self.bounds.get(digest),
                first=firsts.get(digest),
            )
            firsts.setdefault(digest, group)
            groups.append(group)
        return tuple(groups)

    def best(self, count: int = 1) -> tuple[Group, ...]:
        """The groups with the largest success for what the oracle reaches, best first."""
        ordered = sorted(self.groups(), key=lambda one: -one.hits.mean() / max(one.reachable, 1e-9))
        return tuple(ordered[:count])

    def _label(self, run: Run) -> str:
        """Label of the group of a run."""
        experiment, names = self.experiment, identity(run)
        if experiment.entries:
            parts = [run.entry.title or run.entry.name]
        else:
            several = {"learner": experiment.learners, "recipe": experiment.recipes}
            parts = [str(names[name]) for name, values in several.items() if len(values) > 1]
        if len({each.config.problem.name for each in self.runs}) > 1:
            parts.append(names["problem"])
        for field, value in run.choices.items():
            parts.append(f"{field.rpartition('.')[2]}={shown(value)}")
        return " ".join(parts) or f"{names['learner']} {names['recipe']} {names['problem']}"

    @cached_property
    def varied(self) -> list[str]:
        """Fields that vary between the finished trainings."""
        return list(dict.fromkeys(field for run in self.finished for field in run.choices))

    def rows(self) -> list[dict[str, Any]]:
        """One row per finished training."""
        rows = []
        for run, trained in self.finished.items():
            bounds = self.bounds.get(run.config.problem.unseen.digest)
            rows.append(
                {
                    **self._named(run),
                    "iterations": trained.last.iteration,
                    "environment_steps": trained.last.environment_steps,
                    "seconds": trained.clock.seconds,
                    "processor_seconds": trained.clock.processor_seconds,
                    **figures_of(Outcomes((trained.outcomes,), bounds)),
                    "key": run.key,
                }
            )
        return rows

    def curve_rows(self) -> list[dict[str, Any]]:
        """One row per point of a learning curve, the ends included."""
        return [
            {
                **self._named(run),
                **point._asdict(),
                "seconds": seconds,
                "processor_seconds": processor_seconds,
            }
            for run, trained in self.finished.items()
            for point, seconds, processor_seconds in trained.timed_curve
        ]

    def _named(self, run: Run) -> dict[str, Any]:
        """Who was trained on what, and what varies, as rows begin."""
        entry = {"entry": run.entry.name} if self.experiment.entries else {}
        return entry | identity(run) | {field: run.choices.get(field) for field in self.varied}

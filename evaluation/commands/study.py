"""``kinarm-study``: the trainings of an experiment."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from kinarm._command_line import run_request
from kinarm._console import open_console
from kinarm._fields import Checked
from kinarm._interrupts import GOES_ON, telling
from kinarm._parallel import available_threads
from kinarm._tables import CHOOSE, TableOptions, print_columns
from kinarm.errors import InvalidInputError, TrainingFailedError

if TYPE_CHECKING:
    from kinarm.evaluation.experiments.executors import Executor
    from kinarm.evaluation.experiments.study import Study

BOUNDING = "bounding what could be reached, drawing figures"


@dataclass(frozen=True, kw_only=True)
class RunningOptions(Checked):
    """Where trainings run.

    Parameters
    ----------
    jobs : int
        Trainings at a time on this machine.
    ray : str
        Run on Ray: auto, the address of a cluster, or local.
    slurm : bool
        Run as array jobs of Slurm.
    bundle : int
        Trainings of one element of a Slurm array.
    minutes : int
        Time limit of an element of a Slurm array [min].
    """

    jobs: int | None = None
    ray: str | None = field(default=None, metadata={"metavar": "ADDRESS"})
    slurm: bool = False
    bundle: int | None = None
    minutes: int | None = None

    GROUPS: ClassVar[Mapping[str, str]] = {"where trainings run": "jobs ray slurm bundle minutes"}
    DEFAULTS: ClassVar[Mapping[str, str]] = {
        "jobs": "one a processor",
        "ray": "this machine without Ray",
        "bundle": "1",
        "minutes": "240",
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.slurm and self.ray is not None:
            raise InvalidInputError("--ray and --slurm exclude each other")
        if self.slurm and self.jobs is not None:
            raise InvalidInputError("--jobs is for this machine: it does not go with --slurm")
        for name in ("bundle", "minutes"):
            if getattr(self, name) is not None and not self.slurm:
                raise InvalidInputError(f"--{name} goes with --slurm")

    def executor(self, folder: Path, threads: int = 1) -> "Executor":
        """Where trainings run; Slurm's jobs lie in the folder."""
        from kinarm.evaluation.experiments import executors

        if self.ray is not None:
            return executors.RayExecutor(self.ray, self.jobs, threads)
        if self.slurm:
            place, bundle, minutes = folder / "slurm", self.bundle or 1, self.minutes or 240
            return executors.SlurmExecutor(place, bundle, minutes, threads)
        return executors.LocalExecutor(self.jobs or available_threads(), threads)


@dataclass(frozen=True, kw_only=True)
class StudyRequest(RunningOptions, TableOptions):
    """Run the trainings of an experiment, and write their results.

    Parameters
    ----------
    experiment : Path
        The file of the experiment, or the name of a shipped one.
    only : tuple of str
        Names of entries of the experiment that are trained.
    problems : tuple of str
        Names or files of problems instead of its own.
    seeds : int
        Trainings with each setting instead of its own.
    out : Path
        Output folder.
    threads : int
        Threads of a training.
    train : bool
        Train what is missing; else write the results of the finished trainings.
    """

    experiment: Path = field(metadata={"flag": "experiment", "metavar": "EXPERIMENT"})
    only: tuple[str, ...] = ()
    problems: tuple[str, ...] = ()
    seeds: int | None = None
    out: Path | None = field(default=None, metadata={"metavar": "DIR"})
    threads: int = 1
    train: bool = True

    GROUPS: ClassVar = {
        "experiment": "experiment only problems seeds out train threads",
        "table": "columns",
        **RunningOptions.GROUPS,
    }
    DEFAULTS: ClassVar = {
        **RunningOptions.DEFAULTS,
        "columns": "all that fit",
        "only": "all",
        "problems": "its own",
        "seeds": "its own",
        "out": "the name of the experiment",
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in RunningOptions.GROUPS["where trainings run"].split():
            if not self.train and getattr(self, name):
                raise InvalidInputError(f"--{name} does not go with --no-train")

    @property
    def folder(self) -> Path:
        """Where the files go."""
        return self.out or Path(self.experiment.stem)

    def run(self, command: str | None = None) -> "Study":
        """Run the missing trainings, and write the results.

        ``command`` is recorded, by default this request.

        Raises
        ------
        TrainingFailedError
            If trainings failed; the results of the others are written.
        KeyboardInterrupt
            If it is interrupted; what is finished is kept.
        """
        from kinarm.evaluation.experiments.experiment import Experiment
        from kinarm.evaluation.experiments.page import write_all
        from kinarm.evaluation.experiments.study import Study
        from kinarm.evaluation.experiments.table import COLUMNS

        self.chosen(COLUMNS)
        experiment = Experiment.load(self.experiment).only(
            entries=self.only, problems=self.problems, seeds=self.seeds
        )
        study = Study(experiment, self.folder)
        with telling(lambda: GOES_ON):
            failed = None
            try:
                if self.train:
                    where = self.executor(self.folder, self.threads)
                    study.run(jobs=self.jobs, threads=self.threads, executor=where)
            except TrainingFailedError as error:
                failed = error
            if len(study):
                with open_console(stderr=True).status(BOUNDING):
                    write_all(study, command or repr(self))
            if failed:
                raise failed
        return study


@dataclass(frozen=True, kw_only=True)
class StatusRequest:
    """Say how far an experiment is.

    Parameters
    ----------
    folder : Path
        Folder of the experiment.
    """

    folder: Path = field(metadata={"flag": "folder", "metavar": "DIR"})


def _carry_out(request: StudyRequest, command: str) -> None:
    """Run a request, and print the best settings."""
    from kinarm.evaluation.experiments.table import COLUMNS

    study = request.run(command=command)
    if not len(study):
        print("no training is finished")
    else:
        print_columns(
            request.chosen(COLUMNS),
            [study.best(SHOWN)],
            open_console(),
            whole=bool(request.columns),
            advice=CHOOSE,
        )
        print(f"written: {request.folder / 'index.html'}, with tables and figures beside it")


SHOWN = 20
"""Rows that are printed."""


def _status(request: StatusRequest, _: str) -> None:
    """Print how far an experiment is."""
    from kinarm.evaluation.experiments.study import Study

    print("\n".join(Study.load(request.folder).status()))


OTHERS = {"status": (StatusRequest, _status)}

main = partial(run_request, "kinarm-study", StudyRequest, _carry_out, others=OTHERS)
"""Run the command line."""

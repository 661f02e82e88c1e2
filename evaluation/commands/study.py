"""``kinarm-study``: many trainings from one file."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from kinarm._command_line import run_request
from kinarm._console import print_table
from kinarm._interrupts import GOES_ON, telling
from kinarm._validation import whole_number
from kinarm.evaluation.running.options import RunningOptions

if TYPE_CHECKING:
    from kinarm.evaluation.running.executor import Executor
    from kinarm.evaluation.studies.study import Study

PROG = "kinarm-study"

EPILOG = """
A study file names learners, recipes, problems and seeds, and the fields that vary:

  learner = "ars"
  recipe = "tuned"
  problems = ["right", "both"]
  seeds = 4

  [trials]
  count = 1000

  [fixed]
  iterations = 2000

  [grid]
  step_size = [0.01, 0.02, 0.05]
  "problem.task.start_spread" = [0.2, 1.0]

The same command goes on with what is missing, whatever stopped it. More seeds, values or iterations
extend a study: nothing is trained twice.

examples:
  kinarm-study steps.toml                  into the folder steps
  kinarm-study steps.toml --jobs 1         one training at a time
  kinarm-study steps.toml --ray auto       on the Ray cluster that this machine is part of
  kinarm-study steps.toml --no-train       write what is finished so far
  kinarm-study status steps                how far it is
"""


@dataclass(frozen=True, kw_only=True)
class StudyRequest(RunningOptions):
    """Run the trainings of a study, and write their results.

    Parameters
    ----------
    study : Path
        The study file.
    out : Path
        Output folder.
    threads : int
        Threads of a training.
    train : bool
        Train what is missing; else write the results of the finished trainings.

    Raises
    ------
    InvalidInputError
        If a number is out of range.
    """

    study: Path = field(metadata={"flag": "study", "metavar": "STUDY.toml"})
    out: Path | None = field(default=None, metadata={"metavar": "DIR"})
    threads: int = 1
    train: bool = True

    GROUPS: ClassVar = {"study": ("study", "out", "train", "threads"), **RunningOptions.GROUPS}
    DEFAULTS: ClassVar = {
        **RunningOptions.DEFAULTS,
        "out": "the name of the file without its ending",
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.train:
            self.refuse_without_training()
        whole_number("threads", self.threads, 1)

    @property
    def folder(self) -> Path:
        """Where the files go."""
        return self.out or Path(self.study.stem)

    def run(self, executor: "Executor | None" = None, command: str | None = None) -> "Study":
        """Run the missing trainings, and write the results.

        Parameters
        ----------
        executor : Executor, optional
            Where trainings are carried out, instead of where the options say.
        command : str, optional
            What to record as the command that made the files; this request by default.

        Returns
        -------
        Study
            The study with what is finished.

        Raises
        ------
        KinarmError
            If the file cannot be used, the folder is another study's, or a package is missing.
        KeyboardInterrupt
            If it is interrupted; what is finished is kept, and the message says so.
        """
        from kinarm.evaluation.studies.page import write_all
        from kinarm.evaluation.studies.study import Study

        study = Study(self.study, self.folder)
        with telling(lambda: GOES_ON):
            if self.train:
                chosen = executor or self.elsewhere(self.folder, self.threads)
                study.run(jobs=self.jobs, threads=self.threads, executor=chosen)
            if len(study):
                write_all(study, command or repr(self))
        return study


@dataclass(frozen=True, kw_only=True)
class StatusRequest:
    """Say how far a study is.

    Parameters
    ----------
    folder : Path
        Folder of the study.
    """

    folder: Path = field(metadata={"flag": "folder", "metavar": "DIR"})


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    typed = sys.argv[1:] if arguments is None else arguments
    if typed[:1] == ["status"]:
        run_request(f"{PROG} status", StatusRequest, _status, typed[1:])
    run_request(PROG, StudyRequest, _carry_out, typed, epilog=EPILOG)


def _carry_out(request: StudyRequest, command: str) -> None:
    """Run a request, and print the best settings."""
    from kinarm.evaluation.studies.page import HEADINGS, group_row

    study = request.run(command=command)
    if len(study):
        print_table(HEADINGS, [group_row(group) for group in study.best(SHOWN)])
        print(f"written: {request.folder / 'index.html'}, with tables and figures beside it")
    failed = study.failures
    for run, error in failed.items():
        sys.stderr.write(f"failed: {run.name}: {error}\n")
    if request.train and failed:
        sys.stderr.write(f"{PROG}: {len(failed)} of {len(study.runs)} trainings failed\n")
        sys.exit(1)
    if not len(study):
        print("no training is finished")


SHOWN = 20
"""Rows that are printed."""


def _status(request: StatusRequest, command: str) -> None:  # noqa: ARG001
    """Print how far a study is."""
    from kinarm.evaluation.studies.status import StudyStatus
    from kinarm.evaluation.studies.study import Study

    print("\n".join(StudyStatus.of(Study.load(request.folder)).lines()))


if __name__ == "__main__":
    main()

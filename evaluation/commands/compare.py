"""``kinarm-compare``: learners on the same problems, judged on the same trials."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from kinarm._command_line import run_request
from kinarm._console import open_console
from kinarm._files import check_folder, only_writer
from kinarm._interrupts import GOES_ON, telling
from kinarm._validation import whole_number
from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.evaluation.running.options import RunningOptions

if TYPE_CHECKING:
    from kinarm.evaluation.comparison.results import Comparison
    from kinarm.evaluation.comparison.runs import PlannedRun
    from kinarm.evaluation.running.executor import Executor

EPILOG = """
needs the extra zoo for learners of Stable-Baselines3 and sb3-contrib: pip install 'kinarm[zoo]'

An interrupted comparison goes on where it stopped, by the same command; a finished training is
repeated only with other settings.

examples:
  kinarm-compare                                          everything, which takes hours
  kinarm-compare --learners ars-tuned sb3-tqc-her --problems right --seeds 1
  kinarm-compare --no-train                               write what is finished so far
  kinarm-compare --settings mine.toml --out mine          a table of learners of your own
"""


@dataclass(frozen=True, kw_only=True)
class ComparisonRequest(RunningOptions):
    """Train learners on the same problems, and compare their success, steps and time.

    Parameters
    ----------
    learners : tuple of str
        Names of learners in the table.
    problems : tuple of str
        Names or files of problems.
    seeds : int
        Trainings of each learner on each problem.
    steps : int
        Environment steps after which a training ends.
    trials : int
        Trials that policies face.
    settings : Path
        Table of learners with their settings.
    out : Path
        Output folder.
    train : bool
        Train what is missing; else write the results of the finished trainings.

    Raises
    ------
    InvalidInputError
        If a number is out of range, a name is unknown or nothing is left to compare.
    """

    learners: tuple[str, ...] = ()
    problems: tuple[str, ...] = ("right", "both")
    seeds: int = 3
    steps: int | None = None
    trials: int = 1000
    settings: Path | None = field(default=None, metadata={"metavar": "FILE.toml"})
    out: Path = field(default=Path("comparison"), metadata={"metavar": "DIR"})
    train: bool = True

    GROUPS: ClassVar = {
        "what is compared": ("learners", "problems", "seeds", "steps", "trials", "settings"),
        "output": ("out", "train"),
        **RunningOptions.GROUPS,
    }
    DEFAULTS: ClassVar = {
        **RunningOptions.DEFAULTS,
        "learners": "all of the table",
        "steps": "those of the table",
        "settings": "the shipped one",
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.train:
            self.refuse_without_training()
        for name in ("seeds", "trials"):
            whole_number(name, getattr(self, name), 1)
        if self.steps is not None:
            whole_number("steps", self.steps, 1)
        if not self.problems:
            raise InvalidInputError("there is no problem to compare learners on")

    @property
    def runs(self) -> "list[PlannedRun]":
        """All trainings, whether finished or not.

        Raises
        ------
        KinarmError
            If a name is unknown, or a file cannot be used.
        """
        from kinarm.evaluation.comparison.learners import read_learners
        from kinarm.evaluation.comparison.runs import Protocol, planned_runs
        from kinarm.problem import ReachProblem

        table = read_learners(self.settings)
        for name in self.learners:
            if name not in table:
                raise UnknownNameError("learner", name, table)
        chosen = [table[name] for name in dict.fromkeys(self.learners or table)]
        problems = [ReachProblem.load(problem) for problem in self.problems]
        names = [problem.name for problem in problems]
        for name in names:
            if names.count(name) > 1:
                raise InvalidInputError(f"two problems are called {name!r}")
        return planned_runs(chosen, problems, self.seeds, self.steps, Protocol(trials=self.trials))

    def run(self, executor: "Executor | None" = None, command: str | None = None) -> "Comparison":
        """Run the missing trainings, and write the results.

        Parameters
        ----------
        executor, command
            As for ``ReproductionRequest.run``.

        Raises
        ------
        KinarmError
            If a name is unknown, a file cannot be used, a package is missing, another process
            writes to the folder, a worker ends unexpectedly, or nothing is finished and nothing is
            to be trained.
        """
        runs = self.runs
        for learner in {run.learner.name: run.learner for run in runs}.values():
            learner.check_installed()
        check_folder(self.out / "runs")
        with only_writer(self.out):
            return self._carry_out(runs, executor, command)

    def _carry_out(
        self, runs: "list[PlannedRun]", executor: "Executor | None", command: str | None
    ) -> "Comparison":
        """Train and write in a folder that no other process writes to."""
        from kinarm.evaluation.comparison.document import write_all
        from kinarm.evaluation.comparison.results import Comparison
        from kinarm.evaluation.comparison.runs import load_run

        folder = self.out / "runs"
        missing = [run for run in runs if load_run(folder, run) is None]
        with telling(lambda: GOES_ON):
            if missing and self.train:
                self._train(missing, folder, executor)
            found = {run: load_run(folder, run) for run in runs}
            comparison = Comparison({run: curve for run, curve in found.items() if curve})
            if not comparison.curves:
                raise InvalidInputError(f"no training is finished in {str(folder)!r}")
            with open_console(stderr=True).status(
                "bounding what could be reached, drawing figures"
            ):
                write_all(comparison, self.out, command or repr(self))
        return comparison

    def _train(
        self, missing: "list[PlannedRun]", folder: Path, executor: "Executor | None"
    ) -> None:
        """Run the missing trainings, and report each that is finished."""
        from kinarm.evaluation.comparison.runs import save_run
        from kinarm.evaluation.comparison.training import carry_out
        from kinarm.workers import LocalExecutor

        local = LocalExecutor(min(self.at_once, len(missing)))
        console = open_console(stderr=True)
        finished = (executor or self.elsewhere(self.out) or local).carry_out(carry_out, missing)
        for count, (number, curve) in enumerate(finished, start=1):
            save_run(folder, missing[number], curve)
            console.print(f"{count} of {len(missing)} trainings: {missing[number].name}")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    run_request("kinarm-compare", ComparisonRequest, _report, arguments, epilog=EPILOG)


def _report(request: ComparisonRequest, command: str) -> None:
    """Run a request, and print its table."""
    from rich.table import Table

    from kinarm.evaluation.comparison.document import HEADER, result_rows

    table = Table(*HEADER, header_style="bold")
    for row in result_rows(request.run(command=command)):
        table.add_row(*row)
    open_console().print(table)
    print(f"written: {request.out / 'LEARNERS.md'}, with tables and figures beside it")


if __name__ == "__main__":
    main()

"""``kinarm-reproduce``: train what the paper trained, and judge its claims."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from kinarm._command_line import run_request
from kinarm._console import open_console
from kinarm._interrupts import GOES_ON, telling
from kinarm._parallel import available_threads
from kinarm._tables import print_table
from kinarm.evaluation.commands.study import BOUNDING, RunningOptions

if TYPE_CHECKING:
    from kinarm.evaluation.experiments.experiment import Experiment
    from kinarm.evaluation.paper.claims import Claim


@dataclass(frozen=True, kw_only=True)
class ReproductionRequest(RunningOptions):
    """Train everything that the paper trained, and judge its claims.

    Parameters
    ----------
    out : Path
        Output folder.
    quick : bool
        Make a smoke run: every step with trainings of a few iterations, and no
        verdicts.
    ppo : bool
        Train with PPO as well, and judge the claims that compare it with ARS.
    """

    out: Path | None = field(default=None, metadata={"metavar": "DIR"})
    quick: bool = False
    ppo: bool = True

    GROUPS: ClassVar = {"what is trained": "quick ppo out", **RunningOptions.GROUPS}
    DEFAULTS: ClassVar = {
        **RunningOptions.DEFAULTS,
        "out": "reproduction; with --quick, reproduction-quick",
    }

    @property
    def folder(self) -> Path:
        """Where the files go."""
        return self.out or Path("reproduction-quick" if self.quick else "reproduction")

    @property
    def experiment(self) -> "Experiment":
        """The trainings: the shipped experiment, or its part without PPO."""
        from kinarm.evaluation.experiments.experiment import Experiment

        shipped = Experiment.load("reproduction_quick" if self.quick else "reproduction")
        wanted = (entry for entry in shipped.entries if self.ppo or entry.learner != "ppo")
        return replace(shipped, entries=tuple(wanted))

    def run(self, command: str | None = None) -> "Sequence[Claim]":
        """Run the missing trainings, write the results, and return the claims read literally.

        ``command`` is recorded, by default this request.

        Raises
        ------
        KeyboardInterrupt
            If it is interrupted; what is finished is kept.
        """
        from kinarm.evaluation.experiments.study import Study
        from kinarm.evaluation.paper.page import write_all

        study = Study(self.experiment, self.folder)
        threads = max(1, available_threads() // (self.jobs or available_threads()))
        with telling(lambda: GOES_ON):
            study.run(threads=threads, executor=self.executor(self.folder, threads))
            with open_console(stderr=True).status(BOUNDING):
                return write_all(study, command or repr(self))


def _report(request: ReproductionRequest, command: str) -> None:
    """Run a request, and print its verdicts, if it has any."""
    from kinarm.evaluation.experiments.plan import plan
    from kinarm.evaluation.paper.page import CLAIM_COLUMNS, SMOKE, claim_rows

    claims = request.run(command=command)
    if request.quick:
        print(SMOKE.format(len(plan(request.experiment))))
    else:
        print_table(CLAIM_COLUMNS, claim_rows(claims), expendable=CLAIM_COLUMNS[1:2])
    print(f"written: {request.folder / 'REPRODUCTION.md'}, with tables and figures beside it")
    if request.quick:
        print("next: kinarm-reproduce trains everything to the end and judges the claims")


main = partial(run_request, "kinarm-reproduce", ReproductionRequest, _report)
"""Run the command line."""

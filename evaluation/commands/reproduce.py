"""``kinarm-reproduce``: train what the paper trained, and see which of its claims hold."""

import json
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from kinarm._command_line import run_request
from kinarm._console import open_console
from kinarm._files import check_folder, only_writer, write_text
from kinarm._interrupts import GOES_ON, telling
from kinarm._parallel import available_threads
from kinarm.errors import InvalidInputError
from kinarm.evaluation.running.options import RunningOptions

if TYPE_CHECKING:
    from kinarm.evaluation.reproduction.claims import Claim
    from kinarm.evaluation.reproduction.results import Results
    from kinarm.evaluation.reproduction.runs import RunStore
    from kinarm.evaluation.reproduction.study import Study
    from kinarm.evaluation.running.executor import Executor

EPILOG = """
needs the extra ppo: pip install 'kinarm[ppo]' (or --no-ppo)

An interrupted reproduction goes on where it stopped, by the same command.

examples:
  kinarm-reproduce                  the whole paper, into the folder reproduction
  kinarm-reproduce --quick          a smoke run of a minute, which judges no claim
  kinarm-reproduce --no-ppo         Augmented Random Search alone, a few minutes
"""


@dataclass(frozen=True, kw_only=True)
class ReproductionRequest(RunningOptions):
    """Train everything that the paper trained, and judge its claims.

    Parameters
    ----------
    out : Path
        Output folder.
    quick : bool
        Make a smoke run: every step with trainings of a few iterations, and no verdicts.
    ppo : bool
        Train with PPO as well, and judge the claims that compare it with ARS.

    Raises
    ------
    InvalidInputError
        If there are no jobs.
    """

    out: Path | None = field(default=None, metadata={"metavar": "DIR"})
    quick: bool = False
    ppo: bool = True

    GROUPS: ClassVar = {"what is trained": ("quick", "ppo", "out"), **RunningOptions.GROUPS}
    DEFAULTS: ClassVar = {
        **RunningOptions.DEFAULTS,
        "out": "reproduction; with --quick, reproduction-quick",
    }

    @property
    def folder(self) -> Path:
        """Where the files go."""
        return self.out or Path("reproduction-quick" if self.quick else "reproduction")

    @property
    def study(self) -> "Study":
        """What is trained."""
        from kinarm.evaluation.reproduction.study import full_study, quick_study

        return (quick_study if self.quick else full_study)(ppo=self.ppo)

    def run(
        self, executor: "Executor | None" = None, command: str | None = None
    ) -> "tuple[Claim, ...]":
        """Run the missing trainings, and write the results.

        Parameters
        ----------
        executor : Executor, optional
            Where trainings are carried out; the processors of this machine if it is left out.
        command : str, optional
            What to record as the command that made the files; this request if it is left out.

        Returns
        -------
        tuple of Claim
            The claims under the literal reading.

        Raises
        ------
        KinarmError
            If the extra ``ppo`` is missing, the folder holds another study, cannot be written to or
            is written to by another process, or a worker ends unexpectedly.
        """
        from kinarm.policies.learners import find_learner

        if self.ppo:
            find_learner("ppo").check_installed()
        check_folder(self.folder)
        with only_writer(self.folder):
            return self._carry_out(executor, command)

    def _carry_out(self, executor: "Executor | None", command: str | None) -> "tuple[Claim, ...]":
        """Train and write in a folder that no other process writes to."""
        from kinarm.evaluation.reproduction.document import write_all
        from kinarm.evaluation.reproduction.results import Results
        from kinarm.evaluation.reproduction.runs import RunStore

        study, folder = self.study, self.folder
        _claim_folder(folder, study)
        store = RunStore(folder, study.protocol)
        results = Results.load(study, store)
        with telling(lambda: GOES_ON):
            if results.missing:
                results = _train(results, store, self.at_once, executor or self.elsewhere(folder))
            with open_console(stderr=True).status(
                "bounding what could be reached, drawing figures"
            ):
                return write_all(results, store, command or repr(self))


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    run_request("kinarm-reproduce", ReproductionRequest, _report, arguments, epilog=EPILOG)


def _report(request: ReproductionRequest, command: str) -> None:
    """Run a request, and print its verdicts, if it has any."""
    claims, study = request.run(command=command), request.study
    if study.is_judged:
        _print_verdicts(claims)
    else:
        print(study.warning)
    print(f"written: {request.folder / 'REPRODUCTION.md'}, with tables and figures beside it")
    if not study.is_judged:
        print("next: kinarm-reproduce trains everything to the end and judges the claims")


def _print_verdicts(claims: "Sequence[Claim]") -> None:
    """Print each claim, what was measured, and whether it holds."""
    from rich.table import Table

    from kinarm.evaluation.statistics import estimate_text

    table = Table("claim", "measured (95 %)", "claimed", "verdict", header_style="bold")
    for claim in claims:
        measured = "\n".join(estimate_text(part.estimate) for part in claim.parts)
        claimed = "\n".join(f"{part.claimed} {part.threshold:g}" for part in claim.parts)
        table.add_row(claim.statement, measured, claimed, claim.verdict)
    open_console().print(table)


def _claim_folder(folder: Path, study: "Study") -> None:
    """Mark the folder with its study; refuse a folder of another study."""
    from kinarm._archive import load_json, reading

    marker = folder / "study.json"
    if marker.exists():
        held = "foreign"
        with suppress(InvalidInputError), reading(repr(str(marker)), "study", InvalidInputError):
            held = str(load_json(marker, "study", InvalidInputError)["study"])
        if held != study.name:
            raise InvalidInputError(
                f"{str(folder)!r} holds a {held} reproduction, not a {study.name} one: "
                "name another folder with --out"
            )
    write_text(marker, json.dumps({"study": study.name}))


def _train(
    results: "Results", store: "RunStore", jobs: int, executor: "Executor | None"
) -> "Results":
    """Run the missing trainings, the longest first, and read all runs anew."""
    from kinarm.evaluation.reproduction.results import Results
    from kinarm.evaluation.reproduction.training import carry_out
    from kinarm.evaluation.running.progress import TaskProgress
    from kinarm.workers import LocalExecutor

    study = results.study
    missing = sorted(results.missing, key=lambda training: -training.cost)
    console = open_console(stderr=True)
    if results.runs:
        console.print(f"{len(results.runs)} of {len(study.trainings)} trainings are finished")
    jobs = min(jobs, len(missing))
    threads = max(1, available_threads() // jobs)
    work = partial(carry_out, protocol=study.protocol, threads=threads)
    with TaskProgress(len(study.trainings), missing, jobs, console) as progress:
        chosen = executor or LocalExecutor(jobs, threads)
        for number, (policy, run) in chosen.carry_out(work, missing):
            store.save(missing[number], policy, run)
            progress.finished(missing[number])
    return Results.load(study, store)


if __name__ == "__main__":
    main()

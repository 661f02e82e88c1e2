"""A study of transfer between tasks and between arms."""

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kinarm._console import open_console
from kinarm._files import check_folder, only_writer
from kinarm._interrupts import GOES_ON, telling
from kinarm._validation import whole_number
from kinarm.errors import InvalidInputError
from kinarm.evaluation.studies.transfer.planning import (
    MOST_SEEDS,
    PlannedTraining,
    Protocol,
    planned_trainings,
)
from kinarm.evaluation.studies.transfer.runs import TransferRun, load_run, save_run
from kinarm.policies.learners import find_learner
from kinarm.workers import LocalExecutor

if TYPE_CHECKING:
    from kinarm.evaluation.running.executor import Executor


@dataclass(frozen=True, kw_only=True, eq=False)
class TransferStudy:
    """Policies of the paper's task 1 on tasks 2 and 3 and on another arm.

    All trainings have the recipe ``tuned`` without its mirror, with which there would be nothing
    left to ask: a policy with a mirror is as good on both sides.

    Parameters
    ----------
    learners : tuple of str
        Who learns.
    seeds : int
        Trainings of each kind.
    lengths : tuple of float
        Lengths of the trainings on other tasks, as shares of the recipe's iterations.
    settings : mapping
        By learner, settings that replace those of the recipe.
    protocol : Protocol
        How policies are judged.

    Raises
    ------
    InvalidInputError
        If a number is out of range, or there is no learner or length.
    UnknownNameError
        If there is no such learner.
    """

    learners: tuple[str, ...] = ("ars", "ppo")
    seeds: int = 4
    lengths: tuple[float, ...] = (1.0, 0.1)
    settings: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    protocol: Protocol = field(default_factory=Protocol)

    def __post_init__(self) -> None:
        whole_number("seeds", self.seeds, 1, MOST_SEEDS)
        if not self.learners or not self.lengths:
            raise InvalidInputError("a study of transfer needs a learner and a length")
        for length in self.lengths:
            if not 0 < length <= 1:
                raise InvalidInputError(f"lengths must lie above 0 and up to 1, got {length}")
        for learner in self.learners:
            find_learner(learner)

    @cached_property
    def trainings(self) -> tuple[PlannedTraining, ...]:
        """All trainings; those that others begin with come first."""
        return tuple(planned_trainings(self))

    def run(
        self, folder: Path, executor: "Executor | None" = None, command: str = ""
    ) -> dict[str, Any]:
        """Carry out what is missing, and tell what came of it all.

        Parameters
        ----------
        folder : Path
            Where finished trainings are kept: an interrupted study goes on with what is missing.
        executor : Executor, optional
            Where trainings run; one after the other in this process by default.
        command : str
            What made the document, for the record.

        Returns
        -------
        dict
            The document, as JSON can hold it; see
            ``kinarm.evaluation.studies.transfer.document.transfer_document``.

        Raises
        ------
        KinarmError
            If a package is missing, the folder cannot be written to or another process does, or
            a worker ends unexpectedly.
        KeyboardInterrupt
            If it is interrupted; what is finished is kept, and the message says so.
        """
        from kinarm.evaluation.studies.transfer.document import transfer_document

        for learner in self.learners:
            find_learner(learner).check_installed()
        check_folder(folder)
        with ExitStack() as stack:
            stack.enter_context(only_writer(folder))
            stack.enter_context(telling(lambda: GOES_ON))
            self._train(folder, executor or LocalExecutor(1))
            return transfer_document(self, self.finished(folder), command)

    def finished(self, folder: Path) -> dict[PlannedTraining, TransferRun]:
        """The finished trainings that lie in a folder."""
        found = {training: load_run(folder, training) for training in self.trainings}
        return {training: run for training, run in found.items() if run is not None}

    def _train(self, folder: Path, executor: "Executor") -> None:
        """Carry out the missing trainings, those first that others begin with."""
        from kinarm.evaluation.running.progress import TaskProgress
        from kinarm.evaluation.studies.transfer.training import carry_out

        finished = self.finished(folder)
        missing = [training for training in self.trainings if training not in finished]
        sources = [training for training in missing if training.source is None]
        others = [training for training in missing if training.source is not None]
        work = partial(carry_out, folder=folder)
        console = open_console(stderr=True)
        with TaskProgress(len(self.trainings), missing, 1, console) as progress:
            for wave in filter(None, (sources, others)):
                for number, run in executor.carry_out(work, wave):
                    save_run(folder, wave[number], run)
                    progress.finished(wave[number])

"""``python -m kinarm.evaluation.studies.transfer``: carry out a study of transfer."""

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from kinarm._command_line import run_request
from kinarm._files import check_folder, write_text
from kinarm._validation import whole_number
from kinarm.errors import InvalidInputError

if TYPE_CHECKING:
    from kinarm.evaluation.studies.transfer.study import TransferStudy

PROG = "python -m kinarm.evaluation.studies.transfer"


@dataclass(frozen=True, kw_only=True)
class TransferRequest:
    """Train policies for one task, and see what they are worth for others.

    Parameters
    ----------
    learners : tuple of str
        Who learns.
    seeds : int
        Trainings of each kind.
    out : Path
        File of the document; tables and figure lie beside it.
    folder : Path
        Where finished trainings are kept; an interrupted study goes on with what is missing.
    jobs : int
        Trainings at a time.

    Raises
    ------
    InvalidInputError
        If a number is out of range, or the document is no JSON file.
    """

    learners: tuple[str, ...] = ("ars", "ppo")
    seeds: int = 4
    out: Path = field(metadata={"metavar": "FILE.json"})
    folder: Path = field(metadata={"metavar": "FOLDER"})
    jobs: int = 1

    def __post_init__(self) -> None:
        whole_number("jobs", self.jobs, 1)
        if self.out.suffix != ".json":
            raise InvalidInputError(f"out must be a .json file, got {str(self.out)!r}")

    @property
    def study(self) -> "TransferStudy":
        """The study, with the full recipes.

        Raises
        ------
        KinarmError
            If there is no such learner, or a number is out of range.
        """
        from kinarm.evaluation.studies.transfer.study import TransferStudy

        return TransferStudy(learners=self.learners, seeds=self.seeds)


def run(request: TransferRequest, command: str) -> None:
    """Carry out the study of a request, write what came of it, and say where."""
    from kinarm.workers import LocalExecutor

    check_folder(request.out.parent)
    executor = LocalExecutor(request.jobs)
    document = request.study.run(request.folder, executor, command)
    page = write_all(document, request.out)
    sys.stdout.write(f"written: {request.out}, {page}, with a figure beside them\n")


def write_all(document: dict[str, object], out: Path) -> Path:
    """Write document, tables and figure; return the file of the tables.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    from kinarm.evaluation.figures import save_figure
    from kinarm.evaluation.studies.transfer.figures import learning_curves
    from kinarm.evaluation.studies.transfer.page import transfer_page

    write_text(out, json.dumps(document, indent=1) + "\n")
    picture, _ = save_figure(learning_curves(document), out.parent, out.stem)
    page = out.with_name(f"{out.stem.upper()}.md")
    write_text(page, transfer_page(document, picture.name))
    return page


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    run_request(PROG, TransferRequest, run, arguments)


if __name__ == "__main__":
    main()

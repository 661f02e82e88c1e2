"""``kinarm-bench``: how fast everything is on this machine."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from kinarm._command_line import run_request
from kinarm._console import open_console
from kinarm._files import check_folder, only_writer
from kinarm._validation import whole_number

if TYPE_CHECKING:
    from rich.console import Console

EPILOG = """
--peers needs the extra peers, and the extra vamp for VAMP: pip install 'kinarm[peers]'. What is
not installed is named and left out; so are arms with meshes without the extra robots.

examples:
  kinarm-bench                                            a table, in a minute or two
  kinarm-bench --peers                                    other simulators beside kinarm as well
  kinarm-bench --ppo --limits --peers --out speed         everything, with files
"""


@dataclass(frozen=True, kw_only=True)
class BenchmarkRequest:
    """Measure how fast kinarm is on this machine.

    Parameters
    ----------
    repetitions : int
        How often each figure is measured.
    policy : str
        Trained policy to run, on the problem that it is for.
    ppo : bool
        Time a training with PPO as well, a minute or two.
    limits : bool
        Count the operations of a step and say where time goes as well, a minute or two.
    peers : bool
        Measure other simulators and learners beside kinarm as well, a few minutes.
    studies : bool
        Time studies by one and two processes as well, a few minutes.
    out : Path
        Output folder, for a document and a page.
    json : bool
        Print JSON on standard output.

    Raises
    ------
    InvalidInputError
        If there are no repetitions.
    """

    repetitions: int = 7
    policy: str = field(default="ars-tuned-both", metadata={"metavar": "NAME_OR_FILE"})
    ppo: bool = False
    limits: bool = False
    peers: bool = False
    studies: bool = False
    out: Path | None = field(default=None, metadata={"metavar": "DIR"})
    json: bool = False

    GROUPS: ClassVar = {
        "what is measured": ("repetitions", "policy", "ppo", "limits", "peers", "studies"),
        "output": ("out", "json"),
    }
    DEFAULTS: ClassVar = {"out": "a table on standard output alone"}

    def __post_init__(self) -> None:
        whole_number("repetitions", self.repetitions, 1)

    def run(self, command: str | None = None) -> dict[str, Any]:
        """Measure everything.

        Parameters
        ----------
        command : str, optional
            What to record as the command that made the files; this request if it is left out.

        Returns
        -------
        dict
            Figures that JSON can hold: rates [1/s], shares, and times [s].

        Raises
        ------
        KinarmError
            If the policy cannot be used, or the folder cannot be written to.
        """
        from kinarm.evaluation.measurements.document import write_all

        if self.out is None:
            return self._measure()
        check_folder(self.out)
        with only_writer(self.out):
            document = self._measure()
            write_all(document, self.out, command or repr(self))
        return document

    def _measure(self) -> dict[str, Any]:
        """Measure what the options name."""
        from kinarm.evaluation.measurements import benchmark

        return benchmark.measure(
            self.policy,
            self.repetitions,
            ppo=self.ppo,
            limits=self.limits,
            peers=self.peers,
            studies=self.studies,
        )


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    run_request("kinarm-bench", BenchmarkRequest, _report, arguments, epilog=EPILOG)


def _report(request: BenchmarkRequest, command: str) -> None:
    """Run a request, and print its figures."""
    from kinarm.evaluation.measurements import table

    document = request.run(command)
    if request.json:
        print(json.dumps(document))
        return
    console = open_console()
    title = f"kinarm-bench, policy {document['policy']}"
    _print_table(console, title, table.HEADER, table.rows(document))
    if "limits" in document:
        console.print(table.limit_text(document))
        limits = document["limits"]
        _print_table(console, "", table.OPERATION_HEADER, table.operation_rows(limits))
        _print_table(console, "", table.TIME_HEADER, table.time_rows(limits))
    if "peers" in document:
        _print_table(console, "peers", table.PEER_HEADER, table.peer_rows(document["peers"]))


WORDS = ("what", "peer", "where", "time of", "spent in")
"""Headings of columns that hold no numbers."""


def _print_table(
    console: "Console", title: str, header: Sequence[str], rows: Iterable[tuple[str, ...]]
) -> None:
    """Print a table; an empty row ends a section."""
    from rich.table import Table

    table = Table(title=title or None, title_justify="left")
    for heading in header:
        table.add_column(heading, justify="left" if heading in WORDS else "right")
    for row in rows:
        table.add_row(*row) if row else table.add_section()
    console.print(table)


if __name__ == "__main__":
    main()

"""``kinarm-reproduce``: train what the paper trained, and see which of its claims hold."""

import argparse
import json
import sys
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from kinarm.command_line import Parser, command_text, run_command, whole_number
from kinarm.errors import InvalidInputError
from kinarm.files import check_folder, write_text
from kinarm.parallel import available_threads

if TYPE_CHECKING:
    from kinarm.evaluation.reproduction.claims import Claim
    from kinarm.evaluation.reproduction.results import Results
    from kinarm.evaluation.reproduction.runs import RunStore
    from kinarm.evaluation.reproduction.study import Study

PROG = "kinarm-reproduce"

EPILOG = """
needs the extra ppo: pip install 'kinarm[ppo]' (or --no-ppo)

An interrupted reproduction goes on where it stopped, by the same command.

examples:
  kinarm-reproduce                  the whole paper, into the folder reproduction
  kinarm-reproduce --quick          see in a minute that everything works; results mean nothing
  kinarm-reproduce --no-ppo         Augmented Random Search alone, a few minutes
"""


def build_parser() -> Parser:
    """The options of the command."""
    parser = Parser(
        prog=PROG,
        description="Train everything that the paper trained, and judge its claims.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="output folder (reproduction, or reproduction-quick with --quick)",
    )
    parser.add_argument(
        "--jobs",
        type=whole_number(1),
        default=available_threads(),
        metavar="N",
        help="trainings at a time (one a processor)",
    )
    parser.add_argument("--quick", action="store_true", help="a smoke version of everything")
    parser.add_argument("--no-ppo", dest="ppo", action="store_false", help="leave PPO out")
    return parser


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    run_command(
        PROG,
        lambda: _reproduce(build_parser().parse_args(arguments), command_text(PROG, arguments)),
    )


def _reproduce(options: argparse.Namespace, command: str) -> None:
    """Train what is missing, then write what it came to."""
    from rich.console import Console

    from kinarm.evaluation.reproduction.document import write_all
    from kinarm.evaluation.reproduction.results import Results
    from kinarm.evaluation.reproduction.runs import RunStore
    from kinarm.evaluation.reproduction.study import full_study, quick_study
    from kinarm.policies.ppo import require_ppo

    if options.ppo:
        require_ppo()
    study = (quick_study if options.quick else full_study)(ppo=options.ppo)
    folder = options.out or Path("reproduction-quick" if options.quick else "reproduction")
    check_folder(folder, create=True)
    _claim_folder(folder, study)
    store = RunStore(folder, study.protocol)
    results = Results.load(study, store)
    try:
        if results.missing:
            results = _train(results, store, options.jobs)
        with Console(stderr=True).status("bounding what could be reached, drawing figures"):
            claims = write_all(results, store, command)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(
            "interrupted; what is finished is kept, and the same command goes on"
        ) from None
    _print(claims)
    if study.warning:
        sys.stdout.write(f"{study.warning}\n")
    sys.stdout.write(f"written: {folder / 'REPRODUCTION.md'}, with tables and figures beside it\n")


def _print(claims: "Iterable[Claim]") -> None:
    """Print the verdicts."""
    from rich.console import Console
    from rich.table import Table

    table = Table("claim", "measured (95 %)", "claimed", "verdict", header_style="bold")
    for claim in claims:
        measured, claimed = zip(
            *((str(part.estimate), f"{part.claimed} {part.threshold:g}") for part in claim.parts),
            strict=True,
        )
        table.add_row(claim.statement, "\n".join(measured), "\n".join(claimed), claim.verdict)
    Console(width=None if sys.stdout.isatty() else 120, highlight=False).print(table)


def _claim_folder(folder: Path, study: "Study") -> None:
    """Mark the folder as that of a study; refuse one that holds another."""
    marker = folder / "study.json"
    if marker.exists():
        try:
            held = json.loads(marker.read_bytes())["study"]
        except (ValueError, KeyError, TypeError, OSError):
            held = "foreign"
        if held != study.name:
            raise InvalidInputError(
                f"{str(folder)!r} holds a {held} reproduction, not a {study.name} one: "
                "name another folder with --out"
            )
    write_text(marker, json.dumps({"study": study.name}))


def _train(results: "Results", store: "RunStore", jobs: int) -> "Results":
    """Carry out what is missing, the longest first, and read all runs anew."""
    from rich.console import Console

    from kinarm.evaluation.reproduction.executor import LocalExecutor
    from kinarm.evaluation.reproduction.progress import StudyProgress
    from kinarm.evaluation.reproduction.results import Results
    from kinarm.evaluation.reproduction.training import carry_out

    study = results.study
    missing = sorted(results.missing, key=lambda training: -training.cost)
    console = Console(stderr=True, highlight=False)
    if results.runs:
        console.print(f"{len(results.runs)} of {len(study.trainings)} trainings are finished")
    jobs = min(jobs, len(missing))
    threads = max(1, available_threads() // jobs)
    work = partial(carry_out, protocol=study.protocol, folder=store.folder, threads=threads)
    with StudyProgress(study, missing, jobs, console) as progress:
        for training in LocalExecutor(jobs, threads).carry_out(work, missing):
            progress.finished(training)
    return Results.load(study, store)


if __name__ == "__main__":
    main()

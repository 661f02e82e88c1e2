"""``kinarm-eval``: put policies to the trials and report how they did."""

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kinarm.command_line import Parser, command_text, run_command, whole_number
from kinarm.errors import InvalidInputError
from kinarm.files import check_folder, write_text

if TYPE_CHECKING:
    from kinarm.evaluation.entrants import Entrant
    from kinarm.evaluation.evaluation import Evaluation

PROG = "kinarm-eval"

EPILOG = """
examples:
  kinarm-eval --trials 200                              all shipped policies and baselines
  kinarm-eval --policy ars-tuned-right --task right     one recipe, all its training seeds
  kinarm-eval --policy my_policy.npz --out results      your own, with figures and every trial
  kinarm-eval --trials 200 --report results             a page to look at: results/index.html
"""


def build_parser() -> Parser:
    """The options of the command."""
    parser = Parser(
        prog=PROG,
        description="Put policies to random reaching trials and report how they did.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--task", action="append", metavar="NAME", help="left, right or both; repeatable"
    )
    parser.add_argument(
        "--policy",
        action="append",
        metavar="NAME_OR_FILE",
        help="shipped policy, recipe (all its seeds), random, zero, oracle, or .npz file; "
        "repeatable; default: all shipped ones, random and zero",
    )
    parser.add_argument(
        "--trials", type=whole_number(1), default=200, metavar="N", help="trials a task (200)"
    )
    parser.add_argument(
        "--seed", type=whole_number(0), default=0, metavar="N", help="seed of the trials (0)"
    )
    parser.add_argument("--arm", default="paper", metavar="NAME_OR_URDF", help="arm to use (paper)")
    parser.add_argument(
        "--allow-other-arm",
        action="store_true",
        help="let policies face an arm that they were not trained for",
    )
    parser.add_argument(
        "--matrix", action="store_true", help="every policy on every task, not only on its own"
    )
    parser.add_argument(
        "--no-oracle",
        dest="oracle",
        action="store_false",
        help="leave out the bounds of what any policy could reach",
    )
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="write evaluation.json and histograms there"
    )
    parser.add_argument(
        "--report", type=Path, metavar="DIR", help="write the report there: index.html, one page"
    )
    parser.add_argument(
        "--json", action="store_true", help="print the JSON document alone on standard output"
    )
    parser.add_argument("--markdown", action="store_true", help="print the table as Markdown")
    return parser


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    run_command(
        PROG, lambda: _evaluate(build_parser().parse_args(arguments), command_text(PROG, arguments))
    )


def _evaluate(options: argparse.Namespace, command: str) -> None:
    """From options to table, document and figures."""
    from rich.console import Console

    from kinarm.evaluation.document import evaluation_document
    from kinarm.evaluation.table import print_table

    with Console(stderr=True).status("evaluating; the first run compiles") as status:
        evaluations = evaluate_all(options, status.update)
        document = evaluation_document(evaluations, command)
        if options.report is not None:
            _report(options.report, document, evaluations, status.update)
    if options.out is not None:
        _write(options.out, document, evaluations)
    if options.json:
        json.dump(document, sys.stdout)
        sys.stdout.write("\n")
        return
    console = Console(width=None if sys.stdout.isatty() else 200, highlight=False)
    print_table(document, console, markdown=options.markdown)
    if not options.markdown:
        console.print(_footnote(document), style="dim")
        if not options.policy and all(row["trained_on"] is None for row in document["results"]):
            console.print(f"no shipped policy was trained for arm {options.arm}", style="dim")
    if options.out is not None:
        console.print(f"written: {options.out / 'evaluation.json'} and histograms", style="dim")
    if options.report is not None:
        console.print(f"written: {options.report / 'index.html'}", style="dim")


def _footnote(document: dict[str, Any]) -> str:
    """What the figures in the table stand on."""
    protocol = document["protocol"]
    tasks = protocol["tasks"].items()
    hashes = (f"{task} {entry['trial_set_hash']}" for task, entry in tasks)
    lines = [
        f"{protocol['trials']} trials a task, seed {protocol['seed']}, arm {protocol['arm']}; "
        "95 % intervals in brackets"
    ]
    bounds = [(task, entry["oracle"]) for task, entry in tasks if entry["oracle"]]
    if bounds:
        shares = (f"{task} {100 * bound['tight_share']:.1f} %" for task, bound in bounds)
        lines.append(
            "step ratio: steps over the number proven necessary, of trials that succeeded; "
            f"proofs complete: {', '.join(shares)}"
        )
    lines.append(f"trial sets: {', '.join(hashes)}")
    return "\n".join(lines)


def evaluate_all(
    options: argparse.Namespace, report: Callable[[str], object]
) -> "list[Evaluation]":
    """Let every chosen policy face the trials of its tasks.

    Parameters
    ----------
    options : Namespace
        The options of the command.
    report : callable
        Called with what is being done.
    """
    from kinarm.arm import Arm
    from kinarm.evaluation.bounds import oracle_bounds
    from kinarm.evaluation.evaluation import run_trials
    from kinarm.evaluation.trials import TrialSet
    from kinarm.simulator import Simulator
    from kinarm.task import load_task

    tasks = list(dict.fromkeys(load_task(name).name for name in options.task or ()))
    arm = Arm.load(options.arm)
    pairs = pair_with_tasks(choose_entrants(options, arm), tasks, options)
    _check_names(entrant for entrant, _ in pairs)
    if not pairs:
        raise InvalidInputError("no chosen policy was trained on a task that exists: name a --task")
    for entrant, _ in pairs:
        entrant.check(arm, allow_other_arm=options.allow_other_arm)
    for folder in (options.out, options.report):
        if folder is not None:
            check_folder(folder, create=True)
    evaluations = []
    for task in dict.fromkeys(task for _, task in pairs):
        trials = TrialSet.draw(Simulator(arm, task), options.trials, options.seed)
        if options.oracle:
            oracle_bounds(trials, partial(_report_bounds, report, task))
        report(f"evaluating on {task}")
        evaluations += [
            run_trials(entrant, trials, options.allow_other_arm, oracle=options.oracle)
            for entrant, faced in pairs
            if faced == task
        ]
    return evaluations


def _report_bounds(report: Callable[[str], object], task: str, done: int, total: int) -> None:
    """Say how far the oracle is."""
    report(f"what could any policy reach on {task}? {done} of {total} trials solved")


def choose_entrants(options: argparse.Namespace, arm: Any) -> "list[Entrant]":
    """Entrants named on the command line, or all that fit the arm, without repetition."""
    from kinarm.evaluation.entrants import find_entrants, shipped_entrants

    if not options.policy:
        return list(shipped_entrants(arm))
    named = (entrant for name in options.policy for entrant in find_entrants(name))
    return list({(entrant.name, entrant.source): entrant for entrant in named}.values())


def _check_names(entrants: "Iterable[Entrant]") -> None:
    """Refuse two entrants of one name, which tables could not tell apart."""
    known: dict[str, Entrant] = {}
    for entrant in entrants:
        first = known.setdefault(entrant.name, entrant)
        if first.source != entrant.source:
            sources = (e.source or "the one that needs no file" for e in (first, entrant))
            raise InvalidInputError(
                f"two policies are called {entrant.name!r}: {' and '.join(map(str, sources))}; "
                "rename a file"
            )


def pair_with_tasks(
    entrants: "list[Entrant]", tasks: list[str], options: argparse.Namespace
) -> "list[tuple[Entrant, str]]":
    """Decide who faces which task.

    By default a trained policy faces the task that it was trained on and a baseline all tasks in
    play. ``--task`` restricts the default selection; together with ``--policy`` or ``--matrix``
    it says what they face. The oracle joins on every task that is faced.
    """
    from kinarm.evaluation.entrants import ORACLE
    from kinarm.task import TASKS

    trained = list(dict.fromkeys(e.trained_on for e in entrants if e.trained_on))
    played = tasks or [task for task in TASKS if task in trained] or list(TASKS)
    if options.matrix:
        played = tasks or list(TASKS)
    named = bool(options.policy and tasks)
    pairs = [
        (entrant, task)
        for task in played
        for entrant in entrants
        if options.matrix or named or entrant.trained_on in (None, task)
    ]
    if options.oracle and ORACLE not in entrants:
        pairs += [(ORACLE, task) for task in dict.fromkeys(task for _, task in pairs)]
    return pairs


def _write(folder: Path, document: dict[str, Any], evaluations: "list[Evaluation]") -> None:
    """Write the document and the figures."""
    from kinarm.evaluation.figures import distance_histograms, save_figure

    write_text(folder / "evaluation.json", json.dumps(document, indent=1))
    shown = [e for e in evaluations if e.entrant.algorithm != "oracle"] or evaluations
    save_figure(distance_histograms(shown), folder, "final_distance")


def _report(
    folder: Path,
    document: dict[str, Any],
    evaluations: "list[Evaluation]",
    report: Callable[[str], object],
) -> None:
    """Write the page."""
    from kinarm.evaluation.report.page import write_report

    report("writing the report")
    write_report(folder, document, evaluations)


if __name__ == "__main__":
    main()

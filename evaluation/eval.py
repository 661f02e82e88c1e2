"""``kinarm-eval``: put policies to the trials and report how they did."""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kinarm.command_line import Parser, command_text, run_command, whole_number
from kinarm.errors import InvalidInputError
from kinarm.files import check_folder, write_atomically

if TYPE_CHECKING:
    from kinarm.evaluation.entrants import Entrant
    from kinarm.evaluation.evaluations import Evaluation

PROG = "kinarm-eval"

EPILOG = """
examples:
  kinarm-eval --trials 200                              all shipped policies and baselines
  kinarm-eval --policy ars-tuned-right --task right     one recipe, all its training seeds
  kinarm-eval --policy my_policy.npz --out results      your own, with figures and every trial
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
        help="shipped policy, recipe (all its seeds), baseline (random, zero) or .npz file; "
        "repeatable; default: all shipped ones and the baselines",
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
        "--out", type=Path, metavar="DIR", help="write evaluation.json and histograms there"
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

    from kinarm.evaluation.report import evaluation_document, print_table

    with Console(stderr=True).status("evaluating; the first run compiles"):
        evaluations = evaluate_all(options)
        document = evaluation_document(evaluations, command)
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


def _footnote(document: dict[str, Any]) -> str:
    """What the figures in the table stand on."""
    protocol = document["protocol"]
    hashes = (f"{task} {entry['trial_set_hash']}" for task, entry in protocol["tasks"].items())
    return (
        f"{protocol['trials']} trials a task, seed {protocol['seed']}, arm {protocol['arm']}; "
        f"95 % intervals in brackets\ntrial sets: {', '.join(hashes)}"
    )


def evaluate_all(options: argparse.Namespace) -> "list[Evaluation]":
    """Let every chosen policy face the trials of its tasks."""
    from kinarm.arm import Arm
    from kinarm.evaluation.evaluations import run_trials
    from kinarm.evaluation.trials import TrialSet
    from kinarm.simulator import Simulator
    from kinarm.task import load_task

    tasks = list(dict.fromkeys(load_task(name).name for name in options.task or ()))
    arm = Arm.load(options.arm)
    entrants = choose_entrants(options, arm)
    if options.out is not None:
        check_folder(options.out, create=True)
    trial_sets: dict[str, TrialSet] = {}
    evaluations = []
    for entrant, task in pair_with_tasks(entrants, tasks, options):
        if task not in trial_sets:
            simulator = Simulator(arm, task)
            trial_sets[task] = TrialSet.draw(simulator, options.trials, options.seed)
        evaluations.append(run_trials(entrant, trial_sets[task], options.allow_other_arm))
    if not evaluations:
        raise InvalidInputError("no chosen policy was trained on a task that exists: name a --task")
    return evaluations


def choose_entrants(options: argparse.Namespace, arm: Any) -> "list[Entrant]":
    """Entrants named on the command line, or all that fit the arm, without repetition."""
    from kinarm.evaluation.entrants import find_entrants, shipped_entrants

    if not options.policy:
        return list(shipped_entrants(arm))
    entrants: dict[str, Entrant] = {}
    for entrant in (entrant for name in options.policy for entrant in find_entrants(name)):
        known = entrants.setdefault(entrant.name, entrant)
        if known.source != entrant.source:
            raise InvalidInputError(
                f"two policies are called {entrant.name!r}: {known.source or 'the baseline'} and "
                f"{entrant.source or 'the baseline'}; rename a file"
            )
    return list(entrants.values())


def pair_with_tasks(
    entrants: "list[Entrant]", tasks: list[str], options: argparse.Namespace
) -> "list[tuple[Entrant, str]]":
    """Decide who faces which task.

    By default a trained policy faces the task that it was trained on and a baseline all tasks in
    play. ``--task`` restricts the default selection; together with ``--policy`` or ``--matrix``
    it says what they face.
    """
    from kinarm.task import TASKS

    trained = list(dict.fromkeys(e.trained_on for e in entrants if e.trained_on))
    played = tasks or [task for task in TASKS if task in trained] or list(TASKS)
    if options.matrix:
        played = tasks or list(TASKS)
    named = bool(options.policy and tasks)
    return [
        (entrant, task)
        for task in played
        for entrant in entrants
        if options.matrix or named or entrant.trained_on in (None, task)
    ]


def _write(folder: Path, document: dict[str, Any], evaluations: "list[Evaluation]") -> None:
    """Write the document and the figures."""
    from kinarm.evaluation.plots import distance_histograms, save_figure

    text = json.dumps(document, indent=1).encode()
    write_atomically(folder / "evaluation.json", lambda file: file.write(text))
    save_figure(distance_histograms(evaluations), folder, "final_distance")


if __name__ == "__main__":
    main()

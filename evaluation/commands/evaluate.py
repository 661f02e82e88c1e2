"""``kinarm-eval``: evaluate policies on random reaching trials, beside an oracle."""

import json
from functools import partial
from typing import TYPE_CHECKING

from kinarm._command_line import run_request
from kinarm._console import open_console, working
from kinarm.evaluation.request import DOCUMENT, REPORT, EvaluationRequest

if TYPE_CHECKING:
    from kinarm.evaluation.document import EvaluationDocument

EPILOG = """
Without --problem, a trained policy faces the problem that it was trained for. Policies that differ
in their training seed alone share a row.

examples:
  kinarm-eval                                            all shipped policies and baselines
  kinarm-eval --policy best --problem right              the best policy for a problem
  kinarm-eval --policy ars-tuned-both                    one recipe, all its training seeds
  kinarm-eval --policy right/                            the policies of a folder
  kinarm-eval --policy mine.npz zero oracle --problem right   side by side
  kinarm-eval --policy mine.npz --out results            files, with the outcome of every trial
  kinarm-eval --policy mine.npz --report page            a page to look at: page/index.html
  kinarm-eval --policy mine.npz --card share/mine.md     what to publish beside a policy
  kinarm-eval --policy model.zip --problem right         a model of Stable-Baselines3
  kinarm-eval --policy my_module:my_policy --problem left   a function of your own
"""
HOLDING_NOTE = (
    "mm columns, held and closest are from trials that success does not end; contact "
    "counts as a miss; the oracle aims at 5 mm there"
)


def _report(request: EvaluationRequest, command: str) -> None:
    """Run a request, and print the table with its notes, or JSON."""
    from kinarm.evaluation.table import print_table

    with working("evaluating") as say:
        document = request.run(command, say)
    if request.json:
        print(json.dumps(document.to_json()))
        return
    console = open_console()
    print_table(document, console, markdown=request.markdown)
    if not request.markdown:
        console.print(_footnote(document), style="dim")
        if not request.policies and all(row.trained_on is None for row in document.results):
            console.print("no shipped policy was trained for this", style="dim")
    if request.out is not None:
        console.print(f"written: {request.out / DOCUMENT} and histograms", style="dim")
    if request.report is not None:
        console.print(f"written: {request.report / REPORT}", style="dim")
    if request.card is not None:
        beside = f"{request.card.stem}.npz and {request.card.stem}.html"
        console.print(f"written: {request.card}, {beside}", style="dim")


def _footnote(document: "EvaluationDocument") -> str:
    """Notes on what the figures in the table are of."""
    from kinarm.evaluation.report.templating import template_environment
    from kinarm.evaluation.table import REPLACED, has_star, table_rows

    protocol = document.protocol
    rows = (row for name in protocol.problems for row in table_rows(document, name))
    text = (
        template_environment()
        .get_template("footnote.txt")
        .render(
            protocol=protocol,
            results=document.results,
            starred=any(map(has_star, rows)),
            replaced=REPLACED,
        )
    )
    return text.rstrip()
        lines.append(
            "step ratio: steps divided by the number proven necessary, in trials that succeeded; "
            f"proofs complete: {', '.join(shares)}"
        )
        bounded = min(each.bounded for each in bounds.values())
        if bounded < protocol.trials:
            lines.append(
                f"oracle, relative success and step ratio are of the first {bounded} trials of "
                f"{protocol.trials}; --policy oracle bounds all"
            )
    shown = (row for name, _ in problems for row in table_rows(document, name))
    if any(map(has_star, shown)):
        lines.append(REPLACED)
    if protocol.hold:
        lines.append(HOLDING_NOTE)
    hashes = (f"{problem} {faced.trial_set_hash}" for problem, faced in problems)
    lines.append(f"trial sets: {', '.join(hashes)}")
    lines += dict.fromkeys(row.note for row in document.results if row.note)
    return "\n".join(lines)


main = partial(run_request, "kinarm-eval", EvaluationRequest, _report, skip=("problem",))
"""Run the command line."""

if __name__ == "__main__":
    main()

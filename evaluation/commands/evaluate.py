"""``kinarm-eval``: evaluate policies on random trials, beside an oracle."""

import json
from functools import partial
from typing import TYPE_CHECKING

from kinarm._command_line import run_request
from kinarm._console import open_console, working
from kinarm.evaluation.request import DOCUMENT, REPORT, EvaluationRequest

if TYPE_CHECKING:
    from kinarm.evaluation.document import EvaluationDocument


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
    """Notes on the figures in the table."""
    from kinarm.evaluation.report.templating import template_environment
    from kinarm.evaluation.table import REPLACED, has_star, table_rows

    protocol = document.protocol
    rows = (row for name in protocol.problems for row in table_rows(document, name))
    template = template_environment().get_template("footnote.txt")
    text = template.render(
        protocol=protocol,
        results=document.results,
        starred=any(map(has_star, rows)),
        replaced=REPLACED,
    )
    return text.rstrip()


main = partial(run_request, "kinarm-eval", EvaluationRequest, _report, skip=("problem",))
"""Run the command line."""

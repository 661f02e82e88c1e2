"""``kinarm-eval``: evaluate policies on random trials, beside an oracle."""

import json
from functools import partial
from typing import TYPE_CHECKING

from kinarm._command_line import run_request
from kinarm._console import open_console
from kinarm.evaluation.request import DOCUMENT, REPORT, EvaluationRequest

if TYPE_CHECKING:
    from kinarm.evaluation.document import EvaluationDocument


def _report(request: EvaluationRequest, command: str) -> None:
    """Run a request, and print the table with its notes, or JSON."""
    from kinarm.evaluation.table import all_columns, print_table

    with open_console(stderr=True).status("evaluating") as status:
        document = request.run(command, status.update)
    if request.json:
        print(json.dumps(document.to_json()))
        return
    console = open_console()
    columns = request.chosen(all_columns()) if request.columns else ()
    print_table(document, console, markdown=request.markdown, columns=columns)
    if not request.markdown:
        console.print(_footnote(document), style="dim")
        if not request.policies and all(row.trained_on is None for row in document.results):
            console.print("no shipped policy was trained for this", style="dim")
    written = []
    if request.out is not None:
        written.append(f"{request.out / DOCUMENT}")
    if request.report is not None:
        written.append(f"{request.report / REPORT}")
    for files in written:
        console.print(f"written: {files}", style="dim", soft_wrap=True)


def _footnote(document: "EvaluationDocument") -> str:
    """Notes on the figures in the table."""
    from kinarm.evaluation.report.templating import template_environment

    template = template_environment().get_template("footnote.txt")
    return template.render(protocol=document.protocol, results=document.results).rstrip()


main = partial(run_request, "kinarm-eval", EvaluationRequest, _report, skip=("problem",))
"""Run the command line."""

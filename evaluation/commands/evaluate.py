"""``kinarm-eval``: evaluate policies on random trials, beside an oracle."""

import json
from functools import partial

from kinarm._command_line import run_request
from kinarm._console import open_console
from kinarm.evaluation.report.templating import template
from kinarm.evaluation.request import EvaluationRequest


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
        shown = {"protocol": document.protocol, "results": document.results}
        console.print(template("footnote.txt").render(shown).rstrip(), style="dim")
        if not request.policies and all(row.trained_on is None for row in document.results):
            console.print("no shipped policy was trained for this", style="dim")
    for path in request.files:
        console.print(f"written: {path}", style="dim", soft_wrap=True)


main = partial(run_request, "kinarm-eval", EvaluationRequest, _report, skip=("problem",))
"""Run the command line."""

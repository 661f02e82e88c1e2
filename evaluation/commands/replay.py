"""``kinarm-replay``: watch trials in a browser, from one file."""

from functools import partial

from kinarm._command_line import run_request
from kinarm.evaluation.replay.request import ReplayRequest


def _report(request: ReplayRequest, _: str) -> None:
    request.run(lambda line: print(line, flush=True))


main = partial(run_request, "kinarm-replay", ReplayRequest, _report)
"""Run the command line."""

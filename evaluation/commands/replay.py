"""``kinarm-replay``: watch trials in a browser, from one file or live."""

from collections.abc import Sequence

from kinarm._command_line import run_request
from kinarm.evaluation.replay.request import ReplayRequest

EPILOG = """
examples:
  kinarm-replay --policy best --problem right             the first five trials of the best policy
  kinarm-replay --policy mine.npz --worst 5               the worst of 200
  kinarm-replay results/evaluation.json --policy mine.npz --worst 5   of an evaluation
  kinarm-replay --policy best --problem right --failures  all failures of 10000 trials, by cause
  kinarm-replay --compare ppo-tuned-both oracle           two on the same trials, one as a ghost
  kinarm-replay --policy mine.npz --record trials.npz     keep the recordings as well
  kinarm-replay trials.npz                                and play them later
  kinarm-replay --policy oracle --problem left --live     endless fresh trials in the browser
"""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    run_request("kinarm-replay", ReplayRequest, _report, arguments, epilog=EPILOG)


def _report(request: ReplayRequest, _: str) -> None:
    request.run(lambda line: print(line, flush=True))

"""``kinarm-replay``: watch trials in a browser, from one file or live."""

from collections.abc import Sequence

from kinarm._command_line import run_request
from kinarm.evaluation.replays.request import ReplayRequest

EPILOG = """
examples:
  kinarm-replay --policy ars-tuned-right --trials 5       the first five trials
  kinarm-replay --policy ars-tuned-right --worst 5        the worst of 200
  kinarm-replay results/evaluation.json --collisions      what an evaluation collided in
  kinarm-replay --policy best --problem right --failures  why it fails, of 10000 trials
  kinarm-replay --compare ppo-tuned-both oracle           two on the same trials, one as a ghost
  kinarm-replay --policy my_policy.npz --record mine.npz  keep the recordings as well
  kinarm-replay mine.npz                                  and play them later
  kinarm-replay --policy oracle --problem left --live     endless fresh trials in the browser
"""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    run_request("kinarm-replay", ReplayRequest, _report, arguments, epilog=EPILOG)


def _report(request: ReplayRequest, _: str) -> None:
    request.run(lambda line: print(line, flush=True))


if __name__ == "__main__":
    main()

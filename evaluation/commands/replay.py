"""``kinarm-replay``: watch trials in a browser, from one file or live."""

import argparse
from collections.abc import Sequence

from kinarm._command_line import Parser, add_options, request_of, run_command
from kinarm.evaluation.replays.request import ReplayRequest

PROG = "kinarm-replay"

EPILOG = """
examples:
  kinarm-replay --policy ars-tuned-right --trials 5       the first five trials
  kinarm-replay --policy ars-tuned-right --worst 5        the worst of 200
  kinarm-replay results/evaluation.json --collisions      what an evaluation collided in
  kinarm-replay --compare ppo-tuned-both oracle           two on the same trials, one as a ghost
  kinarm-replay --policy my_policy.npz --record mine.npz  keep the recordings as well
  kinarm-replay mine.npz                                  and play them later
  kinarm-replay --policy oracle --problem left --live     endless fresh trials in the browser
"""


def build_parser() -> Parser:
    """The options of the command."""
    parser = Parser(
        prog=PROG,
        description="Write one HTML file that replays trials offline, or show them live.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_options(parser, ReplayRequest)
    return parser


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    run_command(PROG, lambda: _replay(build_parser().parse_args(arguments)))


def _replay(options: argparse.Namespace) -> None:
    request_of(options, ReplayRequest).run(lambda line: print(line, flush=True))


if __name__ == "__main__":
    main()

"""``kinarm``, or ``python -m kinarm``, lists commands; ``kinarm eval`` runs one."""

import argparse
import sys
from collections.abc import Sequence
from importlib import import_module

from kinarm._command_line import run_command
from kinarm._parser import Parser

PROG = "kinarm"

COMMANDS = {
    "train": ("kinarm.evaluation.commands.train", "train a policy"),
    "eval": ("kinarm.evaluation.commands.evaluate", "evaluate policies beside the oracle"),
    "replay": ("kinarm.evaluation.commands.replay", "watch what policies do, in a browser"),
    "plan": ("kinarm.evaluation.commands.plan", "plan a motion of an arm that touches nothing"),
    "export": ("kinarm.evaluation.commands.export", "run a policy on an arm, without kinarm"),
    "run": ("kinarm.evaluation.commands.run", "drive an arm by a policy, with a shield"),
    "study": ("kinarm.evaluation.commands.study", "compare learners and their settings"),
    "problem": ("kinarm.evaluation.commands.problem", "look at problems, and check your own"),
    "arms": ("kinarm.evaluation.commands.arms", "look at arms, and check your own"),
    "bench": ("kinarm.evaluation.commands.bench", "measure how fast everything is here"),
    "reproduce": ("kinarm.evaluation.commands.reproduce", "reproduce what the paper reports"),
}
"""Modules and purposes of the commands, by name without ``kinarm-``."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the named command, or list all."""
    typed = list(sys.argv[1:] if arguments is None else arguments)
    if typed[:1] == ["--"]:
        del typed[0]
    if typed and typed[0] in COMMANDS:
        module, _ = COMMANDS[typed[0]]
        import_module(module).main(typed[1:])
    run_command(PROG, lambda: _explain(typed or ["--help"]))


def _explain(typed: Sequence[str]) -> None:
    """Print help or version, or refuse an unknown command."""
    lines = (f"  {purpose:<44} {PROG}-{name}" for name, (_, purpose) in COMMANDS.items())
    parser = Parser(
        prog=PROG,
        usage=f"{PROG} COMMAND ... [options]",
        description="Learn to reach with a simulated robot arm.\n\nto:\n" + "\n".join(lines),
        epilog=f"{PROG} COMMAND, or {PROG}-COMMAND, runs one; with --help it says more.",
    )
    parser.add_argument(
        "command", nargs="?", choices=COMMANDS, metavar="COMMAND", help=argparse.SUPPRESS
    )
    parser.parse_args(typed)


if __name__ == "__main__":
    main()

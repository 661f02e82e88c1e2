"""``python -m kinarm`` lists the commands; ``python -m kinarm eval`` runs one of them."""

import sys
from collections.abc import Sequence
from importlib import import_module

from kinarm._command_line import run_command
from kinarm._parser import Parser

PROG = "python -m kinarm"

COMMANDS = {
    "eval": ("kinarm.evaluation.commands.evaluate", "put policies to the trials"),
    "replay": ("kinarm.evaluation.commands.replay", "watch trials in a browser"),
    "train": ("kinarm.policies.train", "train a policy"),
    "study": ("kinarm.evaluation.commands.study", "train many policies from one file"),
    "compare": ("kinarm.evaluation.commands.compare", "compare learners on the same problems"),
    "reproduce": ("kinarm.evaluation.commands.reproduce", "train what the paper trained"),
    "problem": ("kinarm.evaluation.commands.problem", "list, show and check problems"),
    "arms": ("kinarm.evaluation.commands.arms", "list arms, and show what is known of one"),
    "bench": ("kinarm.evaluation.commands.bench", "measure how fast everything is here"),
}
"""Modules of the commands, and what they are for, by name without ``kinarm-``."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command that is named, or list all of them."""
    typed = list(sys.argv[1:] if arguments is None else arguments)
    if typed and typed[0] in COMMANDS:
        module, _ = COMMANDS[typed[0]]
        import_module(module).main(typed[1:])
    run_command(PROG, lambda: _explain(typed or ["--help"]))


def _explain(typed: Sequence[str]) -> None:
    """Print the help or the version, or refuse a command that does not exist."""
    lines = (f"  {name:<10} {purpose}  (kinarm-{name})" for name, (_, purpose) in COMMANDS.items())
    parser = Parser(
        prog=PROG,
        description="Learn to reach with a simulated robot arm.",
        epilog="commands:\n" + "\n".join(lines) + "\n\nkinarm-eval --help, and so on, tells more.",
    )
    parser.add_argument("command", choices=COMMANDS, metavar="COMMAND", help="one of those below")
    parser.parse_args(typed)


if __name__ == "__main__":
    main()

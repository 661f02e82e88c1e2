"""``python -m kinarm`` lists the commands; ``python -m kinarm eval`` runs one of them."""

import argparse
import subprocess
import sys
from collections.abc import Sequence
from importlib import import_module

from kinarm._command_line import run_command
from kinarm._completion import SHELLS
from kinarm._parser import CommandParser

PROG = "python -m kinarm"

COMMANDS = {
    "eval": ("kinarm.evaluation.commands.evaluate", "evaluate policies beside the oracle"),
    "replay": ("kinarm.evaluation.commands.replay", "watch trials in a browser"),
    "train": ("kinarm.policies.train", "train a policy"),
    "study": ("kinarm.evaluation.commands.study", "train many policies from one file"),
    "compare": ("kinarm.evaluation.commands.compare", "compare learners on the same problems"),
    "reproduce": ("kinarm.evaluation.commands.reproduce", "train what the paper trained"),
    "problem": ("kinarm.evaluation.commands.problem", "list, show and check problems"),
    "arms": ("kinarm.evaluation.commands.arms", "list arms, and describe one"),
    "bench": ("kinarm.evaluation.commands.bench", "measure how fast everything is here"),
}
"""Modules of the commands, and what they are for, by name without ``kinarm-``."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command that is named, or list all of them."""
    typed = list(sys.argv[1:] if arguments is None else arguments)
    if typed[:1] == ["--"]:
        del typed[0]
    if typed and typed[0] in COMMANDS:
        module, _ = COMMANDS[typed[0]]
        import_module(module).main(typed[1:])
    run_command(PROG, lambda: _explain(typed or ["--help"]))


def _explain(typed: Sequence[str]) -> None:
    """Print the help, the version or completion scripts, or refuse an unknown command."""
    lines = (f"  {name:<10} {purpose}  (kinarm-{name})" for name, (_, purpose) in COMMANDS.items())
    parser = CommandParser(
        prog=PROG,
        usage=f"{PROG} COMMAND ... [options]",
        description="Learn to reach with a simulated robot arm.\n\ncommands:\n" + "\n".join(lines),
        epilog="COMMAND --help says more.",
    )
    parser.add_argument(
        "command", nargs="?", choices=COMMANDS, metavar="COMMAND", help=argparse.SUPPRESS
    )
    parser.add_argument(
        "--print-completion",
        choices=SHELLS,
        help="Print the completion script of a shell for all commands and exit",
    )
    shell = parser.parse_args(typed).print_completion
    if shell is not None:
        for module, _ in COMMANDS.values():
            words = [sys.executable, "-m", module, "--print-completion", shell]
            subprocess.run(words, check=True)


if __name__ == "__main__":
    main()

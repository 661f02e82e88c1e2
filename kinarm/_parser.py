"""The parser of command lines: help, one-line errors and version."""

import argparse
import re
import textwrap
from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

from kinarm import __version__
from kinarm.errors import one_line


class Parser(argparse.ArgumentParser):
    """An argument parser that reports bad usage in one line and exits with status 2.

    Its help ends with the text of ``data/help`` with its name, if any.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(formatter_class=HelpFormatter, add_help=False, **options)
        self._optionals.title = "general"
        # Numbers such as -1e-05, too, are values and no options.
        self._negative_number_matcher = re.compile(r"-\.?\d")
        self.add_argument("-h", "--help", action="help", help="Show this help and exit")
        self.add_argument(
            "--version",
            action="version",
            version=f"kinarm {__version__}",
            help="Show the version of kinarm and exit",
        )

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Parse, and refuse unknown options."""
        parsed, unknown = super().parse_known_args(args, namespace)
        if unknown:
            given = (word.partition("=")[0] for word in unknown if word.startswith("--"))
            known = self._option_string_actions
            meant = [name for word in given for name in get_close_matches(word, known, 1)]
            hint = f"; did you mean {', '.join(meant)}?" if meant else ""
            self.error(f"unrecognized arguments: {' '.join(unknown)}{hint}")
        return parsed, unknown

    def add_commands(self, what: str) -> "argparse._SubParsersAction[Parser]":
        """Let the first word be a command, called ``what``, with options."""
        title, metavar = f"{what}s", what.upper()
        return self.add_subparsers(
            title=title, dest=what, required=True, metavar=metavar, parser_class=Parser
        )

    def error(self, message: str) -> NoReturn:
        """Print one line on standard error and exit."""
        self.exit(2, f"{self.prog}: {one_line(message)} (see {self.prog} --help)\n")

    def format_help(self) -> str:
        """Usage, purpose, then groups of options, the general one last."""
        self._action_groups.sort(key=lambda group: group is self._optionals)
        end = Path(import_module("kinarm.data").__path__[0], "help", f"{self.prog}.txt")
        if end.is_file():
            self.epilog = end.read_text()
        return super().format_help()


def group_of_options(parser: argparse._ActionsContainer, title: str) -> argparse._ActionsContainer:
    """Group of a parser with a title, made if missing."""
    for group in parser._action_groups:
        if group.title == title:
            return group
    return parser.add_argument_group(title)


class HelpFormatter(argparse.RawDescriptionHelpFormatter):
    """Its usage shows what is needed alone, and names are not broken at hyphens."""

    def _format_usage(
        self,
        usage: str | None,
        actions: Iterable[argparse.Action],
        groups: Iterable[argparse._MutuallyExclusiveGroup],
        prefix: str | None,
    ) -> str:
        if usage is not None:
            return super()._format_usage(usage, actions, groups, prefix)
        known = list(actions)
        needed = [each for each in known if each.required or not each.option_strings]
        options = " [options]" if len(needed) < len(known) else ""
        return super()._format_usage(None, needed, (), prefix).rstrip("\n") + f"{options}\n\n"

    def _split_lines(self, text: str, width: int) -> list[str]:
        return textwrap.wrap(" ".join(text.split()), width, break_on_hyphens=False)

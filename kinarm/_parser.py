"""The parser of command lines: help that can be read, one-line errors, version and completion."""

import argparse
import re
import sys
import textwrap
from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from typing import Any, ClassVar, NoReturn

from kinarm.errors import one_line

EXAMPLE = re.compile(r"  (\S.*?) {2,}(\S.*)$")
"""A line of help with an example and its meaning."""


class Parser(argparse.ArgumentParser):
    """An argument parser that reports bad usage in one line and exits with status 2.

    Attributes
    ----------
    completable : bool
        Whether it prints the completion of a shell.
    """

    completable: ClassVar[bool] = True

    def __init__(self, **options: Any) -> None:
        super().__init__(formatter_class=HelpFormatter, add_help=False, **options)
        self._optionals.title = "general"
        self.add_argument("-h", "--help", action="help", help="Show this help and exit")
        self.add_argument(
            "--version", action=_ShowVersion, nargs=0, help="Show the version of kinarm and exit"
        )
        if self.completable:
            from kinarm._completion import SHELLS, PrintCompletion

            self.add_argument(
                "--print-completion",
                action=PrintCompletion,
                choices=SHELLS,
                help="Print the completion script of a shell and exit",
            )

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Parse, and refuse what is unknown here: the parser of a command knows its own options."""
        parsed, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}{self._suggestion(unknown)}")
        return parsed, unknown

    def _suggestion(self, unknown: Sequence[str]) -> str:
        """Options that are spelt like the unknown ones."""
        given = (word.partition("=")[0] for word in unknown if word.startswith("--"))
        known = self._option_string_actions
        meant = [name for word in given for name in get_close_matches(word, known, 1)]
        return f"; did you mean {', '.join(meant)}?" if meant else ""

    def error(self, message: str) -> NoReturn:
        """Print one line on standard error and exit."""
        self.exit(2, f"{self.prog}: {one_line(message)} (see {self.prog} --help)\n")

    def format_help(self) -> str:
        """Usage, purpose, then the groups of options; what all commands have comes last."""
        general = self._optionals
        self._action_groups.sort(key=lambda group: group is general)
        return super().format_help()


class CommandParser(Parser):
    """The parser of one of the commands of a program, which leaves completion to the program's."""

    completable = False


def group_of_options(parser: argparse._ActionsContainer, title: str) -> argparse._ActionsContainer:
    """The group of a parser with a title, which is made if there is none."""
    for group in parser._action_groups:
        if group.title == title:
            return group
    return parser.add_argument_group(title)


class HelpFormatter(argparse.HelpFormatter):
    """Wraps paragraphs, and leaves lines that are indented as they are, if they are short enough.

    Where an example is not, all have their meaning on a line of its own; one that is still too long
    goes on in the next line, as shells accept it. Usage names what has to be given.
    """

    def _format_usage(
        self,
        usage: str | None,
        actions: Iterable[argparse.Action],
        groups: Iterable[argparse._MutuallyExclusiveGroup],
        prefix: str | None,
    ) -> str:
        if usage is None:
            known = list(actions)
            needed = [action for action in known if action.required and action.option_strings]
            words = [f"{each.option_strings[0]} {self._metavar(each)}" for each in needed]
            words += [self._positional(each) for each in known if not each.option_strings]
            if len(needed) < sum(bool(each.option_strings) for each in known):
                words.append("[options]")
            usage = " ".join(["%(prog)s", *words]).replace("%(prog)s", self._prog)
            return f"usage: {usage}\n\n" if prefix is None else f"{prefix}{usage}"
        return super()._format_usage(usage, actions, groups, prefix)

    def _metavar(self, action: argparse.Action) -> str:
        return self._format_args(action, self._get_default_metavar_for_optional(action))

    def _positional(self, action: argparse.Action) -> str:
        return self._format_args(action, self._get_default_metavar_for_positional(action))

    def _split_lines(self, text: str, width: int) -> list[str]:
        return textwrap.wrap(" ".join(text.split()), width, break_on_hyphens=False)

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        blocks = (block.strip("\n") for block in re.split(r"\n{2,}", text.strip("\n")))
        return "\n\n".join(self._block(block, width, indent) for block in blocks)

    def _block(self, block: str, width: int, indent: str) -> str:
        """A paragraph, or lines of which some are indented."""
        if "\n " not in block and not block.startswith(" "):
            return textwrap.fill(
                block,
                width,
                initial_indent=indent,
                subsequent_indent=indent,
                break_on_hyphens=False,
            )
        lines = block.splitlines()
        if max(map(len, lines)) > width:
            apart = "\n".join(EXAMPLE.sub(r"  \1\n      \2", line) for line in lines)
            lines = [part for line in apart.splitlines() for part in _continued(line, width)]
        return "\n".join(indent + line for line in lines)


def _continued(line: str, width: int) -> list[str]:
    """A line of help in lines of this width at most; those of an example end in backslashes."""
    if len(line) <= width:
        return [line]
    start = line[: len(line) - len(line.lstrip())]
    mark, further = (" \\", "  ") if len(start) == 2 else ("", "")
    *parts, last = textwrap.wrap(
        line.strip(),
        width - len(mark),
        initial_indent=start,
        subsequent_indent=start + further,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [*(part + mark for part in parts), last]


class _ShowVersion(argparse.Action):
    """Print the version of kinarm, which is looked up only then, and exit."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**{**options, "default": argparse.SUPPRESS})

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from importlib.metadata import version

        sys.stdout.write(f"kinarm {version('kinarm')}\n")
        parser.exit()

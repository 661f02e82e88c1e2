"""Completion of shells: shtab prints the script of a shell."""

import argparse
import re
import shlex
import sys
import textwrap
import zlib
from collections.abc import Callable, Iterable, Iterator
from typing import Any

SHELLS = ("bash", "zsh", "fish")

DETAILS = re.compile(r" \(default: |\. Names: |[;:] ")
"""Where the help of an option goes into details."""

LONGEST = 60
"""Letters of a help that a shell shows."""

FUNCTIONS: dict[str, Callable[[Iterable[str], str], str]] = {
    "bash": lambda names, call: (
        f"{call}() {{ compgen -W {shlex.quote(' '.join(names))} -- $1; _shtab_compgen_files $1; }}"
    ),
    "zsh": lambda names, call: f"{call}() {{ compadd -- {shlex.join(names)}; _files }}",
    "fish": lambda names, call: (
        f"function {call}; printf '%s\\n' {shlex.join(names)}; "
        "__fish_complete_path (commandline -ct); end"
    ),
}
"""Functions of shells that list names and files."""


class PrintCompletion(argparse.Action):
    """Print the script with which a shell completes a command, and exit."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**{**options, "default": argparse.SUPPRESS})

    def __call__(self, parser: argparse.ArgumentParser, *given: Any) -> None:
        _, shell, *_ = given
        sys.stdout.write(completion_script(parser, shell))
        parser.exit()


def completion_script(parser: argparse.ArgumentParser, shell: str) -> str:
    """The script with which a shell completes the options of a parser.

    Options that take files have ``file`` or ``folder`` as their ``completes``; those that take
    names, too, have a function that lists these.
    """
    import shtab

    for action in _actions(parser):
        if action.help:
            action.help = textwrap.shorten(
                DETAILS.split(action.help)[0], LONGEST, placeholder=" ..."
            )
        completes = getattr(action, "completes", None)
        if completes in ("file", "folder"):
            action.complete = shtab.FILE if completes == "file" else shtab.DIRECTORY  # type: ignore[attr-defined]
        elif completes is not None:
            action.complete = _names_or_files(shell, tuple(completes()))  # type: ignore[attr-defined]
    script: str = shtab.complete(parser, shell=shell)
    return script + "\n"


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """All options of a parser and of the commands that it has."""
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for inner in action.choices.values():
                yield from _actions(inner)


def _names_or_files(shell: str, names: tuple[str, ...]) -> dict[str, Any]:
    """How a shell completes one of some names, or a file."""
    call = f"_kinarm_files_or_names_{zlib.crc32(' '.join(names).encode()):08x}"
    return {
        "bash": call,
        "zsh": f"{{{call}}}",
        "fish": f"({call})",
        "preamble": {shell: FUNCTIONS[shell](names, call)},
    }

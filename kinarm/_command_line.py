"""Command lines: how they run, and the statuses that they end with."""

import io
import os
import shlex
import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from typing import Any, NoReturn, TypeVar

from kinarm._interrupts import EXIT_STATUS, begin, end, was_interrupted
from kinarm._options import add_options, given_options
from kinarm._parser import CommandParser, Parser
from kinarm.errors import KinarmError, one_line

Request = TypeVar("Request")
Commands = Mapping[str, tuple[type, Callable[[Any], None]]]
"""By name, the request of each command, and what runs it and prints what it came to."""


def run_command(prog: str, command: Callable[[], None]) -> NoReturn:
    """Run a command line and turn its outcome into an exit status; here every command ends.

    Status 0 is success, 1 a failure of the machine, 2 bad input, 130 an interruption; all but
    success come with one line on standard error. A reader that closes the pipe is no failure.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # letters that an encoding lacks
    begin()
    try:
        status = _run(command)
        end()
    except BaseException as error:
        end()
        status = _status_of(prog, error)
    sys.exit(status)


def _run(command: Callable[[], None]) -> int:
    """Run a command and flush what it printed."""
    status = 0
    try:
        command()
    except SystemExit as leaving:
        status = leaving.code if isinstance(leaving.code, int) else 0
    sys.stdout.flush()
    return status


def _status_of(prog: str, error: BaseException) -> int:
    """Report an error in one line and return the status; raise faults of kinarm itself again."""
    if was_interrupted(error):
        _discard_output()
        said = str(error) if isinstance(error, KeyboardInterrupt) else ""
        return _report(prog, said or "interrupted", EXIT_STATUS)
    if isinstance(error, KinarmError):
        return _report(prog, str(error), error.exit_status)
    if isinstance(error, BrokenPipeError):
        _discard_output()
        return 0
    if isinstance(error, OSError):
        _discard_output()
        return _report(prog, f"{error.filename or 'standard output'}: {error.strerror}", 1)
    if isinstance(error, MemoryError):
        return _report(prog, f"out of memory: {str(error) or 'no more to be had'}", 1)
    raise error


def _discard_output() -> None:
    with suppress(io.UnsupportedOperation):  # a stream of this process alone
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _report(prog: str, message: str, status: int) -> int:
    sys.stderr.write(f"{prog}: {one_line(message)}\n")
    return status


def run_request(
    prog: str,
    kind: type[Request],
    report: Callable[[Request, str], None],
    arguments: Sequence[str] | None,
    *,
    epilog: str = "",
    skip: Collection[str] = (),
) -> NoReturn:
    """Run a command line all of whose options are the fields of one request; see `run_command`.

    Parameters
    ----------
    prog, kind
        Name of the command, and its request, a dataclass whose first line says what it does.
    report : callable
        Runs a request and prints what it came to; its second argument is the command as typed.
    arguments : sequence of str, optional
        What is typed after the name; by default that of this process.
    epilog, skip
        What help ends with, and fields that are no options.
    """
    typed = sys.argv[1:] if arguments is None else arguments
    parser = Parser(prog=prog, description=_first_line(kind), epilog=epilog)
    add_options(parser, kind, skip=skip)
    command = " ".join([prog, *map(shlex.quote, typed)])
    run_command(
        prog, lambda: report(kind(**given_options(parser.parse_args(typed), kind)), command)
    )


def run_commands(
    prog: str,
    description: str,
    commands: Commands,
    arguments: Sequence[str] | None,
    *,
    epilog: str = "",
) -> NoReturn:
    """Run a command line whose first word is one of several commands; see `run_command`.

    Parameters
    ----------
    prog, description, arguments, epilog
        As for `run_request`; the description says what the program is for.
    commands : mapping
        See `Commands`.
    """
    parser = Parser(prog=prog, description=description, epilog=epilog)
    parsers = parser.add_subparsers(
        title="commands",
        dest="command",
        required=True,
        metavar="COMMAND",
        parser_class=CommandParser,
    )
    for name, (kind, _) in commands.items():
        said = _first_line(kind)
        add_options(parsers.add_parser(name, help=said, description=said), kind)

    def run() -> None:
        options = parser.parse_args(arguments)
        kind, report = commands[options.command]
        report(kind(**given_options(options, kind)))

    run_command(prog, run)


def _first_line(kind: type) -> str:
    return (kind.__doc__ or "").partition("\n")[0]

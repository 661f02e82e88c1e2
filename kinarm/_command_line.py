"""What the command lines share: options from dataclasses, one-line errors, exit statuses."""

import argparse
import io
import math
import os
import re
import shlex
import sys
import textwrap
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, Field, is_dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple, NoReturn, TypeVar, get_args, get_origin, get_type_hints

from kinarm._fields import alternatives, expected, init_fields, summary_of
from kinarm._interrupts import EXIT_STATUS, begin, end, was_interrupted
from kinarm.errors import KinarmError, one_line

Request = TypeVar("Request")

EXAMPLE = re.compile(r"  (\S.*?) {2,}(\S.*)$")
"""A line of help with an example and its meaning."""


class Parser(argparse.ArgumentParser):
    """An argument parser that reports bad usage in one line and exits with status 2."""

    def __init__(self, **options: Any) -> None:
        super().__init__(formatter_class=_HelpFormatter, **options)
        self.add_argument(
            "--version", action=_ShowVersion, nargs=0, help="show kinarm's version and exit"
        )

    def error(self, message: str) -> NoReturn:
        """Print one line on standard error and exit."""
        self.exit(2, f"{self.prog}: {one_line(message)} (see {self.prog} --help)\n")


class _HelpFormatter(argparse.HelpFormatter):
    """Wraps paragraphs, and leaves lines that are indented as they are, if they are short enough.

    An example that is not has its meaning on a line of its own.
    """

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        blocks = (block.strip("\n") for block in re.split(r"\n{2,}", text.strip("\n")))
        return "\n\n".join(self._block(block, width, indent) for block in blocks)

    def _block(self, block: str, width: int, indent: str) -> str:
        """A paragraph, or lines of which some are indented."""
        if "\n " not in block and not block.startswith(" "):
            return textwrap.fill(block, width, initial_indent=indent, subsequent_indent=indent)
        lines: list[str] = []
        for line in block.splitlines():
            example = EXAMPLE.match(line)
            if example and len(line) > width:
                lines += [f"  {example[1]}", f"      {example[2]}"]
            else:
                lines.append(line)
        return "\n".join(indent + line for line in lines)


class _ShowVersion(argparse.Action):
    """Print the version of kinarm, which is looked up only then, and exit."""

    def __init__(self, **options: Any) -> None:
        super().__init__(default=argparse.SUPPRESS, **options)

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from importlib.metadata import version

        sys.stdout.write(f"kinarm {version('kinarm')}\n")
        parser.exit()


def run_command(prog: str, command: Callable[[], None]) -> NoReturn:
    """Run a command line and turn its outcome into an exit status; here every command ends.

    Status 0 is success, 1 a failure of the machine, 2 bad input, 130 an interruption; all but
    success come with one line on standard error. A reader that closes the pipe is no failure.
    """
    _prepare_streams()
    begin()
    try:
        status = _run(command)
        end()
    except BaseException as error:
        end()
        status = _status_of(prog, error)
    sys.exit(status)


def _prepare_streams() -> None:
    """Let whatever is printed be printable: on closed streams, and in encodings without it."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed before this process began
            setattr(sys, name, open(os.devnull, "w"))  # noqa: PTH123, SIM115
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


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
    """Tell of an error in one line; what is nobody's fault but kinarm's is raised again."""
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
    """Let what is still buffered for standard output go nowhere, so that exiting is quiet."""
    with suppress(io.UnsupportedOperation):  # a stream of this process alone
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _report(prog: str, message: str, status: int) -> int:
    sys.stderr.write(f"{prog}: {one_line(message)}\n")
    return status


def add_options(
    parser: argparse._ActionsContainer,
    kind: type,
    *,
    skip: Collection[str] = (),
    negatable: bool = False,
) -> None:
    """Add an option for every field of a dataclass; only those that are given are parsed.

    Names, types and help come from the dataclass and its docstring. A field's metadata may hold
    ``flag`` (another name of the option, or one without dashes for a positional argument),
    ``metavar``, ``repeat`` (a tuple is collected from repetitions of the option), and ``names`` (a
    function that lists the names that an option takes, for its help). The fields
    of a nested dataclass get its name as a prefix, such as ``--reward-success``. If ``negatable``,
    there is an option ``--no-x`` also for what is false by default.
    """
    for name, item in init_fields(kind).items():
        if name not in skip:
            _add_option(parser, kind, item, negatable=negatable)


def _add_option(
    parser: argparse._ActionsContainer,
    kind: type,
    item: Field[Any],
    prefix: str = "",
    negatable: bool = False,
) -> None:
    """Add the option of one field, or those of a nested dataclass."""
    hint = alternatives(get_type_hints(kind)[item.name])[0]
    if isinstance(hint, type) and is_dataclass(hint):
        for inner in init_fields(hint).values():
            _add_option(parser, hint, inner, f"{prefix}{item.name}.", negatable=True)
        return
    name = f"{prefix}{item.name}"
    flag = option_name(item, prefix)
    options: dict[str, Any] = {"default": argparse.SUPPRESS, "help": _help(kind, item)}
    if flag.startswith("--"):
        options["dest"] = name
        options["required"] = item.default is MISSING and item.default_factory is MISSING
    elif item.default is not MISSING:
        options["nargs"] = "?"
    if hint is bool:
        negative = item.default is True and "flag" not in item.metadata
        action = argparse.BooleanOptionalAction if negatable or negative else "store_true"
        parser.add_argument(flag, action=action, **options)
        return
    if get_origin(hint) is tuple:
        hint, *others = get_args(hint)
        count = "+" if Ellipsis in others else 1 + len(others)
        options |= {"action": "append"} if item.metadata.get("repeat") else {"nargs": count}
    usual = METAVARS.get(hint, "NAME") if flag.startswith("--") else flag
    options["metavar"] = item.metadata.get("metavar", usual)
    if get_origin(hint) is Literal:
        options["choices"] = get_args(hint)
        del options["metavar"]
    parser.add_argument(flag, type=_parser_of(hint), **options)


def option_name(item: Field[Any], prefix: str = "") -> str:
    """What the option of a field is called."""
    usual = "--" + re.sub(r"[._]", "-", f"{prefix}{item.name}")
    return str(item.metadata.get("flag", usual))


METAVARS = {int: "N", float: "X", Path: "FILE"}


def _help(kind: type, item: Field[Any]) -> str:
    """Description of a field and its default, as argparse formats it."""
    default = item.default
    said = summary_of(kind, item.name).replace("`", "")
    if "names" in item.metadata:
        said = f"{said.removesuffix('.')}. Names: {', '.join(item.metadata['names']())}."
    if isinstance(default, bool) or default in (None, (), MISSING):
        return said.replace("%", "%%")
    shown = " ".join(map(str, default)) if isinstance(default, tuple) else default
    return f"{said} ({shown})".replace("%", "%%")


def _parser_of(hint: Any) -> Callable[[str], Any]:
    """Argument type: refuses texts that are not of a type."""

    def parse(text: str) -> Any:
        if text is argparse.SUPPRESS:  # a positional argument that is not given
            return text
        try:
            value = hint(text) if hint in (int, float) else text
        except ValueError:
            value = math.nan
        if isinstance(value, float) and not math.isfinite(value):
            wanted = "a finite number" if hint is float else expected(hint)
            raise argparse.ArgumentTypeError(f"must be {wanted}, got {text!r}")
        return Path(text) if hint is Path else value

    return parse


def given_options(options: argparse.Namespace, kind: type) -> dict[str, Any]:
    """What the command line gives of a dataclass's fields; nested ones as mappings."""
    given: dict[str, Any] = {}
    for name, value in vars(options).items():
        outer, _, inner = name.partition(".")
        if outer not in init_fields(kind):
            continue
        if inner:
            given.setdefault(outer, {})[inner] = value
        else:
            given[name] = tuple(value) if isinstance(value, list) else value
    return given


def request_of(options: argparse.Namespace, kind: type[Request]) -> Request:
    """Build the dataclass of what the command line gives; the rest has its defaults."""
    return kind(**given_options(options, kind))


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
    prog : str
        Name of the command; what it does is the first line of the request's docstring.
    kind : type
        The request, a dataclass.
    report : callable
        Runs a request and prints what it came to; its second argument is the command as typed.
    arguments : sequence of str, optional
        What is typed after the name; by default that of this process.
    epilog, skip
        What help ends with, and fields that are no options.
    """
    typed = sys.argv[1:] if arguments is None else arguments
    parser = Parser(prog=prog, description=(kind.__doc__ or "").partition("\n")[0], epilog=epilog)
    add_options(parser, kind, skip=skip)
    command = shlex.join([prog, *typed])
    run_command(prog, lambda: report(request_of(parser.parse_args(typed), kind), command))


class Command(NamedTuple):
    """One of several commands of a program.

    Attributes
    ----------
    kind : type
        Its request, a dataclass; the first line of its docstring says what it does.
    report : callable
        Runs a request and prints what it came to.
    """

    kind: type
    report: Callable[[Any], None]


def run_commands(
    prog: str,
    description: str,
    commands: Mapping[str, Command],
    arguments: Sequence[str] | None,
    *,
    epilog: str = "",
) -> NoReturn:
    """Run a command line whose first word is one of several commands; see `run_command`.

    Parameters
    ----------
    prog : str
        Name of the program.
    description : str
        What it is for.
    commands : mapping
        The commands by name.
    arguments : sequence of str, optional
        What is typed after the name; by default that of this process.
    epilog : str
        What help ends with.
    """
    parser = Parser(prog=prog, description=description, epilog=epilog)
    parsers = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, command in commands.items():
        said = (command.kind.__doc__ or "").partition("\n")[0]
        add_options(parsers.add_parser(name, help=said, description=said), command.kind)

    def run() -> None:
        options = parser.parse_args(arguments)
        command = commands[options.command]
        command.report(request_of(options, command.kind))

    run_command(prog, run)


def print_table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table on standard output, as wide as the terminal, or as it is if that is none."""
    from rich.table import Table

    from kinarm._console import open_console

    table = Table(*headings, box=None, header_style="bold", pad_edge=False)
    for row in rows:
        table.add_row(*row)
    open_console(piped_width=1000).print(table)

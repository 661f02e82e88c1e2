"""Command lines: options from fields of dataclasses, runs and ends."""

import argparse
import io
import math
import os
import re
import shlex
import signal
import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, Field, is_dataclass
from pathlib import Path
from typing import Any, Literal, NoReturn, TypeVar, get_args, get_origin

from kinarm._fields import alternatives, expected, field_types, init_fields, summary_of
from kinarm._interrupts import EXIT_STATUS, answer_requests, interrupt, is_interruption
from kinarm._parser import Parser, group_of_options
from kinarm.errors import KinarmError, one_line

METAVARS = {int: "N", float: "X", Path: "FILE"}

Request = TypeVar("Request")
Commands = Mapping[str, tuple[type, Callable[[Any], None]]]
"""Requests of commands by name, and what runs them."""


def add_options(
    parser: argparse._ActionsContainer,
    kind: type,
    *,
    skip: Collection[str] = (),
    explicit: bool = False,
    names: Mapping[str, Sequence[str]] | None = None,
) -> None:
    """Add an option for every field of a dataclass; only given ones are parsed.

    Names, types and help come from the dataclass and its docstring. Fields of a
    nested dataclass get its name as a prefix, such as ``--reward-success``. A
    class attribute ``GROUPS`` puts fields, a text of their names, into titled
    groups; ``DEFAULTS`` says what happens without an option whose field has no
    telling default, and such a field may be left out.

    A field's metadata may hold ``flag`` (another name of the option; without
    dashes, of a positional argument), ``bare`` (values are also taken without
    the option), ``metavar``, ``repeat`` (repetitions of the option give a
    tuple, else its several values), ``nargs`` (how many of these),
    ``parse`` (makes the value of the text), ``names`` (lists names for help;
    those given here come first).

    With ``explicit``, help says every default, and what is false by default has
    ``--no-x``. Fields to ``skip`` get no option.
    """
    groups: Mapping[str, str] = getattr(kind, "GROUPS", {})
    titles = {name: title for title, members in groups.items() for name in members.split()}
    is_parser = isinstance(parser, argparse.ArgumentParser)
    rest = group_of_options(parser, "options") if is_parser else parser
    items = init_fields(kind)
    for name in dict.fromkeys((*titles, *items)):
        if name not in skip:
            group = group_of_options(parser, titles[name]) if name in titles else rest
            _add_option(group, kind, items[name], explicit=explicit, names=names or {})


def _add_option(
    parser: argparse._ActionsContainer,
    kind: type,
    item: Field[Any],
    prefix: str = "",
    *,
    explicit: bool,
    names: Mapping[str, Sequence[str]],
) -> None:
    """Add the options of a field."""
    hint = alternatives(field_types(kind)[item.name])[0]
    if isinstance(hint, type) and is_dataclass(hint):
        for inner in init_fields(hint).values():
            _add_option(parser, hint, inner, f"{prefix}{item.name}.", explicit=True, names=names)
        return
    flag = option_name(item, prefix)
    known = names.get(item.name) or item.metadata.get("names", tuple)()
    default = _default(kind, item, explicit=explicit)
    options: dict[str, Any] = {
        "default": argparse.SUPPRESS,
        "help": _help(summary_of(kind, item.name), known, default),
    }
    if flag.startswith("--"):
        without = item.default is MISSING and item.default_factory is MISSING
        options |= {"dest": f"{prefix}{item.name}", "required": without and not default}
    elif item.default is not MISSING:
        options["nargs"] = "?"
    if hint is bool:
        negative = item.default is True and "flag" not in item.metadata
        action = argparse.BooleanOptionalAction if explicit or negative else "store_true"
        parser.add_argument(flag, action=action, **options)
        return
    values = _value_options(item, hint, flag)
    parser.add_argument(flag, **options, **values)
    if item.metadata.get("bare"):
        several = {
            "nargs": "*" if get_origin(hint) is tuple else "?",
            "help": f"The same as {flag}",
        }
        bare = {"default": argparse.SUPPRESS, **values, **several}
        parser.add_argument(f"{prefix}{item.name}", **bare)


def _value_options(item: Field[Any], hint: Any, flag: str) -> dict[str, Any]:
    """How argparse takes the value of an option."""
    options: dict[str, Any] = {}
    if "parse" in item.metadata:
        make = _argument_type(item.metadata["parse"], hint)
        return {"type": make, "metavar": item.metadata["metavar"]}
    if get_origin(hint) is tuple:
        hint, *others = get_args(hint)
        if item.metadata.get("repeat"):
            options = {"action": "append"}
        elif Ellipsis in others:
            options = {"action": "extend", "nargs": item.metadata.get("nargs", "+")}
        else:
            options = {"nargs": 1 + len(others)}
    if get_origin(hint) is Literal:
        options["choices"] = get_args(hint)
    else:
        usual = METAVARS.get(hint, "NAME") if flag.startswith("--") else flag
        options["metavar"] = item.metadata.get("metavar", usual)
    return {**options, "type": _argument_type(hint if hint in METAVARS else str, hint)}


def _argument_type(make: Callable[[str], Any], hint: Any) -> Callable[[str], Any]:
    """Make the value of a text, or refuse it."""

    def parsed(text: str) -> Any:
        if text is argparse.SUPPRESS:  # a positional argument that is not given
            return text
        try:
            value = make(text)
        except KinarmError as error:
            raise argparse.ArgumentTypeError(str(error)) from error
        except ValueError:
            value = math.nan
        if isinstance(value, float) and not math.isfinite(value):
            wanted = "a finite number" if hint is float else expected(hint)
            raise argparse.ArgumentTypeError(f"must be {wanted}, got {text!r}")
        return value

    return parsed


def option_name(item: Field[Any], prefix: str = "") -> str:
    """Name of the option of a field."""
    usual = "--" + re.sub(r"[._]", "-", f"{prefix}{item.name}")
    return str(item.metadata.get("flag", usual))


def _default(kind: type, item: Field[Any], *, explicit: bool) -> str:
    """Value without an option, in words; empty if it is obvious."""
    defaults: Mapping[str, str] = getattr(kind, "DEFAULTS", {})
    default = item.default
    if item.name in defaults:
        return defaults[item.name]
    if isinstance(default, bool):
        return "yes" if default else "no" if explicit else ""
    if default in (None, ()):
        return "none" if explicit else ""
    if default is MISSING:
        return ""
    return " ".join(map(str, default)) if isinstance(default, tuple) else str(default)


def _help(said: str, names: Sequence[str], default: str) -> str:
    """Description, names and default of a field, for argparse."""
    said = said.replace("`", "")
    if default:
        said = f"{said} (default: {default})"
    if names:
        said = f"{said}. Names: {', '.join(names)}"
    return said.replace("%", "%%")


def given_options(options: argparse.Namespace, kind: type) -> dict[str, Any]:
    """Given fields of a dataclass; nested ones as mappings."""
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


def run_command(prog: str, command: Callable[[], None]) -> NoReturn:
    """Run a command line and exit with its status.

    Status 0 is success, 1 a failure of the machine, 2 bad input, 130 an interruption; all others
    print one line on standard error. A closed pipe is no failure.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # letters that an encoding lacks
    status = 0
    answer_requests(interrupt)
    try:
        try:
            command()
        except SystemExit as leaving:
            status = leaving.code if isinstance(leaving.code, int) else 0
        sys.stdout.flush()
        answer_requests(signal.SIG_IGN)
    except BaseException as error:
        answer_requests(signal.SIG_IGN)
        status = _status_of(prog, error)
    sys.exit(status)


def _status_of(prog: str, error: BaseException) -> int:
    """Report an error in one line; return its status, or raise kinarm's faults."""
    if is_interruption(error):
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
    arguments: Sequence[str] | None = None,
    *,
    skip: Collection[str] = (),
    others: Mapping[str, tuple[type, Callable[[Any, str], None]]] | None = None,
) -> NoReturn:
    """Run a command line whose options are the fields of a request; see `run_command`.

    The first line of the request's class describes the command. ``report`` runs a request and
    prints; it also gets the command as typed, by default in this process. If the first word is one
    of ``others``, their request and report take the rest.
    """
    typed = sys.argv[1:] if arguments is None else arguments
    if others and typed and typed[0] in others:
        run_request(f"{prog} {typed[0]}", *others[typed[0]], typed[1:])
    parser = Parser(prog=prog, description=_first_line(kind))
    add_options(parser, kind, skip=skip)
    command = " ".join([prog, *map(shlex.quote, typed)])
    run_command(
        prog, lambda: report(kind(**given_options(parser.parse_args(typed), kind)), command)
    )


def run_commands(
    prog: str, description: str, commands: Commands, arguments: Sequence[str] | None = None
) -> NoReturn:
    """Run a command line whose first word is a command, the first one by default."""
    parser = Parser(prog=prog, description=description)
    parsers = parser.add_commands("command")
    for name, (kind, _) in commands.items():
        said = _first_line(kind)
        add_options(parsers.add_parser(name, help=said, description=said), kind)

    def run() -> None:
        typed = sys.argv[1:] if arguments is None else arguments
        options = parser.parse_args(typed or [next(iter(commands))])
        kind, report = commands[options.command]
        report(kind(**given_options(options, kind)))

    run_command(prog, run)


def _first_line(kind: type) -> str:
    return (kind.__doc__ or "").partition("\n")[0]

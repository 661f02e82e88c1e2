"""What the command lines share: one-line errors, exit statuses and argument types."""

import argparse
import math
import os
import shlex
import sys
from collections.abc import Callable, Sequence
from typing import NoReturn

from kinarm.errors import KinarmError


class Parser(argparse.ArgumentParser):
    """An argument parser that reports bad usage in one line and exits with status 2."""

    def error(self, message: str) -> NoReturn:
        """Print one line on standard error and exit."""
        self.exit(2, f"{self.prog}: {' '.join(message.split())} (see {self.prog} --help)\n")


def run_command(prog: str, command: Callable[[], None]) -> NoReturn:
    """Run a command line and turn its outcome into an exit status.

    Status 0 is success, 1 a failure of the machine, 2 bad input, 130 an interruption; all but
    success come with one line on standard error. A reader that closes the pipe is no failure.
    """
    sys.exit(_status(prog, command))


def _status(prog: str, command: Callable[[], None]) -> int:
    """Run a command and flush what it printed."""
    try:
        try:
            command()
        except SystemExit as leaving:
            sys.stdout.flush()
            return leaving.code if isinstance(leaving.code, int) else 0
        sys.stdout.flush()
    except KinarmError as error:
        return _report(prog, str(error), error.exit_status)
    except BrokenPipeError:
        _discard_output()
    except OSError as error:
        _discard_output()
        return _report(prog, f"{error.filename or 'standard output'}: {error.strerror}", 1)
    except KeyboardInterrupt as interruption:
        return _report(prog, str(interruption) or "interrupted", 130)
    return 0


def _discard_output() -> None:
    """Let what is still buffered for standard output go nowhere, so that exiting is quiet."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _report(prog: str, message: str, status: int) -> int:
    sys.stderr.write(f"{prog}: {' '.join(message.split())}\n")
    return status


def whole_number(at_least: int) -> Callable[[str], int]:
    """Argument type: an integer that is at least some value."""

    def parse(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            value = at_least - 1
        if value < at_least:
            raise argparse.ArgumentTypeError(
                f"must be a whole number of at least {at_least}, got {text!r}"
            )
        return value

    return parse


def finite_number(text: str) -> float:
    """Argument type: a finite number."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"must be a finite number, got {text!r}")
    return value


def command_text(prog: str, arguments: Sequence[str] | None) -> str:
    """The command as typed, for the record."""
    return shlex.join([prog, *(sys.argv[1:] if arguments is None else arguments)])

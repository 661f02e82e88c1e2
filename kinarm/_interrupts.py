"""Requests to end: Ctrl-C and its like end a command in one line and with one status.

While a command runs, a request raises an `Interruption`, unless one is on its way; while it ends,
requests are ignored. Other processes are left alone.
"""

import os
import re
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

REQUESTS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
EXIT_STATUS = 130

GOES_ON = "interrupted; what is finished is kept, and the same command goes on"


class Interruption(KeyboardInterrupt):
    """A request to end.

    An exact `KeyboardInterrupt` within `exec`, as in imports, makes CPython end a process by the
    signal.
    """


def is_command() -> bool:
    """Whether this process is kinarm's script or ``python -m kinarm``."""
    program = sys.argv[0] if sys.argv else ""
    if program == "-m":  # while Python looks for the module, which may be ours
        return any(re.fullmatch(r"(-\w*m)?kinarm(\..+)?", word) for word in sys.orig_argv)
    name = os.path.basename(program)  # noqa: PTH119
    return name.partition("-")[0] == "kinarm" and program in sys.orig_argv


def answer_requests(answer: Any) -> None:
    """Set how a command answers; requests that are ignored from the start stay so."""
    if is_command():  # pragma: no cover - tests are no command; test_interrupts starts some
        for request in REQUESTS:
            if signal.getsignal(request) is not signal.SIG_IGN:
                signal.signal(request, answer)


def interrupt(*_: object) -> None:
    """Raise an `Interruption`, unless one is on its way."""
    if not is_interruption(sys.exc_info()[1]):
        raise Interruption


def is_interruption(error: BaseException | None) -> bool:
    """Whether an error is an interruption, or came up while one was on its way."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__context__
    return error is not None


@contextmanager
def telling(what_is_left: Callable[[], str]) -> Iterator[None]:
    """Do what can be interrupted; ``what_is_left`` then gives a line."""
    try:
        yield
    except BaseException as error:
        if not is_interruption(error):
            raise
        raise KeyboardInterrupt(what_is_left()) from None


@contextmanager
def kept_from_children() -> Iterator[None]:
    """Keep what a terminal sends from processes that start here."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGHUP))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)

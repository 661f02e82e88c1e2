"""Requests to end: Ctrl-C and its like end a command in one line and with one status.

A command that starts, with this module, ends at once. While it runs, an `Interruption` is raised,
which `was_interrupted` recognises even where libraries make another error of it. While it ends,
requests are ignored. Processes that only import kinarm are left alone.
"""

import os
import re
import signal
import sys
from contextlib import contextmanager

TYPE_CHECKING = False  # `typing` takes longer to load than all the rest
if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

REQUESTS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
EXIT_STATUS = 130

GOES_ON = "interrupted; what is finished is kept, and the same command goes on"

_phase = "starting"
_requested = False


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


def _answer(*_: object) -> None:
    """Answer a request, by the command's phase."""
    global _requested
    if _phase == "starting":
        os._exit(EXIT_STATUS)
    error = sys.exc_info()[1]
    while error is not None and not isinstance(error, Interruption):
        error = error.__context__
    if _phase == "running" and error is None:  # else one is on its way
        _requested = True
        raise Interruption


def begin() -> None:
    """From now on requests are raised."""
    global _phase
    _phase = "running"


def end() -> None:
    """From now on requests are ignored."""
    global _phase
    _phase = "ending"


def was_interrupted(error: BaseException) -> bool:
    """Whether a request to end caused an error."""
    return _requested or isinstance(error, KeyboardInterrupt)


@contextmanager
def telling(what_is_left: "Callable[[], str]") -> "Iterator[None]":
    """Do what can be interrupted; ``what_is_left`` then gives a line."""
    try:
        yield
    except BaseException as error:
        if not was_interrupted(error):
            raise
        raise KeyboardInterrupt(what_is_left()) from None


@contextmanager
def kept_from_children() -> "Iterator[None]":
    """Keep what a terminal sends from processes that start here."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGHUP))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


if is_command():  # pragma: no cover - tests are no command; test_interrupts starts some
    for _request in REQUESTS:
        if signal.getsignal(_request) is not signal.SIG_IGN:
            signal.signal(_request, _answer)

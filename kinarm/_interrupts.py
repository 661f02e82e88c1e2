"""Requests to end: Ctrl-C and its like end a command in order, in one line and with one status.

While a command starts, which it does from its first line on, that of this module, there is nothing
to lose, and it ends at once. While it runs, an `Interruption` is raised; some libraries make
another error of it, and `was_interrupted` knows of it in any case. Once the command ends, requests
are ignored. Processes that only import kinarm keep their own ways.
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

    After an exact `KeyboardInterrupt` within `exec`, as imports are full of, CPython ends a
    process by the signal, whatever that returns.
    """


def is_command() -> bool:
    """Whether this process is a command of kinarm: by its script, or by ``python -m kinarm``."""
    program = sys.argv[0] if sys.argv else ""
    if program == "-m":  # so it stands while Python looks for the module, which may be ours
        return any(re.fullmatch(r"(-\w*m)?kinarm(\..+)?", word) for word in sys.orig_argv)
    name = os.path.basename(program)  # noqa: PTH119
    return name.partition("-")[0] == "kinarm" and program in sys.orig_argv


def _answer(*_: object) -> None:
    """Answer a request, by the phase in which the command is."""
    global _requested
    if _phase == "starting":
        os._exit(EXIT_STATUS)
    error = sys.exc_info()[1]
    while error is not None and not isinstance(error, Interruption):
        error = error.__context__
    if _phase == "running" and error is None:  # else one, or what was made of it, is on its way
        _requested = True
        raise Interruption


def begin() -> None:
    """From now on there is something to lose: requests are raised."""
    global _phase
    _phase = "running"


def end() -> None:
    """From now on the process ends, and requests are ignored."""
    global _phase
    _phase = "ending"


def was_interrupted(error: BaseException) -> bool:
    """Whether a request to end caused an error."""
    return _requested or isinstance(error, KeyboardInterrupt)


@contextmanager
def telling(what_is_left: "Callable[[], str]") -> "Iterator[None]":
    """Do what can be interrupted; if it is, ``what_is_left`` gives the line that is printed."""
    try:
        yield
    except BaseException as error:
        if not was_interrupted(error):
            raise
        raise KeyboardInterrupt(what_is_left()) from None


@contextmanager
def kept_from_children() -> "Iterator[None]":
    """Processes that are started here never see what a terminal sends to all of its processes."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGHUP))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


if is_command():  # pragma: no cover - tests are no command; test_interrupts starts some
    for _request in REQUESTS:
        if signal.getsignal(_request) is not signal.SIG_IGN:
            signal.signal(_request, _answer)

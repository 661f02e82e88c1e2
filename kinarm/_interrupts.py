"""Requests to end: Ctrl-C and its like reach a command once, and it ends in order.

A command answers them from its first line on, which is that of this module. While it starts,
there is nothing to lose: it ends at once. While it runs, an `Interruption` is raised, once:
further requests are ignored until the process is over. Some libraries drop exceptions or make
others of them; what got lost is raised again, and `was_interrupted` knows of it in any case.
Processes that only import kinarm keep their own ways.
"""

from __future__ import annotations

import os
import signal
import sys
from contextlib import contextmanager
from itertools import pairwise

TYPE_CHECKING = False  # `typing` takes longer to load than all the rest
if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from sys import UnraisableHookArgs
    from types import FrameType, TracebackType
    from typing import Literal

REQUESTS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
EXIT_STATUS = 130

GOES_ON = "interrupted; what is finished is kept, and the same command goes on"

AGAIN = 0.5
"""After so long, an interruption that got lost is raised again [s]."""


class Interruption(KeyboardInterrupt):
    """A request to end.

    After an exact `KeyboardInterrupt` within `exec`, as imports are full of, CPython ends a
    process by the signal, whatever that returns.
    """


PATIENCE = 3.0
"""So long may work that is asked to stop take to do so [s]."""

_phase: Literal["foreign", "starting", "running", "ending"] = "foreign"
_requested = False
_ask: Callable[[], object] | None = None


def is_command() -> bool:
    """Whether this process is a command of kinarm: by its script, or by ``python -m kinarm``."""
    program = sys.argv[0] if sys.argv else ""
    if program == "-m":  # so it stands while Python looks for the module
        return _module(sys.orig_argv).partition(".")[0] == "kinarm"
    return os.path.basename(program).startswith("kinarm-") and program in sys.orig_argv  # noqa: PTH119


def _module(words: Sequence[str]) -> str:
    """The module that a command line of Python names by ``-m``, which may follow other letters."""
    for option, word in pairwise([*words, ""]):
        if option.startswith("-m") and len(option) > 2:
            return option[2:]
        if option.startswith("-") and not option.startswith("--") and option.endswith("m"):
            return word
    return ""


def _take_over() -> None:
    """Answer requests from now on, but for those that were ignored before."""
    global _phase
    _phase = "starting"
    for request in REQUESTS:
        if signal.getsignal(request) is not signal.SIG_IGN:
            signal.signal(request, _answer)
    signal.signal(signal.SIGALRM, _answer)
    sys.unraisablehook, sys.excepthook = _tell_unraisable, _tell_printed


def _answer(_: int, __: FrameType | None) -> None:
    """Answer a request, or the reminder that there was one."""
    global _requested
    if _phase == "starting":
        os._exit(EXIT_STATUS)
    if _phase == "running" and not _on_its_way():
        if _ask is not None and not _requested:
            _requested = True
            signal.setitimer(signal.ITIMER_REAL, PATIENCE, AGAIN)
            _ask()
            return
        _requested = True
        signal.setitimer(signal.ITIMER_REAL, AGAIN, AGAIN)
        raise Interruption


def _on_its_way() -> bool:
    """Whether an interruption, or what was made of it, is being handled."""
    error = sys.exc_info()[1]
    while error is not None and not isinstance(error, Interruption):
        error = error.__context__
    return error is not None


def _tell_unraisable(failure: UnraisableHookArgs) -> None:
    """Say nothing of an interruption that has no way to go; it is raised again."""
    if not isinstance(failure.exc_value, Interruption):
        sys.__unraisablehook__(failure)


def _tell_printed(
    kind: type[BaseException], error: BaseException, traceback: TracebackType | None
) -> None:
    """Say nothing of an interruption that compiled code prints in place of passing it on."""
    if not isinstance(error, Interruption):
        sys.__excepthook__(kind, error, traceback)


def begin() -> None:
    """From now on there is something to lose: requests are raised."""
    global _phase
    if _phase == "starting":
        _phase = "running"


def end() -> None:
    """From now on the process ends, and requests are ignored."""
    global _phase
    if _phase != "foreign":
        _phase = "ending"
        signal.setitimer(signal.ITIMER_REAL, 0)
        for request in REQUESTS:
            signal.signal(request, signal.SIG_IGN)


def was_interrupted(error: BaseException) -> bool:
    """Whether a request to end caused an error."""
    return _requested or isinstance(error, KeyboardInterrupt)


@contextmanager
def telling(what_is_left: Callable[[], str]) -> Iterator[None]:
    """Do what can be interrupted; if it is, ``what_is_left`` gives the line that is printed."""
    try:
        yield
    except BaseException as error:
        if not was_interrupted(error):
            raise
        raise KeyboardInterrupt(what_is_left()) from None


@contextmanager
def asking(stop: Callable[[], object]) -> Iterator[None]:
    """Do what stops in order once ``stop`` is called: a request to end calls it.

    The request is raised afterwards, or when the work has not stopped after `PATIENCE`, or at the
    second request.
    """
    global _ask
    _ask = stop
    try:
        yield
    finally:
        _ask = None
    if _requested:
        raise Interruption


@contextmanager
def kept_from_children() -> Iterator[None]:
    """Processes that are started here never see what a terminal sends to all of its processes."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGHUP))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


if is_command():
    _take_over()  # pragma: no cover - tests are no command; test_interrupts starts some

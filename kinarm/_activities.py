"""Who is told what takes long while it is done: compilation, or what precedes a training."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

COMPILING = "compiling, once: up to half a minute"
"""What is told while kernels are compiled."""

_listeners: list[Callable[[str], object]] = []
_activities: list[str] = []


@contextmanager
def told_of_activities(listener: Callable[[str], object]) -> Iterator[None]:
    """Tell a listener what begins, in words, and what goes on when that is over, or nothing: ""."""
    _listeners.append(listener)
    try:
        yield
    finally:
        _listeners.remove(listener)


@contextmanager
def doing(activity: str) -> Iterator[None]:
    """Tell all listeners; the same activity within it belongs to it."""
    before = _latest()
    _activities.append(activity)
    _tell(before)
    try:
        yield
    finally:
        _activities.remove(activity)
        _tell(activity)


def _latest() -> str:
    return _activities[-1] if _activities else ""


def _tell(before: str) -> None:
    if (now := _latest()) != before:
        for listener in _listeners:
            listener(now)

"""Who is told that kernels are being compiled: it takes long, and happens once."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

COMPILING = "compiling, once: up to half a minute"
"""What commands say meanwhile."""

_listeners: list[Callable[[bool], object]] = []
_depth = 0


@contextmanager
def told_of_compilation(listener: Callable[[bool], object]) -> Iterator[None]:
    """Tell a listener when compilation begins (True) and when it is over (False)."""
    _listeners.append(listener)
    try:
        yield
    finally:
        _listeners.remove(listener)


@contextmanager
def compiling() -> Iterator[None]:
    """Tell all listeners; a kernel's helpers are compiled within it, and belong to it."""
    global _depth
    _depth += 1
    _tell(begins=True)
    try:
        yield
    finally:
        _tell(begins=False)
        _depth -= 1


def _tell(*, begins: bool) -> None:
    if _depth == 1:
        for listener in _listeners:
            listener(begins)

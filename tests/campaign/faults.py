"""Failing writes: every call that changes files within a folder can be made to fail."""

import builtins
import contextlib
import errno
import io
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from unittest import mock

FAULTS: tuple[Callable[[], BaseException], ...] = (
    lambda: OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)),
    lambda: PermissionError(errno.EACCES, os.strerror(errno.EACCES)),
    lambda: OSError(errno.EIO, os.strerror(errno.EIO)),
    MemoryError,
    KeyboardInterrupt,
)
"""What a call can raise."""

WRITING = set("wax+")


class Points:
    """Counts the calls that change files of a folder, and lets one of them fail.

    Parameters
    ----------
    folder : Path
        Where calls count.
    failing : int
        Number of the call that fails; none if it is negative.
    fault : callable
        Makes what it raises.
    """

    def __init__(self, folder: Path, failing: int, fault: Callable[[], BaseException]) -> None:
        self.passed = 0
        self._folder, self._failing, self._fault = str(folder), failing, fault

    def pass_one(self) -> None:
        """Count a call; raise if it is the one that fails."""
        self.passed += 1
        if self.passed - 1 == self._failing:
            raise self._fault()

    def concerns(self, path: Any) -> bool:
        """Whether a path is one of the folder."""
        with contextlib.suppress(TypeError, ValueError):
            return str(Path(path).absolute()).startswith(self._folder)
        return False


class CountedFile:
    """A file whose writes count."""

    def __init__(self, file: Any, points: Points) -> None:
        self._file, self._points = file, points

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)

    def __enter__(self) -> "CountedFile":
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def write(self, content: Any) -> Any:
        """Write, or fail."""
        self._points.pass_one()
        return self._file.write(content)


@contextlib.contextmanager
def failing(
    folder: Path, number: int = -1, fault: Callable[[], BaseException] = OSError
) -> Iterator[Points]:
    """Let the call of a number fail that changes files of a folder; count them all."""
    points = Points(folder, number, fault)
    opened = io.open

    def open_counted(file: Any, mode: str = "r", *others: Any, **options: Any) -> Any:
        if not WRITING & set(mode) or not points.concerns(file):
            return opened(file, mode, *others, **options)
        points.pass_one()
        return CountedFile(opened(file, mode, *others, **options), points)

    def counted(name: str) -> Callable[..., Any]:
        call = getattr(os, name)

        def made(path: Any, *others: Any, **options: Any) -> Any:
            if name == "fsync" or points.concerns(path):
                points.pass_one()
            return call(path, *others, **options)

        return made

    with contextlib.ExitStack() as stack:
        stack.enter_context(mock.patch.object(io, "open", open_counted))
        stack.enter_context(mock.patch.object(builtins, "open", open_counted))
        for name in ("fsync", "replace", "mkdir"):
            stack.enter_context(mock.patch.object(os, name, counted(name)))
        yield points

"""The judge: what may come of a call, and what it may cost."""

import gc
import os
import tempfile
import traceback
import tracemalloc
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from kinarm.errors import KinarmError

LONGEST = 2000
"""Characters of the longest message."""

MEMORY_FACTOR, MEMORY_SLACK = 4, 50 * 10**6
"""What a loader may take: times the size of its file, and bytes."""

TRACED = 250
"""Every input of so many is watched by tracemalloc, unless another number is given."""


class Verdict(NamedTuple):
    """What came of a call: whether the input was accepted, what is wrong, what it took.

    Attributes
    ----------
    accepted : bool
        Whether it returned.
    finding : str
        What is wrong, with the place; empty if nothing is.
    memory : int
        Resident and allocated memory at its highest, above that before the call [bytes].
    """

    accepted: bool
    finding: str
    memory: int


class Judge:
    """Calls, watches what they print, raise and take, and says what is wrong with that.

    To be used as a context, in a process of its own: standard error goes to a file.

    Parameters
    ----------
    traced : int
        Every input of so many is watched by tracemalloc, too; none if it is 0.
    """

    def __init__(self, traced: int = TRACED) -> None:
        self._traced = traced

    def __enter__(self) -> "Judge":
        self._printed = tempfile.TemporaryFile()
        self._kept = os.dup(2)
        os.dup2(self._printed.fileno(), 2)
        self._calls = 0
        self._memory = Memory()
        self._warnings = warnings.catch_warnings()
        self._warnings.__enter__()
        warnings.simplefilter("always")
        return self

    def __exit__(self, *_: object) -> None:
        self._warnings.__exit__(None, None, None)
        os.dup2(self._kept, 2)
        os.close(self._kept)
        self._printed.close()

    def __call__(self, load: Callable[[Path], object], path: Path) -> Verdict:
        """Let a loader read a file."""
        self._calls += 1
        traced = self._traced > 0 and self._calls % self._traced == 1
        limit = MEMORY_FACTOR * path.stat().st_size + MEMORY_SLACK
        before = self._memory.restart()
        if traced:
            gc.collect()
            tracemalloc.start()
        accepted, finding = False, ""
        try:
            load(path)
            accepted = True
        except KinarmError as error:
            finding = unfit(str(error))
        except BaseException as error:
            finding = f"{type(error).__name__} at {place_of(error)}"
        memory = self._memory.peak() - before
        if traced:
            memory = max(memory, tracemalloc.get_traced_memory()[1])
            tracemalloc.stop()
        if not finding and memory > limit:
            finding = f"takes more than {limit // 10**6} MB"
        return Verdict(accepted, finding or self._what_is_printed(), max(memory, 0))

    def _what_is_printed(self) -> str:
        """What appeared on standard error, if anything did."""
        size = os.fstat(2).st_size
        if not size:
            return ""
        os.lseek(2, 0, os.SEEK_SET)
        text = os.read(2, 200).decode("utf-8", "replace")
        os.ftruncate(2, 0)
        os.lseek(2, 0, os.SEEK_SET)
        line = text.splitlines()[0].rpartition("site-packages/")[2]  # of no machine in particular
        return f"prints {line[:120]!r}"


def unfit(message: str) -> str:
    """What is wrong with a message that is to be one line; empty if nothing is."""
    if len(message.splitlines()) != 1:
        return f"a message of {len(message.splitlines())} lines: {message[:60]!r}"
    if len(message) > LONGEST:
        return f"a message of {len(message):.0e} characters: {message[:60]!r}"
    return ""


def place_of(error: BaseException) -> str:
    """Where an error comes from: the last line of kinarm's that it passed."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if "/tests/" not in f.filename and "site-packages" not in f.filename]
    last = own[-1] if own else frames[-1]
    return f"{Path(last.filename).name}:{last.lineno} in {last.name}"


class Memory:
    """This process's resident memory, and its peak since it was last asked for."""

    def __init__(self) -> None:
        self._status = os.open("/proc/self/status", os.O_RDONLY)
        self._reset = os.open("/proc/self/clear_refs", os.O_WRONLY)

    def restart(self) -> int:
        """Let the peak be what it is now, and return that [bytes]."""
        os.pwrite(self._reset, b"5", 0)
        return self._entry(b"VmRSS:")

    def peak(self) -> int:
        """The peak [bytes]."""
        return self._entry(b"VmHWM:")

    def _entry(self, name: bytes) -> int:
        text = os.pread(self._status, 4096, 0)
        return int(text.partition(name)[2].split(maxsplit=1)[0]) * 1024

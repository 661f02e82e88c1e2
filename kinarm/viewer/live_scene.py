"""The scene of a live page, for pages that are opened now and later."""

import struct
import threading
from collections.abc import Mapping
from itertools import takewhile
from typing import Any, NamedTuple

import umsgpack


class NumberedCommand(NamedTuple):
    """A drawing command, led by its length, and its place in the order of all."""

    number: int
    content: bytes


class LiveScene:
    """The drawing commands that still count; any thread may add some.

    A command takes the place of an earlier one for the same part of the same node, so that the
    scene grows with what is seen, not with time, and a page that is slow leaves out what is past.
    """

    def __init__(self) -> None:
        self._commands: dict[tuple[str, str, str], NumberedCommand] = {}
        self._last = 0
        self._lock = threading.Lock()

    def add(self, command: Mapping[str, Any]) -> None:
        """Take one of Meshcat's commands."""
        packed = umsgpack.packb(command)
        content = struct.pack("<I", len(packed)) + packed
        path, kind = command["path"], command["type"]
        key = (path, kind, command.get("property", ""))
        with self._lock:
            if kind == "delete":
                for other in [other for other in self._commands if _within(other[0], path)]:
                    del self._commands[other]
            self._commands.pop(key, None)  # so that the order is that of the latest commands
            self._last += 1
            self._commands[key] = NumberedCommand(self._last, content)

    def since(self, number: int) -> list[NumberedCommand]:
        """Commands after a number that still count, in order."""
        with self._lock:
            commands = reversed(self._commands.values())
            return [*takewhile(lambda command: command.number > number, commands)][::-1]


def _within(path: str, node: str) -> bool:
    """Whether a path leads to a node or to one below it."""
    return path == node or path.startswith(f"{node.rstrip('/')}/")

"""Catch what is sent to a Meshcat window, the same bytes for the same drawing."""

from typing import Any

import umsgpack


class Capture:
    """Stands in for Meshcat's window and keeps every command, in order.

    Attributes
    ----------
    commands : list of bytes
        As Meshcat's viewer decodes them.
    """

    def __init__(self) -> None:
        self.commands: list[bytes] = []
        self._numbers: dict[str, str] = {}

    def send(self, command: Any) -> None:
        """Keep a command, with its random ids replaced by numbers."""
        self.commands.append(umsgpack.packb(self._renumbered(command.lower())))

    def _renumbered(self, value: Any, key: str = "") -> Any:
        if isinstance(value, dict):
            return {name: self._renumbered(entry, name) for name, entry in value.items()}
        if isinstance(value, list):
            return [self._renumbered(entry) for entry in value]
        if key in ("uuid", "geometry", "material"):
            return self._numbers.setdefault(value, f"id-{len(self._numbers)}")
        return value

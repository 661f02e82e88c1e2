"""The scene of a page as Meshcat commands, the same bytes for the same recordings."""

import struct
from collections.abc import Sequence
from typing import Any

import meshcat
import numpy as np
import umsgpack

from kinarm.arm import Arm
from kinarm.recording import Recording
from kinarm.viewer.drawing import FLASH, draw_arm, draw_goal, draw_surroundings, draw_trace, put
from kinarm.viewer.meshes import capsule
from kinarm.viewer.surroundings import FLASH_RADIUS


def scene_commands(trials: Sequence[Sequence[Recording]], arm: Arm) -> bytes:
    """Draw surroundings, goal, arm and the ways of the tool in each trial's recordings.

    Returns the commands as Meshcat's viewer decodes them, each led by its length.
    """
    capture = CapturingWindow()
    window = meshcat.Visualizer(window=capture)
    problem = trials[0][0].problem
    draw_surroundings(window, problem.scene)
    draw_goal(window["goal"], problem)
    put(window["flash"], FLASH, capsule(0.0, FLASH_RADIUS))
    draw_arm(window["arm"], arm)
    for number, runs in enumerate(trials):
        for name, run in zip(("run", "ghost"), runs, strict=False):
            points = np.array([arm.tool_position(state) for state in run.states])
            draw_trace(window[f"trials/{number}/{name}"], points, run.outcome)
    return b"".join(struct.pack("<I", len(each)) + each for each in capture.commands)


class CapturingWindow:
    """Stands in for Meshcat's window and keeps every command as bytes, in order."""

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

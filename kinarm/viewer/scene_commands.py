"""The scene of a page as Meshcat commands, the same bytes for the same recordings."""

import struct
from collections.abc import Sequence
from typing import Any

import meshcat
import numpy as np
import umsgpack

from kinarm.arm import Arm
from kinarm.collision import ContactModel
from kinarm.recording import Recording
from kinarm.scene import Scene
from kinarm.viewer.arm_shapes import collision_parts
from kinarm.viewer.camera import stage_scale
from kinarm.viewer.drawing import (
    FLASH,
    SHAPE,
    draw_arm,
    draw_goal,
    draw_surroundings,
    draw_trace,
    put,
)
from kinarm.viewer.meshes import capsule
from kinarm.viewer.surroundings import FLASH_RADIUS


def replay_commands(trials: Sequence[Sequence[Recording]], arm: Arm) -> bytes:
    """Draw surroundings, goal, arm and the ways of the tool in each trial's recordings.

    Returns the commands as Meshcat's viewer decodes them, each led by its length.
    """
    capture = CapturingWindow()
    window, problem = meshcat.Visualizer(window=capture), trials[0][0].problem
    scale = stage_scale(arm, problem.scene)
    _draw_stage(window, arm, problem.scene, scale)
    draw_goal(window["goal"], problem)
    for number, runs in enumerate(trials):
        for name, run in zip(("run", "ghost"), runs, strict=False):
            points = np.array([arm.tool_position(state) for state in run.states])
            draw_trace(window[f"trials/{number}/{name}"], points, run.outcome, scale)
    return capture.content


def arm_commands(model: ContactModel, scene: Scene) -> bytes:
    """Draw an arm in a scene, and the shapes that decide about contact; see `replay_commands`."""
    capture = CapturingWindow()
    window = meshcat.Visualizer(window=capture)
    frames = _draw_stage(window, model.arm, scene, stage_scale(model.arm, scene))
    for number, part in enumerate(collision_parts(model.arm)):
        put(frames[part.joint][f"shape_{number}"], SHAPE, part.mesh)
    return capture.content


def _draw_stage(
    window: meshcat.Visualizer, arm: Arm, scene: Scene, scale: float
) -> list[meshcat.Visualizer]:
    """Draw surroundings, the ball that marks a contact, and an arm; return the arm's frames."""
    draw_surroundings(window, scene)
    put(window["flash"], FLASH, capsule(0.0, scale * FLASH_RADIUS))
    return draw_arm(window["arm"], arm)


class CapturingWindow:
    """Stands in for Meshcat's window and keeps every command as bytes, in order."""

    def __init__(self) -> None:
        self.commands: list[bytes] = []
        self._numbers: dict[str, str] = {}

    def send(self, command: Any) -> None:
        """Keep a command, with its random ids replaced by numbers."""
        self.commands.append(umsgpack.packb(self._renumbered(command.lower())))

    @property
    def content(self) -> bytes:
        """All commands, each led by its length."""
        return b"".join(struct.pack("<I", len(each)) + each for each in self.commands)

    def _renumbered(self, value: Any, key: str = "") -> Any:
        if isinstance(value, dict):
            return {name: self._renumbered(entry, name) for name, entry in value.items()}
        if isinstance(value, list):
            return [self._renumbered(entry) for entry in value]
        if key in ("uuid", "geometry", "material"):
            return self._numbers.setdefault(value, f"id-{len(self._numbers)}")
        return value

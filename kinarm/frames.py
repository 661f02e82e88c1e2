"""Frames of an arm, by name."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kinarm.arm import Arm
from kinarm.errors import UnknownNameError

KINDS = (pin.FrameType.JOINT, pin.FrameType.BODY, pin.FrameType.FIXED_JOINT)
"""Kinds of frames; of several with one name, the first kind counts."""


class Frame(NamedTuple):
    """A frame that is fixed to a joint.

    Attributes
    ----------
    joint : int
        The joint that carries it: 0 is the world, k the k-th joint.
    placement : ndarray, shape (4, 4)
        Where it is in the joint's frame, as a homogeneous transform [m].
    """

    joint: int
    placement: NDArray[np.float64]


class Frames:
    """Frames of an arm: joints and links by their names, and the tool.

    Parameters
    ----------
    arm : Arm
        The arm.

    Attributes
    ----------
    tool : Frame
        Has its origin in the tool point, and the axes of the arm's tool frame.
    """

    def __init__(self, arm: Arm) -> None:
        self._named: dict[str, Frame] = {}
        for kind in KINDS:
            for frame in arm.model.frames:
                if frame.type == kind:
                    self._named.setdefault(frame.name, _frame(frame))
        tool_id = arm.model.getFrameId(arm.tool_frame, pin.FrameType.BODY)
        self.tool = _frame(arm.model.frames[tool_id])
        self.tool.placement[:3, 3] = arm.chain.tool
        for frame in (self.tool, *self._named.values()):
            frame.placement.flags.writeable = False

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints and links."""
        return tuple(self._named)

    def __getitem__(self, name: str | None) -> Frame:
        """Frame of a name; None is the tool."""
        if name is None:
            return self.tool
        if name not in self._named:
            raise UnknownNameError("frame", name, self.names)
        return self._named[name]


def _frame(frame: pin.Frame) -> Frame:
    return Frame(int(frame.parentJoint), np.array(frame.placement.homogeneous, order="C"))

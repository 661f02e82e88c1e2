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

    Attributes
    ----------
    tool : Frame
        Has its origin in the tool point, and the axes of the arm's tool frame.
    """

    def __init__(self, arm: Arm) -> None:
        self._named: dict[str, Frame] = {}
        for frame in [each for kind in KINDS for each in arm.model.frames if each.type == kind]:
            self._named.setdefault(frame.name, _frame(frame))
        self.tool = _frame(arm.model.frames[arm.model.getFrameId(arm.tool_frame, pin.BODY)])
        self.tool.placement[:3, 3] = arm.chain.tool

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints and links."""
        return tuple(self._named)

    def __getitem__(self, name: str | None) -> Frame:
        """Frame of a name; None is the tool."""
        if name is not None and name not in self._named:
            raise UnknownNameError("frame", name, self.names)
        return self.tool if name is None else self._named[name]


def _frame(frame: pin.Frame) -> Frame:
    return Frame(int(frame.parentJoint), np.array(frame.placement.homogeneous, order="C"))

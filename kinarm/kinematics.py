"""Kinematics of an arm: poses and Jacobians."""

from abc import ABC, abstractmethod
from functools import cached_property

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from kinarm._parallel import run_rows
from kinarm.arm import Arm
from kinarm.chain import Frame, find_frames
from kinarm.errors import UnknownNameError, one_or_many
from kinarm.kernels.compiling import Array
from kinarm.kernels.kinematics import follow_frame


class Kinematics(ABC):
    """Compiled kinematics of an arm; a `World` also knows about contact."""

    arm: Arm
    threads: int

    @abstractmethod
    def in_contact(self, configurations: ArrayLike) -> NDArray[np.bool_]:
        """Tell which configurations touch something."""

    @cached_property
    def frames(self) -> dict[str, Frame]:
        """Frames of joints and links by name."""
        return find_frames(self.arm.model)

    @cached_property
    def tool(self) -> Frame:
        """Frame at the tool point with the axes of the arm's tool frame."""
        model = self.arm.model
        return Frame.of(model.frames[model.getFrameId(self.arm.tool_frame, pin.BODY)])

    def poses(self, configurations: ArrayLike, frame: str | None = None) -> Array:
        """Poses of a frame.

        Parameters
        ----------
        configurations : array_like, shape (n_joints,) or (n, n_joints)
            Joint positions [rad or m].
        frame : str, optional
            Name of a joint or link; the tool by default, its origin in the tool
            point.

        Returns
        -------
        ndarray, shape (4, 4) or (n, 4, 4)
            Homogeneous transforms to the world [m].
        """
        return self._of_frame(configurations, frame, (4, 4))

    def jacobians(self, configurations: ArrayLike, frame: str | None = None) -> Array:
        """Jacobians of a frame.

        Parameters
        ----------
        configurations, frame
            As for `poses`.

        Returns
        -------
        ndarray, shape (6, n_joints) or (n, 6, n_joints)
            Velocity of the frame's origin, then angular velocity, along the
            world's axes [m/rad and rad/rad; m/m and 0 of a sliding joint].
        """
        return self._of_frame(configurations, frame, (6, self.arm.n_joints))

    def _of_frame(
        self, configurations: ArrayLike, frame: str | None, shape: tuple[int, int]
    ) -> Array:
        """Fill in an array of a shape at each configuration."""
        q, one = one_or_many("configurations", configurations, (self.arm.n_joints,))
        filled = np.zeros((len(q), *shape))
        if frame is not None and frame not in self.frames:
            raise UnknownNameError("frame", frame, self.frames)
        placed = self.tool if frame is None else self.frames[frame]
        arrays = (self.arm.chain, *placed, q, filled)
        run_rows(follow_frame, len(q), len(q), self.threads, *arrays)
        return filled[0] if one else filled

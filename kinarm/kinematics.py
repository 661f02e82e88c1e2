"""Kinematics of an arm: poses, Jacobians, and inverse kinematics."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from kinarm._parallel import run_rows
from kinarm.arm import Arm
from kinarm.chain import Frame, find_frames, within_limits
from kinarm.errors import (
    InvalidInputError,
    UnknownNameError,
    finite_array,
    one_or_many,
    whole_number,
)
from kinarm.kernels.compiling import Array
from kinarm.kernels.inverse import TURN, Search, solve_targets
from kinarm.kernels.kinematics import follow_frame
from kinarm.randomness import low_discrepancy_points

ISOLATED_SEPARATION, CONTINUUM_SEPARATION = 1e-3, 0.2
"""Least difference in some joint of isolated and of other solutions [rad or m]."""

SEEDS, LEAST_SEEDS = 1024, 128
"""Seeds: at most, and at least for isolated solutions."""

LOT = 1024
"""Targets solved together."""

ORTHONORMAL = 1e-6
"""Deviation from orthonormal axes that a wanted pose may have."""


@dataclass(frozen=True, eq=False)
class InverseSolutions:
    """Configurations that bring the tool to targets.

    Attributes
    ----------
    configurations : ndarray, shape (m, n_joints)
        Target by target, those of one with the smallest largest move first [rad
        or m].
    owner : ndarray of int, shape (m,)
        Target of each.
    isolated : bool
        Whether solutions are isolated and complete; else they are spread over a
        continuum.
    """

    configurations: Array
    owner: NDArray[np.int64]
    isolated: bool

    def __len__(self) -> int:
        return len(self.owner)

    def __repr__(self) -> str:
        kind = "isolated" if self.isolated else "spread"
        return f"InverseSolutions({len(self)} {kind} configurations)"

    def of(self, target: int) -> Array:
        """Configurations of a target, shape (k, n_joints) [rad or m]; k may be 0."""
        chosen: Array = self.configurations[self.owner == target]
        return chosen


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

    def inverse_kinematics(
        self,
        targets: ArrayLike,
        directions: ArrayLike | None = None,
        *,
        near: ArrayLike | None = None,
        free: bool = False,
        tool_axis: ArrayLike | None = None,
        joints: int | None = None,
        turns: bool = False,
        most: int = 64,
        separation: float | None = None,
    ) -> InverseSolutions:
        """Find all configurations within the limits that bring the tool to positions or poses.

        Damped Newton steps move seeds to an error of 1e-10 of the arm's reach
        and 1e-10 rad. Solutions are *isolated*, and each is returned once, if
        no more joints move than the target has coordinates: 3 of a position, 5
        with a direction, 6 of a pose. Else, and at singular configurations,
        they are spread over a continuum. Targets do not affect each other.

        Parameters
        ----------
        targets : array_like, shape (3,), (n, 3), (4, 4) or (n, 4, 4)
            Positions of the tool point [m], or poses of the tool as `poses`
            gives them.
        directions : array_like, shape (3,) or (n, 3), optional
            Directions of the tool's axis.
        near : array_like, shape (n_joints,), optional
            Solutions nearest to it come first; of whole turns the nearest is
            returned. Joints that do not move rest there. Home by default [rad
            or m].
        free : bool
            Keep only solutions without contact.
        tool_axis : array_like, shape (3,), optional
            The tool's axis in the tool frame; by default along the last joint's
            axis, away from the joint before.
        joints : int, optional
            Number of joints that move, from the base; by default the actuated
            ones for positions, and all that matter for poses.
        turns : bool
            Give solutions that differ by whole turns one by one.
        most : int
            Largest number of solutions of a target, before contact and turns.
        separation : float, optional
            Least difference of two solutions in some joint; by default 0.001 if
            they are isolated, else 0.2 [rad or m].
        """
        arm = self.arm
        positions, wanted, axes = self._targets(targets, directions, tool_axis)
        start = finite_array("near", arm.home if near is None else near, (arm.n_joints,))
        start = within_limits("near", start, arm.chain, arm.joint_names)
        search = self._search(axes, start, joints, separation)
        configurations, owner = self._solutions(search, positions, wanted, most)
        if free:
            kept = ~self.in_contact(configurations)
            configurations, owner = configurations[kept], owner[kept]
        if turns:
            configurations, owner = _turned(arm, configurations, owner, search.seeds.shape[1])
        order = np.lexsort((np.abs(configurations - start).max(axis=1, initial=0.0), owner))
        return InverseSolutions(configurations[order], owner[order], search.least > 0)

    def _solutions(
        self, search: Search, positions: Array, directions: Array, most: int
    ) -> tuple[Array, NDArray[np.int64]]:
        """Solutions, and their targets, at positions (n, 3) and directions (n, n_axes, 3)."""
        n_joints = self.arm.n_joints
        found, counts = [], np.empty(len(positions), dtype=np.int64)
        for first in range(0, len(positions), LOT):
            lot = slice(first, first + LOT)
            n = len(positions[lot])
            rows = np.empty((n, whole_number("most", most, 1) + 1, n_joints))
            arrays = (self.arm.chain, search, positions[lot], directions[lot], rows, counts[lot])
            run_rows(solve_targets, n, 100 * n, self.threads, *arrays)
            found += [row[:count] for row, count in zip(rows, counts[lot], strict=True)]
        owner = np.repeat(np.arange(len(positions)), counts)
        return np.concatenate([np.empty((0, n_joints)), *found]), owner

    def _search(
        self, axes: Array, near: Array, joints: int | None, separation: float | None
    ) -> Search:
        """Check and complete a search."""
        moved = _moved(self.arm, axes) if joints is None else joints
        moved = whole_number("joints", moved, 1, self.arm.n_joints)
        isolated = moved <= {0: 3, 1: 5, 3: 6}[len(axes)]
        if separation is None:
            separation = ISOLATED_SEPARATION if isolated else CONTINUUM_SEPARATION
        if not separation > 0:
            raise InvalidInputError(f"separation must be greater than 0, got {separation}")
        return Search(
            tool=self.arm.chain.tool,
            axes=axes,
            scale=1.0 / self.arm.reach,
            near=near,
            seeds=low_discrepancy_points(SEEDS, moved),
            least=LEAST_SEEDS if isolated else 0,
            separation=float(separation),
        )

    def _targets(
        self, targets: ArrayLike, directions: ArrayLike | None, tool_axis: ArrayLike | None
    ) -> tuple[Array, Array, Array]:
        """Positions (n, 3), directions of axes of the tool (n, n_axes, 3), and these (n_axes, 3).

        The axes are in the last joint frame.
        """
        if np.shape(targets)[-2:] == (4, 4):
            if directions is not None or tool_axis is not None:
                raise InvalidInputError("a pose is wanted: directions and tool_axis do not apply")
            poses, _ = one_or_many("targets", targets, (4, 4))
            _check_poses(poses)
            columns = np.ascontiguousarray(poses[:, :3, :3].transpose(0, 2, 1))
            axes = np.ascontiguousarray(self.tool.placement[:3, :3].T)
            return np.ascontiguousarray(poses[:, :3, 3]), columns, axes
        positions, _ = one_or_many("targets", targets, (3,))
        if directions is None:
            if tool_axis is not None:
                raise InvalidInputError("tool_axis applies only with directions")
            return positions, np.empty((len(positions), 0, 3)), np.empty((0, 3))
        along, _ = one_or_many("directions", directions, (3,))
        if len(along) not in (1, len(positions)):
            raise InvalidInputError(
                f"directions must be one or as many as targets: {len(along)} for {len(positions)}"
            )
        along = np.broadcast_to(_units("directions", along), positions.shape)
        if tool_axis is None:
            axis = _approach(self.arm)
        else:
            given = _units("tool_axis", finite_array("tool_axis", tool_axis, (3,))[None])
            axis = (self.tool.placement[:3, :3] * given).sum(axis=1)
        # Copies are writable like the others: kernels are not compiled once more for them.
        return positions, np.array(along[:, None], order="C"), np.array(axis[None])


def _check_poses(poses: Array) -> None:
    """Refuse matrices that are no poses."""
    turns = poses[:, :3, :3]
    products = (turns[:, :, :, None] * turns[:, :, None, :]).sum(axis=1)
    right = np.abs(products - np.eye(3)).max(axis=(1, 2), initial=0.0) <= ORTHONORMAL
    right &= (np.cross(turns[:, :, 0], turns[:, :, 1]) * turns[:, :, 2]).sum(axis=1) > 0
    right &= np.abs(poses[:, 3] - [0, 0, 0, 1]).max(axis=1, initial=0.0) <= ORTHONORMAL
    if not right.all():
        raise InvalidInputError(
            f"target {int(right.argmin())} is no pose: a rotation, a position and (0, 0, 0, 1)"
        )


def _units(name: str, vectors: Array) -> Array:
    """Scale vectors, shape (n, 3), to length one."""
    lengths = np.sqrt(np.square(vectors).sum(axis=1, keepdims=True))
    if not (lengths > 0).all():
        raise InvalidInputError(f"{name} must not be zero")
    units: Array = vectors / lengths
    return units


def _approach(arm: Arm) -> Array:
    """Axis of the last joint in its own frame, away from the joint before."""
    axis: Array = arm.chain.axis[-1]
    before = arm.model.jointPlacements[arm.n_joints].actInv(np.zeros(3))
    return -axis if float(((before - arm.chain.tool) * axis).sum()) > 0 else axis


def _moved(arm: Arm, axes: Array) -> int:
    """Number of joints that move: actuated ones, or all that matter for a pose."""
    if len(axes) == 0:
        return arm.n_actuated
    chain = arm.chain
    about = np.abs(np.cross(chain.axis[-1], [axes[0], chain.tool])).max() <= 1e-9
    spins = len(axes) == 1 and about and not chain.prismatic[-1]
    return arm.n_joints - int(spins)


def _turned(
    arm: Arm, configurations: Array, owner: NDArray[np.int64], moved: int
) -> tuple[Array, NDArray[np.int64]]:
    """Add solutions that differ by whole turns within the limits."""
    for joint in np.flatnonzero(~arm.chain.prismatic[:moved]):
        span = int((arm.upper[joint] - arm.lower[joint]) / TURN)
        turns = np.arange(-span, span + 1)
        others, owner = np.tile(configurations, (len(turns), 1)), np.tile(owner, len(turns))
        others[:, joint] += np.repeat(turns, len(configurations)) * TURN
        within = (others[:, joint] >= arm.lower[joint]) & (others[:, joint] <= arm.upper[joint])
        configurations, owner = others[within], owner[within]
    return configurations, owner

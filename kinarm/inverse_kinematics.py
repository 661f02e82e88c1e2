"""Kinematics of an arm: poses of its tool, and configurations that bring it to targets."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from kinarm._parallel import run_rows
from kinarm.arm import Arm
from kinarm.errors import (
    NOT_NEGATIVE,
    InvalidInputError,
    check_range,
    finite_array,
    one_or_many,
    whole_number,
)
from kinarm.kernels.compiling import Array
from kinarm.kernels.elementary import TURN
from kinarm.kernels.inverse import Search, solve_targets
from kinarm.kernels.kinematics import follow_tool
from kinarm.randomness import low_discrepancy_points

ISOLATED_SEPARATION, CONTINUUM_SEPARATION = 1e-3, 0.2
"""Least difference in some joint of isolated and of other solutions [rad or m]."""

SEEDS, LEAST_SEEDS = 1024, 128
"""Seeds: at most by default, and at least for isolated solutions."""

LOT = 1024
"""Targets solved together."""

POSITION_TOLERANCE, ROTATION_TOLERANCE = 1e-6, 1e-5
"""Errors of solutions at most [m, rad]: the rounding of URDFs, not of arms."""

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
    position_error, rotation_error : ndarray, shape (m,)
        Distance of the tool from the target, and angle of its axis or
        orientation from the wanted one, 0 if none is wanted [m, rad].
    isolated : bool
        Whether solutions are isolated and complete; else they are spread over a
        continuum.
    """

    configurations: Array
    owner: NDArray[np.int64]
    position_error: Array
    rotation_error: Array
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


class InverseKinematics:
    """Compiled kinematics of an arm, forwards and back; a `World` also knows about contact."""

    arm: Arm
    threads: int
    in_contact: Callable[[ArrayLike], NDArray[np.bool_]]

    @cached_property
    def tool(self) -> Array:
        """Pose of the tool frame, at the tool point, in the frame of the last joint, shape (4, 4).

        Where it is in the world, `poses` tells.
        """
        model = self.arm.model
        frame = model.frames[model.getFrameId(self.arm.tool_frame, pin.BODY)]
        return np.array(frame.placement.homogeneous, order="C")

    def poses(self, configurations: ArrayLike) -> Array:
        """Poses of the tool, whose origin is the tool point.

        Parameters
        ----------
        configurations : array_like, shape (n_joints,) or (n, n_joints)
            Joint positions [rad or m].

        Returns
        -------
        ndarray, shape (4, 4) or (n, 4, 4)
            Homogeneous transforms to the world [m].
        """
        q, one = one_or_many("configurations", configurations, (self.arm.n_joints,))
        filled = np.empty((len(q), 4, 4))
        run_rows(follow_tool, len(q), len(q), self.threads, self.arm.chain, self.tool, q, filled)
        return filled[0] if one else filled

    def inverse_kinematics(
        self,
        targets: ArrayLike,
        directions: ArrayLike | None = None,
        *,
        near: ArrayLike | None = None,
        free: bool = False,
        joints: int | None = None,
        turns: bool = False,
        most: int = 64,
        seeds: int = SEEDS,
        position_tolerance: float = POSITION_TOLERANCE,
        rotation_tolerance: float = ROTATION_TOLERANCE,
        best: bool = False,
    ) -> InverseSolutions:
        """Find all configurations within the limits that bring the tool to positions or poses.

        Damped Newton steps move seeds to an error of 1e-10 of the arm's reach
        and 1e-10 rad. Solutions are *isolated*, and each is returned once, if
        no more joints move than the target has coordinates: 3 of a position, 5
        with a direction, 6 of a pose. Else, and at singular configurations,
        they are spread over a continuum, 0.2 rad or m apart in some joint. Targets
        do not affect each other. Raises InvalidInputError if a shape is wrong, or
        ``near`` is beyond the limits.

        Parameters
        ----------
        targets : array_like, shape (3,), (n, 3), (4, 4) or (n, 4, 4)
            Positions of the tool point [m], or poses of the tool as `poses`
            gives them.
        directions : array_like, shape (3,) or (n, 3), optional
            Directions of the tool's axis: that of the last joint, away from the joint
            before.
        near : array_like, shape (n_joints,), optional
            Solutions nearest to it come first; of whole turns the nearest is
            returned. Joints that do not move rest there. Home by default [rad
            or m].
        free : bool
            Keep only solutions without contact.
        joints : int, optional
            Number of joints that move, from the base; by default the actuated
            ones for positions, and all that matter for poses.
        turns : bool
            Give solutions that differ by whole turns one by one.
        most : int
            Largest number of solutions of a target, before contact and turns.
        seeds : int
            Largest number of seeds that look for them. Where there are solutions, one of the first
            32 finds one nearly always; without, all are tried.
        position_tolerance, rotation_tolerance : float
            Errors that solutions may have where none is exact, as arms of four
            or five axes have for most poses [m, rad].
        best : bool
            Give the nearest configuration that was found to a target without
            solution, with its error, where seeds came no closer. An error of
            the arm's reach counts like one of 1 rad.
        """
        arm = self.arm
        positions, wanted, axes = self._targets(targets, directions)
        start = finite_array("near", arm.home if near is None else near, (arm.n_joints,))
        start = arm.chain.within_limits("near", start, arm.joint_names)
        for name, each in (("position", position_tolerance), ("rotation", rotation_tolerance)):
            check_range(f"{name}_tolerance", each, NOT_NEGATIVE)
        moved = _moved(arm, axes) if joints is None else joints
        moved = whole_number("joints", moved, 1, arm.n_joints)
        isolated = moved <= {0: 3, 1: 5, 3: 6}[len(axes)]
        search = Search(
            tool=arm.chain.tool,
            axes=axes,
            scale=1.0 / arm.reach,
            position_tolerance=position_tolerance,
            rotation_tolerance=rotation_tolerance,
            near=start,
            seeds=low_discrepancy_points(whole_number("seeds", seeds, 1), moved),
            least=LEAST_SEEDS if isolated else 0,
            separation=ISOLATED_SEPARATION if isolated else CONTINUUM_SEPARATION,
        )
        configurations, owner = self._solutions(search, positions, wanted, most)
        if best:
            unsolved = np.setdiff1d(np.arange(len(positions)), owner)
            nearest, far = self._nearest(search, positions[unsolved], wanted[unsolved])
            configurations = np.concatenate([configurations, nearest])
            owner = np.concatenate([owner, unsolved[far]])
        if free:
            kept = ~self.in_contact(configurations)
            configurations, owner = configurations[kept], owner[kept]
        if turns:
            configurations, owner = _turned(arm, configurations, owner, moved)
        order = np.lexsort((np.abs(configurations - start).max(axis=1, initial=0.0), owner))
        configurations, owner = configurations[order], owner[order]
        errors = self._errors(axes, configurations, positions[owner], wanted[owner])
        return InverseSolutions(configurations, owner, *errors, isolated)

    def _nearest(
        self, search: Search, positions: Array, directions: Array
    ) -> tuple[Array, NDArray[np.int64]]:
        """The nearest configuration to each target, shape (n, n_joints), and the targets.

        It is the best of those at which seeds came no closer.
        """
        anywhere = search._replace(
            position_tolerance=np.inf, rotation_tolerance=np.inf, least=0, separation=0.0
        )
        found, owner = self._solutions(anywhere, positions, directions, SEEDS)
        apart, turned = self._errors(search.axes, found, positions[owner], directions[owner])
        order = np.lexsort((np.hypot(search.scale * apart, turned), owner))
        targets, first = np.unique(owner[order], return_index=True)
        return found[order[first]], targets

    def _errors(
        self, axes: Array, configurations: Array, positions: Array, directions: Array
    ) -> tuple[Array, Array]:
        """Errors of position and of rotation, shape (n,) each [m, rad]."""
        poses = self.poses(configurations)
        apart = np.linalg.norm(poses[:, :3, 3] - positions, axis=1)
        in_tool = axes @ self.tool[:3, :3]
        reached = in_tool @ poses[:, :3, :3].transpose(0, 2, 1)
        sines = np.linalg.norm(np.cross(reached, directions).sum(axis=1), axis=1)
        cosines = (reached * directions).sum(axis=(1, 2))
        if len(axes) == 3:  # 2 sin and 1 + 2 cos of the angle of the rotation
            sines, cosines = 0.5 * sines, 0.5 * (cosines - 1.0)
        return apart, np.arctan2(sines, cosines) if len(axes) else np.zeros(len(apart))

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

    def _targets(
        self, targets: ArrayLike, directions: ArrayLike | None
    ) -> tuple[Array, Array, Array]:
        """Positions (n, 3), directions of axes of the tool (n, n_axes, 3), and these (n_axes, 3).

        The axes are in the last joint frame.
        """
        if np.shape(targets)[-2:] == (4, 4):
            if directions is not None:
                raise InvalidInputError("a pose is wanted: directions do not apply")
            poses, _ = one_or_many("targets", targets, (4, 4))
            _check_poses(poses)
            columns = np.ascontiguousarray(poses[:, :3, :3].transpose(0, 2, 1))
            axes = np.ascontiguousarray(self.tool[:3, :3].T)
            return np.ascontiguousarray(poses[:, :3, 3]), columns, axes
        positions, _ = one_or_many("targets", targets, (3,))
        if directions is None:
            return positions, np.empty((len(positions), 0, 3)), np.empty((0, 3))
        along, _ = one_or_many("directions", directions, (3,))
        if len(along) not in (1, len(positions)):
            raise InvalidInputError(
                f"directions must be one or as many as targets: {len(along)} for {len(positions)}"
            )
        lengths = np.sqrt(np.square(along).sum(axis=1, keepdims=True))
        if not (lengths > 0).all():
            raise InvalidInputError("directions must not be zero")
        along = np.broadcast_to(along / lengths, positions.shape)
        # Copies are writable like the others: kernels are not compiled once more for them.
        axes = np.array(approach_axis(self.arm)[None])
        return positions, np.array(along[:, None], order="C"), axes


def _check_poses(poses: Array) -> None:
    """Refuse matrices that are no poses."""
    turns = poses[:, :3, :3]
    products = (turns[:, :, :, None] * turns[:, :, None, :]).sum(axis=1)
    off = np.abs(products - np.eye(3)).max(axis=(1, 2), initial=0.0)
    right = (np.cross(turns[:, :, 0], turns[:, :, 1]) * turns[:, :, 2]).sum(axis=1) > 0
    last = np.abs(poses[:, 3] - [0, 0, 0, 1]).max(axis=1, initial=0.0)
    for target in np.flatnonzero((off > ORTHONORMAL) | ~right | (last > ORTHONORMAL)):
        raise InvalidInputError(
            f"target {target} is no pose: its axes must be orthonormal and right-handed, and its "
            f"last row [0, 0, 0, 1], got {poses[target].tolist()}"
        )


def approach_axis(arm: Arm) -> Array:
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

"""Inverse kinematics: configurations that bring the tool to positions or poses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm._parallel import run_rows
from kinarm._validation import finite_array, one_or_many, whole_number
from kinarm.arm import Arm
from kinarm.errors import InvalidInputError
from kinarm.frames import Frame
from kinarm.kernels.inverse import TURN, Search, solve_targets
from kinarm.randomness import low_discrepancy_points

if TYPE_CHECKING:
    from kinarm.world import World

ISOLATED_SEPARATION, SPREAD_SEPARATION = 1e-3, 0.2
"""Least difference in some joint of isolated solutions, and of those of a continuum [rad or m]."""

SEEDS, LEAST_SEEDS = 1024, 128
"""Configurations to begin with: at most, and before a search for isolated solutions may end."""

LOT = 1024
"""Targets that are solved together."""

ORTHONORMAL = 1e-6
"""By how much the axes of a wanted pose may miss being orthonormal."""


@dataclass(frozen=True, eq=False)
class InverseSolutions:
    """Configurations that bring the tool to targets.

    Attributes
    ----------
    configurations : ndarray, shape (m, n_joints)
        Target by target, those of one with the smallest largest move first [rad or m].
    owner : ndarray of int, shape (m,)
        Which target each belongs to.
    isolated : bool
        Whether solutions are isolated, so that these are all; else each target has a continuum of
        them, over which these are spread.
    """

    configurations: NDArray[np.float64]
    owner: NDArray[np.int64]
    isolated: bool

    def __len__(self) -> int:
        return len(self.owner)

    def __repr__(self) -> str:
        kind = "isolated" if self.isolated else "spread"
        return f"InverseSolutions({len(self)} {kind} configurations)"

    def of(self, target: int) -> NDArray[np.float64]:
        """Configurations of a target, shape (k, n_joints) [rad or m]; k may be 0."""
        chosen: NDArray[np.float64] = self.configurations[self.owner == target]
        return chosen


def solve(
    world: World,
    targets: ArrayLike,
    directions: ArrayLike | None,
    *,
    near: ArrayLike | None,
    tool_axis: ArrayLike | None,
    joints: int | None,
    free: bool,
    turns: bool,
    most: int,
    separation: float | None,
) -> InverseSolutions:
    """Find configurations at targets; see `World.inverse_kinematics`."""
    arm = world.arm
    positions, wanted, axes = _targets(arm, world.frames.tool, targets, directions, tool_axis)
    start = _near(arm, near)
    moved = _moved(arm, axes) if joints is None else whole_number("joints", joints, 1)
    if moved > arm.n_joints:
        raise InvalidInputError(f"joints must be at most {arm.n_joints}, got {moved}")
    isolated = moved <= {0: 3, 1: 5, 3: 6}[len(axes)]
    if separation is None:
        separation = ISOLATED_SEPARATION if isolated else SPREAD_SEPARATION
    if not separation > 0:
        raise InvalidInputError(f"separation must be greater than 0, got {separation}")
    search = Search(
        tool=arm.chain.tool,
        axes=axes,
        scale=1.0 / arm.reach,
        near=start,
        seeds=low_discrepancy_points(SEEDS, moved),
        least=LEAST_SEEDS if isolated else 0,
        separation=float(separation),
    )
    found, counts = [], np.empty(len(positions), dtype=np.int64)
    for first in range(0, len(positions), LOT):
        lot = slice(first, first + LOT)
        n = len(positions[lot])
        rows = np.empty((n, whole_number("most", most, 1) + 1, arm.n_joints))
        arrays = (arm.chain, search, positions[lot], wanted[lot], rows, counts[lot])
        run_rows(solve_targets, n, 100 * n, world.threads, *arrays)
        found += [row[:count] for row, count in zip(rows, counts[lot], strict=True)]
    configurations = np.concatenate([np.empty((0, arm.n_joints)), *found])
    owner = np.repeat(np.arange(len(positions)), counts)
    if free:
        kept = ~world.in_contact(configurations)
        configurations, owner = configurations[kept], owner[kept]
    if turns:
        configurations, owner = _turned(arm, configurations, owner, moved)
    order = np.lexsort((np.abs(configurations - start).max(axis=1, initial=0.0), owner))
    return InverseSolutions(configurations[order], owner[order], isolated)


def _targets(
    arm: Arm,
    tool: Frame,
    targets: ArrayLike,
    directions: ArrayLike | None,
    tool_axis: ArrayLike | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Positions (n, 3), directions of the tool's axes (n, n_axes, 3), and these axes (n_axes, 3).

    The axes are those of the last joint frame.
    """
    if _are_poses(targets):
        if directions is not None or tool_axis is not None:
            raise InvalidInputError("a pose is wanted: directions and tool_axis do not apply")
        poses, _ = one_or_many("targets", targets, (4, 4))
        _check_poses(poses)
        columns = np.ascontiguousarray(poses[:, :3, :3].transpose(0, 2, 1))
        axes = np.ascontiguousarray(tool.placement[:3, :3].T)
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
        axis = _approach(arm)
    else:
        given = _units("tool_axis", finite_array("tool_axis", tool_axis, (3,))[None])
        axis = (tool.placement[:3, :3] * given).sum(axis=1)
    # Copied, they can be written to like the others: kernels are not compiled once more for them.
    return positions, np.array(along[:, None], order="C"), np.array(axis[None])


def _are_poses(targets: ArrayLike) -> bool:
    """Whether targets have the shape of a pose, or of many."""
    try:
        return np.shape(targets)[-2:] == (4, 4)
    except ValueError:
        return False


def _check_poses(poses: NDArray[np.float64]) -> None:
    """Refuse matrices that are no homogeneous transforms."""
    turns = poses[:, :3, :3]
    products = (turns[:, :, :, None] * turns[:, :, None, :]).sum(axis=1)
    right = np.abs(products - np.eye(3)).max(axis=(1, 2), initial=0.0) <= ORTHONORMAL
    right &= (np.cross(turns[:, :, 0], turns[:, :, 1]) * turns[:, :, 2]).sum(axis=1) > 0
    right &= np.abs(poses[:, 3] - [0, 0, 0, 1]).max(axis=1, initial=0.0) <= ORTHONORMAL
    if not right.all():
        raise InvalidInputError(
            f"target {int(right.argmin())} is no pose: a rotation, a position and (0, 0, 0, 1)"
        )


def _units(name: str, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Scale vectors, shape (n, 3), to length one."""
    lengths = np.sqrt(np.square(vectors).sum(axis=1, keepdims=True))
    if not (lengths > 0).all():
        raise InvalidInputError(f"{name} must not be zero")
    units: NDArray[np.float64] = vectors / lengths
    return units


def _approach(arm: Arm) -> NDArray[np.float64]:
    """Axis of the last joint in its own frame, away from the joint before."""
    axis: NDArray[np.float64] = arm.chain.axis[-1]
    before = arm.model.jointPlacements[arm.n_joints].actInv(np.zeros(3))
    return -axis if float(((before - arm.chain.tool) * axis).sum()) > 0 else axis


def _moved(arm: Arm, axes: NDArray[np.float64]) -> int:
    """Number of joints that move: those of the actions, or those that matter for a pose."""
    if len(axes) == 0:
        return arm.n_actuated
    chain = arm.chain
    about = np.abs(np.cross(chain.axis[-1], [axes[0], chain.tool])).max() <= 1e-9
    spins = len(axes) == 1 and about and not chain.prismatic[-1]
    return arm.n_joints - int(spins)


def _near(arm: Arm, near: ArrayLike | None) -> NDArray[np.float64]:
    """Check the configuration whose neighbours are preferred; home by default."""
    q = finite_array("near", arm.home if near is None else near, (arm.n_joints,))
    if ((q < arm.lower) | (q > arm.upper)).any():
        raise InvalidInputError(f"near lies outside the limits: {q.tolist()}")
    return q


def _turned(
    arm: Arm, configurations: NDArray[np.float64], owner: NDArray[np.int64], moved: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Add what differs by whole turns and lies within the limits."""
    for joint in np.flatnonzero(~arm.chain.prismatic[:moved]):
        span = int((arm.upper[joint] - arm.lower[joint]) / TURN)
        copies = []
        for turn in range(-span, span + 1):
            other = configurations.copy()
            other[:, joint] += turn * TURN
            within = (other[:, joint] >= arm.lower[joint]) & (other[:, joint] <= arm.upper[joint])
            copies.append((other[within], owner[within]))
        configurations = np.concatenate([each for each, _ in copies])
        owner = np.concatenate([each for _, each in copies])
    return configurations, owner

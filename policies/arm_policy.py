"""Run a policy of kinarm on an arm: this file, contract.json, policy.npz, Python 3.9 and NumPy.

``policy = ArmPolicy(folder)``, then once a time step ``send(policy.command(read_joints(), goal))``.
Functions take arrays of NumPy, or of a library with functions of the same names.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

CONSTANT_BELOW = 1e-6
"""Inputs with a smaller standard deviation in training count as constant."""

KINDS = ("position", "direction", "pose", "configuration")
"""Kinds of goals."""

ENTRIES = [[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]]
FROM_LEFT = [[1, -1, -1, -1], [1, 1, -1, 1], [1, 1, 1, -1], [1, -1, 1, 1]]
FROM_RIGHT = [[1, -1, -1, -1], [1, 1, 1, -1], [1, -1, 1, 1], [1, 1, -1, 1]]
"""Entries and signs of matrices that multiply by a quaternion."""


def choose_action(xp: Any, policy: Any, functions: list[str], side: int | None, x: Any) -> Any:
    """Fractions of the velocity limits in [-1, 1], for observations, shape (..., n_observations).

    Takes the arrays of policy.npz, the layers' functions, and the entry of the goal's y, by which
    a mirror tells the left, else None. A residual policy adds to ``rates``, by their longest.
    """
    left = None if side is None else x[..., side : side + 1] > 0
    if left is not None:
        x = xp.where(left, x * policy["mirror_observations"], x)
    rates = x[..., policy["rates"]] if "rates" in policy else None
    constant = policy["std"] < CONSTANT_BELOW
    scale = xp.where(constant, 0.0, 1.0 / xp.where(constant, 1.0, policy["std"]))
    x = (x - policy["mean"]) * scale
    for k, name in enumerate(functions):
        x = activated(xp, name, x @ policy[f"weights_{k}"].T + policy[f"bias_{k}"])
    if rates is not None:
        x = rates + xp.amax(xp.abs(rates), -1)[..., None] * x
    action = xp.clip(x, -1.0, 1.0)
    return action if left is None else xp.where(left, action * policy["mirror_actions"], action)


def activated(xp: Any, name: str, x: Any) -> Any:
    """Values of a layer after its function."""
    functions = {
        "linear": lambda: x,
        "tanh": lambda: xp.tanh(x),
        "relu": lambda: xp.where(x < 0, 0.0 * x, x),
        "hardtanh": lambda: xp.clip(x, -1.0, 1.0),
        "elu": lambda: xp.where(x < 0, xp.exp(xp.clip(x, -50.0, 0.0)) - 1.0, x),
        "leaky_relu": lambda: xp.where(x < 0, 0.01 * x, x),
        "silu": lambda: x * (0.5 + 0.5 * xp.tanh(0.5 * x)),
    }
    return functions[name]()


def arm_arrays(contract: Any) -> dict[str, Any]:
    """The arm's joints, and limits of the actuated ones, as arrays."""
    joints, tool = contract["joints"], contract["tool"]
    names = ["translation", "rotation", "axis", "lower", "upper", "velocity_limit"]
    arm = {name: np.array([each[name] for each in joints]) for name in [*names, "sign", "offset"]}
    for name in ("lower", "upper", "velocity_limit"):
        arm[name] = arm[name][: sum(each["actuated"] for each in joints)]
    arm["step"] = arm.pop("velocity_limit") * contract["time_step"]
    arm["unit"] = np.eye(6)
    arm["kind"] = np.zeros(KINDS.index(contract["goal"]["kind"]))  # by its length
    arm["slides"] = np.array([1.0 if each["kind"] == "prismatic" else 0.0 for each in joints])
    return {**arm, **{f"tool_{name}": np.array(place) for name, place in tool.items()}}


def from_readings(arm: Any, readings: Any) -> Any:
    """Joint positions of the model, from those that the arm reads."""
    return (readings - arm["offset"]) * arm["sign"]


def to_readings(arm: Any, joints: Any) -> Any:
    """Joint positions as the arm has them, from those of the model."""
    return joints * arm["sign"] + arm["offset"]


def next_command(xp: Any, arm: Any, commanded: Any, action: Any) -> Any:
    """Next command to the actuated joints, within the limits of velocity and position."""
    n = len(arm["step"])
    return xp.clip(commanded[..., :n] + action * arm["step"], arm["lower"], arm["upper"])


def multiplier(xp: Any, quaternion: Any, signs: list[list[int]]) -> Any:
    """Matrix that multiplies quaternions w x y z by this one, shape (..., 4, 4)."""
    return quaternion[..., ENTRIES] * xp.asarray(signs)


def times(matrix: Any, vector: Any) -> Any:
    """Product of matrices, shape (..., m, n), and vectors, shape (..., n)."""
    return (matrix @ vector[..., None])[..., 0]


def forward_kinematics(xp: Any, arm: Any, joints: Any) -> tuple[list[Any], list[Any], Any, Any]:
    """Orientations w x y z and positions [m] of joint frames, their rotations, and the tool."""
    half = (0.5 * joints * (1.0 - arm["slides"]))[..., None]
    turn = xp.concatenate([xp.cos(half), xp.sin(half) * arm["axis"]], -1)
    turn = times(multiplier(xp, turn, FROM_RIGHT), arm["rotation"])
    following = multiplier(xp, turn, FROM_RIGHT)
    quaternions = [turn[..., 0, :]]
    for k in range(1, joints.shape[-1]):
        quaternions.append(times(following[..., k, :, :], quaternions[-1]))
    turned = xp.stack(quaternions, -2)
    from_left, from_right = (multiplier(xp, turned, signs) for signs in (FROM_LEFT, FROM_RIGHT))
    rotations = (from_left @ from_right.swapaxes(-1, -2))[..., 1:, 1:]
    slid = times(rotations, (joints * arm["slides"])[..., None] * arm["axis"])
    offset = times(rotations[..., :-1, :, :], arm["translation"][1:])
    positions = [arm["translation"][0] + slid[..., 0, :]]
    for k in range(1, joints.shape[-1]):
        positions.append(positions[-1] + offset[..., k - 1, :] + slid[..., k, :])
    last = rotations[..., -1, :, :]
    return quaternions, positions, rotations, positions[-1] + times(last, arm["tool_position"])


def resolved_rate(xp: Any, arm: Any, commanded: Any, goal: Any) -> Any:
    """Action of a damped Newton step from commanded joint positions to the goal."""
    quaternions, positions, rotations, tool = forward_kinematics(xp, arm, commanded)
    n, rest, kind = len(arm["step"]), goal[..., 3:], KINDS[len(arm["kind"])]
    slides, axes = arm["slides"][:n, None], times(rotations, arm["axis"])[..., :n, :]
    lever = tool[..., None, :] - xp.stack(positions, -2)[..., :n, :]
    turned, error = (1.0 - slides) * axes, goal[..., :3] - tool
    moved, turn = slides * axes + cross(xp, turned, lever), None
    if kind == "direction":
        reached = times(rotations[..., -1, :, :], arm["tool_axis"])
        cosine = (reached * rest).sum(-1)[..., None]
        turn = cross(xp, reached, rest) / xp.clip(0.5 + 0.5 * cosine, 1e-6, 1.0) ** 0.5
        turned = turned - times(turned, reached)[..., None] * reached[..., None, :]
    elif kind == "pose":
        reached = times(multiplier(xp, arm["tool_rotation"], FROM_RIGHT), quaternions[-1])
        off = times(multiplier(xp, reached * xp.asarray([1, -1, -1, -1]), FROM_RIGHT), rest)
        turn = 2.0 * xp.where(off[..., :1] < 0, -off, off)[..., 1:]
    if turn is not None:
        moved, error = xp.concatenate([moved, turned], -1), xp.concatenate([error, turn], -1)
    if kind == "configuration":
        step = rest[..., :n] - commanded[..., :n]
    else:
        damping = 0.1 * (error * error).sum(-1)[..., None, None] + 1e-12
        square = moved.swapaxes(-1, -2) @ moved
        square = square + damping * arm["unit"][: error.shape[-1], : error.shape[-1]]
        step = times(moved, solved(xp, square, error))
    action = step / arm["step"]
    return action / xp.clip(xp.amax(xp.abs(action), -1)[..., None], 1.0, 1e9)


def solved(xp: Any, square: Any, right: Any) -> Any:
    """Solution of a positive definite system, shapes (..., n, n) and (..., n)."""
    whole, n = xp.concatenate([square, right[..., None]], -1), right.shape[-1]
    rows = [whole[..., i, :] for i in range(n)]
    for i in range(n):
        rows[i] = rows[i] / rows[i][..., i : i + 1]
        for j in {*range(n)} - {i}:
            rows[j] = rows[j] - rows[j][..., i : i + 1] * rows[i]
    return xp.stack([row[..., n] for row in rows], -1)


def cross(xp: Any, a: Any, b: Any) -> Any:
    """Cross product of vectors, shapes (..., 3)."""
    pairs = ((1, 2), (2, 0), (0, 1))
    return xp.stack([a[..., i] * b[..., j] - a[..., j] * b[..., i] for i, j in pairs], -1)


def observe(
    xp: Any,
    arm: Any,
    names: list[str],
    joints: Any,
    commanded: Any,
    goal: Any,
    moved: Any = None,
    action: Any = None,
    time_left: Any = None,
) -> Any:
    """Observation of a step: the parts of these names, one after the other."""
    quaternions, positions, rotations, tool = forward_kinematics(xp, arm, joints)
    rest, rotation = goal[..., 3:], rotations[..., -1, :, :]

    def angles() -> Any:
        pairs = xp.stack([xp.sin(joints), xp.cos(joints)], -1)
        return xp.concatenate([pairs[..., k, :] for k in range(joints.shape[-1])], -1)

    def rotation_error() -> Any:
        reached = times(multiplier(xp, arm["tool_rotation"], FROM_RIGHT), quaternions[-1])
        same = times(rest[..., None, :], reached)
        return rest - xp.where(same < 0, -reached, reached)

    parts: dict[str, Any] = {
        "goal": lambda: goal[..., :3],
        "goal_minus_tool": lambda: goal[..., :3] - tool,
        "orientation": lambda: xp.concatenate(quaternions, -1),
        "position": lambda: xp.concatenate(positions, -1),
        "joint_positions": lambda: joints,
        "joint_angles": angles,
        "commanded": lambda: commanded,
        "direction_error": lambda: rest - times(rotation, arm["tool_axis"]),
        "rotation_error": rotation_error,
        "joints_error": lambda: rest - joints,
        **dict.fromkeys(("goal_direction", "goal_rotation", "goal_joints"), lambda: rest),
        "joint_velocities": lambda: moved,
        "last_action": lambda: action,
        "time_left": lambda: time_left,
        "resolved_rate": lambda: resolved_rate(xp, arm, commanded, goal),
    }
    return xp.concatenate([parts[name]() for name in names], -1)


class ArmPolicy:
    """A policy and all that it remembers, for an arm, or for several that move in step.

    Parameters
    ----------
    folder : path, optional
        Where contract.json and policy.npz are; by default beside this file.
    feedback : {"measured", "commanded"}, optional
        Which joint positions the policy sees; by default those of its training.
    """

    def __init__(self, folder: Any = None, feedback: str | None = None) -> None:
        place = Path(__file__).parent if folder is None else Path(folder)
        self.contract = json.loads((place / "contract.json").read_text(encoding="utf-8"))
        found = hashlib.sha256((place / "policy.npz").read_bytes()).hexdigest()
        if found != self.contract["policy"]["sha256"]:
            raise ValueError(f"policy.npz is not the one that {place / 'contract.json'} is about")
        self.feedback = self.contract["plant"]["feedback"] if feedback is None else feedback
        if self.feedback not in ("measured", "commanded"):
            raise ValueError(f"feedback must be 'measured' or 'commanded', got {feedback!r}")
        with np.load(place / "policy.npz", allow_pickle=False) as arrays:
            self.policy = {name: arrays[name] for name in arrays.files}
        self.arm = arm_arrays(self.contract)
        self.reset()

    def reset(self) -> None:
        """Forget all: the next command starts from the joint positions that come with it."""
        self.commanded: Any = None

    def _begin(self, joints: Any) -> None:
        """Rest at joint positions, which must not lie a step or more beyond the limits."""
        n = len(self.arm["step"])
        within = np.clip(joints[..., :n], self.arm["lower"], self.arm["upper"])
        if (np.abs(within - joints[..., :n]) > self.arm["step"]).any():
            raise ValueError(f"joint_positions lie beyond the limits of joints: {joints}")
        self.commanded = np.concatenate([within, joints[..., n:]], -1)
        self._last, self._action = self.commanded, np.zeros(within.shape)
        self._rows, self._steps = list[Any](), 0

    def command(self, joint_positions: Any, goal: Any) -> Any:
        """Command for the next time step, of the same shape as joint positions [rad or m].

        Parameters
        ----------
        joint_positions : array_like, shape (n_joints,) or (n, n_joints)
            Measured positions [rad or m], in the contract's order, signs and offsets.
        goal : array_like, shape (goal_length,) or (n, goal_length)
            Position in the world [m], and what the contract's goals have beside it.
        """
        arm, made, shown = self.arm, self.contract["policy"], self.contract["observation"]
        n, unit = len(arm["step"]), self.contract["resolution"]
        readings = _checked("joint_positions", joint_positions, len(arm["slides"]))
        joints = from_readings(arm, readings)
        aim = _checked("goal", goal, self.contract["goal"]["length"])
        if self.commanded is None:
            self._begin(joints)
        commanded = np.concatenate([self.commanded[..., :n], joints[..., n:]], -1)
        joints = commanded if self.feedback == "commanded" else joints
        batch, left = joints.shape[:-1], max(1.0 - self._steps / shown["horizon"], 0.0)
        row = observe(
            np,
            arm,
            [part["name"] for part in shown["parts"]],
            joints,
            commanded,
            np.broadcast_to(aim, (*batch, aim.shape[-1])),
            moved=(joints - self._last)[..., :n] / arm["step"],
            action=self._action,
            time_left=np.full((*batch, 1), left),
        )
        self._rows = [row, *(self._rows or [row] * shown["history"])[:-1]]
        functions, x = made["activations"], np.concatenate(self._rows, -1)
        self._action = choose_action(np, self.policy, functions, made["mirror_side"], x)
        command = next_command(np, arm, commanded, self._action)
        command = np.round(command / unit) * unit if unit else command
        self.commanded = np.concatenate([command, self.commanded[..., n:]], -1)
        self._last, self._steps = joints, self._steps + 1
        return to_readings(arm, self.commanded)


def _checked(name: str, value: Any, width: int) -> Any:
    array = np.array(value, dtype=float)
    if array.ndim not in (1, 2) or array.shape[-1] != width or not np.isfinite(array).all():
        raise ValueError(f"{name} must be {width} finite numbers, or rows of them, got {value!r}")
    return array

"""Run a policy of kinarm on an arm: this file, contract.json, policy.npz, Python 3.9 and NumPy.

``policy = ArmPolicy(folder)``, then once a time step ``send(policy.command(read_joints(), goal))``.
Functions take arrays of NumPy, or of a library with functions of the same names.
"""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

CONSTANT_BELOW = 1e-6
"""Inputs with a smaller standard deviation in training count as constant."""

ACCURACY = 1e-9
"""Largest error of a command in the self-test [rad or m]."""

ENTRIES = [[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]]
FROM_LEFT = [[1, -1, -1, -1], [1, 1, -1, 1], [1, 1, 1, -1], [1, -1, 1, 1]]
FROM_RIGHT = [[1, -1, -1, -1], [1, 1, 1, -1], [1, -1, 1, 1], [1, 1, -1, 1]]
"""Entries and signs of matrices that multiply by a quaternion."""


class Network(NamedTuple):
    """Normaliser, layers (weights, bias and function) and mirror, if there is one."""

    mean: Any
    scale: Any
    layers: list[Any]
    signs: Any
    action_signs: Any
    side: int | None

    @classmethod
    def of(cls, arrays: Any, names: list[str], side: int | None) -> Network:
        """Make it of the arrays of policy.npz, functions, and the goal's y in observations."""
        constant = arrays["std"] < CONSTANT_BELOW
        return cls(
            mean=arrays["mean"],
            scale=np.where(constant, 0.0, 1.0 / np.where(constant, 1.0, arrays["std"])),
            layers=[(arrays[f"weights_{k}"], arrays[f"bias_{k}"], f) for k, f in enumerate(names)],
            signs=arrays.get("mirror_observations"),
            action_signs=arrays.get("mirror_actions"),
            side=side,
        )

    def action(self, xp: Any, x: Any) -> Any:
        """Fractions of the velocity limits in [-1, 1], for observations, shape (..., n)."""
        left = None if self.side is None else x[..., self.side : self.side + 1] > 0
        x = x if left is None else xp.where(left, x * self.signs, x)
        x = (x - self.mean) * self.scale
        for weights, bias, name in self.layers:
            x = activated(xp, name, x @ weights.T + bias)
        action = xp.clip(x, -1.0, 1.0)
        return action if left is None else xp.where(left, action * self.action_signs, action)


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


class Arm(NamedTuple):
    """The arm's joints in series, and what commands keep to; see contract.json."""

    slides: Any
    translation: Any
    rotation: Any
    axis: Any
    tool_position: Any
    tool_rotation: Any
    tool_axis: Any
    lower: Any
    upper: Any
    step: Any

    @classmethod
    def of(cls, contract: Any) -> Arm:
        """Read it from a contract."""
        joints = contract["joints"]
        moved = [each for each in joints if each["actuated"]]
        column = {name: np.array([each[name] for each in joints]) for name in joints[0]}
        return cls(
            slides=np.where(column["kind"] == "prismatic", 1.0, 0.0),
            **{name: column[name] for name in ("translation", "rotation", "axis")},
            **{f"tool_{name}": np.array(place) for name, place in contract["tool"].items()},
            lower=np.array([each["lower"] for each in moved]),
            upper=np.array([each["upper"] for each in moved]),
            step=np.array([each["velocity_limit"] for each in moved]) * contract["time_step"],
        )

    def command(self, xp: Any, commanded: Any, action: Any) -> Any:
        """Next command to the actuated joints, within the limits of velocity and position."""
        n = self.step.shape[0]
        return xp.clip(commanded[..., :n] + action * self.step, self.lower, self.upper)


def multiplier(xp: Any, quaternion: Any, signs: list[list[int]]) -> Any:
    """Matrix that multiplies quaternions w x y z by this one, shape (..., 4, 4)."""
    return quaternion[..., ENTRIES] * xp.asarray(signs)


def times(matrix: Any, vector: Any) -> Any:
    """Product of matrices, shape (..., m, n), and vectors, shape (..., n)."""
    return (matrix @ vector[..., None])[..., 0]


def forward_kinematics(xp: Any, arm: Arm, joints: Any) -> tuple[list[Any], list[Any], Any, Any]:
    """Orientations w x y z and positions [m] of joint frames, rotation of the last, and tool."""
    half = (0.5 * joints * (1.0 - arm.slides))[..., None]
    turn = xp.concatenate([xp.cos(half), xp.sin(half) * arm.axis], -1)
    turn = times(multiplier(xp, turn, FROM_RIGHT), arm.rotation)
    following = multiplier(xp, turn, FROM_RIGHT)
    quaternions = [turn[..., 0, :]]
    for k in range(1, joints.shape[-1]):
        quaternions.append(times(following[..., k, :, :], quaternions[-1]))
    turned = xp.stack(quaternions, -2)
    from_left, from_right = (multiplier(xp, turned, signs) for signs in (FROM_LEFT, FROM_RIGHT))
    rotations = (from_left @ from_right.swapaxes(-1, -2))[..., 1:, 1:]
    slid = times(rotations, (joints * arm.slides)[..., None] * arm.axis)
    offset = times(rotations[..., :-1, :, :], arm.translation[1:])
    positions = [arm.translation[0] + slid[..., 0, :]]
    for k in range(1, joints.shape[-1]):
        positions.append(positions[-1] + offset[..., k - 1, :] + slid[..., k, :])
    last = rotations[..., -1, :, :]
    return quaternions, positions, last, positions[-1] + times(last, arm.tool_position)


class Seen(NamedTuple):
    """What an observation is made of; moves and actions are fractions of the largest ones."""

    joints: Any
    commanded: Any
    goal: Any
    moved: Any = None
    action: Any = None
    time_left: Any = None


def observe(xp: Any, arm: Arm, names: list[str], seen: Seen) -> Any:
    """Observation of a step: parts of these names, one after the other."""
    joints, rest = seen.joints, seen.goal[..., 3:]
    quaternions, positions, rotation, tool = forward_kinematics(xp, arm, joints)

    def angles() -> Any:
        pairs = xp.stack([xp.sin(joints), xp.cos(joints)], -1)
        return xp.concatenate([pairs[..., k, :] for k in range(joints.shape[-1])], -1)

    def rotation_error() -> Any:
        reached = times(multiplier(xp, arm.tool_rotation, FROM_RIGHT), quaternions[-1])
        same = times(rest[..., None, :], reached)
        return rest - xp.where(same < 0, -reached, reached)

    parts: dict[str, Any] = {
        "goal": lambda: seen.goal[..., :3],
        "goal_minus_tool": lambda: seen.goal[..., :3] - tool,
        "orientation": lambda: xp.concatenate(quaternions, -1),
        "position": lambda: xp.concatenate(positions, -1),
        "joint_positions": lambda: joints,
        "joint_angles": angles,
        "commanded": lambda: seen.commanded,
        "direction_error": lambda: rest - times(rotation, arm.tool_axis),
        "rotation_error": rotation_error,
        "joints_error": lambda: rest - joints,
        **dict.fromkeys(("goal_direction", "goal_rotation", "goal_joints"), lambda: rest),
        "joint_velocities": lambda: seen.moved,
        "last_action": lambda: seen.action,
        "time_left": lambda: seen.time_left,
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
        made, self.observation = self.contract["policy"], self.contract["observation"]
        if hashlib.sha256((place / "policy.npz").read_bytes()).hexdigest() != made["sha256"]:
            raise ValueError(f"policy.npz is not the one that {place / 'contract.json'} is about")
        self.feedback = self.contract["plant"]["feedback"] if feedback is None else feedback
        if self.feedback not in ("measured", "commanded"):
            raise ValueError(f"feedback must be 'measured' or 'commanded', got {feedback!r}")
        with np.load(place / "policy.npz", allow_pickle=False) as arrays:
            self.network = Network.of(arrays, made["activations"], made["mirror_side"])
        self.arm = Arm.of(self.contract)
        self.reset()

    def reset(self) -> None:
        """Forget all: the next command starts from the joint positions that come with it."""
        self.commanded: Any = None

    def _begin(self, joints: Any) -> None:
        """Rest at joint positions, which must not lie a step or more beyond the limits."""
        n = len(self.arm.step)
        within = np.clip(joints[..., :n], self.arm.lower, self.arm.upper)
        if (np.abs(within - joints[..., :n]) > self.arm.step).any():
            raise ValueError(f"joint_positions lie beyond the limits of joints: {joints}")
        self.commanded = np.concatenate([within, joints[..., n:]], -1)
        self._last, self._action = self.commanded, np.zeros(within.shape)
        self._rows, self._steps = list[Any](), 0

    def command(self, joint_positions: Any, goal: Any) -> Any:
        """Command for the next time step, of the same shape as joint positions [rad or m].

        Parameters
        ----------
        joint_positions : array_like, shape (n_joints,) or (n, n_joints)
            Measured positions [rad or m], in the contract's order.
        goal : array_like, shape (goal_length,) or (n, goal_length)
            Position in the world [m], and what the contract's goals have beside it.
        """
        arm, n = self.arm, len(self.arm.step)
        joints = _checked("joint_positions", joint_positions, len(arm.slides))
        aim = _checked("goal", goal, self.contract["goal"]["length"])
        if self.commanded is None:
            self._begin(joints)
        commanded = np.concatenate([self.commanded[..., :n], joints[..., n:]], -1)
        joints = commanded if self.feedback == "commanded" else joints
        batch, left = joints.shape[:-1], max(1.0 - self._steps / self.observation["horizon"], 0.0)
        seen = Seen(
            joints=joints,
            commanded=commanded,
            goal=np.broadcast_to(aim, (*batch, aim.shape[-1])),
            moved=(joints - self._last)[..., :n] / arm.step,
            action=self._action,
            time_left=np.full((*batch, 1), left),
        )
        row = observe(np, arm, [part["name"] for part in self.observation["parts"]], seen)
        self._rows = [row, *(self._rows or [row] * self.observation["history"])[:-1]]
        self._action = self.network.action(np, np.concatenate(self._rows, -1))
        command, unit = arm.command(np, commanded, self._action), self.contract["resolution"]
        command = np.round(command / unit) * unit if unit else command
        self.commanded = np.concatenate([command, self.commanded[..., n:]], -1)
        self._last, self._steps = joints, self._steps + 1
        return self.commanded.copy()


def _checked(name: str, value: Any, width: int) -> Any:
    array = np.array(value, dtype=float)
    if array.ndim not in (1, 2) or array.shape[-1] != width or not np.isfinite(array).all():
        raise ValueError(f"{name} must be {width} finite numbers, or rows of them, got {value!r}")
    return array


def digest_of(contract: dict[str, Any]) -> str:
    """Hash of a contract without its own."""
    rest = {name: value for name, value in contract.items() if name != "digest"}
    return hashlib.sha256(json.dumps(rest, sort_keys=True).encode()).hexdigest()


def self_test(folder: Any = None) -> list[str]:
    """Compare a folder with what kinarm exported; what differs, if anything, a line each."""
    policy = ArmPolicy(folder)
    intact = digest_of(policy.contract) == policy.contract["digest"]
    wrong = [] if intact else ["contract.json was changed after the export"]
    for number, vector in enumerate(policy.contract["self_test"]):
        policy.reset()
        command = policy.command(vector["joint_positions"], vector["goal"])
        error = np.abs(command - np.array(vector["command"])).max()
        if not error <= ACCURACY:
            wrong.append(f"command of self-test vector {number} is off by {error:.3g}")
    return wrong


if __name__ == "__main__":
    failures = self_test()
    sys.stdout.write("\n".join([*failures, "failed" if failures else "passed", ""]))
    sys.exit(1 if failures else 0)

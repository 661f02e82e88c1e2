"""Policies as folders that run on an arm, without kinarm."""

import hashlib
import io
import json
from operator import methodcaller
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import kinarm
from kinarm._fields import to_plain
from kinarm._files import absolute, check_folder, shipped_files, write_atomically
from kinarm.arm import Arm
from kinarm.contact_pairs import random_configurations
from kinarm.errors import InvalidInputError, OutputError, PolicyFileError, finite_array
from kinarm.policies import arm_policy, self_test
from kinarm.policies.conversion.to_torch import command_module, onnx_model
from kinarm.policies.policy import Policy
from kinarm.world import World

WIRING = ("sign", "offset")
"""Of a joint in a contract: what the arm reads is sign * position + offset."""

ALONE = (arm_policy.__file__, self_test.__file__)
"""Files that run without kinarm."""

VECTORS = 10
"""Self-test vectors of a folder."""

GOALS = {
    "position": "position x, y, z [m]",
    "direction": "position x, y, z [m], and unit direction x, y, z of the tool's axis",
    "pose": "position x, y, z [m], and orientation of the tool frame, quaternion w, x, y, z",
    "configuration": "tool position x, y, z [m], and the model's joint positions there [rad or m]",
}
"""What a row of a goal is, by its kind."""

FRAMES = (
    "Goals and frames are in the world, in which the first joint is placed. A joint frame lies in "
    "the one before by its translation [m] and then its rotation at zero; it turns about its axis "
    "by the right-hand rule, or slides along it. The tool is in the frame of the last joint. "
    "Rotations are quaternions w, x, y, z of unit length."
)


def export_policy(
    policy: Policy,
    folder: str | Path,
    *,
    overwrite: bool = False,
    onnx: bool = True,
    sign: ArrayLike | None = None,
    offset: ArrayLike | None = None,
) -> dict[str, Any]:
    """Write a folder that runs a policy on an arm with NumPy alone; return its contract.

    Parameters
    ----------
    policy : Policy
        A policy that does not see bodies of the scene.
    folder : str or Path
        Where to, a new folder.
    overwrite : bool
        Replace the files of an earlier one.
    onnx : bool
        Write the policy in ONNX as well, which needs the extra ``export``.
    sign, offset : array_like, shape (n_joints,), optional
        What the arm reads of each joint is ``sign``, 1 or -1, times its position in the model, plus
        ``offset`` [rad or m]; by default 1 and 0.

    Raises
    ------
    KinarmError
        If the policy sees bodies, its arm is another version, the folder
        exists, or an extra is missing.
    """
    where = absolute(folder)
    if where.exists() and not (overwrite and where.is_dir()):
        refused = OutputError(f"{str(folder)!r} exists: --overwrite replaces a folder's files")
        refused.add_note("in Python: overwrite=True")
        raise refused
    world = World(policy.problem, threads=1)
    policy.check_arm(world.arm)
    contract, packed = contract_of(policy, world, sign, offset), io.BytesIO()
    policy.save(packed)
    contract["policy"]["sha256"] = hashlib.sha256(packed.getvalue()).hexdigest()
    files = _onnx_files(policy, contract) if onnx else {}
    contract["onnx"] = [*files]
    contract["digest"] = self_test.digest_of(contract)
    files |= {
        **{Path(path).name: Path(path).read_bytes() for path in ALONE},
        "policy.npz": packed.getvalue(),
        "README.md": _readme(contract).encode(),
        "contract.json": (json.dumps(contract, indent=1) + "\n").encode(),
    }
    check_folder(where)
    for name in {"network.onnx", "policy.onnx"} - files.keys():  # of an earlier policy
        (where / name).unlink(missing_ok=True)
    for name, held in files.items():
        write_atomically(where / name, methodcaller("write", held))
    return contract


def _joints(arm: Arm, sign: ArrayLike | None, offset: ArrayLike | None) -> list[dict[str, Any]]:
    """What is to be known of each joint; checks signs and offsets."""
    shape = (arm.n_joints,)
    signs = np.ones(shape) if sign is None else finite_array("sign", sign, shape)
    if (np.abs(signs) != 1.0).any():
        raise InvalidInputError(f"sign must be 1 or -1 for each joint, got {signs.tolist()}")
    offsets = np.zeros(shape) if offset is None else finite_array("offset", offset, shape)
    slides = arm.chain.prismatic.tolist()
    columns = {
        "name": arm.joint_names,
        "kind": ["prismatic" if slide else "revolute" for slide in slides],
        "unit": ["m" if slide else "rad" for slide in slides],
        "actuated": [joint < arm.n_actuated for joint in range(arm.n_joints)],
        "lower": arm.lower.tolist(),
        "upper": arm.upper.tolist(),
        "velocity_limit": arm.velocity_limits.tolist(),
        "home": arm.home.tolist(),
        "sign": signs.tolist(),
        "offset": offsets.tolist(),
        **{each: getattr(arm.chain, each).tolist() for each in ("translation", "rotation", "axis")},
    }
    return [
        {name: column[joint] for name, column in columns.items()} for joint in range(arm.n_joints)
    ]


def contract_of(
    policy: Policy,
    world: World,
    sign: ArrayLike | None = None,
    offset: ArrayLike | None = None,
) -> dict[str, Any]:
    """What somebody who runs the policy in a world has to know, a runtime reads, and a self-test.

    Sign and offset are those of `export_policy`. InvalidInputError if the policy sees what
    only kinarm computes.
    """
    world = world.changed(observation=policy.observation)
    problem, arm, layout, made = world.problem, world.arm, world.layout, policy.provenance
    if layout.sees_bodies:
        seen = [name for name in ("proximity", "obstacles") if name in layout.places]
        raise InvalidInputError(f"the policy sees {' and '.join(seen)}: it needs kinarm to run")
    task, plant, dt, rules = problem.task, problem.plant, problem.stepping.time_step, world.rules
    tool = {"position": arm.chain.tool, "rotation": rules.goal.frame, "axis": rules.goal.axis}
    parts = [
        {"name": part.name, "length": layout.length(part), "unit": part.unit, "is": part.meaning}
        for part in layout.parts
    ]
    kind, side = task.goal.kind, None if policy.mirror is None else policy.mirror.side
    meant = {"kind": kind, "is": GOALS[kind], "length": world.goal_width}
    meant |= {"tolerance": task.tolerance, "rotation_tolerance": task.goal.rotation_tolerance}
    contract = {
        "made_by": f"kinarm {kinarm.__version__}",
        "policy": {
            "name": f"{made.algorithm} {made.recipe}",
            "seed": made.seed,
            "activations": [*policy.activations],
            "mirror_side": side,
        },
        "problem": {"name": problem.name, "digest": problem.digest},
        "arm": {"name": arm.name, "digest": arm.digest, "tool_frame": arm.tool_frame},
        "frames": FRAMES,
        "joints": _joints(arm, sign, offset),
        "tool": {name: array.tolist() for name, array in tool.items()},
        "time_step": dt,
        "rate": 1.0 / dt,
        "goal": {**meant, "hold": task.goal.hold, "speed": task.goal.speed},
        "observation": {
            "parts": parts,
            "history": layout.history,
            "horizon": task.horizon,
            "memory": layout.remembers,
        },
        "plant": {"feedback": plant.feedback, **to_plain(plant)},
        "shield": problem.stepping.shield,
        "resolution": 0.0 if isinstance(plant.resolution, tuple) else plant.resolution,
    }
    return contract | {"self_test": _vectors(policy, world, contract)}


def _vectors(
    policy: Policy, world: World, contract: dict[str, Any]
) -> list[dict[str, list[float]]]:
    """Joint positions of arms at rest, goals, and kinarm's commands."""
    arm, n, resolution = world.arm, world.arm.n_actuated, contract["resolution"]
    q, others = (random_configurations(world.arm, VECTORS, seed) for seed in (0, 1))
    goals, command = world.reached(others), q.copy()
    moved = q[:, :n] + policy(world.observe(q, goals)) * world.rules.step_limit
    command[:, :n] = np.clip(moved, arm.lower[:n], arm.upper[:n])
    if resolution:
        command[:, :n] = np.round(command[:, :n] / resolution) * resolution
    wiring = {name: np.array([each[name] for each in contract["joints"]]) for name in WIRING}
    readings, told = (arm_policy.to_readings(wiring, joints) for joints in (q, command))
    columns = {"joint_positions": readings, "goal": goals, "command": told}
    return [{name: rows[k].tolist() for name, rows in columns.items()} for k in range(VECTORS)]


def _onnx_files(policy: Policy, contract: dict[str, Any]) -> dict[str, bytes]:
    """The bare network, and unless the observation needs memory, all from joints to commands."""
    shown, network, n = contract["observation"], policy.to_torch(), len(contract["joints"])
    files = {"network.onnx": onnx_model(network, {"observation": policy.n_observations}, "action")}
    if shown["memory"] or contract["resolution"]:
        return files
    inputs = {"joint_positions": n, "goal": contract["goal"]["length"], "commanded": n}
    module = command_module(policy.arrays, contract)
    return files | {"policy.onnx": onnx_model(module, inputs, "command")}


def _readme(contract: dict[str, Any]) -> str:
    """What whoever receives the folder reads first."""
    rows = [
        f"| {each['name']} | {each['unit']} | {each['lower']:.4g} to {each['upper']:.4g} "
        f"| {each['velocity_limit']:.4g} | {'yes' if each['actuated'] else 'no'} "
        f"| {each['sign']:+.0f} | {each['offset']:.6g} |"
        for each in contract["joints"]
    ]
    text = shipped_files("help", ".txt")["exported"].read_text()
    return text.format(**contract, table="\n".join(rows))


def load_wiring(folder: Path) -> dict[str, Any]:
    """Signs and offsets of the joints, of an exported folder that passes its self-test.

    PolicyFileError if it does not.
    """
    try:
        runtime = arm_policy.ArmPolicy(folder)
        wrong, arm = self_test.self_test(runtime), runtime.arm
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise PolicyFileError(f"{str(folder)!r} is no exported folder: {error}") from error
    if wrong:
        raise PolicyFileError(f"{str(folder)!r} fails its self-test: {wrong[0]}")
    return {name: arm[name] for name in WIRING}

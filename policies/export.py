"""Policies as folders that run on an arm, without kinarm."""

import hashlib
import io
import json
from operator import methodcaller
from pathlib import Path
from typing import Any

import numpy as np

import kinarm
from kinarm._fields import to_plain
from kinarm._files import absolute, check_folder, save_archive, shipped_files, write_atomically
from kinarm.clearance import random_configurations
from kinarm.errors import InvalidInputError, OutputError
from kinarm.policies import arm_policy
from kinarm.policies.conversion.to_torch import command_module, network_module, onnx_model
from kinarm.policies.policy import FORMAT_VERSION, Policy, policy_content
from kinarm.world import World

RUNTIME, CONTRACT, POLICY, README = "arm_policy.py", "contract.json", "policy.npz", "README.md"
COMMANDS_ONNX, NETWORK_ONNX = "policy.onnx", "network.onnx"

WITH_MEMORY = ("joint_velocities", "last_action", "time_left")
"""Parts of an observation that depend on more than joint positions, command and goal."""

VECTORS = 10
"""Self-test vectors of a folder."""

GOALS = {
    "position": "position x, y, z [m]",
    "direction": "position x, y, z [m], and unit direction x, y, z of the tool's axis",
    "pose": "position x, y, z [m], and orientation of the tool frame, quaternion w, x, y, z",
    "configuration": "tool position x, y, z [m], and the joint positions there [rad or m]",
}
"""What a row of a goal is, by its kind."""

FRAMES = {
    "world": "all positions and orientations are in the world, where the scene's base frame is",
    "joints": "each joint frame in the one before: translation [m], then rotation at zero",
    "quaternions": "w, x, y, z of unit length; joints turn by the right-hand rule about their axis",
}


def export_policy(
    policy: Policy, folder: str | Path, *, overwrite: bool = False, onnx: bool = True
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
    if world.layout.sees_bodies:
        seen = [name for name in ("proximity", "obstacles") if name in world.layout.places]
        raise InvalidInputError(
            f"the policy sees {' and '.join(seen)}; only policies that see no bodies are exported"
        )
    content, packed = policy_content(policy), io.BytesIO()
    save_archive(packed, "policy", FORMAT_VERSION, content.arrays, content.header, compress=True)
    contract = _contract(policy, world) | {"self_test": _self_test(policy, world)}
    contract["policy"]["sha256"] = hashlib.sha256(packed.getvalue()).hexdigest()
    files = _onnx_files(policy, contract) if onnx else {}
    contract["onnx"] = [*files]
    contract["digest"] = arm_policy.digest_of(contract)
    files |= {
        "arm_policy.py": Path(arm_policy.__file__).read_bytes(),
        "policy.npz": packed.getvalue(),
        "README.md": _readme(contract).encode(),
        "contract.json": (json.dumps(contract, indent=1) + "\n").encode(),
    }
    check_folder(where)
    for name, held in files.items():
        write_atomically(where / name, methodcaller("write", held))
    return contract


def _contract(policy: Policy, world: World) -> dict[str, Any]:
    """What somebody who runs the policy has to know, and the runtime reads."""
    problem, arm, layout = policy.problem, world.arm, world.layout
    chain, rules, plant = arm.chain, world.goal_rules(), problem.plant
    joints = [
        {
            "name": name,
            "kind": "prismatic" if chain.prismatic[k] else "revolute",
            "unit": "m" if chain.prismatic[k] else "rad",
            "actuated": k < arm.n_actuated,
            **{
                each: float(getattr(chain, f"{each}s" if each == "velocity_limit" else each)[k])
                for each in ("lower", "upper", "velocity_limit")
            },
            **{
                each: getattr(chain, each)[k].tolist()
                for each in ("translation", "rotation", "axis")
            },
        }
        for k, name in enumerate(arm.joint_names)
    ]
    parts = [
        {
            "name": part.name,
            "meaning": part.meaning,
            "unit": part.unit,
            "start": place.start,
            "length": place.stop - place.start,
        }
        for part, place in zip(layout.parts, layout.places.values(), strict=True)
    ]
    return {
        "made_by": f"kinarm {kinarm.__version__}",
        "policy": {
            "name": f"{policy.provenance.algorithm} {policy.provenance.recipe}",
            "seed": policy.provenance.seed,
            "activations": [*policy.activations],
            "mirror_side": None if policy.mirror is None else policy.mirror.side,
        },
        "problem": {"name": problem.name, "digest": problem.digest},
        "arm": {"name": arm.name, "digest": arm.digest, "tool_frame": arm.tool_frame},
        "frames": FRAMES,
        "joints": joints,
        "tool": {
            "position": chain.tool.tolist(),
            "rotation": rules.frame.tolist(),
            "axis": rules.axis.tolist(),
        },
        "time_step": problem.stepping.time_step,
        "rate": 1.0 / problem.stepping.time_step,
        "goal": {
            "kind": problem.task.goal.kind,
            "meaning": GOALS[problem.task.goal.kind],
            "length": world.goal_width,
            "tolerance": problem.task.tolerance,
        },
        "observation": {
            "parts": parts,
            "history": layout.history,
            "horizon": problem.task.horizon,
        },
        "shield": problem.stepping.shield,
        "plant": {"feedback": plant.feedback, **to_plain(plant)},
        "resolution": _resolution(world),
    }


def _resolution(world: World) -> float:
    """Steps of the commands [rad or m]; 0 for none, and if episodes draw them."""
    lower, upper = world.problem.plant.range_of("resolution")
    return lower if lower == upper else 0.0


def _self_test(policy: Policy, world: World) -> list[dict[str, list[float]]]:
    """Joint positions of arms at rest, goals, and kinarm's commands."""
    arm, limit = world.arm, world.rules.step_limit
    q = random_configurations(world.contact_model, VECTORS)
    goals = world.reached(random_configurations(world.contact_model, VECTORS, seed=1))
    command, n = q.copy(), arm.n_actuated
    moved = q[:, :n] + policy(world.observe(q, goals)) * limit
    command[:, :n] = np.clip(moved, arm.lower[:n], arm.upper[:n])
    if step := _resolution(world):
        command[:, :n] = np.round(command[:, :n] / step) * step
    columns = {"joint_positions": q, "goal": goals, "command": command}
    return [{name: rows[k].tolist() for name, rows in columns.items()} for k in range(VECTORS)]


def _onnx_files(policy: Policy, contract: dict[str, Any]) -> dict[str, bytes]:
    """The bare network, and unless the observation needs memory, all from joints to commands."""
    layout, network = contract["observation"], network_module(policy)
    files = {"network.onnx": onnx_model(network, {"observation": policy.n_observations}, "action")}
    remembers = any(part["name"] in WITH_MEMORY for part in layout["parts"])
    if remembers or layout["history"] > 1 or contract["resolution"]:
        return files
    n = len(contract["joints"])
    inputs = {"joint_positions": n, "goal": contract["goal"]["length"], "commanded": n}
    return files | {"policy.onnx": onnx_model(command_module(policy, contract), inputs, "command")}


def _readme(contract: dict[str, Any]) -> str:
    """What whoever receives the folder reads first."""
    rows = [
        f"| {each['name']} | {each['unit']} | {each['lower']:.4g} to {each['upper']:.4g} "
        f"| {each['velocity_limit']:.4g} | {'yes' if each['actuated'] else 'no'} |"
        for each in contract["joints"]
    ]
    text = shipped_files("help", ".txt")["exported"].read_text()
    return text.format(**contract, table="\n".join(rows))

"""Convert the shipped policies from format 1 to 2, keeping their provenance; run once."""

import json
from pathlib import Path

import numpy as np

from kinarm.networks import Mirror
from kinarm.policies.mirror import find_mirror
from kinarm.policies.policy import Layer, Policy
from kinarm.policies.provenance import Provenance
from kinarm.problem import PROBLEMS
from kinarm.world import World

REWARDS = {
    "progress_reward": "progress",
    "closer_reward": "closer",
    "step_reward": "step",
    "collision_penalty": "collision",
    "success_bonus": "success",
}
PPO_NAMES = {
    "arms": "n_envs",
    "rollout_steps": "n_steps",
    "minibatch": "batch_size",
    "epochs": "n_epochs",
    "hidden": "net_arch",
    "entropy_weight": "ent_coef",
    "value_weight": "vf_coef",
    "initial_log_std": "log_std_init",
    "tolerance": "training_tolerance",
}
WHOLE = {"task", "arm", "horizon", "start_spread"}


def single(layers: list[Layer]) -> list[Layer]:
    """The network whose mirror image was put beside it, with what its switch left of biases."""
    found, n_in = [], layers[0].weights.shape[1]
    for layer in layers[:-1]:
        n = len(layer.bias) // 2
        switch = -layer.weights[:n, -1] if layer is layers[-2] else 0.0
        found.append(Layer(layer.weights[:n, :n_in], layer.bias[:n] + switch))
        n_in = n
    last = layers[-1]
    off = last.weights[:, n_in : 2 * n_in].sum(axis=1)
    found.append(Layer(last.weights[:, :n_in], last.bias - last.weights[:, -1] - off))
    return found


def convert(path: Path) -> None:
    content = np.load(path)
    if "header" in content:
        return
    made = json.loads(str(content["provenance"]))
    problem = PROBLEMS[made.pop("task")].pinned
    assert made.pop("arm") == "paper"
    assert made.pop("arm_digest") == problem.arm_digest
    config = made.pop("config")
    reward = {REWARDS[name]: config.pop(name) for name in REWARDS if name in config}
    settings = {
        PPO_NAMES.get(name, name): value
        for name, value in config.items()
        if name not in WHOLE
    }
    config = {**settings, "reward": {**reward, "allow_perverse": False}}
    layers = [
        Layer(content[f"weights_{k}"], content[f"bias_{k}"])
        for k in range(sum(name.startswith("weights_") for name in content.files))
    ]
    mirror: Mirror | None = None
    if made["algorithm"] == "ppo" and len(layers[0].bias) % 2:
        mirror = find_mirror(World(problem))
        layers = single(layers)
    Policy(
        mean=content["mean"],
        std=content["std"],
        layers=tuple(layers),
        provenance=Provenance(**made, problem=problem, config=config),
        mirror=mirror,
    ).save(path)


for path in sorted(Path(__file__).parent.glob("*.npz")):
    convert(path)

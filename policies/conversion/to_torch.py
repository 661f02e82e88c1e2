"""Policies as modules of PyTorch, and these as ONNX."""

import io
import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from kinarm.errors import needed
from kinarm.policies.arm_policy import Arm, Network, Seen, observe
from kinarm.policies.normalizer import input_scale

if TYPE_CHECKING:
    from kinarm.policies.policy import Policy

OPSET = 17
"""Version of ONNX's operators, from 2022."""


def network_module(policy: "Policy") -> Any:
    """A policy as a module, in double precision; its weights and biases are parameters.

    MissingExtraError without PyTorch.
    """
    torch = needed("torch", "torch", "export")
    module: Any = torch.nn.Module
    mirror, tensor = policy.mirror, torch.tensor
    fixed = {"mean": tensor(policy.mean), "scale": tensor(input_scale(policy.std))}
    if mirror is not None:
        fixed |= {"signs": tensor(mirror.observations), "action_signs": tensor(mirror.actions)}

    class NetworkModule(module):
        """Observations, shape (..., n_observations), to actions, shape (..., n_actions)."""

        def __init__(self) -> None:
            super().__init__()
            self.layers = torch.nn.ModuleList()
            for weights, bias in policy.layers:
                layer = torch.nn.Linear(*weights.shape[::-1], dtype=torch.float64)
                layer.weight.data, layer.bias.data = tensor(weights), tensor(bias)
                self.layers.append(layer)
            for name, values in fixed.items():
                self.register_buffer(name, values)

        def forward(self, observations: Any) -> Any:
            own: dict[str, Any] = {
                "signs": None,
                "action_signs": None,
                **dict(self.named_buffers()),
            }
            pairs = zip(self.layers, policy.activations, strict=True)
            layers = [(layer.weight, layer.bias, name) for layer, name in pairs]
            side = None if mirror is None else mirror.side
            return Network(**own, layers=layers, side=side).action(torch, observations)

    return NetworkModule()


def command_module(policy: "Policy", contract: Mapping[str, Any]) -> Any:
    """A module from joint positions, goal and last command to the next one, in single precision.

    Takes the contract of an exported folder, whose observation needs nothing else.
    """
    torch = needed("torch", "torch", "export")
    module: Any = torch.nn.Module
    arm = Arm(*(torch.tensor(each, dtype=torch.float32) for each in Arm.of(contract)))
    names, n = [part["name"] for part in contract["observation"]["parts"]], len(arm.step)

    class CommandModule(module):
        def __init__(self) -> None:
            super().__init__()
            self.network = network_module(policy).float()

        def forward(self, joints: Any, goal: Any, commanded: Any) -> Any:
            told = torch.concatenate([commanded[..., :n], joints[..., n:]], -1)
            sees = told if contract["plant"]["feedback"] == "commanded" else joints
            seen = Seen(joints=sees, commanded=told, goal=goal)
            command = arm.command(torch, told, self.network(observe(torch, arm, names, seen)))
            return torch.concatenate([command, commanded[..., n:]], -1)

    return CommandModule()


def onnx_model(module: Any, inputs: Mapping[str, int], output: str) -> bytes:
    """A module in ONNX, with inputs of such lengths, shape (n, length) in float32.

    MissingExtraError without the package onnx.
    """
    torch = needed("torch", "torch", "export")
    needed("onnx", "onnx", "export")  # which PyTorch needs
    written = io.BytesIO()
    with warnings.catch_warnings(action="ignore"):  # of a way that PyTorch means to replace
        torch.onnx.export(
            module.float(),
            tuple(torch.zeros(2, length) for length in inputs.values()),
            written,
            input_names=list(inputs),
            output_names=[output],
            dynamic_axes={name: {0: "n"} for name in (*inputs, output)},
            opset_version=OPSET,
            dynamo=False,
        )
    return written.getvalue()

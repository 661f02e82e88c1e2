"""Policies as modules of PyTorch, and these as ONNX."""

import io
import warnings
from collections.abc import Callable, Mapping
from typing import Any

from kinarm.errors import needed
from kinarm.policies.arm_policy import (
    arm_arrays,
    choose_action,
    from_readings,
    next_command,
    observe,
    to_readings,
)

OPSET = 17
"""Version of ONNX's operators, from 2022."""


def module_of(arrays: Mapping[str, Any], function: Callable[..., Any]) -> Any:
    """A module that computes a function of PyTorch, arrays and inputs.

    Weights and biases are its parameters. MissingExtraError without PyTorch.
    """
    torch = needed("torch", "torch", "export")
    base: Any = torch.nn.Module

    class FunctionModule(base):
        def __init__(self) -> None:
            super().__init__()
            for name, array in arrays.items():
                tensor = torch.tensor(array)
                if name.startswith(("weights", "bias")):
                    self.register_parameter(name, torch.nn.Parameter(tensor))
                else:
                    self.register_buffer(name, tensor)

        def forward(self, *inputs: Any) -> Any:
            held = {**dict(self.named_parameters()), **dict(self.named_buffers())}
            return function(torch, held, *inputs)

    return FunctionModule()


def command_module(arrays: Mapping[str, Any], contract: Mapping[str, Any]) -> Any:
    """A policy with all that is about it: joint positions, goal and last command to the next one.

    Takes the arrays of its file, and its contract, whose observation needs nothing else.
    """
    made, n = contract["policy"], sum(each["actuated"] for each in contract["joints"])
    names = [part["name"] for part in contract["observation"]["parts"]]

    def command(xp: Any, held: Any, readings: Any, goal: Any, sent: Any) -> Any:
        joints, last = from_readings(held, readings), from_readings(held, sent)
        told = xp.concatenate([last[..., :n], joints[..., n:]], -1)
        seen = told if contract["plant"]["feedback"] == "commanded" else joints
        x = observe(xp, held, names, seen, told, goal)
        action = choose_action(xp, held, made["activations"], made["mirror_side"], x)
        commanded = xp.concatenate([next_command(xp, held, told, action), last[..., n:]], -1)
        return to_readings(held, commanded)

    return module_of({**arrays, **arm_arrays(contract)}, command)


def onnx_model(module: Any, inputs: Mapping[str, int], output: str) -> bytes:
    """A module in ONNX, with inputs of such lengths, shape (n, length), in single precision."""
    torch, _ = needed("torch", "torch", "export"), needed("onnx", "onnx", "export")
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

"""``kinarm-export``: a policy as a folder that runs on an arm, without kinarm."""

from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from kinarm._command_line import run_request
from kinarm._fields import Checked


@dataclass(frozen=True, kw_only=True)
class ExportRequest(Checked):
    """Write a folder that runs a policy on an arm, with NumPy alone.

    Parameters
    ----------
    policy : str
        The policy: its name, a file, or a model of Stable-Baselines3 (.zip).
    out : Path
        The folder to write.
    problem : str
        The problem of a model of Stable-Baselines3, whose file does not say it.
    vec_normalize : Path
        Statistics of VecNormalize for such a model (runs code), or none.
    onnx : bool
        Write it in ONNX as well, which needs the extra export.
    overwrite : bool
        Replace the files of an earlier folder.
    sign : tuple of float
        1 or -1 for each joint: whether the arm counts it as the model does.
    offset : tuple of float
        What the arm reads of each joint where the model has zero [rad or m].
    """

    policy: str = field(metadata={"flag": "policy", "metavar": "POLICY"})
    out: Path = field(metadata={"metavar": "DIR"})
    problem: str | None = None
    vec_normalize: Path | None = field(default=None, metadata={"metavar": "FILE|none"})
    onnx: bool = True
    overwrite: bool = False
    sign: tuple[float, ...] = ()
    offset: tuple[float, ...] = ()


def _export(request: ExportRequest, _: str) -> None:
    from kinarm.errors import InvalidInputError
    from kinarm.policies import Policy, export_policy, load_policy

    of_model = request.problem, request.vec_normalize
    if request.policy.endswith(".zip"):
        policy = Policy.from_sb3(request.policy, *of_model)
    elif of_model != (None, None):
        raise InvalidInputError("--problem and --vec-normalize are for a model (.zip)")
    else:
        policy = load_policy(request.policy)
    wiring = {"sign": request.sign or None, "offset": request.offset or None}
    export_policy(policy, request.out, overwrite=request.overwrite, onnx=request.onnx, **wiring)
    print(f"written: {request.out}; python {request.out}/self_test.py tests it")


main = partial(run_request, "kinarm-export", ExportRequest, _export)
"""Run the command line."""

"""``kinarm-arms``: list arms, and describe one."""

import sys
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import cast

from kinarm._command_line import Commands, run_commands
from kinarm._tables import print_table
from kinarm.arm_specification import PACKAGE, ArmFile, arm_names

HEADINGS = (
    *("arm", "title", "joints", "actuated", "reach [m]", "speeds [deg/s]"),
    *("licence", "source", "installed"),
)
EXPENDABLE = ("source", "licence", "speeds [deg/s]", "actuated", "joints", "title")
"""Columns that narrow terminals leave out, in this order."""


@dataclass(frozen=True, kw_only=True)
class ListRequest:
    """List the arms that kinarm knows."""

    def rows(self) -> list[tuple[str, ...]]:
        """A row for each arm, under `HEADINGS`; partly empty if not installed."""
        from kinarm.arm import Arm
        from kinarm.errors import ArmError
        from kinarm.evaluation.arm_facts import joint_speeds

        rows = []
        for name in arm_names():
            known, installed = [""] * 4, "no"
            with suppress(ArmError):
                arm = Arm.load(name)
                joints = str(arm.n_joints), str(arm.n_actuated)
                known = [*joints, f"{arm.reach:.2f}", joint_speeds(arm)]
                installed = "yes"
            file = cast("ArmFile", ArmFile.of(name))
            rows.append((name, file.title, *known, file.licence, file.origin, installed))
        return rows


@dataclass(frozen=True, kw_only=True)
class ShowRequest:
    """Describe an arm.

    Parameters
    ----------
    arm : str
        The arm: its name, a URDF, or an arm file.
    tool_frame : str
        Link whose origin is the tool point.
    package_dirs : tuple of str
        Folder of packages that package:// meshes of a URDF are in; repeatable.
    """

    arm: str = field(metadata={"flag": "arm", "metavar": "ARM", "names": arm_names})
    tool_frame: str | None = None
    package_dirs: tuple[str, ...] = field(
        default=(), metadata={"flag": "--package-dir", "metavar": "FOLDER", "repeat": True}
    )


def _list(request: ListRequest) -> None:
    rows = request.rows()
    print_table(HEADINGS, rows, EXPENDABLE)
    if any(row[-1] == "no" for row in rows):
        package = PACKAGE.removesuffix(":")
        sys.stderr.write(f"not installed: part of {package}; pip install 'kinarm[robots]'\n")


def _show(request: ShowRequest) -> None:
    from kinarm.arm import Arm
    from kinarm.evaluation.arm_facts import arm_facts

    arm = Arm.load(request.arm, tool_frame=request.tool_frame, package_dirs=request.package_dirs)
    print(arm_facts(arm))


COMMANDS: Commands = {"list": (ListRequest, _list), "show": (ShowRequest, _show)}


main = partial(run_commands, "kinarm-arms", "List arms, and describe one.", COMMANDS)
"""Run the command line."""

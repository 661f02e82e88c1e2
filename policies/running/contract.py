"""Contracts of exported folders, as a run reads them."""

from pathlib import Path
from typing import Any

from kinarm.errors import PolicyFileError
from kinarm.policies.arm_policy import ArmPolicy, self_test


def is_exported(folder: Path) -> bool:
    """Whether it is a folder of `kinarm.policies.export_policy`."""
    return (folder / "contract.json").is_file()


def load_wiring(folder: Path) -> dict[str, Any]:
    """Signs and offsets of the arm's joints, of a folder that passes its self-test.

    PolicyFileError if it does not.
    """
    try:
        wrong, arm = self_test(folder), ArmPolicy(folder).arm
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise PolicyFileError(f"{str(folder)!r} is no exported folder: {error}") from error
    if wrong:
        raise PolicyFileError(f"{str(folder)!r} fails its self-test: {wrong[0]}")
    return {name: arm[name] for name in ("sign", "offset")}

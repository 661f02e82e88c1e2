"""Workers elsewhere must be of the same kinarm, packages and results as their driver."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import kinarm
from kinarm import SEMANTICS
from kinarm.errors import WorkerError
from kinarm.policies.oracle import ORACLE_SEMANTICS
from kinarm.policies.provenance import package_versions


@cache
def identity() -> tuple[tuple[str, str], ...]:
    """Versions of packages, of results, and the hash of kinarm's source, by name."""
    versions = {
        **package_versions(),
        "semantics": SEMANTICS,
        "oracle semantics": ORACLE_SEMANTICS,
        "source of kinarm": source_digest(),
    }
    return tuple(versions.items())


def source_digest() -> str:
    """Hash of the Python files of kinarm, wherever they lie."""
    content = hashlib.sha256()
    for folder in sorted({Path(folder).resolve() for folder in kinarm.__path__}):
        parts = [folder] if folder.name == "kinarm" else [folder / name for name in BESIDE]
        for path in sorted(path for part in parts for path in part.rglob("*.py")):
            content.update(path.read_bytes())
    return content.hexdigest()[:12]


BESIDE = ("policies", "evaluation", "data")
"""Packages of kinarm that lie beside it in a clone."""


@dataclass(frozen=True)
class Guarded:
    """Work that is refused by a worker which differs from the driver that it was made in.

    Attributes
    ----------
    work : callable
        What to do.
    expected : tuple
        What `identity` told the driver.
    """

    work: Callable[[Any], Any]
    expected: tuple[tuple[str, str], ...]

    def __call__(self, task: Any) -> Any:
        """Do the work for a task.

        Raises
        ------
        WorkerError
            If the worker differs; names the first difference.
        """
        check_identity(self.expected)
        return self.work(task)


def check_identity(expected: tuple[tuple[str, str], ...]) -> None:
    """Refuse to go on if this worker differs from the command, and name the difference.

    Raises
    ------
    WorkerError
        Names the first difference.
    """
    here = dict(identity())
    for name, wanted in expected:
        found = here.get(name, "not installed")
        if found != wanted:
            raise WorkerError(
                f"a worker differs from this process: {name} is {found} there, {wanted} here"
            )

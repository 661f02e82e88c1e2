"""Every peer that is installed, and why the others are left out."""

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from importlib import import_module, metadata
from typing import Any

from kinarm._files import first_line
from kinarm.errors import MissingExtraError
from kinarm.policies.policy import Policy


@dataclass(frozen=True)
class Peer:
    """Somebody to compare with.

    Parameters
    ----------
    package : str
        Name of its distribution.
    imports : str
        The module that it is imported by.
    measured_by : str
        The module beside this one whose ``compare(policy, repetitions)`` yields `Comparison`s.
    extra : str
        The extra of kinarm that brings it.
    """

    package: str
    imports: str
    measured_by: str
    extra: str = "peers"

    @property
    def title(self) -> str:
        """Name and version."""
        return f"{self.package} {metadata.version(self.package)}"


PEERS = (
    Peer("mujoco", "mujoco.rollout", "mujoco_rollouts"),
    Peer("vamp-planner", "vamp", "vamp_validity", extra="vamp"),
    Peer("panda-gym", "panda_gym", "panda_reach"),
    Peer("gymnasium-robotics", "gymnasium_robotics", "fetch_reach"),
    Peer("sb3-contrib", "sb3_contrib", "contrib_ars"),
)


def measure_peers(policy: Policy, repetitions: int) -> list[dict[str, Any]]:
    """Comparisons with all peers; ``skipped`` says why there are none with one."""
    with stdout_to_stderr():
        return [row for peer in PEERS for row in compare_with(peer, policy, repetitions)]


def compare_with(peer: Peer, policy: Policy, repetitions: int) -> list[dict[str, Any]]:
    """Comparisons with a peer, or one row that says what is missing."""
    try:
        import_module(peer.imports)
        title = peer.title
    except (ImportError, metadata.PackageNotFoundError):
        missing = MissingExtraError(peer.package, peer.extra)
        return [{"peer": peer.package, "skipped": str(missing)}]
    except Exception as error:  # what is broken in their import ends no measurement of ours
        return [{"peer": peer.package, "skipped": f"cannot be imported: {first_line(error)}"}]
    compare = import_module(f"{__package__}.{peer.measured_by}").compare
    rows: list[dict[str, Any]] = []
    try:
        rows += ({"peer": title, **each.to_json()} for each in compare(policy, repetitions))
    except MissingExtraError as error:
        rows.append({"peer": title, "skipped": str(error)})
    return rows


@contextmanager
def stdout_to_stderr() -> Iterator[None]:
    """Send output that is printed meanwhile, by code in C as well, to standard error."""
    flush = ctypes.CDLL(None).fflush
    sys.stdout.flush()
    kept = os.dup(1)
    try:
        os.dup2(2, 1)
        with redirect_stdout(sys.stderr):
            yield
    finally:
        sys.stdout.flush()
        flush(None)
        os.dup2(kept, 1)
        os.close(kept)

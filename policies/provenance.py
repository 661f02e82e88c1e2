"""Where a policy comes from."""

import hashlib
import platform
import subprocess
from dataclasses import asdict, dataclass, field, fields
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import kinarm
from kinarm.errors import InvalidInputError

if TYPE_CHECKING:
    from kinarm.arm import Arm
    from kinarm.policies.learners import Config

RECORDED_PACKAGES = (
    *("kinarm", "numpy", "numba", "pin", "coal", "gymnasium", "scipy"),
    *("torch", "stable-baselines3"),
)


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """How a policy was made; stored with it as JSON.

    Parameters
    ----------
    algorithm : str
        Such as ``"ars"``.
    recipe : str
        Name of the settings that it was trained with.
    task : str
        Task that it was trained on.
    arm, arm_digest : str
        Arm that it was trained for: name, and hash of what the simulator uses of it.
    seed : int
        Seed of the training.
    environment_steps : int
        Steps that the training took.
    config : dict
        All settings of the learner.
    versions : dict
        Versions of the packages that matter.
    commit : str
        Commit of kinarm's source, with ``-dirty`` if it was changed; empty if unknown.
    """

    algorithm: str
    recipe: str
    task: str
    arm: str
    arm_digest: str
    seed: int
    environment_steps: int
    config: dict[str, Any] = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=dict)
    commit: str = ""

    @classmethod
    def of(
        cls, algorithm: str, config: "Config", arm: "Arm", environment_steps: int
    ) -> "Provenance":
        """Record a training that took place here and now, with these settings."""
        return cls(
            algorithm=algorithm,
            recipe=config.recipe,
            task=config.task,
            arm=arm.name,
            arm_digest=arm.digest,
            seed=config.seed,
            environment_steps=environment_steps,
            config=asdict(config),  # type: ignore[call-overload]
            versions=package_versions(),
            commit=source_commit(),
        )

    def to_json(self) -> dict[str, Any]:
        """As a dictionary that JSON can hold."""
        return asdict(self)

    @classmethod
    def from_json(cls, entries: dict[str, Any]) -> "Provenance":
        """Rebuild what `to_json` returned.

        Raises
        ------
        InvalidInputError
            If an entry is missing or unknown.
        """
        expected = {item.name for item in fields(cls)}
        if set(entries) != expected:
            wrong = ", ".join(sorted(expected ^ set(entries)))
            raise InvalidInputError(f"the provenance has missing or unknown entries: {wrong}")
        return cls(**entries)


def package_versions() -> dict[str, str]:
    """Versions of Python and of the packages that results depend on."""
    return dict(_package_versions())


@cache
def _package_versions() -> tuple[tuple[str, str], ...]:
    """Look them up once in a process: they are asked for with every policy that is made."""
    versions = {"python": platform.python_version()}
    for package in RECORDED_PACKAGES:
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return tuple(versions.items())


def hash_sources(*others: Path) -> str:
    """Hash of the simulator's sources, and of others in the given order."""
    simulator = Path(kinarm.__file__).parent
    sources = (*sorted(simulator.glob("*.py")), *sorted(simulator.glob("kernels/*.py")), *others)
    content = hashlib.sha256()
    for source in sources:
        content.update(source.read_bytes())
    return content.hexdigest()


@cache
def source_commit() -> str:
    """Commit of the clone that this runs from, or an empty string outside of a clone."""
    root = Path(__file__).resolve().parent.parent
    command = ["git", "-C", str(root), "describe", "--always", "--dirty", "--abbrev=12"]
    if not (root / ".git").exists():
        return ""
    try:
        answer = subprocess.run(command, capture_output=True, text=True, timeout=10, check=True)
    except (OSError, subprocess.SubprocessError):
        return ""
    return answer.stdout.strip()

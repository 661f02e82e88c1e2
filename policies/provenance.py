"""Where a policy comes from."""

import platform
import subprocess
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from kinarm import SEMANTICS
from kinarm._fields import to_plain
from kinarm.policies.config import TrainingConfig
from kinarm.problem import ReachProblem

RECORDED_PACKAGES = (
    *("kinarm", "numpy", "numba", "pin", "coal", "gymnasium", "scipy"),
    *("torch", "stable-baselines3", "sb3-contrib"),
)


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """How a policy was made; stored with it as JSON.

    Parameters
    ----------
    algorithm, recipe : str
        Such as ``"ars"``, and the name of its settings.
    problem : ReachProblem
        Its problem, with the hash of the arm.
    seed : int, optional
        Seed of the training, if any.
    environment_steps : int
        Steps that the training took.
    config : dict
        Settings of the learner, without the problem.
    versions : dict
        Versions of the packages that matter.
    commit : str
        Commit of kinarm's source, with ``-dirty`` if changed; empty if unknown.
    semantics : str, optional
        Version of what kinarm computes (`kinarm.SEMANTICS`) in its training;
        unknown in older files and for policies trained elsewhere.
    """

    algorithm: str
    recipe: str
    problem: ReachProblem
    seed: int | None = None
    environment_steps: int
    config: dict[str, Any] = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=dict)
    commit: str = ""
    semantics: str | None = None

    @classmethod
    def of(cls, algorithm: str, config: TrainingConfig, environment_steps: int) -> "Provenance":
        """Record a training here and now.

        Parameters
        ----------
        algorithm, config, environment_steps
            Name of the learner, its settings, and steps taken.
        """
        settings = to_plain(config)
        del settings["problem"]
        return cls(
            algorithm=algorithm,
            recipe=config.recipe,
            problem=config.problem.pinned,
            seed=config.seed,
            environment_steps=environment_steps,
            config=settings,
            versions=package_versions(),
            commit=source_commit(),
            semantics=SEMANTICS,
        )


def normalization_remark(config: Mapping[str, Any]) -> str:
    """Which statistics normalise what a converted model sees; empty for other policies."""
    statistics = config.get("vec_normalize")
    if statistics is None:
        return ""
    if statistics == "none":
        return "observations not normalised, without VecNormalize"
    return f"observations normalised by {statistics}"


@cache
def package_versions() -> dict[str, str]:
    """Versions of Python and of packages that results depend on."""
    versions = {"python": platform.python_version()}
    for package in RECORDED_PACKAGES:
        with suppress(metadata.PackageNotFoundError):
            versions[package] = metadata.version(package)
    return versions


@cache
def source_commit() -> str:
    """Commit of the clone that this runs from, or an empty string."""
    root = Path(__file__).resolve().parent.parent
    command = ["git", "-C", str(root), "describe", "--always", "--dirty", "--abbrev=12"]
    with suppress(OSError, subprocess.SubprocessError):
        if (root / ".git").exists():
            done = subprocess.run(command, capture_output=True, text=True, timeout=10, check=True)
            return done.stdout.strip()
    return ""

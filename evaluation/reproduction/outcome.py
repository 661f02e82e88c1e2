"""What a training came to, and the files in which it is kept."""

import hashlib
import json
from dataclasses import asdict, dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinarm.errors import PolicyFileError
from kinarm.evaluation import trials
from kinarm.evaluation.reproduction.study import Protocol, Training
from kinarm.files import CORRUPT, write_atomically, write_text
from kinarm.policies import oracle
from kinarm.policies.policy import Policy
from kinarm.policies.provenance import hash_sources, package_versions

FORMAT = "kinarm-outcome-1"
PPO_PACKAGES = ("torch", "stable-baselines3")


@dataclass(frozen=True, kw_only=True, eq=False)
class Outcome:
    """What a training came to; all distances are in metres.

    Attributes
    ----------
    returns : ndarray, shape (n_iterations,)
        Mean returns of the episodes of an iteration; NaN where none ended.
    environment_steps : ndarray of int, shape (n_iterations,)
        Steps taken since the training began.
    wall_time : ndarray, shape (n_iterations,)
        Time spent in the training since it began [s].
    snapshots : ndarray of int, shape (n_snapshots,)
        Iterations (from 0) after which the policy was judged.
    snapshot_distance : ndarray of float32, shape (n_snapshots, n_snapshot_trials)
        Its final distances then.
    distance : ndarray, shape (n_trials,)
        Final distances of the trained policy.
    collision : ndarray of bool, shape (n_trials,)
        Trials that ended in contact.
    steps : ndarray of int, shape (n_trials,)
        Steps that the trials took.
    """

    returns: NDArray[np.float64]
    environment_steps: NDArray[np.int64]
    wall_time: NDArray[np.float64]
    snapshots: NDArray[np.int64]
    snapshot_distance: NDArray[np.float32]
    distance: NDArray[np.float64]
    collision: NDArray[np.bool_]
    steps: NDArray[np.int64]

    @property
    def snapshot_steps(self) -> NDArray[np.int64]:
        """Environment steps at the snapshots, shape (n_snapshots,)."""
        return self.environment_steps[self.snapshots]


class OutcomeStore:
    """The folder in which the outcomes of a study lie.

    An outcome consists of the policy, its wall times and ``runs/NAME.npz``, written in this order:
    where the last is complete and fits the others, the training is finished. Wall times are kept
    apart, so that all other files depend on the settings alone.

    Parameters
    ----------
    folder : Path
        The output folder of the reproduction.
    protocol : Protocol
        How policies are judged.
    """

    def __init__(self, folder: Path, protocol: Protocol) -> None:
        self.folder = folder
        self.protocol = protocol

    def policy_path(self, training: Training) -> Path:
        """Where the trained policy lies."""
        return self.folder / "policies" / f"{training.name}.npz"

    def _run_path(self, training: Training) -> Path:
        return self.folder / "runs" / f"{training.name}.npz"

    def _timing_path(self, training: Training) -> Path:
        return self.folder / "timing" / f"{training.name}.json"

    def save(self, training: Training, policy: Policy, outcome: Outcome) -> None:
        """Write a finished training.

        Raises
        ------
        OutputError
            If a file cannot be written.
        """
        paths = (self.policy_path, self._timing_path, self._run_path)
        for path in paths:
            path(training).parent.mkdir(parents=True, exist_ok=True)
        policy.save(self.policy_path(training))
        arrays = {**vars(outcome)}
        wall_time = arrays.pop("wall_time").round(4).tolist()
        write_text(self._timing_path(training), json.dumps(wall_time))
        arrays["identity"] = np.array(self._identity(training))
        arrays["policy_digest"] = np.array(_digest(self.policy_path(training)))
        write_atomically(self._run_path(training), partial(np.savez_compressed, **arrays))

    def load(self, training: Training) -> Outcome | None:
        """Read a finished training; None if it is not finished, incomplete or of other settings."""
        try:
            wall_time = np.array(json.loads(self._timing_path(training).read_text()), dtype=float)
            with (
                self._run_path(training).open("rb") as opened,
                np.load(opened, allow_pickle=False) as file,
            ):
                arrays: dict[str, Any] = dict(file)
            known = str(arrays.pop("identity")) == self._identity(training)
            intact = str(arrays.pop("policy_digest")) == _digest(self.policy_path(training))
            outcome = Outcome(**arrays, wall_time=wall_time)
        except (OSError, *CORRUPT):
            return None
        complete = len(outcome.wall_time) == len(outcome.returns)
        return outcome if known and intact and complete else None

    def _identity(self, training: Training) -> str:
        """Everything that an outcome depends on, as JSON."""
        versions = package_versions()
        if training.purpose != "ppo":
            versions = {name: v for name, v in versions.items() if name not in PPO_PACKAGES}
        entries = {
            "format": FORMAT,
            **training.to_json(),
            "protocol": asdict(self.protocol),
            "versions": versions,
            "sources": sources_digest(),
        }
        return json.dumps(entries, sort_keys=True)

    def commits(self, trainings: tuple[Training, ...]) -> tuple[str, ...]:
        """Commits at which finished trainings were made."""
        made = set()
        for training in trainings:
            try:
                made.add(Policy.load(self.policy_path(training)).provenance.commit)
            except PolicyFileError:
                continue
        return tuple(sorted(made - {""}))


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@cache
def sources_digest() -> str:
    """Hash of the sources of simulator, learners and trials."""
    policies = Path(oracle.__file__).parent.glob("*.py")
    return hash_sources(*sorted(policies), Path(trials.__file__))[:16]

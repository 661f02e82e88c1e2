"""What a training came to, and the files in which it is kept."""

import hashlib
import json
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinarm import SEMANTICS
from kinarm._archive import load_archive, load_json, reading, save_archive
from kinarm._files import check_folder, write_text
from kinarm.errors import KinarmError, PolicyFileError
from kinarm.evaluation.reproduction.study import PlannedTraining, Protocol
from kinarm.policies.policy import Policy
from kinarm.policies.provenance import package_versions

ARCHIVE = ("trained run", 1)
"""Kind and version of the files."""

PPO_PACKAGES = ("torch", "stable-baselines3")


@dataclass(frozen=True, kw_only=True, eq=False)
class TrainedRun:
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

    def steps_to_level(self, distance: float, share: float) -> float:
        """Environment steps at the first snapshot with a share of trials within a distance [m].

        Infinity if there is no such snapshot.
        """
        reached = (self.snapshot_distance <= distance).mean(axis=1) >= share
        return float(self.snapshot_steps[reached.argmax()]) if reached.any() else float("inf")

    def distance_after(self, environment_steps: float) -> NDArray[np.float32]:
        """Final distances at the last snapshot within a number of steps, or at the first [m]."""
        within = int(np.count_nonzero(self.snapshot_steps <= environment_steps))
        last: NDArray[np.float32] = self.snapshot_distance[max(within - 1, 0)]
        return last


@dataclass(frozen=True)
class RunStore:
    """The output folder of a reproduction, in which the trained runs of a study lie.

    A run consists of the policy, its wall times and ``runs/NAME.npz``, written in this order:
    where the last is complete and fits the others, the training is finished. Wall times are kept
    apart, so that all other files depend on the settings alone.
    """

    folder: Path
    protocol: Protocol

    def policy_path(self, training: PlannedTraining) -> Path:
        """Where the trained policy lies."""
        return self.folder / "policies" / f"{training.name}.npz"

    def _paths(self, training: PlannedTraining) -> tuple[Path, Path]:
        """Where wall times and run lie."""
        name = training.name
        return self.folder / "timing" / f"{name}.json", self.folder / "runs" / f"{name}.npz"

    def save(self, training: PlannedTraining, policy: Policy, run: TrainedRun) -> None:
        """Write a finished training.

        Raises
        ------
        OutputError
            If a file cannot be written.
        """
        timing_path, run_path = self._paths(training)
        for path in (self.policy_path(training), timing_path, run_path):
            check_folder(path.parent)
        policy.save(self.policy_path(training))
        arrays = dict(vars(run))
        write_text(timing_path, json.dumps(arrays.pop("wall_time").round(4).tolist()))
        save_archive(run_path, *ARCHIVE, arrays, self._header(training), compress=True)

    def load(self, training: PlannedTraining) -> TrainedRun | None:
        """Read a finished training; None if it is not finished, incomplete or of other settings."""
        timing_path, run_path = self._paths(training)
        with suppress(KinarmError), reading(repr(str(run_path)), ARCHIVE[0], KinarmError):
            wall_time = np.array(load_json(timing_path, "timing", KinarmError), dtype=float)
            header, arrays = load_archive(run_path, *ARCHIVE, KinarmError)
            run = TrainedRun(**arrays, wall_time=wall_time)
            if header == self._header(training) and len(run.wall_time) == len(run.returns):
                return run
        return None

    def _header(self, training: PlannedTraining) -> dict[str, Any]:
        """Everything that a run depends on, and the hash of its policy."""
        versions = package_versions()
        if training.purpose != "ppo":
            versions = {name: v for name, v in versions.items() if name not in PPO_PACKAGES}
        policy = self.policy_path(training).read_bytes()
        return {
            "semantics": SEMANTICS,
            "training": training.to_json(),
            "protocol": asdict(self.protocol),
            "versions": versions,
            "policy": hashlib.sha256(policy).hexdigest(),
        }

    def commits(self, trainings: Iterable[PlannedTraining]) -> tuple[str, ...]:
        """Commits at which finished trainings were made."""
        made = set()
        for training in trainings:
            try:
                made.add(Policy.load(self.policy_path(training)).provenance.commit)
            except PolicyFileError:
                continue
        return tuple(sorted(made - {""}))

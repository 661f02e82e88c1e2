"""Bounds of what any policy could do in a set of trials, kept in the user's cache folder."""

import hashlib
import os
import tempfile
from functools import cache, partial
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from kinarm.errors import OutputError
from kinarm.evaluation.statistics import Estimate
from kinarm.evaluation.trials import TrialSet
from kinarm.files import CORRUPT, check_folder, write_atomically
from kinarm.policies import oracle
from kinarm.policies.oracle import Oracle, Progress
from kinarm.policies.oracle_solution import OracleSolutions
from kinarm.policies.provenance import hash_sources, package_versions

CACHE_VARIABLE = "KINARM_CACHE"
"""Environment variable that names another cache folder."""

ORACLE_MODULES = ("detour", "inverse", "motion", "motion_search", "oracle", "oracle_solution")
"""What the oracle consists of, beside the simulator."""

_known: WeakKeyDictionary[TrialSet, OracleSolutions] = WeakKeyDictionary()


def oracle_bounds(trials: TrialSet, on_progress: Progress | None = None) -> OracleSolutions:
    """Find what the oracle knows about a set of trials: look it up, or solve and keep it.

    Solutions are kept in the cache folder under a name made of the hash of the trials and of the
    oracle's version, for other processes, and in memory as long as the trials are. A file that
    cannot be read is replaced; where none can be written, nothing is kept.

    Parameters
    ----------
    trials : TrialSet
        The trials.
    on_progress : callable, optional
        Called with the number of trials solved so far and in all, unless they are known.
    """
    if trials not in _known:
        path = cache_folder() / f"oracle-{trials.digest}-{oracle_version()}.npz"
        solutions = _load(path, trials)
        if solutions is None:
            solver = Oracle(simulator=trials.simulator)
            solutions = solver.solve_batch(trials.starts, trials.goals, on_progress=on_progress)
            _save(path, solutions)
        _known[trials] = solutions
    return _known[trials]


def cache_folder() -> Path:
    """Folder for what can be computed anew: ``$KINARM_CACHE``, or kinarm in the user's cache."""
    chosen, users = os.environ.get(CACHE_VARIABLE), os.environ.get("XDG_CACHE_HOME")
    if chosen:
        return Path(chosen)
    try:
        return (Path(users) if users else Path.home() / ".cache") / "kinarm"
    except RuntimeError:  # a user without a home
        return Path(tempfile.gettempdir()) / "kinarm"


@cache
def oracle_version() -> str:
    """Hash of the sources and package versions that solutions depend on."""
    policies = Path(oracle.__file__).parent
    sources = hash_sources(*(policies / f"{name}.py" for name in ORACLE_MODULES))
    return hashlib.sha256(f"{package_versions()} {sources}".encode()).hexdigest()[:12]


def _load(path: Path, trials: TrialSet) -> OracleSolutions | None:
    """Read solutions; None if there are none or they cannot be used."""
    try:
        with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            solutions = OracleSolutions(**dict(file))
    except (OSError, *CORRUPT):
        return None
    task, n = trials.simulator.task, len(trials)
    expected = {
        "actions": (n, task.horizon, trials.simulator.n_actions),
        "paths": (n, task.horizon + 1, trials.simulator.arm.n_axes),
    }
    fits = (array.shape == expected.get(name, (n,)) for name, array in solutions.arrays().items())
    return solutions if all(fits) else None


def _save(path: Path, solutions: OracleSolutions) -> None:
    """Write solutions, if possible, in place of those of another version."""
    arrays: dict[str, Any] = solutions.arrays()
    try:
        check_folder(path.parent, create=True)
        write_atomically(path, partial(np.savez_compressed, **arrays))
    except OutputError:
        return
    trial_set = path.name.rpartition("-")[0]
    for other in set(path.parent.glob(f"{trial_set}-*.npz")) - {path}:
        other.unlink(missing_ok=True)


def bounds_document(solutions: OracleSolutions) -> dict[str, Any]:
    """What the oracle knows about a set of trials, as a dictionary that JSON can hold.

    Returns
    -------
    dict
        ``success``, ``unsolved`` (trials that no motion was found for, and why), ``steps`` and
        ``steps_lower_bound`` of all trials and their ``gap`` where one was found (mean, median,
        95th percentile and maximum), ``tight_share``, and ``trials`` with the bounds of every
        trial.
    """
    missed = np.flatnonzero(~solutions.reachable)
    gap = (solutions.steps - solutions.steps_lower_bound)[solutions.reachable]
    return {
        "success": Estimate.share(solutions.reachable).to_json(),
        "unsolved": [
            {"trial": int(trial), "reason": str(solutions.reasons[trial])} for trial in missed
        ],
        "steps": _summary(solutions.steps),
        "steps_lower_bound": _summary(solutions.steps_lower_bound),
        "gap": _summary(gap) if gap.size else None,
        "tight_share": float(solutions.tight.mean()),
        "trials": {
            "reachable": solutions.reachable.tolist(),
            "steps": solutions.steps.tolist(),
            "steps_lower_bound": solutions.steps_lower_bound.tolist(),
            "tight": solutions.tight.tolist(),
            "final_distance": solutions.final_distance.tolist(),
            "distance_lower_bound": solutions.distance_lower_bound.tolist(),
        },
    }


def _summary(steps: np.ndarray[Any, np.dtype[np.int64]]) -> dict[str, float]:
    return {
        "mean": float(steps.mean()),
        "median": float(np.median(steps)),
        "p95": float(np.percentile(steps, 95)),
        "max": float(steps.max()),
    }

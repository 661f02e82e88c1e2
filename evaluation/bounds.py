"""Bounds of what any policy could do in a set of trials, kept in the user's cache folder."""

import hashlib
import os
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from kinarm import SEMANTICS
from kinarm._archive import cache_folder, load_archive, save_archive
from kinarm._files import check_folder
from kinarm.errors import InvalidInputError, OutputError
from kinarm.evaluation.statistics import Estimate
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.oracle import ORACLE_SEMANTICS, Oracle, OracleSolutions, Progress
from kinarm.policies.provenance import package_versions

KEPT_FILES, KEPT_BYTES = 200, 256 * 2**20
"""Trial sets whose bounds are kept, and how large their files may be together."""

COMPUTING_PACKAGES = ("numpy", "numba", "pin", "coal")
"""Packages that the numbers of a solution come from."""

ARCHIVE = ("bounds", 1)
"""Kind and version of the files."""

TRIAL_BOUNDS = (
    *("reachable", "steps", "steps_lower_bound", "proof_complete"),
    *("final_distance", "distance_lower_bound"),
)
"""What documents hold of every trial."""

MOST_BOUNDED = 2000
"""Trials whose bounds are looked for beside policies that face more: the first ones."""

_bounded: WeakKeyDictionary[TrialSet, TrialSet] = WeakKeyDictionary()

_known: WeakKeyDictionary[TrialSet, OracleSolutions] = WeakKeyDictionary()


def oracle_bounds(trials: TrialSet, on_progress: Progress | None = None) -> OracleSolutions:
    """Find what the oracle knows about a set of trials: look it up, or solve and keep it.

    Solutions are kept in the cache folder under a name made of the hash of the trials and of the
    oracle's version, for other processes, and in memory as long as the trials are. A file that
    cannot be read is replaced; where none can be written, nothing is kept. Beyond ``KEPT_FILES``
    and ``KEPT_BYTES``, the files that were used least recently go.

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
            oracle = Oracle(trials.simulator.problem)
            solutions = oracle.solve_batch(trials.starts, trials.goals, on_progress=on_progress)
            _save(path, solutions)
        _known[trials] = solutions
    return _known[trials]


def bounded_trials(trials: TrialSet) -> TrialSet:
    """The first `MOST_BOUNDED` trials, or all if there are no more or all bounds are known.

    A proof takes a thousand times as long as a policy's trial, and the figures made of proofs need
    no more of them.
    """
    if len(trials) <= MOST_BOUNDED or trials in _known:
        return trials
    if trials not in _bounded:
        _bounded[trials] = trials.chosen(range(MOST_BOUNDED))
    return _bounded[trials]


def first_bounds(trials: TrialSet, on_progress: Progress | None = None) -> OracleSolutions:
    """What the oracle knows about the `bounded_trials`; parameters as of `oracle_bounds`."""
    return oracle_bounds(bounded_trials(trials), on_progress)


@cache
def oracle_version() -> str:
    """Hash of the versions of oracle, simulator and packages that solutions depend on."""
    packages = package_versions()
    versions = (ORACLE_SEMANTICS, SEMANTICS, *(packages[name] for name in COMPUTING_PACKAGES))
    return hashlib.sha256(" ".join(versions).encode()).hexdigest()[:12]


def _load(path: Path, trials: TrialSet) -> OracleSolutions | None:
    """Read solutions; None if there are none or they cannot be used."""
    try:
        solutions = OracleSolutions(**load_archive(path, *ARCHIVE, InvalidInputError).arrays)
    except (InvalidInputError, TypeError):
        return None
    simulator, n = trials.simulator, len(trials)
    expected = {
        "actions": (n, simulator.task.horizon, simulator.n_actions),
        "paths": (n, simulator.task.horizon + 1, simulator.arm.n_joints),
    }
    fits = (array.shape == expected.get(name, (n,)) for name, array in solutions.arrays().items())
    if not all(fits):
        return None
    with suppress(OSError):
        os.utime(path)
    return solutions


def _save(path: Path, solutions: OracleSolutions) -> None:
    """Write solutions, if possible, and make room for them."""
    with suppress(OutputError):
        check_folder(path.parent)
        save_archive(path, *ARCHIVE, solutions.arrays(), {}, compress=True)
        _delete_least_recently_used(path.parent)


def _delete_least_recently_used(folder: Path) -> None:
    """Delete surplus files, and tolerate other processes that change them meanwhile.

    What a process that was killed left half written counts, too.
    """
    used = []
    for path in (*folder.glob("oracle-*.npz"), *folder.glob(".oracle-*.npz.*")):
        with suppress(OSError):
            status = path.stat()
            used.append((status.st_mtime_ns, status.st_size, path))
    total = 0
    for rank, (_, size, path) in enumerate(sorted(used, reverse=True)):
        total += size
        if rank > 0 and (rank >= KEPT_FILES or total > KEPT_BYTES):
            with suppress(OSError):
                path.unlink()


def bounds_document(solutions: OracleSolutions) -> dict[str, Any]:
    """What the oracle knows about a set of trials, as a dictionary that JSON can hold.

    ``bounded`` is the number of trials. ``unsolved`` lists the trials without a motion, and why.
    ``gap`` is the difference of ``steps`` and ``steps_lower_bound`` in the other trials.
    ``proof_complete_share`` is the share of trials whose proof is complete.
    """
    missed = np.flatnonzero(~solutions.reachable)
    gap = (solutions.steps - solutions.steps_lower_bound)[solutions.reachable]
    return {
        "bounded": len(solutions),
        "success": Estimate.share(solutions.reachable).to_json(),
        "unsolved": [
            {"trial": int(trial), "reason": str(solutions.reasons[trial])} for trial in missed
        ],
        "steps": _summary(solutions.steps),
        "steps_lower_bound": _summary(solutions.steps_lower_bound),
        "gap": _summary(gap) if gap.size else None,
        "proof_complete_share": float(solutions.proof_complete.mean()),
        "trials": {name: getattr(solutions, name).tolist() for name in TRIAL_BOUNDS},
    }


def _summary(steps: np.ndarray[Any, np.dtype[np.int64]]) -> dict[str, float]:
    return {
        "mean": float(steps.mean()),
        "median": float(np.median(steps)),
        "p95": float(np.percentile(steps, 95)),
        "max": float(steps.max()),
    }

"""Bounds of what any policy could do, kept in the user's cache folder."""

from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from kinarm import SEMANTICS
from kinarm._files import Arrays, cached_arrays
from kinarm.evaluation.schemas import Count, Document, Share
from kinarm.evaluation.statistics import Estimate
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.oracle import ORACLE_SEMANTICS, Oracle, OracleSolutions, Progress
from kinarm.policies.provenance import package_versions

COMPUTING_PACKAGES = ("numpy", "numba", "pin", "coal")
"""Packages that solutions depend on."""

MOST_BOUNDED = 2000
"""Most trials that are bounded beside policies that face more, the first ones.

A proof takes a thousand times as long as a policy's trial.
"""

_known: WeakKeyDictionary[TrialSet, OracleSolutions] = WeakKeyDictionary()


def oracle_bounds(trials: TrialSet, on_progress: Progress | None = None) -> OracleSolutions:
    """Look up what the oracle knows about trials, or solve and keep it.

    Solutions are kept in the cache folder, under the hash of the trials and of
    the oracle's version, and in memory as long as the trials are.

    Parameters
    ----------
    trials : TrialSet
        The trials.
    on_progress : callable, optional
        Called with the number of trials solved so far and in all, unless they
        are known.
    """
    if trials not in _known:

        def solve() -> Arrays:
            oracle = Oracle(trials.simulator.problem)
            return vars(oracle.solve_batch(trials.starts, trials.goals, on_progress=on_progress))

        made_of = f"{trials.digest} {oracle_version()}".encode()
        found = cached_arrays("oracle", 1, made_of, solve, compress=True)
        _known[trials] = OracleSolutions(**found)
    return _known[trials]


def oracle_version() -> str:
    """The versions that solutions depend on."""
    packages = package_versions()
    return " ".join([ORACLE_SEMANTICS, SEMANTICS, *(packages[each] for each in COMPUTING_PACKAGES)])


class Unsolved(Document, frozen=True, kw_only=True):
    """A trial in which the oracle found no motion to the goal, and why."""

    trial: Count
    reason: str


class TrialBounds(Document, frozen=True, kw_only=True):
    """Bounds of each of the first trials.

    Parameters
    ----------
    steps, steps_lower_bound : list of int
        Steps of the motion that was found, and steps proven necessary.
    final_distance : list of float
        How far from the goal the motion ends [m].
    """

    reachable: list[bool]
    steps: list[Count]
    steps_lower_bound: list[Count]
    proof_complete: list[bool]
    final_distance: list[float]


class Bounds(Document, frozen=True, kw_only=True):
    """Bounds of what any policy could do in the trials of a problem.

    Parameters
    ----------
    bounded : int
        The first trials, which have bounds.
    success : Estimate
        Share of trials with a motion to the goal.
    steps, steps_lower_bound, gap : dict of float
        Mean, median, 95th percentile and maximum: of the motions, of the
        bounds, and of their difference in trials with a motion.
    """

    bounded: Count
    success: Estimate
    unsolved: list[Unsolved]
    steps: dict[str, float]
    steps_lower_bound: dict[str, float]
    gap: dict[str, float] | None
    proof_complete_share: Share
    trials: TrialBounds


def bounds_document(solutions: OracleSolutions) -> Bounds:
    """Bounds of a set of trials, for a document."""
    missed = np.flatnonzero(~solutions.reachable)
    gap = (solutions.steps - solutions.steps_lower_bound)[solutions.reachable]
    trials = {name: getattr(solutions, name).tolist() for name in TrialBounds.__struct_fields__}
    return Bounds(
        bounded=len(solutions),
        success=Estimate.share(solutions.reachable),
        unsolved=[
            Unsolved(trial=trial, reason=str(solutions.reasons[trial])) for trial in missed.tolist()
        ],
        steps=_summary(solutions.steps),
        steps_lower_bound=_summary(solutions.steps_lower_bound),
        gap=_summary(gap) if gap.size else None,
        proof_complete_share=float(solutions.proof_complete.mean()),
        trials=TrialBounds(**trials),
    )


def _summary(steps: NDArray[np.int64]) -> dict[str, float]:
    return {
        "mean": float(steps.mean()),
        "median": float(np.median(steps)),
        "p95": float(np.percentile(steps, 95)),
        "max": float(steps.max()),
    }

"""The document of an evaluation."""

import json
from pathlib import Path
from typing import Any, Literal

import msgspec

from kinarm._files import reading
from kinarm.episodes import Outcome
from kinarm.errors import InvalidInputError
from kinarm.evaluation.bounds import Bounds, bounds_document
from kinarm.evaluation.estimates import BOOTSTRAP_SEED, RESAMPLES
from kinarm.evaluation.outcomes import Cause, Pair
from kinarm.evaluation.schemas import Count, Digest, Document, Goal, Share
from kinarm.evaluation.statistics import LEVEL, Estimate
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.oracle import OracleSolutions
from kinarm.problem import ReachProblem


class Intervals(Document, frozen=True, kw_only=True):
    """How the 95 % intervals are made."""

    level: Share = LEVEL
    shares: str = "mid-P"
    means: str = "Student, the farthest trial once more"
    distances: str = "percentile bootstrap over trials"
    pooled: str = "Student, over training seeds and trials that all of them face"
    resamples: Count = RESAMPLES
    bootstrap_seed: Count = BOOTSTRAP_SEED


class FacedProblem(Document, frozen=True, kw_only=True):
    """A problem, its trials, and what any policy could do there.

    Parameters
    ----------
    arm : str
        Name of the arm.
    problem : dict
        The problem, in the words of problem files.
    digest, trial_set_hash : str
        Hashes of the problem, and of its trials.
    starts : list
        Joint positions, (trials, n_joints) [rad or m].
    goals : list
        Positions, (trials, 3) [m].
    oracle : Bounds, optional
        What the oracle found, if asked.
    """

    arm: str
    problem: dict[str, Any]
    digest: Digest
    trial_set_hash: Digest
    starts: list[list[float]]
    goals: list[Goal]
    oracle: Bounds | None

    @property
    def changes(self) -> list[str]:
        """Settings other than those of the shipped problem of that name."""
        return ReachProblem.from_json(self.problem).changes

    @classmethod
    def of(cls, trials: TrialSet, bounds: OracleSolutions | None) -> "FacedProblem":
        """What was faced, with the bounds of the first trials, if known."""
        return cls(
            arm=trials.simulator.arm.name,
            problem=trials.problem.pinned.to_json(),
            digest=trials.problem.digest,
            trial_set_hash=trials.digest,
            starts=trials.starts.tolist(),
            goals=trials.goals.tolist(),
            oracle=bounds_document(bounds) if bounds is not None else None,
        )


class Protocol(Document, frozen=True, kw_only=True):
    """Who faced what, and how it was measured.

    Parameters
    ----------
    hold : bool
        Whether trials also ran without an end at success.
    versions : dict of str
        Versions of Python and libraries that results may depend on.
    commit : str, optional
        Commit of kinarm, -dirty behind it if files were changed; null without
        Git.
    """

    format_version: Literal[5] = 5
    command: str
    trials: Count
    seed: Count
    hold: bool
    intervals: Intervals
    problems: dict[str, FacedProblem]
    versions: dict[str, str]
    commit: str | None


class Failures(Cause, frozen=True, kw_only=True):
    """Trials that failed for one cause."""

    trials: Count
    share_of_failures: Share


class TrialEnds(Document, frozen=True, kw_only=True):
    """How each trial ended, in order; distances in [m], and bodies that touched."""

    final_distance: list[float]
    steps: list[Count]
    outcome: list[Outcome]
    contact: list[Pair | None]


class TrialHolding(Document, frozen=True, kw_only=True):
    """Course of each trial where success did not end it.

    Parameters
    ----------
    closest, farthest_at_end : list of float
        Smallest distance from the goal, and the largest one in the last steps,
        null where contact ended the trial [m].
    """

    closest: list[float]
    farthest_at_end: list[float | None]
    contact: list[bool]
    steps: list[Count]


class Row(Document, frozen=True, kw_only=True):
    """A row of the table.

    Parameters
    ----------
    trained_on : str, optional
        Name of the problem that the policy was trained for.
    metrics : dict of Estimate
        Figures of merit by their names in kinarm.evaluation.METRICS.
    failures : list of Failures
        Why trials failed, the most frequent cause first.
    """

    policy: str
    algorithm: str
    recipe: str
    problem: str
    trained_on: str | None
    trials: Count
    metrics: dict[str, Estimate]
    failures: list[Failures]


class Result(Row, frozen=True, kw_only=True):
    """One policy on one problem.

    Parameters
    ----------
    note : str
        A remark, such as the statistics in use.
    held : TrialHolding
        What happened without an end at success, if asked for.
    """

    training_seed: int | None
    note: str
    outcomes: TrialEnds
    held: TrialHolding | msgspec.UnsetType = msgspec.UNSET


class Spread(Document, frozen=True, kw_only=True):
    """A figure over training seeds: extremes, standard deviation and values."""

    min: float
    max: float
    std: float
    each: list[float]


class WorstSeed(Document, frozen=True, kw_only=True):
    """The training seed with the lowest success."""

    policy: str
    training_seed: int | None
    success: Estimate


class PooledResult(Row, frozen=True, kw_only=True):
    """Several training seeds of a recipe on one problem.

    Parameters
    ----------
    members : list of str
        Names of the policies, one a seed.
    spread : dict of Spread
        Figures over the seeds, where all have them.
    """

    members: list[str]
    training_seeds: list[int | None]
    spread: dict[str, Spread]
    worst_seed: WorstSeed


class Difference(Document, frozen=True, kw_only=True):
    """What a row of the table has less another row, in the same trials.

    Parameters
    ----------
    policy, reference : str
        The names of both in the table.
    metrics : dict of Estimate
        Differences of the figures of merit.
    """

    policy: str
    reference: str
    problem: str
    metrics: dict[str, Estimate]


class EvaluationDocument(Document, frozen=True, kw_only=True):
    """An evaluation: evaluation.json of kinarm-eval --out, and what kinarm-eval --json prints.

    Parameters
    ----------
    pooled : list of PooledResult
        Training seeds of a recipe together.
    differences : list of Difference
        What rows have less the reference of their problem, if there is one.
    """

    protocol: Protocol
    results: list[Result]
    pooled: list[PooledResult]
    differences: list[Difference]

    def __repr__(self) -> str:
        return f"EvaluationDocument({len(self.results)} results)"

    @classmethod
    def load(cls, path: str | Path) -> "EvaluationDocument":
        """Read a document; a damaged one or one of another version is refused."""
        with reading(repr(str(path)), "evaluation", InvalidInputError):
            return msgspec.convert(json.loads(Path(path).read_bytes()), cls)

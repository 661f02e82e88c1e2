"""Trials, and bounds of them to compare."""

from kinarm.evaluation.trials import TrialSet
from kinarm.policies.oracle import OracleSolutions
from kinarm.problem import PROBLEMS


def draw(problem="right", trials=3, seed=5, **overrides) -> TrialSet:
    return TrialSet.draw(PROBLEMS[problem].replace(**overrides), trials, seed)


def same(one: OracleSolutions, other: OracleSolutions) -> bool:
    """Whether every array is equal, in kind and content."""
    pairs = zip(vars(one).values(), vars(other).values(), strict=True)
    return all(a.dtype == b.dtype and a.tobytes() == b.tobytes() for a, b in pairs)

"""What was checked, how often, and what did not hold."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

EXAMPLES = 5
"""Failures of each kind that are described."""


@dataclass
class Tally:
    """Counts of one part of the evidence.

    Attributes
    ----------
    counts : dict of int
        Sizes, such as how many steps were taken, by their name.
    checked, failed : dict of int
        How often each claim was checked, and how often it did not hold.
    examples : list of dict
        Some failures, with what it takes to repeat them.
    measures : dict of float
        Largest values seen, by their name.
    """

    counts: dict[str, int] = field(default_factory=dict)
    checked: dict[str, int] = field(default_factory=dict)
    failed: dict[str, int] = field(default_factory=dict)
    examples: list[dict[str, Any]] = field(default_factory=list)
    measures: dict[str, float] = field(default_factory=dict)

    def count(self, what: str, number: int) -> None:
        """Add to a size."""
        self.counts[what] = self.counts.get(what, 0) + int(number)

    def largest(self, what: str, value: float) -> None:
        """Keep the largest value."""
        self.measures[what] = max(self.measures.get(what, 0.0), float(value))

    def check(
        self,
        claim: str,
        holds: ArrayLike,
        describe: Callable[[int], dict[str, Any]] = lambda _: {},
    ) -> None:
        """Note for which of many cases a claim holds.

        Parameters
        ----------
        claim : str
            What is claimed.
        holds : array_like of bool
            Whether it does.
        describe : callable
            From the number of a case to what JSON can hold of it.
        """
        verdicts = np.atleast_1d(holds)
        wrong = np.flatnonzero(~verdicts)
        self.checked[claim] = self.checked.get(claim, 0) + verdicts.size
        before = self.failed.get(claim, 0)
        self.failed[claim] = before + wrong.size
        for index in wrong[: max(EXAMPLES - before, 0)].tolist():
            self.examples.append({"claim": claim, "case": index, **describe(index)})

    @property
    def failures(self) -> int:
        """How many claims did not hold, in all."""
        return sum(self.failed.values())

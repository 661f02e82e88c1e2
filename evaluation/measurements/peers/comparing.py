"""What a comparison with a peer is, and how both are timed by turns."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from kinarm.evaluation.measurements.timing import Timing, alternated


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Rates of a peer and of kinarm at the same thing.

    Parameters
    ----------
    what : str
        What was done.
    unit : str
        What the rates count.
    theirs, ours : Timing
        The rates [1/s].
    terms : str
        What is alike, and what either does beyond the other.
    """

    what: str
    unit: str
    theirs: Timing
    ours: Timing
    terms: str

    def to_json(self) -> dict[str, Any]:
        """As a dictionary that JSON can hold; ``ratio`` is that of the medians."""
        return {
            "what": self.what,
            "unit": self.unit,
            "theirs": self.theirs._asdict(),
            "ours": self.ours._asdict(),
            "ratio": self.ours.median / self.theirs.median,
            "terms": self.terms,
        }


def compared(
    theirs: Callable[[], int], ours: Callable[[], int], repetitions: int, **about: str
) -> Comparison:
    """Time both by turns; each returns how many of the unit it did."""
    rates = alternated({"theirs": theirs, "ours": ours}, repetitions)
    return Comparison(theirs=rates["theirs"], ours=rates["ours"], **about)

"""Which parts of the observation a problem shows; the parts are in `kinarm.observation`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, cast

from kinarm._fields import OPTIONAL, Checked, init_fields
from kinarm.errors import ProblemError, check_known
from kinarm.goals import GOAL_RESTS, REST_ERRORS, REST_PARTS

PAPER_PARTS = ("goal", "goal_minus_tool", "orientation", "position")
"""The paper's observation (section 3.2)."""

CERTAIN = (*PAPER_PARTS, *GOAL_RESTS, *REST_ERRORS, "resolved_rate")
"""Parts that recipes name: to know these, no table is loaded, and no Numba."""

LONGEST_HISTORY, MOST_SLOTS = 32, 32


@dataclass(frozen=True, kw_only=True)
class Observation(Checked):
    """What a policy sees.

    Parameters
    ----------
    parts : tuple of str, optional
        Names of the parts in their order; by default those of the paper, and of
        goals with a direction, a rotation or joints these and their error.
    obstacle_slots : int
        Bodies that the part ``obstacles`` shows, the nearest first, from 1 to
        32.
    history : int
        Steps whose observations are shown, the last one first, from 1 to 32.
        Those before the start are like the first.
    """

    parts: tuple[str, ...] | None = None
    obstacle_slots: int = field(default=4, metadata={**OPTIONAL, "at_most": MOST_SLOTS})
    history: int = field(default=1, metadata={**OPTIONAL, "at_most": LONGEST_HISTORY})

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.parts is None:
            return
        available: Sequence[str] = CERTAIN
        if not self.parts or not {*CERTAIN}.issuperset(self.parts):
            from kinarm.observation import OBSERVATION  # loads Numba

            available = [part.name for part in OBSERVATION]
        if not self.parts:
            raise ProblemError(f"an observation needs parts; available: {', '.join(available)}")
        check_known("part of the observation", self.parts, available)
        for name in self.parts:
            if self.parts.count(name) > 1:
                raise ProblemError(f"the observation has the part {name!r} twice")

    def changed(self, change: Any) -> "Observation":
        """Another one, or with other parts, in a list, or other fields, in a mapping."""
        if isinstance(change, list | tuple):
            change = {"parts": change}
        if not isinstance(change, Mapping):
            return cast("Observation", change)
        check_known("field of an observation", change, init_fields(Observation))
        return replace(self, **change)

    def names(self, kind: str) -> tuple[str, ...]:
        """Names of the parts for a kind of goals."""
        given = (*PAPER_PARTS, *REST_PARTS.get(kind, ())) if self.parts is None else self.parts
        for name in given:
            if name in (*GOAL_RESTS, *REST_ERRORS) and name not in REST_PARTS.get(kind, ()):
                raise ProblemError(f"the observation cannot have {name!r}: a goal is a {kind}")
        return given

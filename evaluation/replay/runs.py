"""What one policy did in trials: faced now, or recorded before."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

from kinarm.evaluation.contestants import Contestant
from kinarm.evaluation.failures import Cause, failure_causes
from kinarm.evaluation.outcomes import is_early
from kinarm.evaluation.replay.recorder import recordings_of
from kinarm.evaluation.trials import TrialSet
from kinarm.recording import Recording, outcome_of
from kinarm.rollouts import Rollouts

End = tuple[str, int, float]
"""How a trial ended: outcome, steps and final distance [m]."""


class Run(Protocol):
    """What one policy did in trials, to choose from by their positions."""

    @property
    def numbers(self) -> Sequence[int]:
        """Numbers of the trials."""

    @property
    def ends(self) -> Sequence[End]:
        """How they ended."""

    @property
    def causes(self) -> dict[int, Cause]:
        """Why trials failed, by the positions of those that did."""

    def recorded(self, positions: Sequence[int]) -> list[Recording]:
        """Recordings of some of them."""


@dataclass(frozen=True, eq=False)
class FacedRun:
    """Trials that run now; the chosen ones become recordings."""

    contestant: Contestant
    trials: TrialSet
    rollouts: Rollouts

    @classmethod
    def of(cls, contestant: Contestant, trials: TrialSet, *, allow_other_arm: bool) -> "FacedRun":
        """Let an contestant face trials.

        Raises
        ------
        PolicyFileError
            If it was trained for another arm and that is not allowed.
        """
        contestant.check(trials.simulator.arm, allow_other_arm=allow_other_arm)
        return cls(contestant, trials, contestant.run(trials, record=True))

    @property
    def numbers(self) -> Sequence[int]:
        """Numbers of the trials."""
        return range(len(self.rollouts))

    @cached_property
    def ends(self) -> Sequence[End]:
        """How they ended."""
        outcomes = [outcome_of(self.rollouts, number) for number in self.numbers]
        columns = (self.rollouts.steps.tolist(), self.rollouts.distance.tolist())
        return list(zip(outcomes, *columns, strict=True))

    @cached_property
    def causes(self) -> dict[int, Cause]:
        """Why trials failed, by the positions of those that did."""
        contacts = self.trials.simulator.contact_pairs(self.rollouts)
        return failure_causes(self.rollouts, contacts)

    def recorded(self, positions: Sequence[int]) -> list[Recording]:
        """Recordings of some of them."""
        return recordings_of(self.contestant, self.trials, self.rollouts, positions)


@dataclass(frozen=True, eq=False)
class RecordedRun:
    """Recordings of a file."""

    recordings: Sequence[Recording]

    @property
    def numbers(self) -> Sequence[int]:
        """Numbers of the trials."""
        return [recording.trial for recording in self.recordings]

    @property
    def ends(self) -> Sequence[End]:
        """How they ended."""
        return [(each.outcome, each.steps, each.final_distance) for each in self.recordings]

    @property
    def causes(self) -> dict[int, Cause]:
        """Why trials failed, by the positions of those that did."""
        return {
            position: Cause(each.contact, is_early(each.outcome == "collision", each.steps))
            for position, each in enumerate(self.recordings)
            if each.outcome != "success"
        }

    def recorded(self, positions: Sequence[int]) -> list[Recording]:
        """Recordings of some of them."""
        return [self.recordings[position] for position in positions]

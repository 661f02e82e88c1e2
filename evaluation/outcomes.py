"""How trials ended in the hands of one or several training seeds, and why they failed."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from kinarm.errors import InvalidInputError
from kinarm.rollouts import Rollouts

if TYPE_CHECKING:
    from kinarm.evaluation.holding import Holding

EARLY_STEPS = 3
"""Contact within so many steps is early: the arm started close to what it touches."""

HOLDING_STEPS = 10
"""Last steps of a trial over which the goal is to be held."""


Pair = tuple[str, str]
"""Names of two bodies that touch."""

Outcome = Literal["success", "collision", "truncated"]

End = tuple[Outcome, int, float]
"""How a trial ended: outcome, steps and final distance [m]."""


class Ends(Protocol):
    """The part of finished episodes that figures of merit need; see `kinarm.Rollouts`."""

    @property
    def distance(self) -> NDArray[np.float64]:
        """Final distances [m]."""

    @property
    def steps(self) -> NDArray[np.int64]:
        """Steps taken."""

    @property
    def returns(self) -> NDArray[np.float64]:
        """Sums of rewards."""

    @property
    def success(self) -> NDArray[np.bool_]:
        """Whether the goal was reached."""

    @property
    def collision(self) -> NDArray[np.bool_]:
        """Whether something touched."""

    def __len__(self) -> int: ...


class Bounded(Protocol):
    """The part of the oracle's solutions that figures of merit need."""

    @property
    def reachable(self) -> NDArray[np.bool_]:
        """Whether a motion to the goal was found."""

    @property
    def steps_lower_bound(self) -> NDArray[np.int64]:
        """Steps that are necessary."""


@dataclass(frozen=True, eq=False)
class Outcomes:
    """Outcomes of one or several training seeds in the same trials.

    Their arrays are joined along the last axis, shape (..., n_seeds * n_trials).

    Attributes
    ----------
    rollouts : tuple of Rollouts
        One per training seed.
    bounds : OracleSolutions or None
        What any policy could do in the trials, or in the first ones, if that is known.
    holding : tuple of Holding
        What they did where success did not end the trials, if that is known.
    time_step : float
        Duration of a step [s].
    numbers : ndarray of int, shape (..., n_trials), optional
        Resampled trials; by default each of them once.
    origin : Outcomes, optional
        What was resampled.
    """

    rollouts: tuple[Ends, ...]
    bounds: Bounded | None = None
    holding: "tuple[Holding, ...]" = ()
    time_step: float = float("nan")
    numbers: NDArray[np.int64] | None = None
    origin: "Outcomes | None" = None

    def resampled(self, numbers: NDArray[np.int64]) -> "Outcomes":
        """The same of resampled trials, by their numbers, shape (..., n_trials)."""
        return replace(self, numbers=numbers, origin=self)

    def of_seed(self, seed: int) -> "Outcomes":
        """Outcomes of one of the training seeds."""
        one = slice(seed, seed + 1)
        return replace(self, rollouts=self.rollouts[one], holding=self.holding[one])

    def _joined(self, columns: Iterable[NDArray[Any]]) -> NDArray[Any]:
        chosen = [column if self.numbers is None else column[self.numbers] for column in columns]
        return np.concatenate(chosen, axis=-1)

    @cached_property
    def distance(self) -> NDArray[np.float64]:
        """Final distances [m]."""
        return self._joined(rollouts.distance for rollouts in self.rollouts)

    @cached_property
    def ordered_distance(self) -> NDArray[np.float64]:
        """Final distances along the last axis, the smallest first [m]."""
        return self._ordered("distance")

    @cached_property
    def ordered_closest(self) -> NDArray[np.float64]:
        """Closest approaches along the last axis, the smallest first [m]."""
        return self._ordered("closest")

    def _ordered(self, name: str) -> NDArray[np.float64]:
        if self.origin is None or self.numbers is None:
            return np.sort(getattr(self, name), axis=-1)
        order, ordered = self.origin.order_of(name)
        return _resampled_in_order(ordered, order, self.numbers)

    def order_of(self, name: str) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Positions of the values of an array, the smallest first, and these values."""
        if name not in self._orders:
            values = getattr(self, name)
            order = np.argsort(values, axis=-1)
            self._orders[name] = order, values[order]
        return self._orders[name]

    @cached_property
    def _orders(self) -> dict[str, tuple[NDArray[np.int64], NDArray[np.float64]]]:
        return {}

    @cached_property
    def closest(self) -> NDArray[np.float64]:
        """Closest approaches where success did not end the trials [m]."""
        return self._joined(each.closest for each in self.holding)

    @cached_property
    def farthest_at_end(self) -> NDArray[np.float64]:
        """Largest distances in the last steps of those trials [m]."""
        return self._joined(each.farthest_at_end for each in self.holding)

    @cached_property
    def holding_collision(self) -> NDArray[np.bool_]:
        """Whether those trials ended in contact."""
        return self._joined(each.collision for each in self.holding)

    @cached_property
    def steps(self) -> NDArray[np.int64]:
        """Steps taken."""
        return self._joined(rollouts.steps for rollouts in self.rollouts)

    @cached_property
    def steps_to_success(self) -> NDArray[np.int64]:
        """Steps taken in the trials that succeeded, one axis."""
        return self.steps[self.success]

    @cached_property
    def returns(self) -> NDArray[np.float64]:
        """Sums of rewards."""
        return self._joined(rollouts.returns for rollouts in self.rollouts)

    @cached_property
    def success(self) -> NDArray[np.bool_]:
        """Whether a trial ended within the tolerance, without contact."""
        return self._joined(rollouts.success for rollouts in self.rollouts)

    @cached_property
    def collision(self) -> NDArray[np.bool_]:
        """Whether a trial ended in contact."""
        return self._joined(rollouts.collision for rollouts in self.rollouts)

    @property
    def early_collision(self) -> NDArray[np.bool_]:
        """Whether it did within the first three steps."""
        return self.collision & (self.steps <= EARLY_STEPS)

    @property
    def truncated(self) -> NDArray[np.bool_]:
        """Whether a trial ran out of steps."""
        return ~(self.success | self.collision)

    @property
    def relative_success(self) -> float | None:
        """Success divided by the oracle's, in the trials that the oracle was asked about."""
        reachable = self._known_bounds.reachable
        succeeded = [rollouts.success[: len(reachable)] for rollouts in self.rollouts]
        return float(np.mean(succeeded) / reachable.mean()) if reachable.any() else None

    @cached_property
    def step_ratio(self) -> NDArray[np.float64]:
        """Steps over those proven necessary, of trials that succeeded and are bounded, one axis."""
        necessary = self._known_bounds.steps_lower_bound
        bounded = slice(len(necessary))
        ratios = [
            (rollouts.steps[bounded] / necessary)[rollouts.success[bounded]]
            for rollouts in self.rollouts
        ]
        return np.concatenate(ratios)

    @property
    def _known_bounds(self) -> Bounded:
        if self.bounds is None:
            raise InvalidInputError("there are no bounds: the evaluation was made without them")
        return self.bounds


def _resampled_in_order(
    ordered: NDArray[np.float64], order: NDArray[np.int64], numbers: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Values of resampled trials in order, from values in order: counted, not sorted again.

    Parameters
    ----------
    ordered, order : ndarray, shape (n_seeds * n_trials,)
        Values, the smallest first, and their positions before.
    numbers : ndarray of int, shape (..., n_trials)
        Resampled trials.
    """
    n_trials = numbers.shape[-1]
    rows = numbers.reshape(-1, n_trials)
    starts = n_trials * np.arange(len(rows))[:, None]
    counts = np.bincount((rows + starts).ravel(), minlength=rows.size).reshape(rows.shape)
    times = counts[:, order % n_trials]
    values = np.repeat(np.tile(ordered, len(rows)), times.ravel())
    return values.reshape(*numbers.shape[:-1], len(ordered))


class Cause(NamedTuple):
    """Why a trial failed.

    Attributes
    ----------
    pair : tuple of str, or None
        The bodies that touched; None where the steps ran out.
    early : bool
        Whether they did within the first `EARLY_STEPS` steps.
    """

    pair: Pair | None
    early: bool

    def __str__(self) -> str:
        if self.pair is None:
            return "truncated"
        when = f"within {EARLY_STEPS} steps" if self.early else f"after {EARLY_STEPS} steps"
        return f"{self.pair[0]} touches {self.pair[1]} {when}"


def ends_of(rollouts: Rollouts) -> list[End]:
    """How rollouts ended."""
    codes = (rollouts.success + 2 * rollouts.collision).tolist()
    outcomes: tuple[Outcome, ...] = ("truncated", "success", "collision")
    ended = (outcomes[code] for code in codes)
    return list(zip(ended, rollouts.steps.tolist(), rollouts.distance.tolist(), strict=True))


def failure_causes(ends: Sequence[End], contacts: Sequence[Pair | None]) -> dict[int, Cause]:
    """Causes of the trials that failed, by their numbers.

    Parameters
    ----------
    ends : sequence of End
        How the trials ended.
    contacts : sequence
        The bodies that touched, per trial, as `Simulator.contact_pairs` names them.
    """
    return {
        trial: Cause(contacts[trial], outcome == "collision" and steps <= EARLY_STEPS)
        for trial, (outcome, steps, _) in enumerate(ends)
        if outcome != "success"
    }

"""Batches of episodes, whose arrays serve one rollout or step after the other."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.episodes import Control, Episodes
from kinarm.kernels.rollout import begin
from kinarm.kernels.session import Session
from kinarm.world import World

Array = NDArray[np.float64]


class Batch(NamedTuple):
    """Episodes, where their actions come from, and the session of both."""

    control: Control
    episodes: Episodes
    session: Session

    @classmethod
    def bound(
        cls,
        world: World,
        control: Control,
        starts: Array,
        goals: Array,
        *,
        record: bool = False,
        shift: Array | None = None,
    ) -> "Batch":
        """Allocate episodes at their starts, yet to be begun.

        Parameters
        ----------
        world : World
            Where they take place.
        control : Control
            Where their actions come from.
        starts, goals, record, shift
            As for `Episodes.allocate`.
        """
        n_pairs, horizon = len(world.contact_model.shapes.pairs), world.problem.task.horizon
        episodes, known = Episodes.allocate(
            starts, goals, n_pairs=n_pairs, horizon=horizon, record=record, shift=shift
        )
        return cls(control, episodes, world.session(control, known))

    def refill(self, control: Control, starts: Array, goals: Array, shift: Array | None) -> bool:
        """Take other networks, starts and goals, if they are as many and of the same form.

        Parameters
        ----------
        control, starts, goals, shift
            As for `bound`.
        """
        episodes = self.episodes
        parts = [*zip(_arrays(self.control), _arrays(control), strict=True)]
        collected = 0 if shift is None else len(starts)
        if (
            episodes.q.shape != starts.shape
            or len(episodes.moments) != collected
            or any(own.shape != other.shape for own, other in parts)
        ):
            return False
        for own, other in parts:
            own[...] = other
        episodes.q[:], episodes.target[:], episodes.goal[:] = starts, starts, goals
        episodes.touched[:] = 0
        if shift is not None:
            episodes.shift[:], episodes.moments[:] = shift, 0.0
        return True


class IdleBatch:
    """A batch that no rollout is using, kept for the next one.

    Binding arrays for the kernels takes longer than a short rollout does.
    """

    def __init__(self) -> None:
        self._kept: list[Batch] = []

    def taken(
        self, world: World, control: Control, starts: Array, goals: Array, shift: Array | None
    ) -> Batch:
        """Take the batch and refill it, or make a new one; nobody else gets it until `keep`.

        Parameters
        ----------
        world, control, starts, goals, shift
            As for `Batch.bound`.
        """
        try:
            batch = self._kept.pop()
        except IndexError:
            batch = None
        if batch is not None and batch.refill(control, starts, goals, shift):
            return batch
        own = control._replace(layers=control.layers.copy(), weights=control.weights.copy())
        return Batch.bound(world, own, starts, goals, shift=shift)

    def keep(self, batch: Batch) -> None:
        """Keep a batch that is no longer in use, instead of any other."""
        self._kept[:] = [batch]


def begin_some(first: int, last: int, rows: NDArray[np.int64], session: Session) -> int:
    """Begin some of the rows, with work space that no other thread uses.

    Parameters
    ----------
    first, last : int
        Range of the rows.
    rows : ndarray of int
        Which episodes.
    session : Session
        Theirs; if these are not all rows, another one is made.
    """
    return begin(first, last, rows, session if last - first == len(rows) else session.another())


def _arrays(control: Control) -> list[NDArray[Any]]:
    """All that differs from one control to another."""
    return [part for part in control if isinstance(part, np.ndarray)]

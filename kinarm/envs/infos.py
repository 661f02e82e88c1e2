"""What an environment tells about the steps of many arms."""

from itertools import chain, repeat
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinarm.rollouts import StepResult
from kinarm.task import REWARD_TERMS

TERM_KEYS = tuple(f"reward_{name}" for name in REWARD_TERMS)


class StepInfos:
    """Infos of steps of n arms, batched as Gymnasium batches them.

    Kept together in a few tables, of which each entry of the infos is a row.

    Parameters
    ----------
    tells_terms : bool
        Whether they hold the reward terms.
    """

    def __init__(self, *, tells_terms: bool) -> None:
        self._n_terms = len(TERM_KEYS) if tells_terms else 0
        terms = TERM_KEYS[: self._n_terms]
        entries = ("distance", *terms, "success", "is_success", "collision", "contact")
        self._keys = (*entries, *(f"_{key}" for key in entries))

    def tables(
        self, distance: NDArray[np.float64], result: StepResult, contact: NDArray[np.int64]
    ) -> tuple[NDArray[Any], ...]:
        """Arrays of shape (n_entries, n) for the infos of a step.

        Parameters
        ----------
        distance : ndarray, shape (n,)
            From the tool to the goal [m].
        result : StepResult
            Outcome of the step.
        contact : ndarray of int, shape (n,)
            Numbers of the contacts; see `kinarm.envs.contacts.Contacts`.
        """
        numbers = np.empty((1 + self._n_terms, len(distance)))
        numbers[0] = distance
        numbers[1:] = result.terms.T[: self._n_terms]
        flags = np.empty((3, len(distance)), dtype=bool)
        flags[:2] = result.success
        flags[2] = result.collision
        return numbers, flags, contact[None]

    def named(
        self, tables: tuple[NDArray[Any], ...], told: NDArray[np.bool_]
    ) -> dict[str, NDArray[Any]]:
        """Name the rows of the tables, and add the mask of the arms of which they tell."""
        values = chain(*tables, repeat(told))
        return dict(zip(self._keys, values, strict=False))


def taken_out(table: NDArray[Any], arms: NDArray[np.bool_]) -> NDArray[Any]:
    """Move what a table holds of some arms to a table of their own; all else of it is zero."""
    taken = np.where(arms, table, False)  # which is a zero of every type
    np.copyto(table, False, where=arms)
    return taken

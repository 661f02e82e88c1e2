"""The infos of an environment about steps: of many arms at once, and what touched, as numbers."""

from itertools import chain, repeat
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinarm.episodes import Episodes
from kinarm.rollouts import StepResult
from kinarm.task import REWARD_TERMS
from kinarm.world import World

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
        terms = TERM_KEYS if tells_terms else ()
        self._numbers = slice(1, 2 + len(terms))
        entries = ("distance", *terms, "success", "collision", "contact")
        self._keys = (*entries, *(f"_{key}" for key in entries))

    def tables(self, result: StepResult) -> tuple[NDArray[Any], ...]:
        """Arrays of shape (n_entries, n) for the infos of a step, taken from its result."""
        return result.numbers[self._numbers], result.flags[1:], result.contact[None]

    def named(
        self, tables: tuple[NDArray[Any], ...], told: NDArray[np.bool_]
    ) -> dict[str, NDArray[Any]]:
        """Name the rows of the tables, and add the mask of the arms of which they tell."""
        values = chain(*tables, repeat(told))
        infos = dict(zip(self._keys, values, strict=False))
        infos["is_success"], infos["_is_success"] = infos["success"], told
        return infos


def taken_out(table: NDArray[Any], arms: NDArray[np.bool_]) -> NDArray[Any]:
    """Move the entries of some arms to a new table, which is zero elsewhere."""
    taken = np.where(arms, table, False)  # which is a zero of every type
    np.copyto(table, False, where=arms)
    return taken


class Contacts:
    """Numbers of the pairs of bodies, so that infos hold numbers, as the tools of others demand.

    Parameters
    ----------
    world : World
        Where the bodies are.

    Attributes
    ----------
    names : tuple
        Names of the two bodies of each pair that is tested. Number 0 is None: no contact.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self.names: tuple[tuple[str, str] | None, ...] = (None, *world.contact_model.pair_names)

    def find(self, episodes: Episodes, result: StepResult) -> None:
        """Fill in the numbers of the first contacts of a step that are not known yet.

        Parameters
        ----------
        episodes : Episodes
            After the step. Only configurations of the step whose bit of ``doubt`` is set can touch.
        result : StepResult
            Its outcome; changed in place.
        """
        contact, refused = result.contact, result.collision
        if np.count_nonzero(refused) == np.count_nonzero(contact):
            return
        rows = (refused & (contact == 0)).nonzero()[0]
        ways = self._world.substeps(episodes.q[rows], episodes.target[rows])
        for row, way, doubt in zip(rows.tolist(), ways, episodes.doubt[rows].tolist(), strict=True):
            tested = (q for k, q in enumerate(way) if doubt >> k & 1)
            found = map(self._world.contact_model.first_in_contact, tested)
            contact[row] = next((index + 1 for index in found if index is not None), 0)

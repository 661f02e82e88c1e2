"""Which bodies a refused move would have brought into contact, as a number."""

import numpy as np
from numpy.typing import NDArray

from kinarm.episodes import Episodes
from kinarm.rollouts import StepResult
from kinarm.world import World


class Contacts:
    """Numbers the pairs of bodies, so that infos hold numbers, as the tools of others demand.

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
            After the step.
        result : StepResult
            Its outcome; changed in place.
        """
        contact, refused = result.contact, result.collision
        if np.count_nonzero(refused) == np.count_nonzero(contact):
            return
        rows = (refused & (contact == 0)).nonzero()[0]
        ways = self._world.substeps(episodes.q[rows], episodes.target[rows])
        for row, way, doubt in zip(rows.tolist(), ways, episodes.doubt[rows], strict=True):
            contact[row] = self._first(way, int(doubt))

    def _first(self, way: NDArray[np.float64], doubt: int) -> int:
        """Number of the first contact on the way of a step, shape (n_tested, n_joints).

        Configurations are free of contact unless their bit of ``doubt`` is set.
        """
        for k, configuration in enumerate(way):
            if not doubt >> k & 1:
                continue
            index = self._world.contact_model.first_in_contact(configuration)
            if index is not None:
                return index + 1
        return 0

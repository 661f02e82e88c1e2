"""Which bodies a refused move would have brought into contact, as a number."""

import numpy as np
from numpy.typing import NDArray

from kinarm.episodes import Episodes
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

    def of(self, episodes: Episodes, refused: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Numbers of the first contacts of the last step, shape (n,); 0 where it went on.

        Parameters
        ----------
        episodes : Episodes
            After the step.
        refused : ndarray of bool, shape (n,)
            Which of them were refused it.
        """
        numbers = np.zeros(len(refused), dtype=np.int64)
        if np.count_nonzero(refused):
            rows = refused.nonzero()[0]
            ways = self._world.substeps(episodes.q[rows], episodes.target[rows])
            for row, way, doubt in zip(rows.tolist(), ways, episodes.doubt[rows], strict=True):
                numbers[row] = episodes.touched[row] or self._first(way, int(doubt))
        return numbers

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

"""Steps that the kernels have proven neither free nor in contact: Coal decides about them."""

import numpy as np
from numpy.typing import NDArray

from kinarm.collision import ContactModel
from kinarm.episodes import RUNNING
from kinarm.kernels.compiling import Array
from kinarm.kernels.rollout import refuse
from kinarm.kernels.session import Session
from kinarm.world import World

FEW = 4
"""Of up to so many episodes in doubt, Coal also tells what touches."""


def decide_doubtful_steps(world: World, session: Session, paused: NDArray[np.int64]) -> int:
    """Refuse steps that touch something, clear the others, and return how often Coal was asked.

    Coal is asked in the order of the motion, and not beyond the first contact.

    Parameters
    ----------
    world, session
        Where the arms are, and the episodes, which are changed in place.
    paused : ndarray of int, shape (n,)
        Numbers of those that are in doubt.
    """
    episodes = session.episodes
    ways = world.substeps(episodes.q[paused], episodes.target[paused])
    touched, asked = first_contacts(world.contact_model, ways, episodes.doubt[paused])
    refused = touched != 0
    episodes.touched[paused] = touched
    episodes.status[paused[~refused]] = RUNNING
    episodes.cleared[paused] = ~refused
    if refused.any():
        refuse(paused[refused], session)
        # Those of which only contact as such is known.
        episodes.touched[paused[touched < 0]] = 0
    return asked


def first_contacts(
    contacts: ContactModel, ways: Array, doubt: NDArray[np.int64]
) -> tuple[NDArray[np.int64], int]:
    """Find what the doubtful configurations of steps touch first.

    Parameters
    ----------
    contacts, ways
        Who is asked, and configurations in the order of the motion, shape
        (n, n_tested, n_joints) [rad or m].
    doubt : ndarray of int, shape (n,)
        Bit k set: that of number k, from 0, is in doubt.

    Returns
    -------
    touched : ndarray of int, shape (n,)
        Numbers of the pairs, from 1; -1 where only contact as such is known, 0 where there is none.
    asked : int
        Configurations that Coal was asked about.
    """
    touched, asked = np.zeros(len(ways), dtype=np.int64), 0
    for k in range(ways.shape[1]):
        rows = np.flatnonzero((doubt & 1 << k != 0) & (touched == 0))
        if rows.size:
            hit = rows[contacts.in_contact(ways[rows, k])]
            touched[hit] = -1
            asked += rows.size
            for row in hit if len(ways) <= FEW else ():
                index = contacts.first_in_contact(ways[row, k])
                touched[row] = -1 if index is None else index + 1
    return touched, asked

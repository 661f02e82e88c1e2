"""Steps that the kernels have proven neither free nor in contact: Coal decides about them."""

import numpy as np
from numpy.typing import NDArray

from kinarm.collision import ContactModel
from kinarm.episodes import RUNNING, Episodes
from kinarm.kernels.rollout import refuse
from kinarm.kernels.session import Session
from kinarm.world import World

Bits = NDArray[np.int64]

FEW = 4
"""Up to so many episodes in doubt are decided one by one, which also tells what touches."""


def decide_doubtful_steps(world: World, session: Session, episodes: Episodes, paused: Bits) -> int:
    """Refuse steps that touch something, and clear the others.

    Coal is asked in the order of the motion, and not beyond the first contact.

    Parameters
    ----------
    world : World
        Where the arms are.
    session : Session
        The episodes, bound for the kernels.
    episodes : Episodes
        The same; changed in place.
    paused : ndarray of int
        Which of them are in doubt.

    Returns
    -------
    int
        Configurations that Coal was asked about.
    """
    ways = world.substeps(episodes.q[paused], episodes.target[paused])
    ask = _one_by_one if paused.size <= FEW else _together
    touched, asked = ask(world.contact_model, ways, episodes.doubt[paused])
    episodes.touched[paused] = touched
    refused = touched != 0
    episodes.status[paused[~refused]] = RUNNING
    episodes.cleared[paused] = ~refused
    if refused.any():
        refuse(paused[refused], session)
        # Those of which only contact as such is known.
        episodes.touched[paused[touched < 0]] = 0
    return asked


def _one_by_one(contacts: ContactModel, ways: NDArray[np.float64], doubt: Bits) -> tuple[Bits, int]:
    """Numbers of the pairs that touch first, from 1, or 0; and how often Coal was asked."""
    touched, asked = np.zeros(len(ways), dtype=np.int64), 0
    for row, (way, bits) in enumerate(zip(ways, doubt.tolist(), strict=True)):
        for k, configuration in enumerate(way):
            if bits >> k & 1 and not touched[row]:
                index = contacts.first_in_contact(configuration)
                touched[row] = 0 if index is None else index + 1
                asked += 1
    return touched, asked


def _together(contacts: ContactModel, ways: NDArray[np.float64], doubt: Bits) -> tuple[Bits, int]:
    """Where something touches: -1, or 0; and how many configurations Coal was asked about."""
    touched, asked = np.zeros(len(ways), dtype=np.int64), 0
    for k in range(ways.shape[1]):
        rows = np.flatnonzero((doubt & 1 << k != 0) & (touched == 0))
        if rows.size:
            touched[rows] = -contacts.in_contact(ways[rows, k]).astype(np.int64)
            asked += rows.size
    return touched, asked

"""The shield: what a step that would touch is replaced by."""

from itertools import product

import numpy as np
from numpy.typing import NDArray

SCALES = (1.0, 0.5, 0.2, -0.3)
"""Shares of a step that are tried."""

ALL_MASKS = 8
"""With so many joints or fewer, any of them may be held."""


def shield_table(n_actuated: int) -> NDArray[np.float64]:
    """Shares of a step, joint by joint, that may replace it, shape (n, n_actuated).

    All moving joints have the same share; the others are held. Of many joints, at most two are
    held, or at most two move. Without joints there is no shield.
    """
    if n_actuated == 0:
        return np.zeros((0, 0))
    masks = [
        mask
        for mask in product((1.0, 0.0), repeat=n_actuated)
        if any(mask) and (n_actuated <= ALL_MASKS or not 2 < sum(mask) < n_actuated - 2)
    ]
    return np.array([np.multiply(scale, mask) for scale in SCALES for mask in masks][1:])

"""Observations of the goal-conditioned environments, and the flat ones that policies take."""

from collections.abc import Mapping
from itertools import count

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm._validation import finite_array
from kinarm.errors import InvalidInputError
from kinarm.observation import OBSERVATION, observation_size, part_slices

GOAL_KEYS = ("observation", "achieved_goal", "desired_goal")
"""Entries of a dictionary observation; the achieved goal is the tool point."""


def flat_observation(given: Mapping[str, ArrayLike], n_observations: int) -> NDArray[np.float64]:
    """Put a dictionary observation, of one arm or of several, together as policies take it.

    It has an ``observation`` of shape (..., n_own), ``achieved_goal`` and ``desired_goal`` of shape
    (..., 3) [m]; anything else is refused. The flat one has the shape (..., n_observations).
    """
    if set(given) != set(GOAL_KEYS):
        raise InvalidInputError(
            f"a dictionary observation has the keys {', '.join(GOAL_KEYS)}, got "
            f"{', '.join(map(str, given))}"
        )
    places = part_slices(next(n for n in count(1) if observation_size(n) >= n_observations))
    own = [places[part.name] for part in OBSERVATION if not part.of_goal]
    entries = np.concatenate([np.arange(place.start, place.stop) for place in own])
    batch = np.shape(given["desired_goal"])[:-1]
    rows = (None,) * len(batch)
    goal, tool = (
        finite_array(name, given[name], (*rows, 3)) for name in ("desired_goal", "achieved_goal")
    )
    rest = finite_array("observation", given["observation"], (*rows, len(entries)))
    flat = np.empty((*batch, n_observations))
    flat[..., places["goal"]] = goal
    flat[..., places["goal_minus_tool"]] = goal - tool
    flat[..., entries] = rest
    return flat

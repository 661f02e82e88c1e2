"""Entries of one's own at the end of an environment's observation, computed in Python."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Dict, Space
from numpy.typing import ArrayLike, NDArray

from kinarm.episodes import Episodes
from kinarm.errors import InvalidInputError, finite_array
from kinarm.simulator import Simulator


@dataclass(frozen=True, eq=False)
class ExtraObservation:
    """Entries of one's own, which environments append to the observation.

    They are computed in Python, once a step for all arms. Compiled policies do not see them.

    Parameters
    ----------
    function : callable
        From simulator and episodes to the entries, shape (n_arms, m).
    low, high : array_like, shape (m,)
        Their lowest and highest values.
    """

    function: Callable[[Simulator, Episodes], ArrayLike]
    low: ArrayLike
    high: ArrayLike

    def __post_init__(self) -> None:
        low = finite_array("low of extra_observation", self.low, (None,))
        high = finite_array("high of extra_observation", self.high, low.shape)
        if (low > high).any():
            raise InvalidInputError(f"extra_observation has a low above its high: {low}, {high}")

    def space(self, space: Space[Any]) -> Space[Any]:
        """A space with these entries, in ``observation`` if it is of dictionaries."""
        if isinstance(space, Dict):
            own = self.space(space["observation"])
            return Dict({**space.spaces, "observation": own})
        ends = [(space.low, self.low), (space.high, self.high)]  # type: ignore[attr-defined]
        lower, upper = (np.concatenate(pair).astype(space.dtype) for pair in ends)
        return Box(lower, upper, dtype=lower.dtype.type)

    def appended(
        self, shown: Any, simulator: Simulator, episodes: Episodes, rows: NDArray[np.int64] | slice
    ) -> Any:
        """What is shown of some episodes, with these entries."""
        if isinstance(shown, dict):
            own = self.appended(shown["observation"], simulator, episodes, rows)
            return {**shown, "observation": own}
        shape, given = (len(episodes.status), np.size(self.low)), self.function(simulator, episodes)
        entries = finite_array("extra_observation", given, shape)[rows]
        return np.concatenate([shown, entries], axis=1, dtype=shown.dtype)

"""What the oracle knows about trials."""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class OracleSolution:
    """What the oracle knows about one trial.

    Attributes
    ----------
    reachable : bool
        Whether a motion was found that reaches the goal in the simulator.
    steps : int
        Steps of the motion; the horizon if it does not reach the goal.
    steps_lower_bound : int
        Proven: no motion reaches the goal in fewer steps. The horizon + 1 if none does within the
        horizon.
    proof_complete : bool
        Whether the proof is complete: some configuration at the goal, not proven to touch
        anything, is that many steps away, or the motion takes as many, or the goal is proven to
        be out of reach. Else the budget of the proof ran out. A complete proof may leave the bound
        below ``steps``: contact on the way is no part of it.
    final_distance : float
        Distance from the tool to the goal at the end of the motion [m].
    distance_lower_bound : float
        Proven: no motion within the horizon ends closer to the goal [m]. Zero if one reaches it.
    path : ndarray, shape (steps + 1, n_joints)
        Configurations of the motion, as the simulator went through them [rad or m].
    actions : ndarray, shape (steps, n_actions)
        Actions of the motion.
    reason : str or None
        Why no motion reaches the goal; None if one does.
    """

    reachable: bool
    steps: int
    steps_lower_bound: int
    proof_complete: bool
    final_distance: float
    distance_lower_bound: float
    path: NDArray[np.float64]
    actions: NDArray[np.float64]
    reason: str | None


@dataclass(frozen=True, eq=False)
class OracleSolutions:
    """What the oracle knows about n trials; indexing gives an `OracleSolution`.

    Attributes
    ----------
    reachable, proof_complete : ndarray of bool, shape (n,)
        See `OracleSolution`.
    steps, steps_lower_bound : ndarray of int, shape (n,)
        See `OracleSolution`.
    final_distance, distance_lower_bound : ndarray, shape (n,)
        See `OracleSolution` [m].
    actions : ndarray, shape (n, horizon, n_actions)
        Actions of the motions, zero after their end.
    paths : ndarray, shape (n, horizon + 1, n_joints)
        Configurations of the motions, NaN after their end [rad or m].
    reasons : ndarray of str, shape (n,)
        Why no motion reaches the goal; empty if one does.
    """

    reachable: NDArray[np.bool_]
    proof_complete: NDArray[np.bool_]
    steps: NDArray[np.int64]
    steps_lower_bound: NDArray[np.int64]
    final_distance: NDArray[np.float64]
    distance_lower_bound: NDArray[np.float64]
    actions: NDArray[np.float64]
    paths: NDArray[np.float64]
    reasons: NDArray[np.str_]

    def __post_init__(self) -> None:
        for array in self.arrays().values():
            array.flags.writeable = False

    def __len__(self) -> int:
        return len(self.steps)

    def __repr__(self) -> str:
        return f"OracleSolutions({len(self)} trials, {int(self.reachable.sum())} reached)"

    def __iter__(self) -> Iterator[OracleSolution]:
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: int) -> OracleSolution:
        steps = int(self.steps[index])
        return OracleSolution(
            reachable=bool(self.reachable[index]),
            steps=steps,
            steps_lower_bound=int(self.steps_lower_bound[index]),
            proof_complete=bool(self.proof_complete[index]),
            final_distance=float(self.final_distance[index]),
            distance_lower_bound=float(self.distance_lower_bound[index]),
            path=self.paths[index, : steps + 1],
            actions=self.actions[index, :steps],
            reason=str(self.reasons[index]) or None,
        )

    def arrays(self) -> dict[str, NDArray[Any]]:
        """All arrays by name."""
        return {item.name: getattr(self, item.name) for item in fields(self)}

    @classmethod
    def concatenated(cls, parts: "list[OracleSolutions]") -> "OracleSolutions":
        """Join the solutions of several sets of trials."""
        lots = [part.arrays() for part in parts]
        return cls(**{name: np.concatenate([lot[name] for lot in lots]) for name in lots[0]})

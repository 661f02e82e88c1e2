"""What the oracle knows about trials: bounds and motions."""

from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class OracleSolution:
    """Bounds and motion of one trial.

    Attributes
    ----------
    reachable : bool
        Whether the motion reaches the goal in the simulator.
    steps : int
        Steps of the motion; the horizon if it does not reach the goal.
    steps_lower_bound : int
        Proven: no motion reaches the goal in fewer steps. The horizon + 1 if it
        is out of reach.
    proof_complete : bool
        Whether a configuration at the goal, not proven to touch anything, is
        that many steps away, the motion takes as many, or the goal is proven to
        be out of reach. Else the budget ran out. Contact on the way may make
        ``steps`` larger.
    final_distance : float
        Distance from tool to goal at the end of the motion [m].
    path : ndarray, shape (steps + 1, n_joints)
        Configurations of the motion in the simulator [rad or m].
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
    path: NDArray[np.float64]
    actions: NDArray[np.float64]
    reason: str | None


NUMBERS = [item.name for item in fields(OracleSolution)][:5]


@dataclass(frozen=True, eq=False)
class OracleSolutions:
    """Bounds and motions of n trials; indexing gives an `OracleSolution`.

    Its fields are arrays of shape (n,) here; the others are

    Attributes
    ----------
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
    actions: NDArray[np.float64]
    paths: NDArray[np.float64]
    reasons: NDArray[np.str_]

    def __post_init__(self) -> None:
        for array in vars(self).values():
            array.flags.writeable = False

    def __len__(self) -> int:
        return len(self.steps)

    def __repr__(self) -> str:
        return f"OracleSolutions({len(self)} trials, {int(self.reachable.sum())} reached)"

    def __iter__(self) -> Iterator[OracleSolution]:
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: int) -> OracleSolution:
        steps, known = int(self.steps[index]), vars(self)
        return OracleSolution(
            **{name: known[name][index].item() for name in NUMBERS},
            path=self.paths[index, : steps + 1],
            actions=self.actions[index, :steps],
            reason=str(self.reasons[index]) or None,
        )

    @classmethod
    def concatenated(cls, parts: "list[OracleSolutions]") -> "OracleSolutions":
        """Join the solutions of several sets of trials."""
        lots = [vars(part) for part in parts]
        return cls(**{name: np.concatenate([lot[name] for lot in lots]) for name in lots[0]})

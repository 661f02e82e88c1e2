"""What the oracle knows about trials: bounds and motions."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class OracleSolutions:
    """Bounds and motions of n trials.

    Attributes
    ----------
    reachable : ndarray of bool, shape (n,)
        Whether the motion reaches the goal in the simulator.
    proof_complete : ndarray of bool, shape (n,)
        Whether a configuration at the goal, not proven to touch anything, is
        ``steps_lower_bound`` steps away, the motion takes as many, or the goal
        is proven to be out of reach. Else the budget ran out. Contact on the way
        may make ``steps`` larger.
    steps : ndarray of int, shape (n,)
        Steps of the motion; the horizon if it does not reach the goal.
    steps_lower_bound : ndarray of int, shape (n,)
        Proven: no motion reaches the goal in fewer steps. The horizon + 1 if it
        is out of reach.
    final_distance : ndarray, shape (n,)
        Distance from tool to goal at the end of the motion [m].
    actions : ndarray, shape (n, horizon, n_actions)
        Actions of the motions as planned, of which some arrive sooner; then zero.
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

    @classmethod
    def concatenated(cls, parts: "list[OracleSolutions]") -> "OracleSolutions":
        """Join the solutions of several sets of trials."""
        lots = [vars(part) for part in parts]
        return cls(**{name: np.concatenate([lot[name] for lot in lots]) for name in lots[0]})

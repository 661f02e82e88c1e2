"""How often the pairs of bodies of a world touch, over random configurations."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kinarm.collision import ContactModel, make_verdicts_reliable
from kinarm.errors import ProblemError

SAMPLES = 2000


@dataclass(frozen=True, eq=False)
class ContactStatistics:
    """Which pairs touch at random configurations within the limits.

    Attributes
    ----------
    pairs : tuple
        Names of the two bodies of each tested pair.
    touching : ndarray of bool, shape (n_samples, n_pairs)
        Whether they touch.
    """

    pairs: tuple[tuple[str, str], ...]
    touching: NDArray[np.bool_]

    @classmethod
    def sample(cls, model: ContactModel, count: int = SAMPLES) -> "ContactStatistics":
        """Ask Coal for every pair, at so many `random_configurations`."""
        q = random_configurations(model, count)
        data = model.arm.model.createData()
        geometry_data = make_verdicts_reliable(model.geometry.createData())
        results = list(geometry_data.collisionResults)
        touching = np.zeros((count, len(results)), dtype=bool)
        for row, configuration in zip(touching, q, strict=True):
            pin.computeCollisions(
                model.arm.model, data, model.geometry, geometry_data, configuration, False
            )
            row[:] = [result.isCollision() for result in results]
        return cls(model.pair_names, touching)

    @property
    def free(self) -> NDArray[np.bool_]:
        """Configurations at which nothing touches, shape (n_samples,)."""
        return np.logical_not(self.touching.any(axis=1))

    @property
    def shares(self) -> dict[tuple[str, str], float]:
        """Share of the configurations at which a pair touches, most frequent first."""
        shares = self.touching.mean(axis=0)
        order = np.argsort(-shares, kind="stable")
        return {self.pairs[index]: float(shares[index]) for index in order}

    def check_movable(self, arm: str) -> None:
        """Refuse a world in which no configuration is free, by the pair that touches most often."""
        if not self.free.any():
            (pair, share), *_ = self.shares.items()
            raise ProblemError(
                f"arm {arm!r} cannot move: it touches something at all of {len(self.free)} random "
                f"configurations, {' and '.join(pair)} at {share:.0%} of them"
            )


def random_configurations(model: ContactModel, count: int, seed: int = 0) -> NDArray[np.float64]:
    """Configurations whose actuated joints are uniform within their limits, shape (n, n_joints).

    The others stay at home.

    Parameters
    ----------
    model, count, seed
        An arm in a scene, how many, and the seed that they are drawn from.
    """
    arm, moved = model.arm, slice(model.arm.n_actuated)
    q = np.tile(arm.home, (count, 1))
    uniforms = np.random.default_rng(seed).random((count, arm.n_actuated))
    q[:, moved] = arm.lower[moved] + uniforms * (arm.upper - arm.lower)[moved]
    return q

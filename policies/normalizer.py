"""Running mean and standard deviation of observations."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinarm.policies.arm_policy import CONSTANT_BELOW


def input_scale(std: NDArray[np.float64]) -> NDArray[np.float64]:
    """Factors that normalise inputs: 1 / std, or 0 for constant ones."""
    constant = std < CONSTANT_BELOW
    return np.where(constant, 0.0, 1.0 / np.where(constant, 1.0, std))


def fold_normalizer(
    weights: NDArray[np.float64],
    bias: NDArray[np.float64],
    mean: NDArray[np.float64],
    std: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Make affine layers that take raw instead of normalised observations.

    Sums have a fixed order, unlike those of BLAS.

    Parameters
    ----------
    weights, bias : ndarray, shape (..., n_out, n_observations) and (..., n_out)
        Of layers that take normalised observations.
    mean, std : ndarray, shape (n_observations,)
        Statistics that normalise them.
    """
    scaled = weights * input_scale(std)
    return scaled, bias - (scaled * mean).sum(axis=-1)


@dataclass(frozen=True, eq=False)
class Normalizer:
    """Statistics of all observations seen so far: the paper's mu and diag(Sigma).

    Attributes
    ----------
    count : int
        Number of observations.
    mean : ndarray, shape (n_observations,)
        Their mean; zero before the first one.
    squares : ndarray, shape (n_observations,)
        Sum of their squared deviations from the mean.
    """

    count: int
    mean: NDArray[np.float64]
    squares: NDArray[np.float64]

    @classmethod
    def empty(cls, n_observations: int) -> "Normalizer":
        """Statistics of no observation: mean 0 and standard deviation 1."""
        return cls(0, np.zeros(n_observations), np.zeros(n_observations))

    @classmethod
    def of(cls, observations: NDArray[np.float64]) -> "Normalizer":
        """Statistics of given observations, shape (n, n_observations)."""
        mean = observations.mean(axis=0)
        return cls(len(observations), mean, ((observations - mean) ** 2).sum(axis=0))

    @property
    def std(self) -> NDArray[np.float64]:
        """Population standard deviation, shape (n_observations,); 1 at first."""
        if self.count == 0:
            return np.ones_like(self.mean)
        return np.sqrt(self.squares / self.count)

    def updated(self, moments: NDArray[np.float64], counts: NDArray[np.int64]) -> "Normalizer":
        """Add the observations of a batch of episodes (Chan's parallel update).

        Parameters
        ----------
        moments, counts : ndarray, shape (n, 2, n_observations) and (n,)
            Per episode, sums of the observations less `mean` and of their
            squares, and number of observations.
        """
        added = int(counts.sum())
        if added == 0:
            return self
        total = self.count + added
        first, second = moments.sum(axis=0)
        return Normalizer(
            count=total,
            mean=self.mean + first / total,
            squares=np.maximum(self.squares + second - first**2 / total, 0.0),
        )

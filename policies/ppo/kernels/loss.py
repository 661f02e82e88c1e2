"""The loss of a minibatch and its derivatives by what the networks say."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.kernels.compiling import inlined
from kinarm.kernels.elementary import exponential
from kinarm.policies.ppo.kernels.layers import OUTPUTS, padded
from kinarm.policies.ppo.kernels.tiles import Numbers

HALF_LOG_2_PI = 0.91893853320467274178

MOST = 80.0
"""Largest logarithm of a ratio of densities whose exponential is finite in single precision."""

LOSSES = 4
"""Sums over samples that are logged: policy loss, value loss, clipped ratios, divergence."""


class Experience(NamedTuple):
    """Experience of a rollout, one row a step.

    Actions are not clipped. Scales tell by how much wider than usual the noise was with which they
    were chosen, densities are the logarithms of its probability densities, over the scale.
    """

    observations: Numbers
    actions: Numbers
    scales: Numbers
    densities: Numbers
    advantages: Numbers
    returns: Numbers


class Objective(NamedTuple):
    """Weights of the loss of a minibatch (see `PPOConfig`), and of a sample in its means."""

    clip_range: float
    ent_coef: float
    vf_coef: float
    share: float


@inlined
def derive_by_means(
    layers: NDArray[np.int64],
    experience: Experience,
    rows: NDArray[np.int64],
    objective: Objective,
    standard: tuple[float, float],
    log_std: Numbers,
    precision: NDArray[np.float64],
    work: Numbers,
    gradient: Numbers,
    loss: NDArray[np.float64],
) -> None:
    """Replace means of actions by the derivatives of the clipped surrogate by them."""
    end, n_actions = layers.shape[0] - 1, experience.actions.shape[1]
    sink, wide = layers[end, OUTPUTS], padded(n_actions)
    by_log_std = gradient.shape[0] - wide
    lowest, highest = 1.0 - objective.clip_range, 1.0 + objective.clip_range
    for s in range(rows.shape[0]):
        i, row = rows[s], sink + s * wide
        density, scale = 0.0, float(experience.scales[i])
        for j in range(n_actions):
            deviation = (float(experience.actions[i, j]) - work[row + j]) / scale
            density += log_density(deviation, precision[j], log_std[j])
        difference = min(max(density - experience.densities[i], -MOST), MOST)
        ratio = exponential(difference)
        advantage = (experience.advantages[i] - standard[0]) * standard[1]
        surrogate = advantage * ratio
        limited = advantage * min(max(ratio, lowest), highest)
        loss[0] -= min(surrogate, limited)
        loss[2] += abs(ratio - 1.0) > objective.clip_range
        loss[3] += (ratio - 1.0) - difference
        slope = -surrogate * objective.share if surrogate <= limited else 0.0
        for j in range(n_actions):
            deviation = (float(experience.actions[i, j]) - work[row + j]) / scale
            pull = deviation * precision[j]
            work[row + j] = slope * pull / scale
            gradient[by_log_std + j] += slope * (deviation * pull - 1.0)


@inlined
def derive_by_values(
    layers: NDArray[np.int64],
    experience: Experience,
    rows: NDArray[np.int64],
    objective: Objective,
    work: Numbers,
    loss: NDArray[np.float64],
) -> None:
    """Replace values by the derivatives of the squared error by them."""
    end = layers.shape[0] - 1
    sink, wide = layers[end, OUTPUTS], padded(1)
    for s in range(rows.shape[0]):
        error = float(work[sink + s * wide]) - experience.returns[rows[s]]
        loss[1] += error * error
        work[sink + s * wide] = objective.vf_coef * 2.0 * error * objective.share


@inlined
def find_precision(log_std: Numbers, precision: NDArray[np.float64]) -> None:
    """Fill in inverse variances."""
    for j in range(len(precision)):
        precision[j] = exponential(-2.0 * float(log_std[j]))


@inlined
def log_density(deviation: float, precision: float, log_std: float) -> float:
    """Logarithm of a normal density."""
    return -0.5 * deviation * deviation * precision - log_std - HALF_LOG_2_PI

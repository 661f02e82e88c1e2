"""Kernels for the actions of a rollout and the steps of an update."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.kernels.compiling import inlined, kernel
from kinarm.kernels.elementary import exponential
from kinarm.policies.ppo.kernels.layers import (
    BLOCK,
    LANES,
    OUTPUTS,
    Network,
    Numbers,
    backward,
    forward,
    load_sample,
    padded,
    transpose,
    whole_tiles,
)

HALF_LOG_2_PI = 0.91893853320467274178

MOST = 80.0
"""Largest logarithm of a ratio that is finite in single precision."""

FIRST_DECAY, SECOND_DECAY, EPSILON = 0.9, 0.999, 1e-5
"""Settings of Adam, as in Stable-Baselines3."""


class Experience(NamedTuple):
    """Experience of a rollout: observations and actions (n_steps, width), and numbers (n_steps,).

    Actions are not clipped. Scales tell by how much their noise was wider than usual, densities are
    the logarithms of its probability densities, over the scale.
    """

    observations: Numbers
    actions: Numbers
    scales: Numbers
    densities: Numbers
    advantages: Numbers
    returns: Numbers


class Objective(NamedTuple):
    """Weights of the loss (see `PPOConfig`), and of a sample in its means."""

    clip_range: float
    ent_coef: float
    vf_coef: float
    share: float


@kernel
def choose(
    means: Numbers,
    log_std: Numbers,
    noise: Numbers,
    noisy: NDArray[np.bool_],
    least: float,
    actions: Numbers,
    scales: Numbers,
    densities: Numbers,
) -> None:
    """Turn noise into actions, and find its densities.

    Parameters
    ----------
    means, noise, actions : ndarray of float32, shape (n, n_actions)
        What the actor says, standard normal numbers, and what is filled in.
    log_std : ndarray of float32, shape (n_actions,)
        Logarithms of the standard deviations.
    noisy, least : ndarray of bool, shape (n,), and float
        Rows where the mean logarithm is at least so large.
    scales, densities : ndarray of float32, shape (n,)
        Factors on the standard deviations, and logarithms of the densities of
        the deviations over the scales.
    """
    precision = np.zeros(means.shape[1])
    find_precision(log_std, precision)
    wider = exponential(max(0.0, least - log_std.mean()))
    for i in range(means.shape[0]):
        scales[i] = wider if noisy[i] else 1.0
        scale, density = float(scales[i]), 0.0
        for j in range(means.shape[1]):
            actions[i, j] = means[i, j] + scale * exponential(float(log_std[j])) * noise[i, j]
            deviation = (float(actions[i, j]) - means[i, j]) / scale
            density += log_density(deviation, precision[j], log_std[j])
        densities[i] = density


@kernel
def standardisation(chosen: NDArray[np.int64], advantages: Numbers) -> tuple[float, float]:
    """Mean of the advantages, and factor that makes their deviation one."""
    total, squares = 0.0, 0.0
    for i in chosen:
        total += advantages[i]
    mean = total / len(chosen)
    for i in chosen:
        deviation = advantages[i] - mean
        squares += deviation * deviation
    return mean, 1.0 / (math.sqrt(squares / (len(chosen) - 1)) + 1e-8)


@kernel
def add_gradients(
    first: int,
    last: int,
    actor: Network,
    critic: Network,
    experience: Experience,
    chosen: NDArray[np.int64],
    objective: Objective,
    standard: tuple[float, float],
    gradients: Numbers,
) -> None:
    """Find the gradient of the loss of a minibatch, in fixed parts.

    Parameters
    ----------
    first, last : int
        Which parts.
    actor, critic : Network
        Networks whose parameters lie in one array; its last entries, padded,
        are the logarithms of the standard deviations.
    chosen : ndarray of int, shape (batch_size,)
        Rows of the minibatch.
    standard : tuple of float
        Subtrahend and factor of the advantages.
    gradients : ndarray of float32, shape (n_parts, n_weights)
        Filled with derivatives by the weights.
    """
    n_parts, n_weights = gradients.shape
    n_actions = experience.actions.shape[1]
    by_log_std = n_weights - padded(n_actions)
    log_std = actor.weights[by_log_std:]
    precision = np.zeros(n_actions)
    find_precision(log_std, precision)
    work = np.zeros(actor.work, dtype=np.float32)
    behind = np.zeros((BLOCK + 1) * actor.widest, dtype=np.float32)
    mean_sink = actor.layers[actor.layers.shape[0] - 1, OUTPUTS]
    value_sink = critic.layers[critic.layers.shape[0] - 1, OUTPUTS]
    lowest, highest = 1.0 - objective.clip_range, 1.0 + objective.clip_range
    for part in range(first, last):
        gradient = gradients[part]
        gradient[:] = np.float32(0.0)
        begin, end = part * len(chosen) // n_parts, (part + 1) * len(chosen) // n_parts
        for start in range(begin, end, BLOCK):
            rows = chosen[start : min(start + BLOCK, end)]
            samples, tiled = len(rows), whole_tiles(len(rows))
            for s in range(samples):
                load_sample(experience.observations, rows[s], actor.layers, work, s)
            forward(actor, tiled, work)
            # Replace means of actions by derivatives of the clipped surrogate.
            for s in range(samples):
                i, row = rows[s], mean_sink + s * padded(n_actions)
                density, scale = 0.0, float(experience.scales[i])
                for j in range(n_actions):
                    deviation = (float(experience.actions[i, j]) - work[row + j]) / scale
                    density += log_density(deviation, precision[j], log_std[j])
                difference = min(max(density - experience.densities[i], -MOST), MOST)
                ratio = exponential(difference)
                advantage = (experience.advantages[i] - standard[0]) * standard[1]
                surrogate = advantage * ratio
                limited = advantage * min(max(ratio, lowest), highest)
                slope = -surrogate * objective.share if surrogate <= limited else 0.0
                for j in range(n_actions):
                    deviation = (float(experience.actions[i, j]) - work[row + j]) / scale
                    pull = deviation * precision[j]
                    work[row + j] = slope * pull / scale
                    gradient[by_log_std + j] += slope * (deviation * pull - 1.0)
            backward(actor, tiled, samples, work, behind, gradient)
            forward(critic, tiled, work)
            # Replace values by derivatives of the squared error.
            for s in range(samples):
                row = value_sink + s * padded(1)
                error = float(work[row]) - experience.returns[rows[s]]
                work[row] = objective.vf_coef * 2.0 * error * objective.share
            backward(critic, tiled, samples, work, behind, gradient)
        # Every part has its share of the entropy.
        for j in range(n_actions):
            share = objective.ent_coef * (end - begin) / len(chosen)
            gradient[by_log_std + j] -= share


@kernel
def descend(
    actor: Network,
    critic: Network,
    first_moment: Numbers,
    second_moment: Numbers,
    gradients: Numbers,
    learning_rate: float,
    max_norm: float,
    steps: int,
) -> None:
    """Add up a gradient, clip it, take a step of Adam, and transpose matrices.

    Parameters
    ----------
    actor, critic : Network
        Networks whose parameters lie in one array; changed.
    first_moment, second_moment : ndarray of float32, shape (n_weights,)
        Running means of gradients and their squares; changed.
    gradients : ndarray of float32, shape (n_parts, n_weights)
        Parts of the gradient; the first is overwritten.
    learning_rate, max_norm : float
        The step size of Adam, and the norm to which gradients are clipped.
    steps : int
        Which step it is, counted from 1.
    """
    # The gradient, and its length in a fixed order of sums.
    n_parts, n_weights = gradients.shape
    whole, weights = gradients[0], actor.weights
    for part in range(1, n_parts):
        for k in range(n_weights):
            whole[k] += gradients[part, k]
    squares = np.zeros(LANES)
    for k in range(0, n_weights, LANES):
        for lane in range(LANES):
            squares[lane] += float(whole[k + lane]) * float(whole[k + lane])
    total = 0.0
    for lane in range(LANES):
        total += squares[lane]
    # Clip it, and move against its mean over its root mean square.
    shrink = np.float32(min(max_norm / (math.sqrt(total) + 1e-6), 1.0))
    kept, squares_kept = np.float32(FIRST_DECAY), np.float32(SECOND_DECAY)
    taken, squares_taken = np.float32(1.0 - FIRST_DECAY), np.float32(1.0 - SECOND_DECAY)
    # Numba squares and multiplies, up to 2^16; what the C library gives beyond vanishes beside 1.
    unbias = 1.0 - FIRST_DECAY**steps
    stride = np.float32(learning_rate / unbias)
    unbias = 1.0 - SECOND_DECAY**steps
    widen = np.float32(1.0 / math.sqrt(unbias))
    epsilon = np.float32(EPSILON)
    for k in range(n_weights):
        slope = whole[k] * shrink
        first = kept * first_moment[k] + taken * slope
        second = squares_kept * second_moment[k] + squares_taken * (slope * slope)
        first_moment[k], second_moment[k] = first, second
        weights[k] -= stride * first / (np.sqrt(second) * widen + epsilon)
    transpose(actor)
    transpose(critic)


@inlined
def find_precision(log_std: Numbers, precision: NDArray[np.float64]) -> None:
    """Fill in inverse variances."""
    for j in range(len(precision)):
        precision[j] = exponential(-2.0 * float(log_std[j]))


@inlined
def log_density(deviation: float, precision: float, log_std: float) -> float:
    """Logarithm of a normal density."""
    return -0.5 * deviation * deviation * precision - log_std - HALF_LOG_2_PI

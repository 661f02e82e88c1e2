"""Products, networks and gradients of PPO's kernels held against NumPy, all in double precision."""

import numpy as np
import pytest

from kinarm.errors import InvalidInputError
from kinarm.kernels.compiling import kernel
from kinarm.policies.ppo.kernels.layers import BLOCK, Matrix, evaluate, hyperbolic_tangent, multiply
from kinarm.policies.ppo.kernels.update import (
    Experience,
    Objective,
    add_gradients,
    choose,
    descend,
    standardisation,
)
from kinarm.policies.ppo.networks import ActorCritic, split_parameters

N_OBSERVATIONS, N_ACTIONS = 19, 3
ARCHES = [(7,), (12, 10), (16, 33, 64), (130,)]
OBJECTIVE = Objective(clip_range=0.2, ent_coef=0.01, vf_coef=0.5, share=1 / 150)
DESCENT = 0.01, 0.5  # learning rate, and largest norm of a gradient


@kernel
def product(rows, columns, depth, left, right, start, sink):
    """A product of matrices that lie densely in arrays."""
    a = Matrix(left, 0, depth, 1)
    b = Matrix(right, 0, columns, 1)
    multiply(rows, columns, depth, a, b, Matrix(start, 0, 0, 1), Matrix(sink, 0, columns, 1))


@kernel
def tangents(values):
    """Hyperbolic tangents, in place."""
    for k in range(len(values)):
        values[k] = hyperbolic_tangent(values[k])


def numbers(rng, *shape):
    return rng.normal(size=shape).astype(np.float32)


@pytest.mark.parametrize(
    ("rows", "columns", "depth"), [(8, 16, 1), (8, 16, 0), (16, 32, 5), (24, 48, 50), (8, 112, 3)]
)
def test_products(rows, columns, depth):
    rng = np.random.default_rng(depth)
    left, right = numbers(rng, rows, depth), numbers(rng, depth, columns)
    start, sink = numbers(rng, columns), np.zeros((rows, columns), dtype=np.float32)
    flat = (array.reshape(-1) for array in (left, right, start, sink))
    product(rows, columns, depth, *flat)
    expected = start + left.astype(float) @ right.astype(float)
    np.testing.assert_allclose(sink, expected, rtol=0, atol=2e-6 * (1 + depth**0.5))


def test_hyperbolic_tangent():
    x = np.concatenate([np.linspace(-12, 12, 100_001), np.logspace(-30, 3, 1000), [0.0]])
    found = x.astype(np.float32)
    tangents(found)
    np.testing.assert_allclose(found, np.tanh(x.astype(np.float32), dtype=float), rtol=0, atol=5e-7)
    assert (np.abs(found) <= 1).all()
    mirrored = (-x).astype(np.float32)
    tangents(mirrored)
    np.testing.assert_array_equal(mirrored, -found)


class Reference:
    """Actor and critic in NumPy, and the derivatives of PPO's loss by central differences."""

    def __init__(self, arch, seed=0):
        self.rng = np.random.default_rng(seed)
        self.arch = arch
        self.networks = ActorCritic((N_OBSERVATIONS, *arch, N_ACTIONS))
        self.count = self.networks.n_parameters
        self.vector = 0.3 * numbers(self.rng, self.count)
        self.networks.load(self.vector)

    def outputs(self, vector, observations):
        """Means, values and standard deviations."""
        parts = split_parameters(vector, (N_OBSERVATIONS, *self.arch, N_ACTIONS))
        found = []
        for layers in (parts.actor, parts.critic):
            values = observations.astype(float)
            for k, (weights, bias) in enumerate(layers):
                values = values @ weights.T + bias
                if k < len(layers) - 1:
                    values = np.tanh(values)
            found.append(values)
        return found[0], found[1][:, 0], np.exp(parts.log_std)

    def densities(self, vector, experience):
        means, _, std = self.outputs(vector, experience.observations)
        off = (experience.actions - means) / std / experience.scales[:, None]
        return (-(off**2) / 2 - np.log(std) - np.log(2 * np.pi) / 2).sum(axis=1)

    def experience(self, n):
        """Of a policy that differs a little from the present one."""
        rng = self.rng
        arrays = (numbers(rng, n, N_OBSERVATIONS), numbers(rng, n, N_ACTIONS))
        scales = rng.choice([1.0, 2.5], n).astype(np.float32)
        found = Experience(*arrays, scales, *(numbers(rng, n) for _ in range(3)))
        old = self.densities(self.vector.astype(float), found) + 0.2 * rng.normal(size=n)
        return found._replace(densities=old.astype(np.float32))

    def loss(self, vector, experience):
        ratio = np.exp(self.densities(vector, experience) - experience.densities)
        advantages = experience.advantages.astype(float)
        advantages = (advantages - advantages.mean()) / (advantages.std(ddof=1) + 1e-8)
        limit = OBJECTIVE.clip_range
        clipped = np.clip(ratio, 1 - limit, 1 + limit)
        surrogate = np.minimum(advantages * ratio, advantages * clipped).mean()
        _, values, std = self.outputs(vector, experience.observations)
        entropy = np.log(std * np.sqrt(2 * np.pi * np.e)).sum()
        error = ((values - experience.returns) ** 2).mean()
        return -surrogate - OBJECTIVE.ent_coef * entropy + OBJECTIVE.vf_coef * error

    def found_gradient(self, experience, parts=8):
        """What the kernel makes of a minibatch of all samples."""
        networks, n = self.networks, len(experience.returns)
        gradients = np.empty((parts, len(networks.weights)), dtype=np.float32)
        chosen, objective = np.arange(n), OBJECTIVE._replace(share=1 / n)
        add_gradients(
            *(0, parts, networks.actor, networks.critic, experience, chosen, objective),
            *(standardisation(chosen, experience.advantages), gradients),
        )
        return gradients


@pytest.mark.parametrize("arch", ARCHES)
class TestNetworks:
    def test_outputs(self, arch):
        reference = Reference(arch)
        observations = numbers(reference.rng, 2 * BLOCK + 5, N_OBSERVATIONS)
        means, values, std = reference.outputs(reference.vector.astype(float), observations)
        networks = reference.networks
        np.testing.assert_allclose(networks.means(observations), means, rtol=0, atol=1e-5)
        np.testing.assert_allclose(networks.values(observations, 2), values, rtol=0, atol=1e-5)
        np.testing.assert_allclose(np.exp(networks.log_std), std, rtol=1e-6)

    def test_each_row_is_on_its_own(self, arch):
        reference = Reference(arch)
        observations = numbers(reference.rng, 41, N_OBSERVATIONS)
        whole = reference.networks.means(observations)
        parts = np.empty_like(whole)
        for first, last in ((0, 3), (3, 4), (4, 41)):
            evaluate(first, last, reference.networks.actor, observations, parts)
        np.testing.assert_array_equal(parts, whole)

    def test_gradient(self, arch):
        """Along random directions, in parts that hold none, some or all samples of a block."""
        reference = Reference(arch)
        experience, vector = reference.experience(75), reference.vector.astype(float)
        found = [
            reference.networks.gathered(reference.found_gradient(experience, parts).sum(axis=0))
            for parts in (1, 8, 80)
        ]
        np.testing.assert_allclose(found[0], found[1], rtol=0, atol=1e-5)
        np.testing.assert_allclose(found[0], found[2], rtol=0, atol=1e-5)
        for _ in range(20):
            direction = reference.rng.normal(size=reference.count)
            ahead, behind = vector + 1e-6 * direction, vector - 1e-6 * direction
            slope = reference.loss(ahead, experience) - reference.loss(behind, experience)
            assert found[0] @ direction == pytest.approx(slope / 2e-6, rel=2e-4, abs=2e-4)

    def test_padding_stays_zero(self, arch):
        reference = Reference(arch)
        networks, experience = reference.networks, reference.experience(50)
        moments = [np.zeros_like(networks.weights) for _ in range(2)]
        for step in range(3):
            gradients = reference.found_gradient(experience)
            nets = (networks.actor, networks.critic)
            descend(*nets, *moments, gradients, *DESCENT, step + 1)
        for array in (networks.weights, *moments):
            again = networks.scattered(networks.gathered(array))
            np.testing.assert_array_equal(again, array)
        assert (networks.weights != 0).sum() == reference.count


def test_steps_of_adam():
    """As Kingma and Ba write them, after the gradient was shortened."""
    reference = Reference((12, 10))
    networks, rng = reference.networks, reference.rng
    weights = networks.weights.astype(float)
    moments = [np.zeros_like(networks.weights) for _ in range(2)]
    first, second = np.zeros_like(weights), np.zeros_like(weights)
    for step in range(1, 5):
        gradients = networks.scattered(numbers(rng, reference.count))[None] * np.float32(step == 1)
        gradients = np.concatenate(
            [gradients, gradients, networks.scattered(reference.vector)[None]]
        )
        slope = gradients.astype(float).sum(axis=0)
        slope *= min(0.5 / np.linalg.norm(slope), 1)
        first = 0.9 * first + 0.1 * slope
        second = 0.999 * second + 0.001 * slope**2
        unbiased = first / (1 - 0.9**step), second / (1 - 0.999**step)
        weights -= 0.01 * unbiased[0] / (np.sqrt(unbiased[1]) + 1e-5)
        descend(networks.actor, networks.critic, *moments, gradients, *DESCENT, step)
        np.testing.assert_allclose(networks.weights, weights, rtol=0, atol=1e-6)
    turned = networks.actor.turned.copy()
    networks.load(networks.gathered(networks.weights))
    np.testing.assert_array_equal(networks.actor.turned, turned)


def test_chosen_actions():
    """Noise is wider in replays alone, and never narrower."""
    rng = np.random.default_rng(0)
    means, noise, replayed = numbers(rng, 20, 3), numbers(rng, 20, 3), rng.random(20) < 0.5
    log_std = np.array([-0.7, 0.0, 1.5], dtype=np.float32)
    std = np.exp(log_std.astype(float))
    expected = -(noise**2) / 2 - np.log(std * np.sqrt(2 * np.pi))
    for least, wider in ((1.3, np.exp(1.3 - 0.8 / 3)), (0.2, 1.0), (-np.inf, 1.0)):
        actions, scales, densities = np.empty_like(means), *np.empty((2, 20), dtype=np.float32)
        choose(means, log_std, noise, replayed, least, actions, scales, densities)
        np.testing.assert_allclose(scales, np.where(replayed, wider, 1), rtol=1e-6)
        deviations = scales[:, None] * std * noise
        np.testing.assert_allclose(actions, means + deviations, rtol=0, atol=4e-6)
        np.testing.assert_allclose(densities, expected.sum(axis=1), rtol=0, atol=1e-5)


def test_standardisation():
    advantages = numbers(np.random.default_rng(0), 100)
    chosen = np.random.default_rng(1).permutation(100)[:30]
    mean, scale = standardisation(chosen, advantages)
    assert mean == pytest.approx(advantages[chosen].mean(dtype=float))
    assert scale == pytest.approx(1 / advantages[chosen].std(ddof=1, dtype=float), rel=1e-6)
    assert np.isfinite(standardisation(chosen, np.ones(100, dtype=np.float32))).all()


def test_a_vector_of_another_network_is_refused():
    """By hand: 1 deviation, 24 + 8 in the layers of each, 3 for the action and 3 for the value."""
    with pytest.raises(InvalidInputError, match="expected a state of 71 parameters, got 70"):
        split_parameters(np.arange(70), (7, 3, 2, 1))

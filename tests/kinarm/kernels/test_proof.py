"""Proofs of steps, held against steps that attain their bounds."""

import numpy as np
import pytest
from hanging_chain import LENGTHS, RADIUS, SLAB, tips
from step_proofs import proofs

from kinarm.kernels.planes import DEPTH
from kinarm.kernels.proof import MARGIN


@pytest.fixture(scope="module", params=[(), (SLAB,)], ids=["ground", "slab"])
def below(request, hanging):
    """A hanging chain, and the height of what is below it [m]."""
    return hanging(*request.param), SLAB.upper[2] * len(request.param)


@pytest.mark.parametrize("tested", [2, 4, 32])
def test_bounds_of_steps_hold_and_are_attained(below, tested):
    """Within a step between free configurations, the ball dips as deep as it can."""
    (simulator, level), rng = below, np.random.default_rng(1)
    moves = rng.uniform(0.05, 0.1, (200, 3)) * rng.choice([-1, 1], (200, 1))
    dip = np.square(np.cumsum(moves, axis=1)) @ LENGTHS / 8
    # The chain hangs down at this share of a step; if earlier than halfway, the ball ends higher.
    lowest = np.where(np.arange(200) % 2, 0.5, rng.uniform(0.3, 0.5, 200))
    way = np.zeros((tested + 1, 200, 4))
    way[..., 1:] = (np.arange(tested + 1)[:, None] / tested - lowest)[..., None] * moves
    # The lowest configuration touches by a fiftieth of the dip.
    way[..., 0] = level + RADIUS - 0.02 * dip - tips(way)[1:, :, 1].min(axis=0)
    heights = tips(way)[..., 1] - level - RADIUS
    bounds, doubt, touching = proofs(simulator, tested, way[0], way[-1])
    least = heights[1:].min(axis=0)
    assert (heights[0] > MARGIN).all()
    assert (bounds <= least + 1e-12).all()
    attained = (lowest == 0.5) | (tested == 2)
    assert (bounds > least - 0.01 * dip)[:, attained].all()
    doubted = heights[1:] <= MARGIN
    np.testing.assert_array_equal(doubt, (doubted << np.arange(tested)[:, None]).sum(axis=0))
    first = np.take_along_axis(heights[1:], doubted.argmax(axis=0)[None], axis=0)[0]
    np.testing.assert_array_equal(touching, first < -DEPTH)


def test_nothing_is_claimed_between_margin_and_depth(below):
    """They are 2 um and 1 um, as the docs say."""
    simulator, level = below
    gaps = np.outer([0.1, 0.95, 1.05], [-1e-6, 2e-6]).ravel()
    starts, ends = np.zeros((2, len(gaps), 4))
    ends[:, 0] = level + RADIUS + LENGTHS.sum() + gaps
    starts[:, 0] = ends[:, 0] + 0.1
    _, free, touching, _ = simulator.world.proven(ends)
    np.testing.assert_array_equal(free, gaps > 2e-6)
    np.testing.assert_array_equal(touching, gaps < -1e-6)
    _, doubt, touching = proofs(simulator, 1, starts, ends)
    np.testing.assert_array_equal(doubt, gaps <= 2e-6)
    np.testing.assert_array_equal(touching, gaps < -1e-6)

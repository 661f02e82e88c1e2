"""Straight motions that are proven free: held against Coal at many configurations of each."""

import numpy as np
import pytest
from configurations import pair_distances

from kinarm.bodies import Body
from kinarm.policies.planning.motions import Motions
from kinarm.policies.planning.paths import find_path
from kinarm.problem import PROBLEMS
from kinarm.scene import PAPER_BENCHES, Scene
from kinarm.world import World

BODIES = (
    Body(name="pole", shape="cylinder", size=(0.04, 0.9), position=(0.5, 0.15, 0.45)),
    Body(name="ball", shape="sphere", size=(0.1,), position=(-0.3, 0.4, 0.8)),
    Body(name="bar", shape="capsule", size=(0.03, 0.5), position=(0.1, -0.6, 0.7), rpy=(1, 0, 0)),
    Body(name="slope", shape="halfspace", position=(0, 0, -0.05), rpy=(0.1, 0, 0)),
)


@pytest.fixture(scope="module")
def world():
    """The default arm among bodies of all shapes."""
    scene = Scene(obstacles=(*PAPER_BENCHES, *BODIES))
    return World(PROBLEMS["both"].replace(scene=scene), threads=1)


@pytest.fixture(scope="module")
def ways(world):
    """Ends of random motions, short and long, that begin without contact; shape (n, 2, 6)."""
    rng, arm, n = np.random.default_rng(3), world.arm, 100
    first = rng.uniform(arm.lower, arm.upper, (n, 6))
    second = np.clip(
        first + 10.0 ** rng.uniform(-2, 0.3, (n, 1)) * rng.normal(size=(n, 6)), arm.lower, arm.upper
    )
    first[:, 5], second[:, 5] = 0.0, 0.0
    free = ~world.contact_model.in_contact(first)
    return np.stack([first, second], axis=1)[free]


def samples(way, share=1.0):
    first, second = way
    return first + np.linspace(0.0, share, 300)[:, None] * (second - first)


@pytest.mark.parametrize("margin", [0.0, 0.02])
def test_free_shares_keep_the_margin_and_no_more(world, ways, margin):
    motions, blocked = Motions(world, margin), 0
    for way in ways:
        share = motions.free_share(*way)
        if share == 0.0 and pair_distances(world, way[:1]).min() <= margin + 0.1:
            continue
        assert pair_distances(world, samples(way, share)).min() > margin - 2e-6
        if share < 1.0:
            # The part after it comes that close, as far as samples tell.
            end = min(share + 1.0 / 8.0, 1.0)
            rest = way[0] + np.linspace(share, end, 300)[:, None] * (way[1] - way[0])
            assert pair_distances(world, rest).min() < margin + 2e-3
            blocked += 1
    assert blocked > 5


def test_without_coal_what_is_not_proven_counts_as_contact(world, ways):
    motions = Motions(world)
    for way in ways:
        proven = motions.free_share(*way, asking=False)
        assert proven <= motions.free_share(*way)
        assert motions.is_free(*way) == (proven == 1.0)


def test_a_rest_is_free_where_nothing_touches(world, ways):
    motions = Motions(world)
    assert all(motions.free_share(q, q) == 1.0 for q, _ in ways)
    touching = np.zeros(6)
    touching[1] = 1.9  # leaning into the ground
    assert motions.free_share(touching, touching) == 0.0


def test_paths_do_not_depend_on_what_was_asked_before(world, ways):
    start, end = ways[0, 0], ways[1, 0]
    alone = find_path(Motions(world), start, end[None], np.random.default_rng(0))
    motions = Motions(world)
    for way in ways[:20]:
        motions.free_share(*way)
    np.testing.assert_array_equal(
        find_path(motions, start, end[None], np.random.default_rng(0)), alone
    )

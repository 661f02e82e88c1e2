"""Steps in doubt are judged alike one by one and together."""

import numpy as np
from configurations import contact_boundary, jittered

from kinarm.doubtful_steps import _one_by_one, _together


def ways_in_doubt(simulator):
    """Ways of steps near contact, and random doubts about their configurations."""
    free, _ = contact_boundary(simulator, 31, 300)
    starts = jittered(free, 32)
    rng = np.random.default_rng(33)
    targets = starts + rng.normal(size=starts.shape) * 10.0 ** rng.uniform(-3, -1, (len(starts), 1))
    return simulator.world.substeps(starts, targets), rng.integers(0, 16, len(starts))


def test_both_ways_refuse_the_same_steps(any_simulator):
    ways, doubt = ways_in_doubt(any_simulator)
    contacts = any_simulator.world.contact_model
    named, asked = _one_by_one(contacts, ways, doubt)
    flagged, asked_together = _together(contacts, ways, doubt)
    np.testing.assert_array_equal(named != 0, flagged != 0)
    assert asked == asked_together
    assert 20 < (named != 0).sum() < len(ways) - 20


def test_pairs_are_those_of_the_first_configuration_in_doubt_that_touches(simulator):
    ways, doubt = ways_in_doubt(simulator)
    contacts = simulator.world.contact_model
    named, _ = _one_by_one(contacts, ways, doubt)
    for way, bits, number in zip(ways, doubt, named, strict=True):
        pairs = [contacts.contact_pair(q) for k, q in enumerate(way) if bits >> k & 1]
        touching = [pair for pair in pairs if pair is not None]
        expected = contacts.pair_names[number - 1] if number else None
        assert (touching[0] if touching else None) == expected

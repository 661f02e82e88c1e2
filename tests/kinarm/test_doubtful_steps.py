"""Steps in doubt are refused at the first doubtful configuration that Coal finds in contact."""

import numpy as np
from configurations import contact_boundary, jittered

from kinarm.collision import FEW


def test_few_and_many_steps_are_refused_alike_and_few_name_the_pair(any_simulator):
    contacts, rng = any_simulator.world.contact_model, np.random.default_rng(33)
    starts = jittered(contact_boundary(any_simulator, 31, 300)[0], 32)
    sizes = 10.0 ** rng.uniform(-3, -1, (len(starts), 1))
    ways = any_simulator.world.substeps(starts, starts + rng.normal(size=starts.shape) * sizes)
    scenes = np.zeros((0, 1, 16))
    doubt = rng.integers(0, 1 << ways.shape[1], len(starts))
    together, asked = contacts.first_contacts(ways, doubt, scenes)
    lots = [slice(k, k + FEW) for k in range(0, len(ways), FEW)]
    named, asked_each = zip(
        *(contacts.first_contacts(ways[k], doubt[k], scenes) for k in lots), strict=True
    )
    assert sum(asked_each) == asked
    for way, bits, flag, number in zip(ways, doubt, together, np.concatenate(named), strict=True):
        pairs = [contacts.contact_pair(q) for k, q in enumerate(way) if bits >> k & 1]
        first = next((pair for pair in pairs if pair is not None), None)
        assert flag == (-1 if first else 0)
        assert (contacts.pair_names[number - 1] if number else None) == first
    assert 20 < (together != 0).sum() < len(ways) - 20

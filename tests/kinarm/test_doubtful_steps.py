"""Steps in doubt are refused if Coal finds contact at a doubtful configuration."""

import numpy as np
from configurations import contact_boundary, jittered, substeps

from kinarm.collision import Step
from kinarm.step_contact import steps_in_contact


def test_coal_is_asked_about_doubtful_configurations_up_to_the_first_contact(any_simulator):
    world, rng = any_simulator.world, np.random.default_rng(33)
    starts = jittered(contact_boundary(any_simulator, 31, 300)[0], 32)
    ends = starts + rng.normal(size=starts.shape) * 10.0 ** rng.uniform(-3, -1, (len(starts), 1))
    steps = [Step(world.contact_model, *each) for each in zip(starts, ends, strict=True)]
    doubt = rng.integers(0, 1 << world.rules.tested, len(starts))
    touching, asked = steps_in_contact(steps, doubt, world.rules)
    asked_each = []
    for way, bits, found in zip(substeps(world, starts, ends), doubt, touching, strict=True):
        verdicts = world.contact_model.in_contact(way[[bits >> k & 1 == 1 for k in range(4)]])
        assert found == verdicts.any()
        asked_each.append(verdicts.argmax() + 1 if found else len(verdicts))
    assert asked == sum(asked_each)
    assert 20 < touching.sum() < len(starts) - 20

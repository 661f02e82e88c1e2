"""Arms of other packages: contact in the compiled simulator against Coal's verdicts."""

import numpy as np
import pytest
from configurations import contact_boundary, jittered, random_configurations
from known_arms import INSTALLED, KNOWN_ARMS, simulator_among_boxes
from reference_episodes import compare_actions

pytestmark = INSTALLED


@pytest.fixture(scope="module", params=KNOWN_ARMS)
def simulator(request):
    return simulator_among_boxes(request.param)


def proven(simulator, configurations):
    """Which configurations the kernel calls free, and which touching."""
    _, free, touching, _ = simulator.world.proven(configurations)
    return free, touching


def check_proof(simulator, seed, boundary, jitters, random):
    """Ask the proof and Coal about configurations near contact and anywhere; how many those are."""
    near = np.concatenate(contact_boundary(simulator, seed, boundary))
    parts = [near, *(jittered(near, seed + number) for number in range(jitters))]
    asked = np.concatenate([*parts, random_configurations(simulator, seed, random)])
    free, surely_touching = proven(simulator, asked)
    touching = simulator.world.contact_model.in_contact(asked)
    assert 0.05 < touching.mean() < 0.99
    assert not (free & touching).any()
    assert not (surely_touching & ~touching).any()
    assert free.any()
    return len(asked)


def test_rollouts_equal_the_reference_path(simulator):
    _, collision, count = compare_actions(simulator, 5, 12)
    assert 0 < collision <= count


def test_the_proof_never_clears_what_touches(simulator):
    check_proof(simulator, 6, boundary=300, jitters=3, random=4000)


def test_verdicts_do_not_depend_on_what_was_asked_before(simulator):
    model = simulator.world.contact_model
    near = np.concatenate(contact_boundary(simulator, 9, 250))
    near = np.concatenate([near, *(jittered(near, seed) for seed in range(2))])
    expected = model.in_contact(near)
    for seed in range(4):
        order = np.random.default_rng(seed).permutation(len(near))
        np.testing.assert_array_equal(model.in_contact(near[order]), expected[order])
    for row in np.random.default_rng(4).permutation(len(near)):
        assert (model.first_in_contact(near[row]) is not None) == expected[row]


@pytest.mark.slow
def test_rollouts_equal_the_reference_path_in_many_episodes(simulator):
    """Far more are in data/results/evidence: parts ``steps`` of ``tests.campaign.evidence``."""
    _, collision, count = compare_actions(simulator, 7, 100)
    assert 10 < collision <= count


@pytest.mark.slow
def test_the_proof_never_clears_what_touches_at_tens_of_thousands(simulator):
    """Far more are in data/results/evidence: parts ``contact`` of ``tests.campaign.evidence``."""
    assert check_proof(simulator, 8, boundary=1000, jitters=9, random=10_000) >= 20_000

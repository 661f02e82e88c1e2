"""How often pairs touch, held against Coal's verdicts pair by pair."""

import numpy as np
import pytest

from kinarm.contact_pairs import random_configurations
from kinarm.contact_statistics import ContactStatistics
from kinarm.errors import ProblemError


def test_the_first_pair_is_that_of_single_queries_and_shares_are_sorted(any_simulator):
    model = any_simulator.world.contact_model
    statistics = ContactStatistics.sample(model, 300)
    for row, q in zip(statistics.touching, random_configurations(model.arm, 300), strict=True):
        pair = statistics.pairs[int(row.argmax())] if row.any() else None
        assert pair == model.contact_pair(q)
    np.testing.assert_array_equal(statistics.free, ~statistics.touching.any(axis=1))
    assert set(statistics.shares) == set(model.pair_names)
    assert list(statistics.shares.values()) == sorted(statistics.shares.values(), reverse=True)


def test_configurations_are_uniform_and_joints_that_are_not_actuated_stay_at_home(simulator):
    model, arm = simulator.world.contact_model, simulator.arm
    q = random_configurations(model.arm, 4000)
    np.testing.assert_array_equal(
        q[:, arm.n_actuated :], np.tile(arm.home[arm.n_actuated :], (4000, 1))
    )
    moved = slice(arm.n_actuated)
    shares = (q - arm.lower)[:, moved] / (arm.upper - arm.lower)[moved]
    assert ((shares >= 0) & (shares <= 1)).all()
    np.testing.assert_allclose(shares.mean(axis=0), 0.5, atol=0.03)
    np.testing.assert_array_equal(random_configurations(model.arm, 100), q[:100])


def test_an_arm_that_always_touches_is_refused_with_its_most_frequent_pair():
    pairs = (("hand", "wall"), ("hand", "roof"))
    stuck = ContactStatistics(
        pairs, np.array([[True, False], [True, True], [False, True], [True, True]])
    )
    with pytest.raises(ProblemError, match="cannot move: it touches.* 4 .*hand and wall at 75%"):
        stuck.check_movable("made")
    ContactStatistics(pairs, np.zeros((2, 2), dtype=bool)).check_movable("made")

"""How often pairs touch, held against Coal's verdicts pair by pair."""

import numpy as np
import pytest

from kinarm.contact_statistics import ContactStatistics, random_configurations
from kinarm.errors import ProblemError
from kinarm.problem import PROBLEMS
from kinarm.scene import Scene
from kinarm.world import World


@pytest.fixture(scope="module")
def model(simulators):
    return simulators["paper"].world.contact_model


def test_free_is_what_coal_calls_free(any_simulator):
    model = any_simulator.world.contact_model
    statistics = ContactStatistics.sample(model, 500)
    touching = model.in_contact(random_configurations(model, 500))
    np.testing.assert_array_equal(statistics.free, ~touching)


def test_the_first_pair_is_that_of_single_queries(model):
    statistics = ContactStatistics.sample(model, 300)
    for row, q in zip(statistics.touching, random_configurations(model, 300), strict=True):
        pair = statistics.pairs[int(row.argmax())] if row.any() else None
        assert pair == model.contact_pair(q)


def test_shares_are_sorted_and_always_and_never_are_their_ends(model):
    statistics = ContactStatistics.sample(model, 400)
    shares = statistics.shares
    assert set(shares) == set(model.pair_names)
    assert list(shares.values()) == sorted(shares.values(), reverse=True)
    assert statistics.always == ()
    assert all(shares[pair] == 0 for pair in statistics.never)
    assert 0 < len(statistics.never) < len(shares)


def test_configurations_are_uniform_and_joints_that_are_not_actuated_stay_at_home(model):
    q, arm = random_configurations(model, 4000), model.arm
    np.testing.assert_array_equal(
        q[:, arm.n_actuated :], np.tile(arm.home[arm.n_actuated :], (4000, 1))
    )
    moved = slice(arm.n_actuated)
    shares = (q - arm.lower)[:, moved] / (arm.upper - arm.lower)[moved]
    assert ((shares >= 0) & (shares <= 1)).all()
    np.testing.assert_allclose(shares.mean(axis=0), 0.5, atol=0.03)
    np.testing.assert_array_equal(random_configurations(model, 100), q[:100])


def test_an_arm_that_always_touches_is_refused_with_its_most_frequent_pair():
    pairs = (("hand", "wall"), ("hand", "roof"))
    stuck = ContactStatistics(
        pairs, np.array([[True, False], [True, True], [False, True], [True, True]])
    )
    with pytest.raises(ProblemError, match="cannot move: it touches.* 4 .*hand and wall at 75%"):
        stuck.check_movable("made")
    ContactStatistics(pairs, np.zeros((2, 2), dtype=bool)).check_movable("made")


def test_a_world_without_pairs(write_robot, make_joint):
    bare = Scene(ground=False, obstacles=())
    problem = PROBLEMS["right"].replace(arm=write_robot([make_joint()]), scene=bare)
    statistics = ContactStatistics.sample(World(problem).contact_model, 10)
    assert statistics.free.all()
    assert statistics.shares == {}

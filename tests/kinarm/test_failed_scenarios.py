"""Which scenarios are replayed, and how often."""

import numpy as np
from scipy import stats

from kinarm.failed_scenarios import FailedScenarios


def numbered(*numbers):
    """Scenarios whose numbers all entries hold."""
    column = np.array(numbers, dtype=float)[:, None]
    return np.repeat(column, 6, axis=1), np.repeat(column, 3, axis=1)


def numbers(scenarios):
    starts, goals = scenarios
    assert (starts == starts[:, :1]).all()
    np.testing.assert_array_equal(starts[:, 0], goals[:, 0])
    return starts[:, 0].tolist()


def test_the_last_ones_are_kept_and_repeated_ones_more_than_once():
    failed = FailedScenarios.none(6)
    for entered, kept in (
        ((1, 2), [1, 2]),
        ((3, 2), [1, 2, 3, 2]),
        ((4,), [2, 3, 2, 4]),
        ((), [2, 3, 2, 4]),
        ((5, 6, 7, 8, 9), [6, 7, 8, 9]),
    ):
        failed = failed.followed_by(*numbered(*entered), 4)
        assert numbers(failed) == kept


def test_before_the_first_failure_all_are_new_and_no_number_is_drawn():
    rng = np.random.default_rng(0)
    scenarios, replayed = FailedScenarios.none(6).mixed(
        0.5, rng, 3, lambda count: numbered(*range(count))
    )
    assert numbers(scenarios) == [0, 1, 2]
    assert not replayed.any()
    failed = FailedScenarios(*numbered(7, 8))
    assert not failed.mixed(0.0, rng, 3, lambda count: numbered(*range(count)))[1].any()
    assert rng.random() == np.random.default_rng(0).random()


def test_a_share_comes_again_each_as_often_as_it_is_kept():
    failed = FailedScenarios(*numbered(-1, -2, -2, -2))
    rng, n = np.random.default_rng(3), 20_000
    scenarios, replayed = failed.mixed(0.3, rng, n, lambda count: numbered(*range(count)))
    found = np.array(numbers(scenarios))
    assert stats.binomtest(int(replayed.sum()), n, 0.3).pvalue > 1e-3
    np.testing.assert_array_equal(found[~replayed], np.arange(np.count_nonzero(~replayed)))
    twos = int((found[replayed] == -2).sum())
    assert stats.binomtest(twos, int(replayed.sum()), 0.75).pvalue > 1e-3

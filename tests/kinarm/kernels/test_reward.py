"""The compiled reward terms against formulas by hand, and against the reference path."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit
from reference_episodes import scripted
from simulators import changed

from kinarm.kernels import reward
from kinarm.kernels.reward import add_reward
from kinarm.task import REWARD_TERMS, RewardWeights
from tests.helpers.reference import ReferenceSimulator

weight = st.floats(-10, 10)
distance = st.floats(0, 3)


@njit
def add(weights, before, after, collided, reached, terms, total, e):
    add_reward(weights, before, after, collided, reached, terms, total, e)


def terms_of(weights, before, after, collided=False, reached=False):
    """Weighted terms by name, and what they add to a return of 7."""
    terms, total = np.full((2, len(REWARD_TERMS)), np.nan), np.full(2, 7.0)
    add(weights.vector, before, after, collided, reached, terms, total, 1)
    assert np.isnan(terms[0]).all()
    assert total[0] == 7
    return dict(zip(REWARD_TERMS, terms[1].tolist(), strict=True)), total[1] - 7


def by_hand(weights, before, after, collided, reached):
    return {
        "progress": weights.progress * (before - after),
        "closer": weights.closer * np.sign(before - after),
        "step": weights.step,
        "collision": weights.collision * collided,
        "success": weights.success * reached,
    }


def test_columns_are_the_terms_in_their_order():
    assert REWARD_TERMS == ("progress", "closer", "step", "collision", "success")
    columns = [getattr(reward, name.upper()) for name in REWARD_TERMS]
    assert columns == list(range(len(REWARD_TERMS)))


@pytest.mark.parametrize(
    ("before", "after", "collided", "reached", "expected"),
    [
        (1.0, 0.75, False, False, [0.5, 0.1, -0.5, 0, 0]),
        (1.0, 1.25, False, False, [-0.5, -0.1, -0.5, 0, 0]),
        (1.0, 1.0, True, False, [0, 0, -0.5, -3, 0]),
        (0.5, 0.04, False, True, [0.92, 0.1, -0.5, 0, 5]),
    ],
)
def test_terms_by_hand(before, after, collided, reached, expected):
    weights = RewardWeights(progress=2, closer=0.1, step=-0.5, collision=-3, success=5)
    terms, added = terms_of(weights, before, after, collided, reached)
    assert list(terms.values()) == pytest.approx(expected)
    assert added == pytest.approx(sum(expected))


@given(weight, weight, weight, weight, weight, distance, distance, st.integers(0, 2))
def test_terms_equal_the_formulas(progress, closer, step, collision, success, before, after, end):
    weights = RewardWeights(
        progress=progress,
        closer=closer,
        step=step,
        collision=collision,
        success=success,
        allow_perverse=True,
    )
    terms, added = terms_of(weights, before, after, end == 1, end == 2)
    expected = by_hand(weights, before, after, end == 1, end == 2)
    assert terms == pytest.approx(expected, abs=1e-12)
    assert added == pytest.approx(sum(expected.values()), abs=1e-12)


@pytest.mark.parametrize("term", REWARD_TERMS)
def test_each_term_alone_equals_the_reference(simulator, term):
    weights = dict.fromkeys(REWARD_TERMS, 0) | {term: -0.5 if term == "collision" else 0.5}
    single = changed(simulator, reward=weights, tolerance=0.3)
    rng = np.random.default_rng(1)
    starts, goals = single.sample(rng, 40)
    actions = np.repeat(rng.uniform(-1, 1, (40, 8, 5)), 8, axis=1)
    rollouts = single.rollout_actions(actions, starts, goals)
    reference = ReferenceSimulator(single)
    for i in range(40):
        acts, scenario = scripted(actions[i]), (starts[i], goals[i])
        episode = reference.rollout(acts, *scenario, observed=False)
        assert rollouts.returns[i] == pytest.approx(episode.rewards.sum(), abs=1e-10)
    assert (rollouts.returns != 0).sum() > 2

"""Tasks and reward weights."""

import math

import pytest

from kinarm.errors import InvalidInputError, ProblemError
from kinarm.task import REWARD_TERMS, ReachTask, RewardWeights


def reach(**settings):
    return ReachTask(**{"goal_regions": ("left",), **settings})


def test_defaults_are_the_papers():
    task = reach()
    assert (task.tolerance, task.horizon, task.start_spread) == (0.05, 64, 1.0)
    assert task.goal_weights == ()
    assert task.reward == RewardWeights(progress=1, closer=0, step=0, collision=-1, success=0)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"goal_regions": ("a", "b", "a")}, "goal_regions names one twice: a, b, a"),
        ({"goal_weights": (1, 2)}, "2 goal_weights for 1 goal_regions"),
        ({"goal_weights": (0,)}, r"goal_weights must be greater than 0, got \[0.0\]"),
        ({"goal_weights": (-1,)}, "goal_weights"),
        ({"goal_weights": (math.nan,)}, "goal_weights"),
        ({"goal_weights": (math.inf,)}, "goal_weights"),
        ({"tolerance": 0}, "tolerance must be greater than 0 m, got 0"),
        ({"tolerance": -0.1}, "tolerance"),
        ({"tolerance": math.nan}, "tolerance"),
        ({"tolerance": math.inf}, "tolerance"),
        ({"start_spread": -0.1}, r"start_spread must lie in \[0, 1\], got -0.1"),
        ({"start_spread": 1.5}, "start_spread"),
        ({"start_spread": math.nan}, "start_spread"),
    ],
)
def test_impossible_settings_are_refused(settings, message):
    with pytest.raises(ProblemError, match=message):
        reach(**settings)


@pytest.mark.parametrize("horizon", [0, -5, 2.5, math.nan, True, "64"])
def test_impossible_horizon_is_refused(horizon):
    with pytest.raises(InvalidInputError, match="horizon must be a whole number"):
        reach(horizon=horizon)


class TestRewardWeights:
    def test_terms_are_the_fields_in_their_order(self):
        assert REWARD_TERMS == ("progress", "closer", "step", "collision", "success")
        weights = RewardWeights(progress=1, closer=2, step=3, collision=-4, success=5)
        assert weights.vector.tolist() == [1, 2, 3, -4, 5]

    @pytest.mark.parametrize("term", REWARD_TERMS)
    @pytest.mark.parametrize("value", [math.nan, math.inf])
    def test_must_be_finite(self, term, value):
        with pytest.raises(ProblemError, match=f"reward weight {term} must be finite"):
            RewardWeights(**{term: value})

    @pytest.mark.parametrize(
        ("term", "value", "message"),
        [
            ("collision", 2, "collision = 2 rewards contact: give it the other sign"),
            ("success", -0.5, "success = -0.5 punishes it: give it the other sign"),
        ],
    )
    def test_perverse_ones_have_to_be_asked_for(self, term, value, message):
        with pytest.raises(ProblemError, match=message):
            RewardWeights(**{term: value})
        allowed = RewardWeights(**{term: value}, allow_perverse=True)
        assert getattr(allowed, term) == value

"""Tasks and reward weights."""

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
        ({"horizon": 0}, "horizon must be a whole number"),
        ({"tolerance": 0}, "tolerance must be greater than 0, got 0"),
        ({"start_spread": -0.1}, r"start_spread must lie in \[0, 1\], got -0.1"),
    ],
)
def test_impossible_settings_are_refused(settings, message):
    with pytest.raises((InvalidInputError, ProblemError), match=message):
        reach(**settings)


class TestRewardWeights:
    def test_terms_are_the_fields_in_their_order(self):
        assert REWARD_TERMS == ("progress", "closer", "step", "collision", "success")
        weights = RewardWeights(progress=1, closer=2, step=3, collision=-4, success=5)
        assert weights.vector.tolist() == [1, 2, 3, -4, 5]

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

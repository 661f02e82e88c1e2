"""Recordings of contestants are what an evaluation sees."""

import pytest

from kinarm._fields import to_plain
from kinarm.errors import PolicyFileError
from kinarm.evaluation import Contestant, TrialSet, find_contestants, oracle_bounds, record
from kinarm.evaluation.evaluation import run_trials
from kinarm.problem import ReachProblem


@pytest.mark.parametrize("name", ["skilled", "random", "zero", "oracle"])
def test_they_end_as_the_evaluation(trials, skilled, name):
    contestant = (
        Contestant.from_policy("skilled", skilled)
        if name == "skilled"
        else find_contestants(name)[0]
    )
    evaluation = run_trials(contestant, trials)
    recordings = record(contestant, trials)
    assert [each.outcome for each in recordings] == list(evaluation.rollouts.outcomes)
    assert [each.steps for each in recordings] == evaluation.rollouts.steps.tolist()
    assert [each.final_distance for each in recordings] == evaluation.rollouts.distance.tolist()
    assert [each.contact for each in recordings] == list(evaluation.contacts)
    assert {each.policy for each in recordings} == {name}


def test_they_say_what_is_proven_and_where_they_come_from(trials, skilled):
    bounds = oracle_bounds(trials)
    (recording,) = record(Contestant.from_policy("skilled", skilled), trials, [3], bounds=bounds)
    assert recording.trial == 3
    assert recording.steps_lower_bound == bounds.steps_lower_bound[3]
    assert recording.provenance["trial_seed"] == trials.seed
    assert recording.provenance["policy"] == to_plain(skilled.provenance)
    assert (recording.goal == trials.goals[3]).all()


def test_another_arm(skilled):
    trials = TrialSet.draw(ReachProblem.load("right").replace(arm="paper_flange"), 1, seed=0)
    contestant = Contestant.from_policy("skilled", skilled)
    with pytest.raises(PolicyFileError, match="trained for arm 'paper'"):
        record(contestant, trials)
    (recording,) = record(contestant, trials, allow_other_arm=True)
    assert recording.problem.arm.name == "paper_flange"

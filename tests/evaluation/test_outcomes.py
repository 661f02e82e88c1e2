"""Outcomes beside bounds of a part of the trials."""

from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.contestants import Contestant
from kinarm.evaluation.evaluation import run_trials
from kinarm.evaluation.summary import evaluation_document
from kinarm.evaluation.trials import TrialSet


def test_of_many_trials_the_first_are_bounded(skilled):
    trials = TrialSet.draw("right", 40, seed=8)
    few = TrialSet.draw("right", 12, seed=8)
    assert trials.first(12).digest == few.digest
    assert few.first(12) is few
    bounds, mine = oracle_bounds(few), Contestant.from_policy("skilled", skilled)
    many, first = (run_trials(mine, faced, bounds=bounds) for faced in (trials, few))
    for name in ("relative_success", "step_ratio", "step_ratio_p95"):
        assert many.metrics[name].value == first.metrics[name].value
    faced = evaluation_document([many], "").protocol.problems["right"]
    assert faced.oracle.bounded == len(faced.oracle.trials.steps) == 12
    assert len(faced.starts) == 40

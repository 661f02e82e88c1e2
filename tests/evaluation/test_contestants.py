"""Who takes part: names, groups, files and baselines."""

from dataclasses import replace

import numpy as np
import pytest

from kinarm.errors import InvalidInputError
from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.contestants import ORACLE, UNTRAINED, Contestant
from kinarm.evaluation.evaluation import evaluate
from kinarm.evaluation.finding import find_contestants
from kinarm.evaluation.selection import check_names
from kinarm.evaluation.trials import TrialSet
from kinarm.problem import PROBLEMS


@pytest.mark.parametrize("name", ["random", "zero", "oracle"])
def test_what_is_not_trained_is_found_by_name(name):
    (contestant,) = find_contestants(name)
    assert contestant is UNTRAINED[name]
    assert (contestant.problem, contestant.policy) == (None, None)


def test_a_file_is_named_after_itself(skilled, tmp_path):
    skilled.save(tmp_path / "mine-seed4.npz")
    (contestant,) = find_contestants(tmp_path / "mine-seed4.npz")
    assert contestant.name == "mine-seed4"
    assert (contestant.algorithm, contestant.recipe) == ("ars", "tuned*")
    assert (contestant.problem.name, contestant.seed) == ("right", 1)
    np.testing.assert_array_equal(contestant.policy.layers[0].weights, skilled.layers[0].weights)


def test_the_oracle_replays_what_it_found():
    trials = TrialSet.draw(PROBLEMS["right"].replace(arm="paper_flange"), 12, seed=2)
    rollouts, bounds = ORACLE.run(trials), oracle_bounds(trials)
    assert 0 < bounds.reachable.sum() < 12
    np.testing.assert_array_equal(rollouts.success, bounds.reachable)
    np.testing.assert_array_equal(rollouts.steps, bounds.steps)
    np.testing.assert_array_equal(rollouts.distance, bounds.final_distance)
    assert not rollouts.collision.any()


def served(contestant, **changes):
    """Names of the problems that a contestant is for, in a world with these changes."""
    return [
        name
        for name, problem in PROBLEMS.items()
        if contestant.serves(problem.replace(**changes), lambda own: own.replace(**changes))
    ]


def test_a_policy_is_for_the_problem_that_it_was_trained_for(skilled):
    plain = Contestant.from_policy("plain", replace(skilled, mirror=None))
    assert served(plain) == served(plain, tolerance=0.02) == ["right"]
    assert not plain.serves(PROBLEMS["right"].replace(tolerance=0.02))


def test_a_symmetric_policy_is_also_for_a_part_of_its_goals(skilled):
    assert skilled.mirror is not None
    made = replace(skilled.provenance, problem=PROBLEMS["both"].pinned)
    symmetric = replace(skilled, provenance=made)
    assert served(Contestant.from_policy("of both", symmetric)) == ["left", "right", "both"]
    assert served(Contestant.from_policy("of one", skilled)) == ["right"]
    assert served(Contestant.from_policy("plain", replace(symmetric, mirror=None))) == ["both"]


def test_how_steps_are_tested_for_contact_is_no_other_problem(skilled):
    """A policy of one of the paper's problems faces it as it is now; a note tells of training."""
    right = PROBLEMS["right"]
    made = {
        problem: replace(skilled.provenance, problem=problem.pinned)
        for problem in (right.replace(tested_configurations=4), right.replace(horizon=9))
    }
    four, own = (
        Contestant.from_policy("mine", replace(skilled, mirror=mirror, provenance=each))
        for each, mirror in zip(made.values(), (None, skilled.mirror), strict=True)
    )
    assert four.problem is right
    assert own.problem == own.policy.problem
    assert served(four) == served(four, tested_configurations=7) == ["right"]
    assert evaluate(four, trials=2).problem == right
    told = "training tested steps for contact at 4 configurations"
    assert four.note_on(right) == evaluate(four, trials=2).result.note == told
    assert four.note_on(four.policy.problem) == own.note_on(right) == ""
    assert own.note_on(four.policy.problem) == "training tested steps for contact throughout"


def test_names_have_to_tell_contestants_and_problems_apart(skilled):
    right, lax = PROBLEMS["right"], PROBLEMS["right"].replace(tolerance=0.2)
    mine = Contestant.from_policy("mine", skilled)
    check_names([(mine, right), (ORACLE, right), (mine, PROBLEMS["left"])])
    with pytest.raises(InvalidInputError, match=r"'right': .*task.tolerance is 0.2, not"):
        check_names([(mine, right), (ORACLE, lax)])
    with pytest.raises(InvalidInputError, match="two policies are called 'mine'"):
        check_names([(mine, right), (mine, right)])
    with pytest.raises(InvalidInputError, match="needs no file and elsewhere"):
        check_names([(mine, right), (replace(mine, source="elsewhere"), lax.replace(name="lax"))])

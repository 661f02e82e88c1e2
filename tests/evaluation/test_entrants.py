"""Who takes part: names, groups, files and baselines."""

import numpy as np
import pytest

from kinarm.arm import Arm
from kinarm.errors import PolicyFileError, UnknownNameError
from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.entrants import (
    BASELINES,
    ORACLE,
    Entrant,
    find_entrants,
    shipped_entrants,
)
from kinarm.evaluation.trials import TrialSet
from kinarm.policies import policy_names
from kinarm.simulator import Simulator


@pytest.mark.parametrize("name", ["random", "zero"])
def test_baselines_by_name(name):
    (entrant,) = find_entrants(name)
    assert entrant is BASELINES[name]
    assert (entrant.algorithm, entrant.trained_on, entrant.policy) == ("baseline", None, None)


def test_a_file_is_named_after_itself(skilled, tmp_path):
    skilled.save(tmp_path / "mine-seed4.npz")
    (entrant,) = find_entrants(tmp_path / "mine-seed4.npz")
    assert (entrant.name, entrant.group) == ("mine-seed4", "mine")
    assert (entrant.algorithm, entrant.recipe) == ("ars", "tuned*")
    assert (entrant.trained_on, entrant.seed) == ("right", 1)
    np.testing.assert_array_equal(entrant.policy.layers[0].weights, skilled.layers[0].weights)


def test_a_relative_file_needs_no_folder(skilled, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    skilled.save("mine.npz")
    assert find_entrants("mine.npz")[0].name == "mine"


@pytest.mark.parametrize("name", ["random.npz", "oracle.npz"])
def test_a_file_called_like_a_baseline_is_that_file(skilled, tmp_path, name):
    skilled.save(tmp_path / name)
    (entrant,) = find_entrants(tmp_path / name)
    assert entrant.policy is not None


def test_an_unknown_name_lists_what_exists():
    with pytest.raises(UnknownNameError, match="unknown policy 'nobody'") as caught:
        find_entrants("nobody")
    assert {"random", "zero", "oracle"} <= set(caught.value.available)


def test_a_missing_file_is_told_apart_from_an_unknown_name(tmp_path):
    with pytest.raises(PolicyFileError, match="cannot read"):
        find_entrants(tmp_path / "nobody.npz")


def test_functions_enter_under_their_own_name():
    def careful(observations):
        return np.zeros((len(observations), 5))

    entrant = Entrant.from_function("careful", careful)
    assert (entrant.name, entrant.group, entrant.trained_on) == ("careful", "careful", None)


def test_baselines_close_the_list_of_all_entrants():
    names = [entrant.name for entrant in shipped_entrants(Arm.load())]
    assert names[-2:] == ["random", "zero"]
    assert names[:-2] == list(policy_names())


def test_policies_for_another_arm_are_not_entered():
    entrants = shipped_entrants(Arm.load("paper_flange"))
    assert [entrant.name for entrant in entrants] == ["random", "zero"]


def test_the_oracle_by_name():
    (entrant,) = find_entrants("oracle")
    assert entrant is ORACLE
    assert (entrant.algorithm, entrant.trained_on, entrant.policy) == ("oracle", None, None)


def test_the_oracle_replays_what_it_found():
    trials = TrialSet.draw(Simulator("paper_flange", "right"), 12, seed=2)
    rollouts, bounds = ORACLE.run(trials), oracle_bounds(trials)
    assert 0 < bounds.reachable.sum() < 12
    np.testing.assert_array_equal(rollouts.success, bounds.reachable)
    np.testing.assert_array_equal(rollouts.steps, bounds.steps)
    np.testing.assert_array_equal(rollouts.distance, bounds.final_distance)
    assert not rollouts.collision.any()


def test_the_oracle_does_not_change_other_entrants(skilled, trials):
    entrant = Entrant.from_policy("mine", skilled)
    before = entrant.run(trials)
    ORACLE.run(trials)
    np.testing.assert_array_equal(entrant.run(trials).distance, before.distance)


def test_a_policy_for_another_arm_is_told(skilled):
    entrant = Entrant.from_policy("mine", skilled)
    entrant.check(Arm.load())
    with pytest.raises(PolicyFileError, match=r"trained for arm 'paper', not for 'paper_flange'"):
        entrant.check(Arm.load("paper_flange"))


@pytest.mark.parametrize("entrant", [*BASELINES.values(), ORACLE], ids=lambda e: e.name)
def test_what_is_not_trained_fits_every_arm(shipped_arms, entrant):
    for arm in shipped_arms.values():
        entrant.check(arm)

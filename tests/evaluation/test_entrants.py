"""Who takes part: names, groups, files and baselines."""

import numpy as np
import pytest

from kinarm.arm import Arm
from kinarm.errors import PolicyFileError, UnknownNameError
from kinarm.evaluation.entrants import BASELINES, Entrant, find_entrants, shipped_entrants
from kinarm.policies import policy_names


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


def test_a_file_called_like_a_baseline_is_that_file(skilled, tmp_path):
    skilled.save(tmp_path / "random.npz")
    (entrant,) = find_entrants(tmp_path / "random.npz")
    assert entrant.policy is not None


def test_an_unknown_name_lists_what_exists():
    with pytest.raises(UnknownNameError, match="unknown policy 'nobody'") as caught:
        find_entrants("nobody")
    assert {"random", "zero"} <= set(caught.value.available)


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
